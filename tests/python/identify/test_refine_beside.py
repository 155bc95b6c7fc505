"""Fits of other effects, to be compared with one that is known: few samples tell the hopeless."""

import numpy as np
import pytest

from sysid_vehicle import Model, Vehicle, manoeuvres
from sysid_vehicle.estimate import Driving, first_guess
from sysid_vehicle.identify import Fit, refine, refine_beside
from sysid_vehicle.identify.maximum import THINNED
from sysid_vehicle.log import Log
from sysid_vehicle.simulate import drive

_LENGTH = "tyre_relaxation.relaxation_length_m"


@pytest.fixture(scope="module")
def relaxing(car: Vehicle) -> Fit:
    """The fit of a car whose tyres relax, by more samples than the few that lead."""
    model = Model(car).add("tyre_relaxation").with_values({_LENGTH: 1.5})
    log = drive(model, manoeuvres.lap(45.0, 7.0), seed=31, rate_hz=100.0)
    driving = Driving.of(log)
    fit = refine(model, driving, first_guess(driving, car))
    assert driving.samples > THINNED
    assert fit[_LENGTH].value == pytest.approx(1.5, abs=4.0 * fit[_LENGTH].std)
    return fit


def test_what_explains_nothing_of_it_is_left_after_few_samples(relaxing: Fit) -> None:
    other = relaxing.model.drop("tyre_relaxation").add("rolling_resistance")
    lacking = refine(other, relaxing.driving, relaxing.noise)
    assert lacking.log_likelihood < relaxing.log_likelihood - 100.0
    assert refine_beside(other, relaxing.driving, relaxing, relaxing.log_likelihood) is None


def test_what_comes_near_is_refined_to_the_same_maximum(relaxing: Fit) -> None:
    same = relaxing.model.with_values({_LENGTH: 1.2})
    found = refine_beside(same, relaxing.driving, relaxing, relaxing.log_likelihood)
    assert found is not None
    assert found.log_likelihood == pytest.approx(relaxing.log_likelihood, abs=0.5)
    assert found[_LENGTH].value == pytest.approx(relaxing[_LENGTH].value, abs=relaxing[_LENGTH].std)


def test_noise_of_other_time_scales_is_not_tried_far_below(
    relaxing: Fit, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: list[float] = []
    known = refine_beside.__globals__["likelier_noise"]

    def counted(objective, at_top, *others):  # type: ignore[no-untyped-def]
        asked.append(objective.log_likelihood(*at_top))
        return known(objective, at_top, *others)

    monkeypatch.setitem(refine_beside.__globals__, "likelier_noise", counted)
    for least, times in ((relaxing.log_likelihood + 30.0, 0), (relaxing.log_likelihood, 1)):
        found = refine_beside(relaxing.model, relaxing.driving, relaxing, least)
        assert found is not None
        assert len(asked) == times
        assert np.isfinite(found.log_likelihood)


def test_noise_of_other_time_scales_is_not_tried_where_nobody_wants_it(
    relaxing: Fit, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(refine_beside.__globals__, "likelier_noise", pytest.fail)
    asked: list[Fit] = []

    def worth(near: Fit) -> bool:
        asked.append(near)
        return False

    near = (relaxing.model, relaxing.driving, relaxing, relaxing.log_likelihood)
    assert refine_beside(*near, worth) is None
    assert asked[0].log_likelihood == pytest.approx(relaxing.log_likelihood, abs=0.5)


def test_a_lag_that_would_be_a_lead_is_none_at_all(car: Vehicle) -> None:
    """Scores of a lag may have either sign; where no few samples lead it begins there."""
    log = drive(Model(car), manoeuvres.lap(20.0, 6.0), seed=31)
    columns = {c: log[c][2:] for c in log.channels if c != "time_s"}
    early = {**columns, "steer_rad": log["steer_rad"][:-2], "time_s": log["time_s"][2:]}
    driving = Driving.of(Log.from_arrays(early, name="steering that is logged late"))
    assert driving.samples < THINNED
    fit = refine(Model(car), driving, first_guess(driving, car))
    leads = fit.model.add("steer_lag").with_values({"steer_lag.time_constant_s": -0.01})
    found = refine_beside(leads, driving, fit, fit.log_likelihood - 1e5)
    assert found is not None
    assert "at bound" in str(found["steer_lag.time_constant_s"])
    assert 0.0 < found["steer_lag.time_constant_s"].value < 1e-3
