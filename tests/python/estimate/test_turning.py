"""Errors of lateral motion count where the car turns."""

from dataclasses import replace

import numpy as np
import pytest

from sysid_vehicle import Fit, Log
from sysid_vehicle.estimate import Driving, turning, turning_blocks
from sysid_vehicle.identify.ahead.windows import turns_of, windows_of
from sysid_vehicle.rules import worse
from sysid_vehicle.study.ahead.horizons import PREDICTED, changes, horizons

YAW = PREDICTED.index("yaw_rate_radps")


def straight(like: Log, seconds: float, seed: int = 0) -> Log:
    """A car that goes straight on, with the channels of another log and noise."""
    n = round(seconds * like.rate_hz)
    rng = np.random.default_rng(seed)
    columns = {c: np.zeros(n) for c in like.channels if like.has(c)}
    columns["time_s"] = np.arange(n) / like.rate_hz
    columns["vx_mps"] = np.full(n, 20.0) + 0.03 * rng.standard_normal(n)
    columns["vy_mps"] = 0.03 * rng.standard_normal(n)
    columns["yaw_rate_radps"] = 0.0025 * rng.standard_normal(n)
    columns["ax_mps2"] = 0.06 * rng.standard_normal(n)
    columns["ay_mps2"] = 0.06 * rng.standard_normal(n)
    return Log.from_arrays(columns, name="straight", check=False)


@pytest.fixture(scope="module")
def both(course: Log) -> Driving:
    return Driving.of([straight(course, 120.0), course])


def test_a_straight_is_no_turning(both: Driving, course: Log) -> None:
    turns = turning(both)
    first = both.log_number == 0.0
    assert not turns[first].any()
    assert turns[~first].mean() > 0.8
    # Where the car never turns, all is as good as anything else.
    assert turning(Driving.of(straight(course, 20.0))).mean() > 0.99


def test_slow_and_fast_corners_both_count(course: Log) -> None:
    """A fast car turns slowly, with as much lateral acceleration."""
    n = 2000
    time = np.arange(n) / 100.0

    def turn(speed: float, yaw_rate: float) -> Log:
        columns = {
            "time_s": time,
            "vx_mps": np.full(n, speed),
            "yaw_rate_radps": yaw_rate * np.sin(2.0 * time),
            "ay_mps2": speed * yaw_rate * np.sin(2.0 * time),
            "ax_mps2": np.zeros(n),
            "steer_rad": 0.02 * np.sin(2.0 * time),
        }
        return Log.from_arrays(columns, name=f"{speed:g}", check=False)

    turns = turning(Driving.of([turn(8.0, 0.8), turn(60.0, 0.1)]))
    assert turns[:n].mean() > 0.95
    assert turns[n:].mean() > 0.95


def test_blocks_hold_equal_times_of_turning(both: Driving, course: Log) -> None:
    alone = Driving.of(course)
    starts, turns = turning_blocks(both), turning(both)
    assert len(starts) == max(round(float(turns.sum()) / course.rate_hz / 5.0), 6)
    times = np.add.reduceat(turns.astype(float), starts) / course.rate_hz
    assert times == pytest.approx(np.full(len(times), times.mean()), abs=0.05)
    assert starts[0] == 0
    assert len(turning_blocks(alone)) == len(starts)


def test_a_long_straight_hides_no_error(fit: Fit, both: Driving, course: Log) -> None:
    model = fit.model.add("steer_lag").with_values({"steer_lag.time_constant_s": 0.15})
    late = replace(fit, model=model)
    alone = horizons((late,), ("",), Driving.of(course), (1.0,)).error[0, 0]
    beside = horizons((late,), ("",), both, (1.0,)).error[0, 0]
    assert beside[YAW] == pytest.approx(alone[YAW], rel=0.1)
    assert beside[YAW] > 4.0 * fit.noise.floor().sensor[2]
    assert worse(changes(fit, late, both, (1.0,)))


def test_windows_are_typical_where_the_car_turns(both: Driving) -> None:
    windows = windows_of(both, 2.0)
    turns = turns_of(both, windows)
    ends = np.array([first + size for first, size in windows])
    straight_on = ends <= np.count_nonzero(both.log_number == 0.0)
    assert not turns[straight_on].any()
    assert turns[~straight_on].mean() > 0.7
    assert turns_of(both, [windows[0]]).all()  # where there is nothing else
