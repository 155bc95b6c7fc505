"""Errors some seconds ahead in physical units, and how an effect changes them."""

from collections.abc import Callable
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from sysid_vehicle import Fit, InvalidInput, Log, Model, RoadDisturbance, compare, drive
from sysid_vehicle.effects import effect
from sysid_vehicle.estimate import MEASURED, Driving, turning, turning_blocks
from sysid_vehicle.identify.ahead.ahead import of_few
from sysid_vehicle.manoeuvres import usual_road
from sysid_vehicle.rules import Share, worse
from sysid_vehicle.study import validation
from sysid_vehicle.study.ahead.beyond import Beyond, beyond_noise, own_share
from sysid_vehicle.study.ahead.horizons import (
    LATERAL,
    PREDICTED,
    block_errors,
    changes,
    horizons,
    moved_by,
    moving_with,
)
from sysid_vehicle.study.ahead.waterfall import look_ahead
from sysid_vehicle.study.judge.matters import sizes_that_matter, sufficient, within
from sysid_vehicle.study.validation import AHEAD, at_its_best


@pytest.fixture(scope="module")
def late(fit: Fit) -> Fit:
    """The car, answered by a steering that it has not."""
    return replace(fit, model=answered_late(fit.model))


def answered_late(model: Model) -> Model:
    return model.add("steer_lag").with_values({"steer_lag.time_constant_s": 0.15})


def test_errors_are_in_the_units_of_the_channels(fit: Fit, late: Fit, course: Log) -> None:
    driving = Driving.of(course)
    found = horizons((fit, late), ("right", "late"), driving, (0.5, 2.0))
    assert found.channels == PREDICTED
    assert found.error.shape == (2, 2, 5)
    # Of the right model little more than the noise of the sensors is left.
    assert np.all(found.error[0] < 3.0 * found.noise)
    assert np.all(found.error[0] > 0.7 * found.noise)
    assert np.all(found.low <= found.error)
    assert np.all(found.error <= found.high)
    for i, model in enumerate((fit, late)):
        blocks = block_errors(model, late.noise.floor(), driving, (0.5, 2.0))
        for q, told_of in ((0.1, found.low), (0.5, found.error), (0.9, found.high)):
            assert np.all(told_of[i] >= np.quantile(blocks, q, axis=0, method="lower"))
            assert np.all(told_of[i] <= np.quantile(blocks, q, axis=0, method="higher"))
    yaw = PREDICTED.index("yaw_rate_radps")
    assert np.all(found.error[1, :, yaw] > 2.0 * found.error[0, :, yaw])
    assert found.gains(1)["yaw_rate_radps"][0] < 0.0
    told = found.to_dict()["channels"]["yaw_rate_radps"]
    assert told["unit"] == "rad/s"
    assert told["median"][1][0] == pytest.approx(found.error[1, 0, yaw])
    assert "2 s" in str(found)
    assert "rad/s" in found._repr_html_()


def test_blocks_hold_the_errors_of_all_predictions(fit: Fit, course: Log) -> None:
    driving, noise = Driving.of(course), fit.noise.floor()
    whole = look_ahead(fit, noise, driving, 1.0, apart=0.1)[turning(driving), 2]
    found = block_errors(fit, noise, driving, (1.0,))[:, 0, PREDICTED.index("yaw_rate_radps")]
    assert len(found) == len(turning_blocks(driving))
    assert np.sqrt(np.mean(found**2)) == pytest.approx(np.sqrt(np.nanmean(whole**2)), rel=0.05)


def test_what_makes_predictions_worse_is_seen_and_the_reverse_is_not(
    fit: Fit, late: Fit, course: Log
) -> None:
    driving = Driving.of(course)
    grown = worse(changes(fit, late, driving, (1.0, 2.0)))
    assert {c.channel for c in grown} >= {"yaw_rate_radps"}
    assert worse(changes(late, fit, driving, (1.0, 2.0))) == ()
    assert worse(changes(fit, fit, driving, (1.0, 2.0))) == ()


def test_a_model_that_loses_the_car_is_worse(fit: Fit, course: Log) -> None:
    broken = replace(fit, model=fit.model.with_values({"B_front": float("nan")}))
    driving = Driving.of(course)
    grown = worse(changes(fit, broken, driving, (1.0,)))
    assert len(grown) == len(PREDICTED)
    assert worse(changes(broken, fit, driving, (1.0,))) == ()
    assert changes(broken, broken, driving, (1.0,)) == ()


