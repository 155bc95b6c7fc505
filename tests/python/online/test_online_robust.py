"""Online estimators under threads, pickling, absurd readings and long gaps."""

import copy
import pickle
from concurrent.futures import ThreadPoolExecutor
from functools import cache

import numpy as np
import pytest

import sysid_vehicle as sv
from sysid_vehicle import published
from sysid_vehicle.online import (
    KINDS,
    CorneringRls,
    MuSlipFilter,
    SideslipEstimate,
    SideslipObserver,
    estimate_sideslip,
)
from sysid_vehicle.published import PublishedSideslipObserver

SENSORS = ("steer_rad", "vx_mps", "yaw_rate_radps", "ax_mps2", "ay_mps2")
MODE = SideslipEstimate._fields.index("mode")
THREADS = 4


@pytest.fixture(scope="module")
def vehicle():
    return sv.example_vehicle()


@pytest.fixture(scope="module")
def log(vehicle):
    course = sv.manoeuvres.handling_course(12.0)
    return sv.drive(sv.Model(vehicle), course, seed=1)


@pytest.fixture(scope="module")
def sensors(log):
    return np.nan_to_num(np.column_stack([log[name] for name in SENSORS]), nan=0.0)


@pytest.fixture(scope="module")
def dt(log):
    return np.full(log.n, 1.0 / log.rate_hz)


@pytest.fixture(scope="module")
def undisturbed(vehicle, dt, sensors):
    """What an observer of a kind makes of the readings as they are."""
    return cache(lambda kind: SideslipObserver(vehicle, kind=kind).run(dt, sensors))


def slips(n):
    rng = np.random.default_rng(0)
    alpha = 0.01 * rng.standard_normal((n, 2))
    return np.column_stack([alpha, 100.0 * alpha.sum(axis=1), 10.0 * (alpha[:, 0] - alpha[:, 1])])


def made(vehicle, kind):
    """An observer of any kind, the published one too."""
    if kind == "published":
        return PublishedSideslipObserver(vehicle)
    return SideslipObserver(vehicle, kind=kind)


def in_threads(calls):
    with ThreadPoolExecutor(len(calls)) as pool:
        return [future.result() for future in [pool.submit(call) for call in calls]]


@pytest.mark.parametrize("kind", [*KINDS, "published"])
def test_calls_on_one_observer_take_turns(vehicle, dt, sensors, kind):
    alone = made(vehicle, kind)
    wanted = sorted(alone.run(dt, sensors)[:, 0].tolist() for _ in range(THREADS))
    shared = made(vehicle, kind)
    found = in_threads([lambda: shared.run(dt, sensors)] * THREADS)
    assert sorted(run[:, 0].tolist() for run in found) == wanted
    assert shared.samples == THREADS * len(dt)


@pytest.mark.parametrize("kind", [*KINDS, "published"])
def test_one_observer_for_each_thread_is_like_one_alone(vehicle, dt, sensors, kind):
    alone = made(vehicle, kind).run(dt, sensors)
    observers = [made(vehicle, kind) for _ in range(THREADS)]
    for found in in_threads([lambda o=o: o.run(dt, sensors) for o in observers]):
        assert np.array_equal(found, alone, equal_nan=True)


def test_least_squares_and_friction_filter_take_turns(vehicle):
    readings = slips(20000)
    alone, shared = CorneringRls(vehicle), CorneringRls(vehicle)
    wanted = sorted(alone.run(readings)[:, 0].tolist() for _ in range(THREADS))
    found = in_threads([lambda: shared.run(readings)] * THREADS)
    assert sorted(run[:, 0].tolist() for run in found) == wanted

    friction, one = MuSlipFilter(0.04), MuSlipFilter(0.04)

    def update(which, n):
        for _ in range(n):
            which.update(0.05, 0.4)

    in_threads([lambda: update(friction, 500)] * THREADS)
    update(one, 500 * THREADS)
    assert friction.readings == one.readings == 500 * THREADS
    assert np.array_equal(friction.mean, one.mean)


