"""Shares of the errors ahead count where tyres work as far as they were fitted."""

from dataclasses import replace

import numpy as np
import pytest

from sysid_vehicle import Fit, Log, Model, drive, identify, manoeuvres
from sysid_vehicle.estimate import Driving
from sysid_vehicle.rules import USUAL
from sysid_vehicle.study import validation
from sysid_vehicle.study.ahead.beyond import beyond_noise, own_share
from sysid_vehicle.study.ahead.fitted_range import fitted, within_fitted_range
from sysid_vehicle.study.ahead.own_share import together_by_motion
from sysid_vehicle.study.validation import (
    AHEAD,
    at_its_best,
    best_within,
    beyond_noise_ahead,
    counted_in_shares,
)

LAG = {"steer_lag.time_constant_s": 0.1}
GENTLE_MPS2, LIMIT_MPS2 = 4.0, 7.5


@pytest.fixture(scope="module")
def late(truth: Model) -> Model:
    """The car."""
    return truth.add("steer_lag").with_values(LAG)


@pytest.fixture(scope="module")
def gentle(late: Model, start: Model) -> Fit:
    """The lag, found in gentle driving, beside a rear tyre that is right there alone."""
    log = drive(late, manoeuvres.handling_course(30.0, lateral_mps2=GENTLE_MPS2), seed=3)
    found = identify(start.add("steer_lag"), log, starts=1)
    rear = {f"{c}_rear": late.value(f"{c}_rear") for c in "BCDE"}
    rear |= {"B_rear": rear["B_rear"] / 0.7, "D_rear": rear["D_rear"] * 0.7}
    return replace(found, model=found.model.with_values(rear))


@pytest.fixture(scope="module")
def harder(late: Model) -> Driving:
    """Gentle driving, and more of it at the limit."""
    drives = ((40.0, GENTLE_MPS2, 4), (60.0, LIMIT_MPS2, 5))
    return Driving.of(
        [
            drive(late, manoeuvres.handling_course(seconds, lateral_mps2=most), seed=seed)
            for seconds, most, seed in drives
        ]
    )


def test_fitted_are_the_slip_angles_of_the_driving_of_the_fit(gentle: Fit, harder: Driving) -> None:
    assert fitted(gentle, gentle.driving).all()
    slow, fast = (log.n for log in harder.logs)
    within = fitted(gentle, harder)
    assert np.mean(within[:slow]) > 0.97
    assert np.mean(within[slow : slow + fast]) < 0.7
    # A larger slip angle than any of the fit is beyond, whichever axle has it.
    lf, lr = gentle.model.vehicle.lf_m, gentle.model.vehicle.lr_m

    def slips(driving: Driving) -> np.ndarray:
        v, u, r = (driving.channel(c) for c in ("vx_mps", "vy_mps", "yaw_rate_radps"))
        front = driving.channel("steer_rad") - (u + lf * r) / v
        return np.abs(np.stack([front, (u - lr * r) / v]))

    most = slips(gentle.driving).max(axis=1)
    assert not within[(slips(harder) > 1.2 * most[:, None]).any(axis=0)].any()


def test_a_model_that_holds_beyond_what_was_fitted_counts_there_too(
    gentle: Fit, harder: Driving, late: Model
) -> None:
    right = gentle.model.with_values({f"{c}_rear": late.value(f"{c}_rear") for c in "BCDE"})
    right = right.with_values({f"{c}_front": late.value(f"{c}_front") for c in "BCDE"})
    assert fitted(replace(gentle, model=right), harder).all()


def test_a_small_part_beyond_is_no_matter(gentle: Fit, harder: Driving) -> None:
    first, fast = harder.logs
    late = fitted(gentle, harder)[first.n + 2000 : first.n + 2400]
    assert np.mean(late) < 0.9
    assert fitted(gentle, Driving.of([first, fast.between(20.0, 24.0)])).all()


def test_a_prediction_counts_while_nothing_beyond_is_in_it(gentle: Fit, harder: Driving) -> None:
    within, rate = fitted(gentle, harder), harder.mean_rate_hz
    (one,) = within_fitted_range(gentle, harder, (1.0,))
    first = harder.spans[1].first
    for k in (first + 200, first + 777, first + 1800, *np.flatnonzero(one)[::97]):
        assert one[k] == within[k - round(rate) : k + 1].all()
    for span in harder.spans:  # none ends sooner than it could begin
        assert not one[span.first : span.first + round(rate)].any()


def test_what_counts_as_fitted_is_by_the_rules_that_are_given(
    gentle: Fit, harder: Driving, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Under rules by which hardly any part is explainable no error says that tyres fail beyond."""
    lenient = replace(USUAL, most=0.001)
    assert not fitted(gentle, harder).all()
    assert fitted(gentle, harder, lenient).all()
    assert within_fitted_range(gentle, harder, AHEAD, lenient).all()
    monkeypatch.setattr(validation, "_ways", lambda fit, *_: [fit])
    asked = replace(gentle)
    assert not counted_in_shares(asked, harder, USUAL).all()
    assert counted_in_shares(asked, harder, lenient).all()
    both = replace(gentle), asked
    assert beyond_noise_ahead(both, harder, lenient).within == 1.0
    assert beyond_noise_ahead(both, harder).within < 1.0
    names = ["steer_lag"]
    told, usual = (together_by_motion(both, names, harder, r)[names[0]] for r in (lenient, USUAL))
    assert told[0] != usual[0]


def test_where_every_prediction_goes_beyond_all_of_them_count(gentle: Fit, harder: Driving) -> None:
    assert within_fitted_range(gentle, harder, (1e3,)).all()


def test_tyres_beyond_what_was_fitted_do_not_hide_a_share(gentle: Fit, harder: Driving) -> None:
    """They err with the effect and without it, in the larger part of the driving."""
    without = replace(gentle, model=gentle.model.with_values({"steer_lag.time_constant_s": 0.0}))
    counted = within_fitted_range(gentle, harder, AHEAD)
    assert own_share(without, gentle, harder, AHEAD, counted=counted).low > 0.15
    assert beyond_noise((without, gentle), harder, AHEAD, counted=counted).low > 0.15
    assert not own_share(without, gentle, harder, AHEAD).low > 0.0
    assert not beyond_noise((without, gentle), harder, AHEAD).low > 0.0


def test_parameters_that_are_best_everywhere_need_not_be_so_within(
    gentle: Fit,
    harder: Driving,
    late: Model,
    course: Log,
    fit: Fit,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """A shorter lag with tyres that err less at the limit."""
    values = {"steer_lag.time_constant_s": 0.05, "D_rear": 0.9 * late.value("D_rear")}
    values["B_rear"] = late.value("B_rear") / 0.9
    other = replace(gentle, model=gentle.model.with_values(values))
    asked, poorer = replace(gentle), replace(gentle)
    with monkeypatch.context() as patch:
        patch.setattr(validation, "_ways", lambda *_: [gentle, other])
        assert at_its_best(asked, harder) is other
        counted = counted_in_shares(asked, harder)
        assert not counted.all()
        assert np.array_equal(counted, within_fitted_range(other, harder, AHEAD))
        # So for every model that is held against the final one.
        assert best_within(asked, harder, asked) is gentle
        assert best_within(poorer, harder, asked) is gentle
        told = beyond_noise_ahead((poorer, asked), harder)
        assert told.within == pytest.approx(np.mean(fitted(other, harder)))
    # What holds beyond what was fitted is asked once.
    driving = Driving.of(course)
    assert counted_in_shares(fit, driving).all()
    assert best_within(fit, driving, fit) is at_its_best(fit, driving)
