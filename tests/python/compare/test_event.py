"""A moment at which something outside the model happened: it is told, with its seconds."""

import re
from collections.abc import Callable, Iterator

import numpy as np
import pytest
from pushes import Push

from sysid_vehicle import (
    Driving,
    Fit,
    Log,
    Model,
    RoadDisturbance,
    compare,
    define_effect,
    drive,
    forget_effect,
    identify,
    manoeuvres,
    parameter,
    read_log,
)
from sysid_vehicle.compare import Event

RATE_HZ = 50.0
AT_S = 20.0
COURSE = manoeuvres.handling_course(30.0, lateral_mps2=7.5)


@pytest.fixture
def hand_brake() -> Iterator[str]:
    """An effect that locks the rear wheels for half a second."""
    define_effect(
        "hand_brake",
        title="rear wheels locked for a moment",
        parameters=[parameter("share", "1", typical=0.3, lower=-1.0, upper=1.0)],
        force_y_rear=lambda d, p: np.where(
            (d.time > AT_S) & (d.time < AT_S + 0.5), -p.share * d.F_yr, 0.0
        ),
    )
    yield "hand_brake"
    forget_effect("hand_brake")


def seen(event: Event | None) -> Event:
    """The event, which must be that of all tests."""
    assert event is not None
    assert AT_S - 0.1 <= event.from_s <= AT_S + 0.3
    assert event.from_s < event.until_s <= AT_S + 1.4
    return event


@pytest.fixture(scope="module")
def pushed(truth: Model) -> Log:
    return drive(truth, manoeuvres.lap(40.0), seed=3, rate_hz=RATE_HZ, disturbance=Push(at_s=AT_S))


@pytest.fixture(scope="module")
def pushed_fit(start: Model, pushed: Log) -> Fit:
    return identify(start, pushed, starts=1)


def test_a_push_in_the_training_data_is_told_with_its_seconds(pushed_fit: Fit, pushed: Log) -> None:
    found = compare(pushed_fit, pushed)
    assert found.error > 1.2
    event = seen(found.event)
    assert event.log == pushed.name
    assert event.share > 0.9
    inside = (found.time_s >= event.from_s) & (found.time_s <= event.until_s)
    there = np.sqrt(np.nanmean(found.residual[inside] ** 2))
    assert event.error == pytest.approx(there, rel=0.05)  # channels by themselves and together
    assert event.error > 4.0
    assert re.search(
        r"of the squared error above the noise floor lies in [01](\.\d)? s", str(found)
    )
    assert re.search(r"'lap', (19\.9|20\.0) to 2[01]\.\d s", str(found))
    assert str(event).replace("'", "&#x27;") in found._repr_html_()
    assert event.of("training data").startswith(
        f"{100 * event.share:.0f} % of the squared error of the training data above the noise"
    )
    assert event.to_dict()["from_s"] == event.from_s


def test_what_is_said_to_leave_it_out_does(pushed_fit: Fit, pushed: Log, start: Model) -> None:
    event = seen(compare(pushed_fit, pushed).event)
    bounds = re.findall(r"log\.between\(([\d.]+), ([\d.]+)\)", str(event))
    assert len(bounds) == 2
    parts = [pushed.between(float(a), float(b)) for a, b in bounds]
    assert sum(part.n for part in parts) > pushed.n - 1.3 * RATE_HZ
    without = compare(identify(start, parts, starts=1), parts)
    assert without.error < 1.05
    assert without.event is None
    time = pushed["time_s"]
    kept = (time <= float(bounds[0][1])) | (time >= float(bounds[1][0]))
    with pytest.warns(match="no run of the model crosses"):
        rows = read_log({c: pushed[c][kept] for c in pushed.channels}, name="without rows")
    assert compare(pushed_fit, rows).event is None
    assert len(Driving.of(rows).stretches) == 2


def test_a_hand_brake_in_validation_data_is_told(fit: Fit, truth: Model, hand_brake: str) -> None:
    braked = truth.add(hand_brake).with_values({"hand_brake.share": 0.35})
    log = drive(braked, COURSE, seed=4, rate_hz=RATE_HZ, name="braked")
    found = compare(fit, log)
    assert found.error > 1.4
    assert seen(found.event).log == "braked"


def test_of_several_logs_the_one_is_named(fit: Fit, truth: Model, course: Log) -> None:
    log = drive(truth, COURSE, seed=5, rate_hz=RATE_HZ, name="hit", disturbance=Push(at_s=AT_S))
    assert seen(compare(fit, [course, log]).event).log == "hit"
    assert seen(compare(fit, [log, course]).event).log == "hit"


def test_a_jump_of_the_yaw_rate_is_told(fit: Fit, course: Log, altered: Callable[..., Log]) -> None:
    time, jumped = course["time_s"], np.array(course["yaw_rate_radps"])
    jumped[(time > AT_S) & (time < AT_S + 0.3)] += 0.1
    seen(compare(fit, altered(course, yaw_rate_radps=jumped)).event)


