"""Sideslip observers and recursive least squares on simulated drives."""

import dataclasses
import json
from pathlib import Path

import numpy as np
import pytest

import sysid_vehicle as sv
from sysid_vehicle.cli import main
from sysid_vehicle.errors import InvalidInput, NumericalError, SysidWarning
from sysid_vehicle.online import (
    KINDS,
    CorneringRls,
    SideslipObserver,
    SideslipSettings,
    cornering_stiffness,
    estimate_sideslip,
)
from sysid_vehicle.online.sideslip import static_stiffness
from sysid_vehicle.published import PublishedSideslipObserver

SENSORS = ("steer_rad", "vx_mps", "yaw_rate_radps", "ax_mps2", "ay_mps2")


@pytest.fixture(scope="module")
def vehicle():
    return sv.example_vehicle()


@pytest.fixture(scope="module")
def log(vehicle):
    exact = sv.SensorNoise(vy_mps=0.0)  # the truth that the observer is judged by
    return sv.drive(sv.Model(vehicle), sv.manoeuvres.handling_course(), seed=1, noise=exact)


def sensors_of(log):
    return np.column_stack([log[name] for name in SENSORS])


def with_tyres_times(vehicle, factor):
    return dataclasses.replace(
        vehicle,
        tyre_front=vehicle.tyre_front.replace(B=factor * vehicle.tyre_front.B),
        tyre_rear=vehicle.tyre_rear.replace(B=factor * vehicle.tyre_rear.B),
    )


def test_the_dual_observer_finds_the_sideslip_and_says_how_well(vehicle, log):
    run = estimate_sideslip(vehicle, log)
    error = run.error()
    assert error.rms_deg < 0.2
    assert error.covered > 0.9
    assert "inside 2 sigma" in str(run)
    # Driving far from the peak tells little of it: its error is told with it.
    assert abs(run.mu_f[-1] - vehicle.tyre_front.D) < 2.0 * run.mu_f_std[-1] < 0.5
    assert "friction   std" in str(run)
    # A racing car corners harder: its error is told there too, and of every sample.
    faster = dataclasses.replace(run, ay_mps2=2.0 * run.ay_mps2)
    bands = faster.error().bands
    assert bands[-1][0] >= 14.0
    assert sum(samples for *_, samples in bands) == np.count_nonzero(run.mode != 1)


@pytest.mark.parametrize("kind", sorted(KINDS))
def test_steps_and_whole_log_give_the_same_numbers(vehicle, log, kind):
    sensors = sensors_of(log)[:200]
    dt = np.full(200, 1.0 / log.rate_hz)
    sensors = np.nan_to_num(sensors, nan=0.0)
    whole = SideslipObserver(vehicle, kind=kind).run(dt, sensors)
    step = SideslipObserver(vehicle, kind=kind)
    for k, row in enumerate(sensors):
        if k == 100:
            step = step.copy()
        assert np.array_equal(step.step(dt[k], *row), whole[k], equal_nan=True)


@pytest.mark.parametrize("factor", [0.5, 2.0])
def test_wrong_stiffness_is_corrected_within_20_s_of_cornering(vehicle, log, factor):
    run = estimate_sideslip(with_tyres_times(vehicle, factor), log)
    true = estimate_sideslip(
        vehicle, log, kind="ukf", judge=False
    )  # carries the stiffness of the vehicle
    cornering = np.cumsum(np.abs(log["ay_mps2"]) > 1.0) / log.rate_hz
    at = int(np.argmax(cornering >= 20.0)) or log.n - 1
    assert run.cf_npr[at] == pytest.approx(true.cf_npr[0], rel=0.10)
    assert run.cr_npr[at] == pytest.approx(true.cr_npr[0], rel=0.10)


# The others take as long and fail alike; each sensor and each fault is here.
OFTEN = {
    ("drops out", 0),
    ("drops out", 3),
    ("freezes", 2),
    ("jumps", 0),
    ("jumps", 1),
    ("jumps", 4),
}