@pytest.mark.parametrize("copied", [copy.deepcopy, lambda o: pickle.loads(pickle.dumps(o))])
@pytest.mark.parametrize("kind", [*KINDS, "published"])
def test_a_copy_goes_on_where_the_observer_stood(vehicle, dt, sensors, kind, copied):
    observer = made(vehicle, kind)
    half = len(dt) // 2
    observer.run(dt[:half], sensors[:half])
    other = copied(observer)
    assert other.vehicle == observer.vehicle
    assert other.samples == half
    wanted = observer.run(dt[half:], sensors[half:])
    assert np.array_equal(other.run(dt[half:], sensors[half:]), wanted, equal_nan=True)


@pytest.mark.parametrize("copied", [copy.deepcopy, lambda o: pickle.loads(pickle.dumps(o))])
def test_copies_of_the_other_estimators_go_on_too(vehicle, copied):
    readings = slips(200)
    rls = CorneringRls(vehicle)
    rls.run(readings[:100])
    other = copied(rls)
    assert other.used == rls.used > 0
    assert np.array_equal(other.run(readings[100:]), rls.run(readings[100:]))

    friction = MuSlipFilter(0.04, drift_std=(0.01, 0.02))
    friction.update(0.05, 0.4)
    twin = copied(friction)
    for each in (friction, twin):
        each.update(0.08, 0.6)
    assert twin.readings == friction.readings == 2
    assert np.array_equal(twin.mean, friction.mean)
    assert np.array_equal(twin.covariance, friction.covariance)