def test_a_complete_model_has_none(fit: Fit, fine_fit: Fit, course: Log, fine_course: Log) -> None:
    assert compare(fit, fit.driving).event is None
    assert compare(fit, course).event is None
    assert compare(fine_fit, fine_course).event is None
    assert "squared error" not in str(compare(fit, course))


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("tyre_load_sensitivity.sensitivity", 0.25),
        ("aero_drag.drag_area_m2", 0.45),
        ("steer_lag.time_constant_s", 0.06),
    ],
)
def test_a_missing_effect_is_none(hidden_fit: Callable[..., Fit], name: str, value: float) -> None:
    fit = hidden_fit(name, value)
    found = compare(fit, fit.driving)
    assert found.error > 1.1
    assert found.event is None


def test_grip_that_changes_for_good_is_none(truth: Model, start: Model) -> None:
    car = truth.add("friction_change").with_values(
        {"friction_change.drop": 0.1, "friction_change.at_s": AT_S}
    )
    log = drive(car, manoeuvres.lap(40.0), seed=7, rate_hz=RATE_HZ)
    found = compare(identify(start, log, starts=1), log)
    assert found.error > 1.1
    assert found.event is None


def test_coloured_forces_are_none(truth: Model, start: Model) -> None:
    road = RoadDisturbance(fx_n=150.0, fy_n=250.0, mz_nm=250.0, slope_rad=0.02)
    log = drive(truth, manoeuvres.lap(40.0), seed=6, rate_hz=RATE_HZ, disturbance=road)
    found = compare(identify(start, log, starts=1), log)
    assert found.error > 1.5
    assert found.event is None


def errors_of(
    log: Log, rng: np.random.Generator, began_s: float, elsewhere: float = 1.0
) -> Event | None:
    """The event of readings with five times the error of the floor for a second, by its begin."""
    driving = Driving.of(log)
    count = np.full(driving.samples, 5.0)
    time = driving.channel("time_s")
    errs = (time >= began_s) & (time < began_s + 1.0)
    squares = rng.chisquare(5, driving.samples) * np.where(errs, 25.0, elsewhere**2)
    return Event.of_driving(driving, squares, count, 1.0)


def steered(steer: Callable[[np.ndarray], np.ndarray]) -> Log:
    time = np.arange(0.0, 40.0, 1.0 / RATE_HZ)
    angle = steer(time)
    columns = {
        "time_s": time,
        "vx_mps": np.full_like(time, 20.0),
        "yaw_rate_radps": 5.0 * angle,
        "ay_mps2": 100.0 * angle,
        "steer_rad": angle,
        "fx_n": 100.0 * np.sin(3.0 * time),
    }
    return Log.from_arrays(columns, check=False)


def test_errors_of_a_single_manoeuvre_are_none(rng: np.random.Generator) -> None:
    slalom = steered(lambda t: 0.02 * np.sin(2.0 * t))
    found = errors_of(slalom, rng, 20.0, 1.15)
    assert found is not None
    assert found.from_s == pytest.approx(20.0, abs=0.03)
    assert found.until_s == pytest.approx(21.0, abs=0.03)
    single = steered(
        lambda t: (
            1e-5 * np.sin(40.0 * t)
            + np.where((t > 19.5) & (t < 21.0), 0.05 * np.sin(2.0 * np.pi * (t - 19.5) / 1.5), 0.0)
        )
    )
    assert errors_of(single, rng, 20.0, 1.15) is None
    # Where it errs without being steered, something else happened.
    assert errors_of(single, rng, 30.0, 1.15) is not None


def test_the_same_part_of_few_seconds_is_chance(rng: np.random.Generator) -> None:
    slalom = steered(lambda t: 0.02 * np.sin(2.0 * t))
    shares = []
    for seconds, elsewhere, told in ((40.0, 1.15, True), (4.0, 2.0, False), (4.0, 1.0, True)):
        half = 0.5 * seconds
        part = slalom.between(20.0 - half, 20.0 + half)
        found = errors_of(part, rng, 20.0, elsewhere)
        assert (found is not None) is told
        shares.append(1.0 if found is None else found.share)
    assert shares[0] < 0.75  # less than that of the four seconds: 24 of 24 + 3 * 3


def test_at_the_ends_of_a_log_one_part_is_left(rng: np.random.Generator) -> None:
    slalom = steered(lambda t: 0.02 * np.sin(2.0 * t))
    first, last = (errors_of(slalom, rng, began) for began in (0.0, 39.0))
    assert first is not None
    assert last is not None
    assert first.remedy.count("between") == last.remedy.count("between") == 1
    assert "between(1, 40)" in str(first)
    assert "between(0, 38.9)" in str(last)