@pytest.mark.parametrize("slope_rad", [0.0, 0.015])
def test_a_driver_who_answers_slopes_makes_the_true_car_err_no_more(
    fit: Fit, slope_rad: float
) -> None:
    """The answer to slopes that predictions did not know would move another model's speed less."""
    gains = {"force_gain.drive_error": 0.16, "force_gain.brake_error": 0.16}
    truth = Model(fit.model.vehicle).add("force_gain").with_values(gains)
    road = RoadDisturbance(slope_rad=slope_rad)
    log = drive(truth, usual_road("country", 80.0, 3), seed=3, disturbance=road, rate_hz=50.0)
    slope = (9.81 * slope_rad,) * 2
    noise = replace(fit.noise, disturbance=(10.0,) * 3, road=slope, road_time_s=5.0)
    right = replace(fit, model=truth, noise=noise)
    without = replace(right, model=Model(fit.model.vehicle))
    driving = Driving.of(log)
    before, after = (
        np.nanmedian(block_errors(f, noise.floor(), driving, (1.0, 2.0, 5.0)), axis=0)
        for f in (without, right)
    )
    assert np.all((after < 1.01 * before)[:, [PREDICTED.index("vx_mps")]])
    assert np.all((after < before)[:, PREDICTED.index("ax_mps2")])
    # Of what is ahead the grade alone is known: the crossfall moves a_y, and a little all else.
    told = [i for i, c in enumerate(PREDICTED) if c != "ay_mps2" or not slope_rad]
    sensor = np.array([noise.reading[MEASURED.index(c)] for c in PREDICTED])
    assert np.all((after < 1.5 * sensor)[:, told])
    found = changes(without, right, driving, (1.0, 2.0, 5.0))
    assert {c.channel for c in found} == {*PREDICTED}
    assert worse(found) == ()
    own = own_share(without, right, driving, (1.0, 2.0), channels=moved_by(truth.parts[0]))
    # The speed counts too, whose error the slope takes up in part: less than on the level.
    assert own.low > (0.03 if slope_rad else 0.05)


def test_no_prediction_knows_the_crossfall_to_come(fit: Fit, altered: Callable[..., Log]) -> None:
    """A smoother takes what a model errs sideways for a bank, by which it would be predicted."""
    road = RoadDisturbance(slope_rad=0.015)
    course = usual_road("country", 40.0, 4)
    log = drive(fit.model, course, seed=6, disturbance=road, rate_hz=50.0)
    noise = replace(fit.noise, disturbance=(10.0,) * 3, road=(9.81 * 0.015,) * 2, road_time_s=5.0)
    late = 1000
    turned = log["yaw_rate_radps"] + 0.02 * (np.arange(len(log)) >= late)
    drives = (Driving.of(log), Driving.of(altered(log, yaw_rate_radps=turned)))
    told = [d.measured - look_ahead(fit, noise, d, 2.0) for d in drives]
    moved = np.nanmax(np.abs(told[1] - told[0])[late : late + 100], axis=0)  # begun before
    assert np.all(moved[[MEASURED.index(c) for c in LATERAL]] < 1e-3)


