"""Errors ahead count where two models differ, and of the motion that an effect moves."""

from collections.abc import Callable
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from sysid_vehicle import Fit, Log, Model, drive, manoeuvres
from sysid_vehicle.estimate import Driving
from sysid_vehicle.rules import Share, worse
from sysid_vehicle.study.ahead import own_share as own
from sysid_vehicle.study.ahead.beyond import Beyond, own_share, taken_of
from sysid_vehicle.study.ahead.horizons import LATERAL, changes, moving_with
from sysid_vehicle.study.ahead.own_share import shown_together, together_by_motion
from sysid_vehicle.study.ahead.unmoved import along_alone, changes_of
from sysid_vehicle.study.ahead.where_models_differ import apart
from sysid_vehicle.study.validation import AHEAD, fall_in_error

ALONG = moving_with({"vx_mps"})


@pytest.fixture(scope="module")
def lanes(truth: Model) -> Driving:
    """Speeds up between lane changes at constant speed, by a third of all the time."""
    heavy = truth.add("mass").with_values({"mass.relative_error": 0.15})
    return Driving.of(
        drive(heavy, manoeuvres.double_lane_change((20.0, 24.0, 28.0)), seed=5, rate_hz=50.0)
    )


@pytest.fixture(scope="module")
def heavy(fit: Fit) -> Fit:
    """The fit of a car that is heavier than the vehicle file says."""
    return replace(fit, model=fit.model.add("mass").with_values({"mass.relative_error": 0.15}))


def test_a_mass_has_its_share_where_the_car_speeds_up(fit: Fit, heavy: Fit, lanes: Driving) -> None:
    found = own_share(fit, heavy, lanes, AHEAD, channels=ALONG)
    assert found.low > 0.1
    swapped = own_share(heavy, fit, lanes, AHEAD, channels=ALONG)
    assert swapped.value < -0.1
    # Blocks hold equal times of what differs: nothing is known of the rest.
    squares, noise = apart(fit, heavy, lanes, (1.0,), ALONG)
    assert squares.shape[0] == 2
    assert squares.shape[1] >= 6
    assert noise.shape == squares.shape[2:]
    force = np.abs(lanes.channel("fx_n"))
    assert np.mean(force < 0.2 * force.max()) > 0.3


def test_models_that_predict_the_same_share_nothing(fit: Fit, lanes: Driving) -> None:
    assert own_share(fit, fit, lanes, (1.0,)) == Share(0.0, 0.0, 0.0)
    assert taken_of(fit, fit, lanes, (1.0,), ALONG).share == pytest.approx(0.0)


def test_what_one_motion_lacks_says_nothing_of_the_other(
    fit: Fit, heavy: Fit, lanes: Driving
) -> None:
    """A lag that the car has not spoils the lateral errors, and leaves those of the speed."""
    late = fit.model.add("steer_lag").with_values({"steer_lag.time_constant_s": 0.04})
    both = replace(fit, model=late.add("mass").with_values({"mass.relative_error": 0.15}))
    told = together_by_motion([fit, both], ["steer_lag", "mass"], lanes)
    (before, after), low = told["mass"]
    assert low > 0.0
    assert after < 0.5 * before
    (before, after), low = told["steer_lag"]
    assert after > before
    assert not low > 0.0


