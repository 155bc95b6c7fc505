"""What noise that has learned a road of varying slope hides from scores and refits."""

from dataclasses import replace

import pytest

from sysid_vehicle import (
    Fit,
    Model,
    RoadDisturbance,
    diagnose,
    drive,
    identify,
    manoeuvres,
    verdicts,
)
from sysid_vehicle.diagnose.candidates.on_the_level import (
    may_be_the_drivers,
    needs_road,
    shown_on_the_level,
)
from sysid_vehicle.identify import refine, refit
from sysid_vehicle.rules import USUAL

LEAN = "body_attitude"
ROLL_PER_G_RAD = 0.05


@pytest.fixture(scope="module")
def on_a_road(truth: Model, start: Model) -> Fit:
    """A fit whose noise has a road in place of the lean that the body has in corners."""
    car = truth.add(LEAN).with_values({f"{LEAN}.roll_per_g_rad": ROLL_PER_G_RAD})
    fit = identify(start, drive(car, manoeuvres.lap(12.0), seed=3, rate_hz=50.0), starts=1)
    noise = replace(fit.noise, road=(0.02, 1.0), road_time_s=1.0)
    return refit(fit.model, fit.driving, noise)


@pytest.fixture(scope="module")
def wandering(truth: Model, start: Model) -> Fit:
    """The complete car on a road whose slopes vary."""
    road = RoadDisturbance(100.0, 150.0, 80.0, 0.3, slope_rad=0.026, slope_time_s=1.5)
    log = drive(truth, manoeuvres.lap(20.0), seed=4, rate_hz=50.0, disturbance=road)
    return identify(start, log, starts=1)


def test_a_lean_is_found_that_scores_do_not_show(on_a_road: Fit) -> None:
    scored = diagnose(on_a_road, refits=0)
    assert scored.family[LEAN] > scored.alpha
    found = next(c for c in diagnose(on_a_road).ranking if c.id == LEAN)
    assert found.finished
    assert found.p_value < 1e-6
    assert abs(found.value[1] - ROLL_PER_G_RAD) < 4.0 * found.std[1]
    assert found.fit is not None
    assert not needs_road(found.fit, on_a_road)


def test_a_level_road_shows_the_lean_first(on_a_road: Fit) -> None:
    ranked = diagnose(on_a_road, refits=0).ranking
    shown = shown_on_the_level(on_a_road, on_a_road.driving, ranked, USUAL)
    assert shown[0].id in (LEAN, "accelerometer_scale")
    assert all(c.statistic == next(r for r in ranked if r.id == c.id).statistic for c in shown)


def test_nothing_is_found_on_a_road_that_varies(wandering: Fit) -> None:
    assert wandering.noise.sloping
    dx = diagnose(wandering)
    shown = shown_on_the_level(wandering, wandering.driving, dx.ranking, USUAL)
    assert shown  # a level road has to be corrected by something
    assert not dx.significant


def test_a_fit_that_has_the_same_road_needs_it(wandering: Fit) -> None:
    assert needs_road(wandering, wandering)
    none = replace(wandering, noise=replace(wandering.noise, road=(0.0, 0.0)))
    assert not needs_road(none, wandering)


def test_where_the_lean_is_in_the_model_no_road_hides_it(on_a_road: Fit) -> None:
    with_it = next(c for c in diagnose(on_a_road).ranking if c.id == LEAN)
    assert with_it.fit is not None
    fit = refine(with_it.fit.model, on_a_road.driving, with_it.fit.noise)
    shown = shown_on_the_level(fit, fit.driving, diagnose(fit, refits=0).ranking, USUAL)
    assert not {"accelerometer_scale", "gyro_scale"} & {c.id for c in shown}


@pytest.fixture(scope="module")
def among_hills(truth: Model, start: Model) -> Fit:
    """The complete car, whose driver answers slopes before the speed sensor shows them."""
    country = manoeuvres.usual_road("country", 60.0, seed=1)
    road = RoadDisturbance(slope_rad=0.02)
    log = drive(truth, country, seed=1, rate_hz=50.0, disturbance=road)
    return identify(start, log.without("vy_mps"), starts=1)


def test_what_the_driver_knows_of_slopes_is_no_late_sensor(among_hills: Fit) -> None:
    assert among_hills.noise.road[0] > 0.1
    dx = diagnose(among_hills)
    late = next(c for c in dx.ranking if c.id == "sensor_delay")
    assert late.fit is not None  # it was refitted, and gained what only a late speed seems to gain
    assert late.statistic > 20.0
    assert may_be_the_drivers(late, among_hills)
    assert not dx.significant
    assert verdicts(dx)["sensor_delay"].finding == "not testable"


def test_late_speeds_are_found_where_the_ground_is_level(truth: Model, start: Model) -> None:
    late = truth.add("sensor_delay").with_values({"sensor_delay.speeds_s": 0.12})
    log = drive(late, manoeuvres.lap(40.0), seed=7, rate_hz=25.0).without("vy_mps")
    fit = identify(start, log, starts=1)
    assert fit.noise.road[0] > 0.05  # slopes that are not there take up the delay
    found = diagnose(fit).significant[0]
    assert found.id == "sensor_delay"
    assert not may_be_the_drivers(found, fit)