@pytest.mark.parametrize(
    ("fault", "column"),
    [
        pytest.param(f, c, marks=() if (f, c) in OFTEN else pytest.mark.manual)
        for f in ("drops out", "freezes", "jumps")
        for c in range(5)
    ],
)
def test_a_sensor_that_fails_for_two_seconds_does_no_lasting_harm(vehicle, log, column, fault):
    log = log.between(0.0, 25.0)  # it fails in the second second
    sensors = sensors_of(log)
    rate = round(log.rate_hz)
    first = int(np.argmax(np.abs(log["ay_mps2"]) > 3.0))
    gap = slice(first, first + 2 * rate)
    size = (0.05, 3.0, 0.5, 5.0, 8.0)[column]
    if fault == "drops out":
        sensors[gap, column] = np.nan
    elif fault == "freezes":
        sensors[gap, column] = sensors[first, column]
    else:
        sensors[gap, column] += size
    dt = np.full(log.n, 1.0 / log.rate_hz)
    found = SideslipObserver(vehicle, SideslipSettings.of(log)).run(dt, sensors)
    truth = np.arctan2(log["vy_mps"], log["vx_mps"])
    error = np.degrees(np.abs(found[:, 0] - truth))
    assert np.isfinite(found[:, :2]).all()
    assert np.nanmax(error) < 15.0
    # A steering angle that jumps cannot be told from a road that banks, and is learnt as one.
    most = 1.0 if (column, fault) == (0, "jumps") else 0.5
    assert np.sqrt(np.nanmean(error[first + 12 * rate :] ** 2)) < most


def test_a_slow_car_rolls_without_slip(vehicle):
    observer = SideslipObserver(vehicle)
    slow = observer.step(0.01, 0.1, 2.0, 0.05, 0.0, 0.1)
    share = vehicle.lr_m / vehicle.wheelbase_m
    assert slow.beta_rad == pytest.approx(np.arctan(share * np.tan(0.1)))
    assert slow.mode == 1.0
    assert observer.step(0.01, 0.0, 3.5, 0.0, 0.0, 0.0).mode == 1.0  # hysteresis
    assert observer.step(0.01, 0.0, 4.5, 0.0, 0.0, 0.0).mode == 0.0
    assert observer.step(0.01, 0.0, 3.5, 0.0, 0.0, 0.0).mode == 0.0


@pytest.mark.parametrize("kind", ["dual", "ukf"])
def test_a_slow_car_that_spins_does_not_roll_without_slip(vehicle, kind):
    """Two thirds through a spin the speed along the car is small; it moves sideways at 10 m/s."""

    def first(vx, yaw_rate):
        return SideslipObserver(vehicle, kind=kind).step(0.01, 0.0, vx, yaw_rate, 0.0, 0.8)

    assert first(2.0, 0.003).beta_std_rad == pytest.approx(0.01, abs=0.003)
    spinning = first(2.0, 1.4)
    assert spinning.mode == 1.0
    assert abs(np.arctan2(-10.0, 2.0) - spinning.beta_rad) < 2.0 * spinning.beta_std_rad
    again = first(4.5, 1.4)
    assert again.mode == 0.0
    assert again.beta_std_rad > 0.1


def test_what_cannot_be_is_refused(vehicle, log):
    with pytest.raises(InvalidInput, match="'kalmann' is not known"):
        SideslipObserver(vehicle, kind="kalmann")
    with pytest.raises(InvalidInput, match="did you mean 'ay_mps2'"):
        SideslipSettings(ay_mps=0.1)
    with pytest.raises(InvalidInput, match="road_mps2 = -1"):
        SideslipSettings(road_mps2=-1.0)
    observer = SideslipObserver(vehicle)
    observer.step(0.01, 0.0, 20.0, 0.0, 0.0, 0.0)
    with pytest.raises(NumericalError, match=r"ay_mps2 is infinite.* at sample 1"):
        observer.step(0.01, 0.0, 20.0, 0.0, 0.0, np.inf)
    with pytest.raises(NumericalError, match="time step is not positive at sample 1"):
        observer.step(0.0, 0.0, 20.0, 0.0, 0.0, 0.0)
    with pytest.raises(InvalidInput, match=r"give \(n, 5\)"):
        observer.run(np.ones(3), np.zeros((3, 4)))