def test_of_errors_that_grow_no_share_is_taken(
    fit: Fit, lanes: Driving, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Other blocks of the driving may show a part of what could be explained as explained."""
    monkeypatch.setattr(own, "shares", lambda *_: SimpleNamespace(whole=Share(1.0, 1.0, 1.0)))
    grown = Beyond((0.4, 0.5), -0.25, -0.5, 0.1)
    assert shown_together(grown, [fit, fit], lanes) == grown.low
    unsure = Beyond((0.4, 0.2), 0.5, -0.1, 0.8)
    assert shown_together(unsure, [fit, fit], lanes) == 1.0
    # Nor where more blocks gain than lose, while the median error of the motion grows.
    monkeypatch.setattr(own, "own_share", lambda *_, **__: Share(0.3, 0.2, 0.5))
    heavier = replace(fit, model=fit.model.add("mass"))
    for told, least in ((grown, -0.25), (unsure, 0.2)):
        monkeypatch.setattr(own, "taken_of", lambda *_, told=told, **__: told)
        assert together_by_motion([fit, heavier], ["mass"], lanes)["mass"][1] == least


def test_lateral_errors_are_one_figure_beside_an_effect_along_the_car(
    fit: Fit, course: Log
) -> None:
    """Beside a drag the tyres are fitted anew, to another compromise."""
    driving = Driving.of(course)
    other_tyres = {"B_front": 0.7 * fit.model.value("B_front")}
    drag = fit.model.add("aero_drag").with_values({"aero_drag.drag_area_m2": 0.0})
    other = replace(fit, model=drag.with_values(other_tyres))
    assert along_alone(fit, other)
    assert {c.channel for c in worse(changes(fit, other, driving, AHEAD))} & {*LATERAL}
    told = changes_of(fit, other, driving, AHEAD)
    assert "lateral motion" not in {c.channel for c in worse(told)}
    (lateral,) = (c for c in told if c.channel not in ALONG)
    assert lateral.log_ratio == pytest.approx(0.0, abs=0.01)
    # What it does itself, along the car or by the speed, counts.
    strong = replace(fit, model=drag.with_values({"aero_drag.drag_area_m2": 6.0}))
    assert {c.channel for c in worse(changes_of(fit, strong, driving, AHEAD))} > ALONG
    # So do tyres beside what moves the lateral motion, and without any effect.
    for model in (fit.model.add("steer_ratio"), fit.model):
        found = replace(fit, model=model.with_values(other_tyres))
        assert not along_alone(fit, found)
        told, each = (
            [c for c in changed(fit, found, driving, AHEAD) if c.channel in LATERAL]
            for changed in (changes_of, changes)
        )
        assert told == each
    assert changes_of(fit, found, driving, AHEAD) == changes(fit, found, driving, AHEAD)


def test_errors_along_the_car_are_one_figure_beside_a_lateral_effect(fit: Fit, course: Log) -> None:
    """Beside another yaw inertia a factor on the wheel force is fitted anew."""
    driving = Driving.of(course)
    gained = replace(fit, model=fit.model.add("force_gain"))
    forced = {"force_gain.drive_error": 0.3}
    turned = gained.model.add("yaw_inertia")
    other = replace(fit, model=turned.with_values(forced))
    assert {c.channel for c in worse(changes(gained, other, driving, AHEAD))} & ALONG
    told = changes_of(gained, other, driving, AHEAD)
    assert {c.channel for c in told} == {*LATERAL, "motion along the car"}
    assert "motion along the car" not in {c.channel for c in worse(told)}
    # What it does itself counts, and so does the force without it.
    heavy = replace(fit, model=turned.with_values({"yaw_inertia.relative_error": 2.0}))
    assert {c.channel for c in worse(changes_of(gained, heavy, driving, AHEAD))} & {*LATERAL}
    alone = replace(fit, model=gained.model.with_values(forced))
    assert {c.channel for c in worse(changes_of(gained, alone, driving, AHEAD))} & ALONG


def test_what_the_accelerometer_feels_answers_for_no_motion(fit: Fit, course: Log) -> None:
    """Beside a body that leans the tyres are fitted anew, to another compromise."""
    driving = Driving.of(course)
    other_tyres = {"B_front": 0.7 * fit.model.value("B_front")}
    leans = fit.model.add("body_attitude")
    upright = {"body_attitude.pitch_per_g_rad": 0.0, "body_attitude.roll_per_g_rad": 0.0}
    other = replace(fit, model=leans.with_values({**upright, **other_tyres}))
    grown = {c.channel for c in worse(changes(fit, other, driving, AHEAD))}
    assert {"vy_mps", "yaw_rate_radps"} <= grown
    told = changes_of(fit, other, driving, AHEAD)
    assert {c.channel for c in told} == {"ax_mps2", "ay_mps2", "motion"}
    assert "motion" not in {c.channel for c in worse(told)}
    # What it makes the accelerometer read counts.
    strong = {"body_attitude.roll_per_g_rad": 0.4}
    far = replace(fit, model=leans.with_values({**upright, **strong}))
    assert "ay_mps2" in {c.channel for c in worse(changes_of(fit, far, driving, AHEAD))}
    # Where the accelerometer drives the car, it moves it.
    few = {name: course[name] for name in course.channels if name != "fx_n"}
    blind = Driving.of(Log.from_arrays(few, check=False))
    assert changes_of(fit, other, blind, AHEAD) == changes(fit, other, blind, AHEAD)


def test_the_error_falls_along_the_car_beside_other_tyres(
    fit: Fit, course: Log, altered: Callable[..., Log]
) -> None:
    """A drag that is there is not refused for lateral errors of tyres fitted anew."""
    slower = fit.model.add("aero_drag").with_values({"aero_drag.drag_area_m2": 0.5})
    driving = Driving.of(altered(course, fx_n=course["fx_n"] + 0.3 * course["vx_mps"] ** 2))
    tyres = {"B_front": 0.9 * fit.model.value("B_front")}
    there = replace(fit, model=slower.with_values(tyres))
    lateral = replace(fit, model=fit.model.with_values(tyres))
    assert fall_in_error(fit, lateral, driving).value < 0.0
    assert fall_in_error(fit, there, driving).value > 0.0
    assert fall_in_error(there, fit, driving).value < 0.0
