"""The closed loop: what it reproduces, what it reports, and that only readings reach it."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from sysid_vehicle import (
    InvalidInput,
    Model,
    RoadDisturbance,
    catalogue,
    example_vehicle,
    manoeuvres,
    published,
)
from sysid_vehicle.lab import (
    Actuator,
    ClosedLoop,
    Nominal,
    Online,
    Sensor,
    Sensors,
    Setup,
    Simulator,
    excitation,
    run_closed_loop,
)

SHORT = excitation.multi_sine(duration_s=15.0)
# Column of a recorded array, and where the drive has the same quantity.
RECORDED: dict[str, Callable[[ClosedLoop], np.ndarray]] = {
    "truth_gt": lambda r: np.column_stack(
        [r.truth[n] for n in ("x_m", "y_m", "heading_rad", "vx_mps", "vy_mps", "yaw_rate_radps")]
    ),
    "ay_true": lambda r: r.truth["ay_mps2"],
    "yaw_acc_true": lambda r: r.truth["yaw_acc_radps2"],
    "u": lambda r: np.column_stack([r.inputs["fx_n"], r.inputs["steer_rad"]]),
    "fz_front": lambda r: r.truth["fz_front_n"],
    "fz_rear": lambda r: r.truth["fz_rear_n"],
    "truth_Fy": lambda r: np.column_stack([r.truth["fy_front_n"], r.truth["fy_rear_n"]]),
}


@pytest.fixture(scope="module")
def short() -> ClosedLoop:
    return run_closed_loop(SHORT, seed=1)


@pytest.mark.parametrize(("amplitude_rad", "file"), [(0.35, "amp035"), (0.60, "amp060")])
def test_the_published_preset_repeats_drives_computed_elsewhere(
    amplitude_rad: float, file: str, shared_data: Path
) -> None:
    path = shared_data / "golden_closed_loop" / f"identification_{file}.npz"
    if not path.is_file():
        pytest.skip(f"the recorded drive is not at {path}")
    with np.load(path) as archive:
        recorded = {name: archive[name] for name in archive.files}
    setup = published.setup()
    noise = np.zeros((len(recorded["u"]), len(Sensors.names())))
    exact = np.column_stack([recorded["truth_gt"][:, 3:], recorded["ay_true"]])
    std = setup.sensors.table()[[0, 1, 2, 4], 0]
    noise[:, [0, 1, 2, 4]] = (recorded["measurements"] - exact) / std
    drive = run_closed_loop(
        published.Identification(amplitude_rad=amplitude_rad), setup, seed=0, normal=noise
    )
    for name, column in RECORDED.items():
        size = np.abs(recorded[name]).max()
        assert np.abs(column(drive) - recorded[name]).max() < 1e-7 * size, name


def test_the_published_oval_is_driven_as_published() -> None:
    drive = run_closed_loop(published.Oval(duration_s=750.0), published.setup(), seed=2)
    settled = slice(1000, None)
    assert drive.lost_s is None
    assert np.abs(drive.truth["ay_mps2"][settled]).max() == pytest.approx(6.1, abs=0.4)
    at_speed = drive.truth["vx_mps"] > 59.0
    assert np.median(np.abs(drive.truth["slip_front_rad"][at_speed])) < 0.032
    assert drive.tracking["left_of_track_m"] < 0.3


def test_the_same_seed_drives_the_same(short: ClosedLoop) -> None:
    again = run_closed_loop(SHORT, seed=1)
    other = run_closed_loop(SHORT, seed=2)
    for name, values in short.sensed.items():
        np.testing.assert_array_equal(values, again.sensed[name])
    assert not np.array_equal(short.sensed["vy_mps"], other.sensed["vy_mps"])


def test_only_readings_reach_observer_and_controller(short: ClosedLoop) -> None:
    # A sensor that lies moves the car; a plant told to differ where no sensor looks does not.
    lying = replace(Setup.default(), sensors=replace(Sensors(), vx_mps=Sensor(0.1, bias=1.0)))
    drive = run_closed_loop(SHORT, lying, seed=1)
    slower = drive.truth["vx_mps"][-500:].mean() - short.truth["vx_mps"][-500:].mean()
    assert slower == pytest.approx(-1.0, abs=0.1)


def test_sensors_have_the_noise_they_claim(short: ClosedLoop) -> None:
    for i, name in enumerate(("vx_mps", "vy_mps", "yaw_rate_radps", "ay_mps2")):
        error = short.sensed[name] - short.truth[name]
        claimed = getattr(short.setup.sensors, name).noise_std
        assert error.std() == pytest.approx(claimed, rel=0.06), (i, name)


def test_the_observer_is_better_than_its_sensors_and_tells_the_lateral_force(
    short: ClosedLoop,
) -> None:
    assert short.observer_error["vx_mps"] < 0.03
    assert short.observer_error["yaw_rate_radps"] < 3.2e-3
    nominal, e, u = short.setup.nominal, short.estimate, short.inputs
    loads = [short.truth[f"fz_{a}_n"] for a in ("front", "rear")]
    front = u["steer_rad"] - (e["vy_mps"] + nominal.lf_m * e["yaw_rate_radps"]) / e["vx_mps"]
    rear = -(e["vy_mps"] - nominal.lr_m * e["yaw_rate_radps"]) / e["vx_mps"]
    linear = nominal.stiffness_front * loads[0] * front + nominal.stiffness_rear * loads[1] * rear
    felt = (linear + e["xi_y_n"]) / nominal.mass_kg
    error = (felt - short.truth["ay_mps2"])[200:]
    assert error.std() < 0.05 * short.truth["ay_mps2"].std()


@pytest.mark.parametrize("stiffness", [30.0, 63.0, 120.0])
def test_half_and_double_stiffness_are_followed_all_the_same(stiffness: float) -> None:
    setup = Setup.of(Setup.default().plant, stiffness)
    drive = run_closed_loop(SHORT, setup, seed=3)
    assert not drive.too_hard
    assert drive.tracking["heading_rad"] < 0.004
    assert drive.tracking["vx_mps"] < 0.2


def test_the_tyres_of_the_vehicle_file_are_what_the_loop_believes() -> None:
    """Those of the published car, three times as stiff, were believed of any: cars were lost."""
    car = example_vehicle()
    setup = Setup.of(Model(car))
    assert setup.nominal.stiffness_front == car.tyre_front.cornering_stiffness_per_load
    assert setup.nominal.stiffness_rear == car.tyre_rear.cornering_stiffness_per_load
    assert Setup.of(Model(car), 30.0).nominal.stiffness_rear == 30.0
    hard = excitation.multi_sine(6.0, speed_mps=22.0, duration_s=20.0)
    drive = run_closed_loop(hard, setup, seed=993411)
    assert drive.lost_s is None
    noise = setup.sensors.yaw_rate_radps.noise_std
    assert drive.observer_error["yaw_rate_radps"] < 2.0 * noise  # ten times the noise before


def test_a_wrong_mass_is_followed_all_the_same() -> None:
    setup = Setup.default()
    heavy = replace(setup, nominal=replace(setup.nominal, mass_kg=1.1 * 780.0))
    drive = run_closed_loop(SHORT, heavy, seed=3)
    assert not drive.too_hard
    assert drive.tracking["vx_mps"] < 0.2


def test_a_missing_and_a_slow_sensor_are_enough() -> None:
    sensors = replace(
        Sensors(),
        vy_mps=Sensor(3e-3, rate_hz=2.0),
        heading_rad=Sensor(0.002, rate_hz=10.0),
        ay_mps2=Sensor(0.05, delay_s=0.02),
    )
    drive = run_closed_loop(SHORT, replace(Setup.default(), sensors=sensors), seed=3)
    assert not drive.too_hard
    assert np.isnan(drive.sensed["vy_mps"]).mean() == pytest.approx(0.98, abs=0.005)
    assert drive.tracking["heading_rad"] < 0.01


@pytest.mark.parametrize("effect", [e.id for e in catalogue()])
def test_any_effect_can_be_switched_on_in_the_plant(effect: str, short: ClosedLoop) -> None:
    base = short.setup.plant.drop("aero_downforce")
    plant = base.add(effect)
    typical = {n: p.null_value + p.typical for n, p in plant.parameters.items() if "." in n}
    plain = run_closed_loop(SHORT, Setup.of(base), seed=1)
    drive = run_closed_loop(SHORT, Setup.of(plant.with_values(typical)), seed=1)
    assert drive.lost_s is None
    # What the sensors wrote differs, though the noise is the same.
    assert any(
        np.abs(drive.sensed[n] - plain.sensed[n]).max() > 1e-3 * np.abs(plain.sensed[n]).max()
        for n in Sensors.names()
    )


@pytest.mark.parametrize("speed_mps", [15.0, 25.0, 40.0])
def test_a_reference_of_twice_the_grip_is_reported_and_survived(speed_mps: float) -> None:
    wild = excitation.multi_sine(lateral_mps2=30.0, speed_mps=speed_mps, duration_s=30.0)
    drive = run_closed_loop(wild, seed=1)
    assert drive.lost_s is None
    assert drive.too_hard
    assert "too hard" in str(drive)
    assert np.abs(drive.truth["slip_rear_rad"]).max() < 0.35
    assert np.abs(drive.truth["slip_rear_rad"]).max() > 0.08  # and yet beyond the peak


def test_a_speed_that_cannot_be_reached_is_reported() -> None:
    fast = excitation.speed_ramp(60.0, 140.0, 15.0)
    weak = replace(Setup.default(), force=Actuator(-4000.0, 2000.0))
    met = {s.what: s for s in run_closed_loop(fast, weak, seed=1).saturation}
    assert met["wheel force at its highest"].too_hard


def test_a_lost_car_ends_the_drive_and_is_told() -> None:
    setup = Setup.default()
    slippery = setup.plant.with_values({"D_rear": 0.25})
    drive = run_closed_loop(
        excitation.OnManoeuvre(manoeuvres.step_steer(lateral_mps2=(9.0,))),
        replace(setup, plant=slippery),
        seed=1,
    )
    assert drive.lost_s is not None
    assert drive.too_hard
    assert drive.time_s[-1] == pytest.approx(drive.lost_s - 0.01)
    assert "lost at" in str(drive)


def test_random_forces_push_the_car(short: ClosedLoop) -> None:
    road = RoadDisturbance(fy_n=400.0)
    drive = run_closed_loop(SHORT, seed=1, disturbance=road)
    assert drive.tracking["heading_rad"] > short.tracking["heading_rad"]
    assert drive.lost_s is None


def test_the_log_holds_readings_and_nothing_else(short: ClosedLoop) -> None:
    log = short.to_log()
    assert log.name == "multi_sine"
    assert log.rate_hz == pytest.approx(100.0)
    for name in Sensors.names():
        np.testing.assert_array_equal(log[name], short.sensed[name])
    assert log.n == short.time_s.size


def test_it_prints_and_draws(short: ClosedLoop) -> None:
    assert "within the car's means" in str(short)
    assert "<table>" in short._repr_html_()
    axes = short.plot(what="yaw_rate_radps")
    assert [t.get_text() for t in axes.get_legend().get_texts()] == ["wanted", "driven", "observed"]
    with pytest.raises(InvalidInput, match="nothing is called 'speed'"):
        short.plot(what="speed")
    assert "50 and 50" in str(Setup.default())


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: Sensor(noise_std=-1.0), "noise_std"),
        (lambda: Actuator(1.0, -1.0), "range"),
        (lambda: Online(process=(1.0,)), "process"),
        (lambda: Online(sensors=(0.0, 1.0, 1.0, 1.0)), "some noise"),
        (lambda: Simulator(load_share=0.0), "load_share"),
        (lambda: Nominal(0.0, 1.0, 1.0, 1.0, 0.3), "mass_kg"),
        (lambda: replace(Setup.default(), rate_hz=5.0), "rate_hz"),
        (lambda: replace(Setup.default(), pose_gain=2.0), "pose_gain"),
        (
            lambda: run_closed_loop(SHORT, seed=0, normal=np.zeros((3, 12))),
            "has shape",
        ),
        (
            lambda: run_closed_loop(excitation.speed_ramp(200.0, 300.0, 10.0), seed=0),
            "speed_mps is 200",
        ),
    ],
)
def test_what_makes_no_sense_is_refused(make: Callable[[], object], words: str) -> None:
    with pytest.raises(InvalidInput, match=words):
        make()