def test_a_log_of_another_car_is_refused(vehicle, log):
    pounds = vehicle.replace(mass_kg=vehicle.mass_kg / 0.45359237)
    with pytest.raises(InvalidInput, match="mass_kg seems to be in pounds"):
        estimate_sideslip(pounds, log)


def on_ice(vehicle):
    """The car with a seventh of its friction, and a quarter of its cornering stiffness."""
    tyres = {
        axle: getattr(vehicle, axle).replace(
            D=0.15 * getattr(vehicle, axle).D, B=1.6 * getattr(vehicle, axle).B
        )
        for axle in ("tyre_front", "tyre_rear")
    }
    return vehicle.replace(**tyres)


def test_on_ice_with_tyres_of_a_dry_road_nobody_is_told_that_the_friction_is_known(vehicle):
    slippery = on_ice(vehicle)
    most = 0.8 * sv.manoeuvres.peak_lateral_mps2(slippery)
    slow = sv.manoeuvres.Knots((0.0, 30.0, 60.0), (10.0, 13.0, 11.0))  # braked by the ice alone
    lap = dataclasses.replace(sv.manoeuvres.lap(60.0, most, 14.0), speed_mps=slow)
    log = sv.drive(sv.Model(slippery), lap, seed=255841, rate_hz=50.0)
    with pytest.warns(SysidWarning, match=r"the cornering stiffness is 0\.2\d .* ice or snow"):
        run = estimate_sideslip(vehicle, log)
    assert run.mu_f[-1] > 0.5  # of 0.15
    assert (run.used_friction < 0.17).all()
    assert "friction   std  used" in str(run)
    unused = "friction of which less than half was used is mostly that of the vehicle file"
    assert unused in str(run)
    told = estimate_sideslip(slippery, log)
    assert unused not in str(told)
    assert told.error().covered > 0.9
    assert told.mu_f[-1] < 0.2


@pytest.mark.filterwarnings("ignore:.*not excited")
def test_a_stiffness_that_the_driving_does_not_tell_is_not_told_as_found(vehicle, log):
    """On a straight that of a vehicle file four times too soft stood there as 44 +- 15 kN/rad."""
    straight = sv.drive(
        sv.Model(vehicle), sv.manoeuvres.straight_acceleration(), seed=995871, rate_hz=50.0
    )
    untold = "tells little of the cornering stiffness: it is mostly that of the vehicle file"
    assert untold in str(estimate_sideslip(vehicle, straight))
    assert untold not in str(estimate_sideslip(vehicle, log))
    assert untold not in str(estimate_sideslip(vehicle, straight, kind="ukf"))


def test_friction_is_used_under_the_load_that_braking_moves(vehicle, log):
    """Of a rear axle more was told to be used than the friction told beside it."""
    run = estimate_sideslip(vehicle, log)
    even = dataclasses.replace(run, fx_n=np.zeros(log.n))
    pushed = dataclasses.replace(run, fx_n=np.full(log.n, 5000.0))
    front, rear = vehicle.static_loads_n
    moved = 5000.0 * vehicle.cg_height_m / vehicle.wheelbase_m
    assert pushed.used_friction == pytest.approx(
        even.used_friction * (front / (front - moved), rear / (rear + moved))
    )