@pytest.mark.parametrize("kind", ["dual", "ukf"])
@pytest.mark.parametrize("seed", [950201, 950202])
def test_the_band_holds_while_the_steering_is_not_read_and_afterwards(vehicle, kind, seed):
    """The angle was held as if read: bands held 0.3 of it, and 0.5 for ten seconds after."""
    drive = sv.drive(sv.Model(vehicle), sv.manoeuvres.handling_course(12.0), seed=seed)
    readings = np.column_stack([drive[name] for name in SENSORS])
    moving = np.abs(drive["ay_mps2"]) > 2.0
    first = int(np.flatnonzero(moving)[len(moving[moving]) // 3])
    gap = slice(first, first + round(1.5 * drive.rate_hz))
    readings[gap, 0] = np.nan
    found = SideslipObserver(vehicle, kind=kind).run(np.full(drive.n, 1 / drive.rate_hz), readings)
    error = found[:, 0] - np.arctan2(drive["vy_mps"], drive["vx_mps"])
    noise = 0.03 / drive["vx_mps"]  # of the lateral speed that it is judged by
    held = np.abs(error) < 2.0 * np.hypot(found[:, 1], noise)
    assert np.mean(held[gap]) > 0.85
    assert np.mean(held[gap.stop :]) > 0.9
    assert (found[gap, MODE] == 2).all()
    assert (found[gap.stop :, MODE] == 0).all()


@pytest.mark.parametrize("kind", ["ukf", "square-root-ukf"])
def test_without_its_accelerometer_speeds_tell_the_wheel_force(vehicle, kind):
    """It walked until it took all grip: 6 deg rms in place of 0.08."""
    drive = sv.drive(sv.Model(vehicle), sv.manoeuvres.handling_course(20.0), seed=950204)
    dt, second = np.full(drive.n, 1.0 / drive.rate_hz), round(drive.rate_hz)
    whole = np.column_stack([drive[name] for name in SENSORS])
    blind = np.where(np.array(SENSORS) == "ax_mps2", np.nan, whole)

    def run(readings: np.ndarray) -> tuple[np.ndarray, float]:
        found = SideslipObserver(vehicle, kind=kind).run(dt, readings)
        error = found[:, 0] - np.arctan2(drive["vy_mps"], drive["vx_mps"])
        means = np.convolve(error, np.ones(second) / second, "valid")  # of which little is noise
        return found, float(np.sqrt(np.mean(means[second:] ** 2)))

    found, error = run(blind)
    assert error < 2.0 * run(whole)[1]
    assert (found[:, MODE] == 2).all()


@pytest.mark.parametrize("kind", KINDS)
def test_a_speed_that_is_not_read_goes_on_by_the_acceleration(vehicle, kind):
    """Kinds with fixed tyres held the last one while the car braked."""
    drive = sv.drive(sv.Model(vehicle), sv.manoeuvres.lap(60.0), seed=950206)
    readings = np.column_stack([drive[name] for name in SENSORS])
    speed, span = drive["vx_mps"], round(2.0 * drive.rate_hz)
    first = int(np.argmax(np.abs(speed[span:] - speed[:-span])))
    gap = slice(first, first + span)
    assert np.ptp(speed[gap]) > 5.0
    readings[gap, SENSORS.index("vx_mps")] = np.nan
    found = SideslipObserver(vehicle, kind=kind).run(np.full(drive.n, 1 / drive.rate_hz), readings)
    vx = found[gap, SideslipEstimate._fields.index("vx_mps")]
    assert np.sqrt(np.mean((vx - speed[gap]) ** 2)) < 0.3
    assert (found[gap, MODE] == 2).all()


@pytest.mark.parametrize("channel", range(5))
@pytest.mark.parametrize("kind", KINDS)
def test_the_mode_says_where_a_reading_is_missing(vehicle, dt, sensors, kind, channel):
    spoilt = sensors.copy()
    spoilt[200:210, channel] = np.nan
    found = SideslipObserver(vehicle, kind=kind).run(dt[:220], spoilt[:220])
    assert (found[200:210, MODE] == 2).all()
    assert (found[:200, MODE] == 0).all()


def test_a_state_of_another_version_is_refused(vehicle):
    core = SideslipObserver(vehicle)._core
    state = core.__getstate__()
    for other in (state[:-1], np.append(state, 0.0)):
        with pytest.raises(ValueError, match="made by another version"):
            type(core).__new__(type(core)).__setstate__(other)


FOLLOWED = sorted(KINDS)


@pytest.mark.parametrize(
    "value",
    [1e30, 200.0, *(pytest.param(v, marks=pytest.mark.manual) for v in (-1e30, 5e3))],
)
@pytest.mark.parametrize("column", range(5))
@pytest.mark.parametrize("kind", FOLLOWED)
def test_one_absurd_reading_does_little_harm_and_is_told(
    vehicle, dt, sensors, undisturbed, kind, column, value
):
    clean = undisturbed(kind)
    at = int(np.argmax(np.abs(sensors[:, 4]) > 3.0))
    spoilt = sensors.copy()
    spoilt[at, column] = value
    found = SideslipObserver(vehicle, kind=kind).run(dt, spoilt)
    assert np.isfinite(found[:, :2]).all()
    assert np.degrees(np.abs(found[:, 0] - clean[:, 0])).max() < 1.0
    assert found[at, MODE] == 2.0
    assert found[at, 1] > 0.999 * clean[at, 1]  # nothing is learnt from it


@pytest.mark.parametrize("column", range(5))
@pytest.mark.parametrize("kind", FOLLOWED)
def test_absurd_readings_on_and_on_leave_a_doubtful_but_possible_sideslip(
    vehicle, dt, sensors, undisturbed, kind, column
):
    spoilt = sensors.copy()
    half = len(dt) // 2
    spoilt[half:, column] = 1e30 * (-1.0) ** np.arange(len(dt) - half)
    found = SideslipObserver(vehicle, kind=kind).run(dt, spoilt)
    assert np.isfinite(found[:, :2]).all()
    assert np.abs(found[:, 0]).max() < 1.2
    assert (found[half:, MODE] == 2.0).all()
    usual = undisturbed(kind)
    # The dual observer has the longitudinal force from the speed, too.
    least = 0.9 if (kind, column) == ("dual", 3) else 1.0
    assert found[half + 20 :, 1].mean() > least * usual[half + 20 :, 1].mean()


@pytest.mark.parametrize("kind", FOLLOWED)
def test_a_yaw_rate_that_jumps_and_returns_is_refused(vehicle, dt, sensors, undisturbed, kind):
    clean = undisturbed(kind)
    at = int(np.argmax(np.abs(sensors[:, 4]) > 3.0))
    spoilt = sensors.copy()
    spoilt[at : at + 3, 2] += 4.0  # no car turns so fast of a sudden
    found = SideslipObserver(vehicle, kind=kind).run(dt, spoilt)
    assert (found[at : at + 3, MODE] == 2.0).all()
    assert np.degrees(np.abs(found[:, 0] - clean[:, 0])).max() < 1.0


@pytest.mark.parametrize("gap_s", [0.3, 0.9, 10.0, 1e4])
@pytest.mark.parametrize("kind", FOLLOWED)
def test_a_long_step_is_bridged_or_begins_again(vehicle, log, dt, sensors, kind, gap_s):
    at = int(np.argmax(np.abs(sensors[:, 4]) > 3.0))
    observer = SideslipObserver(vehicle, kind=kind)
    before = observer.run(dt[:at], sensors[:at])
    after = observer.step(gap_s, *sensors[at])
    truth = np.arctan2(log["vy_mps"], log["vx_mps"])
    assert abs(after.beta_rad - truth[at]) < 3.0 * after.beta_std_rad + np.radians(1.0)
    assert abs(after.beta_rad) < 0.3
    if gap_s >= 1.0:
        assert after.beta_std_rad > 2.0 * before[-1, 1]
    later = observer.run(dt[at + 1 :], sensors[at + 1 :])
    assert np.isfinite(later[:, :2]).all()
    assert np.degrees(np.abs(later[500:, 0] - truth[at + 501 :])).max() < 3.0


def test_the_published_observer_refuses_what_cannot_be(vehicle, dt, sensors):
    observer = PublishedSideslipObserver(vehicle)
    observer.run(dt[:100], sensors[:100])
    for column, name in enumerate(SENSORS):
        absurd = sensors[100].copy()
        absurd[column] = 1e30
        with pytest.raises(sv.NumericalError, match=rf"{name} = 1e\+30 is beyond"):
            observer.step(0.01, *absurd)
    with pytest.raises(sv.NumericalError, match="cannot bridge 10 s"):
        observer.step(10.0, *sensors[100])
    assert np.isfinite(observer.run(dt[100:], sensors[100:])[:, :2]).all()
    missing = sensors[100].copy()
    missing[4] = np.nan
    with pytest.raises(sv.NumericalError, match=r"ay_mps2 is missing: leave .* dual observer"):
        observer.step(0.01, *missing)


def test_a_slower_speed_is_no_sensor_that_is_missing(vehicle, log):
    """Half of the samples were told to lack a sensor where the speed came at half the rate."""
    columns = {name: np.array(log[name]) for name in log.channels}
    columns["vx_mps"][np.arange(log.n) % 2 == 1] = np.nan
    slower = estimate_sideslip(vehicle, sv.Log.from_arrays(columns, name="slower", check=False))
    assert (slower.mode[1:-1] == 0).all()
    assert "missing" not in str(slower)
    columns["yaw_rate_radps"][1000:1100] = np.nan
    with pytest.warns(sv.SysidWarning, match="yaw_rate_radps: no values"):
        log = sv.Log.from_arrays(columns, name="lost", check=False)
    lost = estimate_sideslip(vehicle, log)
    assert (lost.mode[1000:1100] == 2).all()
    assert "% of samples with a sensor missing or refused" in str(lost)


@pytest.mark.parametrize("kind", ["dual", "ukf"])
def test_a_log_without_longitudinal_acceleration_is_estimated_with_a_warning(vehicle, kind):
    drive = sv.drive(sv.Model(vehicle), sv.manoeuvres.lap(40.0), seed=995051)
    columns = {name: drive[name] for name in drive.channels if name != "ax_mps2"}
    blind = sv.Log.from_arrays(columns, name="blind")
    with pytest.warns(sv.SysidWarning, match=r"blind: there is no channel 'ax_mps2'.* record it"):
        found = estimate_sideslip(vehicle, blind, kind=kind)
    whole = estimate_sideslip(vehicle, drive, kind=kind)
    assert found.error().rms_deg < 1.5 * whole.error().rms_deg
    assert found.error().covered > 0.9
    assert np.mean(found.mode == 2) < 0.01
    assert found.used_friction == pytest.approx(whole.used_friction, rel=0.1)
    with pytest.raises(sv.InvalidInput, match="there is no channel 'ax_mps2'"):
        published.estimate_sideslip(vehicle, blind)