def test_a_spin_does_not_decide(
    fit: Fit, late: Fit, course: Log, altered: Callable[..., Log]
) -> None:
    """Where one block is lost by both models, the others tell."""
    yaw = course["yaw_rate_radps"].copy()
    few = slice(len(yaw) // 2, len(yaw) // 2 + 200)
    yaw[few] += 3.0
    driving = Driving.of(altered(course, yaw_rate_radps=yaw))
    assert worse(changes(fit, late, driving, AHEAD))
    assert not worse(changes(late, fit, driving, AHEAD))


def test_the_share_of_the_error_ahead_that_a_model_takes_away(
    fit: Fit, late: Fit, course: Log
) -> None:
    driving = Driving.of(course)
    half = replace(late, model=late.model.with_values({"steer_lag.time_constant_s": 0.075}))
    whole = beyond_noise((late, half, fit), driving, (1.0, 2.0))
    assert whole.squares[0] > whole.squares[1] > whole.squares[2] >= 0.0
    assert whole.share > 0.9
    assert 0.8 < whole.low <= whole.share <= whole.high <= 1.0
    some = beyond_noise((late, half), driving, (1.0, 2.0))
    # Errors go with the lag, and their squares with its square.
    assert some.share == pytest.approx(0.75, abs=0.12)
    assert beyond_noise((late, late), driving, (1.0,)).share == 0.0
    assert beyond_noise((half, late), driving, (1.0,)).share < -1.0
    assert str(some).endswith(")")
    assert beyond_noise((late, half), Driving.of(course.between(0.0, 4.0)), (5.0,)).share == 1.0


def test_a_model_that_loses_the_car_takes_nothing_away(fit: Fit, course: Log) -> None:
    broken = replace(fit, model=fit.model.with_values({"B_front": float("nan")}))
    driving = Driving.of(course)
    assert beyond_noise((fit, broken), driving, (1.0,)).share <= 0.0
    assert beyond_noise((broken, fit), driving, (1.0,)).share > 0.99


def test_errors_smaller_than_matters(fit: Fit, late: Fit, course: Log) -> None:
    driving = Driving.of(course)
    right, wrong = (horizons((f,), ("",), driving, (1.0,)) for f in (fit, late))
    usual = sizes_that_matter({})
    assert usual["yaw_rate_radps"] == pytest.approx(np.radians(0.5))
    assert within(right, usual)
    assert not within(wrong, usual)
    assert within(wrong, dict.fromkeys(usual, 10.0))
    given = sizes_that_matter({"yaw_rate": "2 deg/s", "vy_mps": 0.3, "ay": "0.1g"})
    assert given["yaw_rate_radps"] == pytest.approx(np.radians(2.0))
    assert given["vy_mps"] == 0.3
    assert given["ay_mps2"] == pytest.approx(0.980665)


def test_parameters_fitted_to_predictions_may_be_sufficient(fit: Fit, course: Log) -> None:
    driving, usual = Driving.of(course), sizes_that_matter({})
    assert sufficient(fit, driving, usual) is fit
    bent = replace(fit, model=fit.model.with_values({"B_front": 0.5 * fit.model.value("B_front")}))
    found = sufficient(bent, driving, usual)
    assert found is not None
    assert found.horizon_s == validation.AHEAD_S
    assert sufficient(fit, driving, dict.fromkeys(usual, 1e-6)) is None


@pytest.mark.parametrize(
    ("name", "size", "words"),
    [
        ("yaw", 1.0, "'yaw' is no channel.*yaw_rate"),
        ("foo", 1.0, "'foo' is no channel; give vx, vy, yaw_rate, ax, ay"),
        ("vy", "1kg", "vy = '1kg': give a number above 0, with m/s"),
        ("vy", -1.0, "vy = -1.0: give a number above 0"),
        ("vy", "1.2.3", "vy = '1.2.3'"),
        ("vy", "fast", "vy = 'fast'"),
    ],
)
def test_sizes_that_mean_nothing_are_refused(name: str, size: float | str, words: str) -> None:
    with pytest.raises(InvalidInput, match=words):
        sizes_that_matter({name: size})


def test_the_speed_ahead_is_no_error_of_the_model_where_no_wheel_force_is_known(
    fit: Fit, late: Fit, course: Log, altered: Callable[..., Log]
) -> None:
    biased = altered(course, without=("fx_n",), ax_mps2=course["ax_mps2"] + 0.3)
    driving = Driving.of(biased)
    assert horizons((fit,), ("right",), driving, (2.0,)).channels == LATERAL
    found = beyond_noise((late, fit), driving, (1.0, 2.0))
    # The bias makes the speed err by 0.6 m/s after 2 s, with the right model as with the other.
    assert found.share > 0.8


def test_parameters_that_serve_one_step_at_the_price_of_seconds_are_not_taken(
    fine_fit: Fit, fine_course: Log, monkeypatch: pytest.MonkeyPatch
) -> None:
    fit, driving = fine_fit, Driving.of(fine_course)

    def served(fit: Fit, test: Driving, like: Fit) -> SimpleNamespace:
        return SimpleNamespace(model=fit.model.with_values({"D_front": 0.3}))

    monkeypatch.setattr(validation, "_prediction", served)
    assert at_its_best(replace(fit), driving).model is fit.model
    # And they are where they predict better.
    blunt = replace(fit, model=fit.model.with_values({"D_front": 0.5}))
    monkeypatch.setattr(validation, "_prediction", lambda *_: SimpleNamespace(model=fit.model))
    assert at_its_best(blunt, driving).model is fit.model


def test_an_error_that_grows_is_not_called_gone() -> None:
    assert str(Beyond((1.0, 7.9), -6.9, -200.0, 0.03)) == "0 % (0 to 3)"


def test_the_own_share_of_what_a_model_has_more(fit: Fit, late: Fit, course: Log) -> None:
    driving = Driving.of(course)
    own = own_share(late, fit, driving, (1.0, 2.0))
    # A lag of the steering moves little of the speed; of yaw rate and a_y it is nearly all.
    assert 0.4 < own.low <= own.value <= own.high < 1.0
    swapped = own_share(
        replace(fit, noise=late.noise), replace(late, noise=fit.noise), driving, (1.0, 2.0)
    )
    assert swapped.value == pytest.approx(-own.value)
    assert own_share(fit, fit, driving, (1.0,)) == Share(0.0, 0.0, 0.0)
    half = replace(late, model=late.model.with_values({"steer_lag.time_constant_s": 0.075}))
    assert 0.0 < own_share(half, fit, driving, (1.0, 2.0)).value < own.value
    short = Driving.of(course.between(0.0, 4.0))
    assert not own_share(late, fit, short, (5.0,)).known


def test_only_errors_of_the_motion_that_is_moved_count(fit: Fit, late: Fit, course: Log) -> None:
    driving = Driving.of(course)
    every, lateral, along = (
        own_share(late, fit, driving, (1.0, 2.0), channels=c)
        for c in ((), moving_with({"yaw_rate_radps"}), moving_with({"ax_mps2"}))
    )
    assert along.value < 0.3 < every.value < 0.8 < lateral.value
    assert moving_with({"ay_mps2", "ax_mps2"}) == set(PREDICTED)
    # A lever arm of the accelerometer leaves the motion as it is; the speed sensor's tells of both.
    assert moved_by(effect("imu_lever_arm")) == {"ax_mps2", "ay_mps2"}
    assert moved_by(effect("speed_sensor_lever_arm")) == set(PREDICTED)
    assert moved_by(effect("mass")) == moving_with({"vx_mps"})
    # What is not predicted at all leaves all that is.
    assert own_share(late, fit, driving, (1.0, 2.0), channels=moving_with({"steer_rad"})) == every


def test_what_loses_the_car_has_no_share(fit: Fit, course: Log) -> None:
    broken = replace(fit, model=fit.model.with_values({"B_front": float("nan")}))
    driving = Driving.of(course)
    assert own_share(broken, fit, driving, (1.0,)).value > 0.99
    assert own_share(fit, broken, driving, (1.0,)).value < -0.99


def test_one_spin_decides_no_share(
    fine_fit: Fit, late: Fit, fine_course: Log, altered: Callable[..., Log]
) -> None:
    fit, course = fine_fit, fine_course
    late = replace(fit, model=answered_late(fit.model))
    yaw = course["yaw_rate_radps"].copy()
    yaw[len(yaw) // 2 :][:200] += 3.0
    spun = Driving.of(altered(course, yaw_rate_radps=yaw))
    plain = own_share(late, fit, Driving.of(course), (1.0,)).value
    assert own_share(late, fit, spun, (1.0,)).value == pytest.approx(plain, abs=0.1)


def test_few_blocks_tell_less_than_many() -> None:
    assert of_few(5) == pytest.approx(2.776 / 1.960, rel=1e-3)
    assert of_few(6) > of_few(12) > of_few(100) > 1.0


def test_channels_read_now_and_then_are_predicted_and_mapped(fit: Fit, course: Log) -> None:
    rows = np.arange(course.n)
    slow = {c: np.where(rows % 4 == 1 + k, course[c], np.nan) for k, c in enumerate(LATERAL)}
    log = Log.from_arrays({c: slow.get(c, course[c]) for c in course.channels}, check=False)
    found = horizons((fit,), ("right",), Driving.of(log), (2.0, 5.0))
    assert np.isfinite(found.error).all()
    speed = {**slow, "vx_mps": np.where(rows % 4 == 0, course["vx_mps"], np.nan)}
    log = Log.from_arrays({c: speed.get(c, course[c]) for c in course.channels}, check=False)
    assert np.isfinite(compare(fit, log).failure_map.error).any()