def test_least_squares_find_the_stiffness_behind_exact_readings(vehicle):
    rng = np.random.default_rng(0)
    alpha = 0.02 * rng.standard_normal((500, 2))
    true = np.array([9.0e4, 12.0e4])
    force = alpha * true
    ay = force.sum(axis=1) / vehicle.mass_kg
    turned = (vehicle.lf_m * force[:, 0] - vehicle.lr_m * force[:, 1]) / vehicle.yaw_inertia_kgm2
    readings = np.column_stack([alpha, ay, turned])
    rls = CorneringRls(vehicle, forgetting=1.0, most_slip_rad=1.0)
    found = rls.run(readings)
    assert found[-1, :2] == pytest.approx(true, rel=1e-3)
    assert found[-1, :2] == pytest.approx(rls.stiffness_npr)
    before = rls.std_npr
    rls.reset()
    assert rls.std_npr[0] > 10.0 * before[0]
    assert rls.stiffness_npr == pytest.approx(found[-1, :2])


def test_without_slip_nothing_is_forgotten(vehicle):
    rls = CorneringRls(vehicle, forgetting=0.98)
    before = rls.stiffness_npr, rls.std_npr
    for _ in range(1000):
        assert not rls.step(1e-4, 1e-4, 0.3, 0.0)
    assert (rls.stiffness_npr, rls.std_npr) == before
    assert rls.used == 0
    with pytest.raises(InvalidInput, match=r"0\.98 to 1"):
        CorneringRls(vehicle, forgetting=0.9)


def test_least_squares_over_a_log(vehicle, log):
    run = cornering_stiffness(vehicle, log)
    true = estimate_sideslip(vehicle, log, kind="ukf", judge=False)
    assert run.cf_npr[-1] == pytest.approx(true.cf_npr[0], rel=0.1)
    assert run.cr_npr[-1] == pytest.approx(true.cr_npr[0], rel=0.1)
    with pytest.warns(SysidWarning, match="hold slip angles"):
        cornering_stiffness(vehicle, log, beta_rad=np.full(log.n, 0.5))


@pytest.mark.parametrize("seed", [1, 2])
def test_the_interval_of_least_squares_covers_the_bend_of_the_tyres(vehicle, seed):
    """The secant at the slips used lies 4 to 5 % below the slope at the origin."""
    drive = sv.drive(sv.Model(vehicle), sv.manoeuvres.handling_course(60.0), seed=seed)
    run = cornering_stiffness(vehicle, drive)
    true = static_stiffness(vehicle)
    assert abs(run.cf_npr[-1] - true[0]) < 2.0 * run.cf_std_npr[-1] < 0.2 * true[0]
    assert abs(run.cr_npr[-1] - true[1]) < 2.0 * run.cr_std_npr[-1] < 0.2 * true[1]


def test_noise_of_the_yaw_rate_does_not_make_the_stiffness_too_small(vehicle, log):
    true, off = static_stiffness(vehicle), {"short": [], "chosen": []}
    for seed in range(4):
        rng = np.random.default_rng(seed)
        columns = {name: log[name] for name in log.channels}
        columns["yaw_rate_radps"] = log["yaw_rate_radps"] + 0.05 * rng.standard_normal(log.n)
        noisy = sv.Log.from_arrays(columns, name="noisy", check=False)
        for name, window_s in (("short", 0.05), ("chosen", None)):
            run = cornering_stiffness(vehicle, noisy, forgetting=1.0, window_s=window_s)
            off[name] += [run.cf_npr[-1] / true[0] - 1.0, run.cr_npr[-1] / true[1] - 1.0]
    assert np.abs(off["chosen"]).max() < 0.02
    assert np.std(off["chosen"]) < 0.8 * np.std(off["short"])


@pytest.mark.parametrize("seed", [852280, 829923, 556232])
def test_the_interval_of_least_squares_holds_in_gentle_driving(vehicle, seed):
    gentle = sv.manoeuvres.lap(40.0, 0.1 * sv.manoeuvres.peak_lateral_mps2(vehicle), 14.0)
    run = cornering_stiffness(vehicle, sv.drive(sv.Model(vehicle), gentle, seed=seed))
    for found, std, true in zip(
        (run.cf_npr[-1], run.cr_npr[-1]),
        (run.cf_std_npr[-1], run.cr_std_npr[-1]),
        static_stiffness(vehicle),
        strict=True,
    ):
        assert abs(found - true) < 3.0 * std
        assert abs(found / true - 1.0) < 0.06
        assert std < 0.06 * true


