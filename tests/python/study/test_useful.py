"""Whether predictions are better with what a step added."""

from collections.abc import Callable
from dataclasses import replace

import pytest

from sysid_vehicle import Driving, Fit, Model, drive, manoeuvres
from sysid_vehicle.identify import refine
from sysid_vehicle.study.ahead.beyond import Beyond
from sysid_vehicle.study.judge.useful import useless
from sysid_vehicle.study.results.added import AddedEffect


@pytest.fixture(scope="module")
def missing(hidden_fit: Callable[[str, float], Fit]) -> Fit:
    """A fit of a car whose steering lags, without the lag."""
    return hidden_fit("steer_lag.time_constant_s", 0.05)


@pytest.fixture(scope="module")
def elsewhere(truth: Model) -> Driving:
    """Driving of the same car that no fit saw."""
    car = truth.add("steer_lag").with_values({"steer_lag.time_constant_s": 0.05})
    return Driving.of(drive(car, manoeuvres.handling_course(30.0), seed=8, rate_hz=50.0))


def test_what_the_car_has_is_of_use_and_what_acts_on_nothing_is_not(
    missing: Fit, elsewhere: Driving
) -> None:
    lagging = refine(missing.model.add("steer_lag"), missing.driving, missing.noise)
    heavier = refine(lagging.model.add("gyro_bias"), missing.driving, lagging.noise)
    assert useless((missing, lagging, heavier), elsewhere) == {"gyro_bias"}
    # Of one step it is told as a whole.
    assert useless((missing, heavier), elsewhere) == frozenset()


def test_what_alone_predicts_better_is_of_use_though_no_single_error_shows_it(
    missing: Fit, elsewhere: Driving
) -> None:
    biased = refine(missing.model.add("gyro_bias"), missing.driving, missing.noise)
    sure, unsure = (Beyond((1.0, 0.8), 0.2, low, 0.4, 1.0) for low in (0.1, -0.1))
    assert useless((missing, biased), elsewhere, explained=unsure) == {"gyro_bias"}
    assert useless((missing, biased), elsewhere, explained=sure) == frozenset()
    # Beside what does predict better the rest is of no use all the same.
    lagging = refine(missing.model.add("steer_lag"), missing.driving, missing.noise)
    heavier = refine(lagging.model.add("gyro_bias"), missing.driving, lagging.noise)
    assert useless((missing, lagging, heavier), elsewhere, explained=sure) == {"gyro_bias"}


def test_a_model_that_errs_more_is_of_no_use(missing: Fit, elsewhere: Driving) -> None:
    lagging = refine(missing.model.add("steer_lag"), missing.driving, missing.noise)
    wrong = replace(lagging, model=lagging.model.with_values({"steer_lag.time_constant_s": 0.2}))
    assert useless((missing, wrong), elsewhere) == {"steer_lag"}


def test_what_is_of_no_use_is_told_beside_what_else_speaks_against_it() -> None:
    told = "of no use for prediction"
    named = AddedEffect("mass", (), 5.154, 5.148, 1e-9, takes_little=True, useful=False)
    assert told in str(named)
    assert "hardly falls" not in str(named)
    assert named.to_dict()["useful"] is False
    stand_in = replace(named, stands_in="it has no share", grade="alias")
    assert "compensates for something else" in stand_in.reserve
    assert told in stand_in.reserve
    assert told not in replace(named, useful=True).reserve
    assert "hardly falls" in replace(named, useful=True).reserve
