"""A lag that only slow changes show is the answer of a driver, and no clock."""

from collections.abc import Callable

import numpy as np
import pytest

import sysid_vehicle as sv
from sysid_vehicle.log.laws.regression import find_lag, in_changes

STEP_S = 0.02
TIME_S = np.arange(0.0, 240.0, STEP_S)
WINDOWS = np.arange(50, TIME_S.size - 50, 10)
FREE = np.full(2, np.inf)
Table = tuple[np.ndarray, np.ndarray]


def low_passed(values: np.ndarray, over_s: float) -> np.ndarray:
    half = int(over_s / STEP_S)
    box = np.ones(2 * half + 1) / (2 * half + 1)
    return np.convolve(np.convolve(values, box, mode="same"), box, mode="same")


def sides(late_s: float, slow_s: float) -> Callable[[float], Table]:
    """A channel against another one: all of it comes late, or what is slow in it."""
    noise = np.random.default_rng(4).standard_normal((3, TIME_S.size))
    slow, quick = (low_passed(noise[i], over_s) for i, over_s in enumerate((4.0, 0.2)))
    slow, quick = slow / np.std(slow), 0.1 * quick / np.std(quick)
    answer = np.interp(TIME_S - late_s, TIME_S, quick)
    answer += np.interp(TIME_S - late_s - slow_s, TIME_S, slow) + 0.02 * noise[2]

    def make(lag_s: float) -> Table:
        moved = np.interp(TIME_S - lag_s, TIME_S, quick + slow)
        return answer[WINDOWS], np.column_stack([moved, np.ones_like(moved)])[WINDOWS]

    return make


@pytest.mark.parametrize("late_s", [-0.2, 0.08, 0.2])
def test_a_late_clock_lags_in_a_moment_too(late_s: float) -> None:
    usable = np.ones(WINDOWS.size, dtype=bool)
    of = sides(late_s, 0.0)
    lag = find_lag(of, np.zeros(2), FREE, usable)
    told = in_changes(lag, of, np.zeros(2), FREE, usable)
    assert told is not None
    assert told.seconds == pytest.approx(late_s, abs=0.02)
    assert told.deviation <= lag.deviation


@pytest.mark.parametrize("slow_s", [-0.2, 0.2])
def test_a_slow_answer_does_not(slow_s: float) -> None:
    usable = np.ones(WINDOWS.size, dtype=bool)
    of = sides(0.0, slow_s)
    lag = find_lag(of, np.zeros(2), FREE, usable)
    assert abs(lag.seconds) > 4.0 * lag.deviation
    assert in_changes(lag, of, np.zeros(2), FREE, usable) is None


@pytest.mark.parametrize("seed", [22, 37, 66])
def test_on_a_motorway_noise_of_the_lateral_speed_is_no_lag_of_the_steering(seed: int) -> None:
    """The law told 0.17 to 0.22 s there, eight deviations and more, of sound steering."""
    course = sv.manoeuvres.usual_road("motorway", 50.0, seed=seed)
    log = sv.drive(sv.Model(sv.example_vehicle()), course, seed=seed)
    assert not sv.Log.from_arrays({c: log[c] for c in log.channels}).contradictions


def test_on_a_country_road_a_late_steering_is_told() -> None:
    course = sv.manoeuvres.usual_road("country", 50.0, seed=303)
    log = sv.drive(sv.Model(sv.example_vehicle()), course, seed=303)
    columns = {c: np.asarray(log[c]) for c in log.channels}
    time_s = columns["time_s"]
    columns["steer_rad"] = np.interp(time_s - 0.2, time_s, columns["steer_rad"])
    with pytest.warns(sv.SysidWarning, match="steer_rad: lags behind"):
        (told,) = sv.Log.from_arrays(columns).contradictions
    assert told.late_s == pytest.approx(0.2, abs=0.03)