def test_least_squares_leave_out_what_is_missing(vehicle, log):
    whole = cornering_stiffness(vehicle, log, window_s=0.15)
    columns = {name: np.array(log[name]) for name in log.channels}
    columns["steer_rad"][1000:1200] = np.nan
    columns["steer_rad"][-3:] = np.nan
    columns["ay_mps2"][np.arange(log.n) % 4 != 0] = np.nan  # a slower sensor
    columns["vx_mps"][2000:2100] = 0.0
    with pytest.warns(SysidWarning, match="no values"):
        spoilt = sv.Log.from_arrays(columns, name="spoilt", check=False)
    run = cornering_stiffness(vehicle, spoilt, window_s=0.15)
    assert not run.used[1000:1200].any()
    assert not run.used[2000:2100].any()
    assert run.used.sum() > 0.8 * whole.used.sum()
    assert run.cf_npr[-1] == pytest.approx(whole.cf_npr[-1], rel=0.02)
    assert run.cr_npr[-1] == pytest.approx(whole.cr_npr[-1], rel=0.02)
    columns["steer_rad"][:] = np.nan
    columns["steer_rad"][::50] = 0.01
    rare = sv.Log.from_arrays(columns, name="rare", check=False)
    with pytest.warns(SysidWarning, match="only 0 samples"):
        cornering_stiffness(vehicle, rare, window_s=0.15)
    for window_s in (0.0, np.nan, np.inf):
        with pytest.raises(InvalidInput, match="window_s"):
            cornering_stiffness(vehicle, log, window_s=window_s)


def test_the_command_line_prints_and_writes(vehicle, log, tmp_path, capsys):
    log.between(0.0, 20.0).to_csv(tmp_path / "run.csv")
    vehicle.to_toml(tmp_path / "car.toml")
    args = ["sideslip", str(tmp_path / "run.csv"), "--vehicle", str(tmp_path / "car.toml")]
    outputs = ["--plot", str(tmp_path / "a.svg"), "--json", str(tmp_path / "a.json")]
    assert main([*args, *outputs]) == 0
    assert "stiffness" in capsys.readouterr().out
    content = json.loads((tmp_path / "a.json").read_text())
    assert content["kind"] == "dual"
    assert len(content["series"]["beta_rad"]) == len(content["series"]["time_s"])
    assert "<svg" in (tmp_path / "a.svg").read_text()
    assert main([*args, "--plot", str(tmp_path / "a.png")]) == 2


def test_the_published_observer_repeats_its_figures(shared_data: Path):
    raw = np.genfromtxt(
        shared_data / "carsim_like_handling/handling_course.csv", delimiter=",", names=True
    )
    mass, lf, lr = 1549.8, 1.11, 1.756
    load = mass * 9.80665 / (lf + lr)
    car = sv.Vehicle(
        mass_kg=mass, lf_m=lf, lr_m=lr, cg_height_m=0.5, track_front_m=1.5, track_rear_m=1.5,
        drag_area_m2=0.6, brake_front_share=0.6, drive_front_share=1.0, yaw_inertia_kgm2=2315.3,
        tyre_front=sv.Tyre(B=1e5 / (load * lr), C=1.0, D=1.0),
        tyre_rear=sv.Tyre(B=1e5 / (load * lf), C=1.0, D=1.0),
    )  # fmt: skip
    columns = ("delta_f", "vx", "yawrate", "ax", "ay")
    sensors = np.column_stack([raw[name] for name in columns])
    found = PublishedSideslipObserver(car).run(np.full(len(raw), 0.01), sensors)
    error = np.degrees(found[:, 0] - raw["beta"])
    assert np.sqrt(np.mean(error**2)) == pytest.approx(0.462, rel=0.02)
    assert np.abs(error).max() == pytest.approx(3.60, rel=0.02)
