"""Simulated drives: the car goes where it shall, the log holds what the sensors saw."""

import re
from dataclasses import fields

import numpy as np
import pytest

from sysid_vehicle import manoeuvres
from sysid_vehicle.errors import InvalidInput, NumericalError, SysidWarning
from sysid_vehicle.log import CHANNELS
from sysid_vehicle.model import Model
from sysid_vehicle.simulate import (
    Drive,
    RoadDisturbance,
    SensorNoise,
    drive,
    drive_truth,
    example_vehicle,
)
from sysid_vehicle.tyre import Tyre
from sysid_vehicle.vehicle import GRAVITY_MPS2

# Sizes of hidden effects that every manoeuvre must survive.
HIDDEN: dict[str, dict[str, float]] = {
    "downforce": {"aero_downforce.cl_a_front_m2": 0.9, "aero_downforce.cl_a_rear_m2": 1.3},
    "drag": {"aero_drag.drag_area_m2": 0.45},
    "load sensitivity": {"tyre_load_sensitivity.sensitivity": 0.25},
    "combined slip": {"combined_slip.ellipse": 1.0},
    "relaxation": {"tyre_relaxation.relaxation_length_m": 0.45},
    "lag": {"steer_lag.time_constant_s": 0.06},
    "offset": {"steer_offset.offset_rad": 0.006},
    "bank": {"road_bank.bank_rad": 0.05},
    "grade": {"road_grade.grade_rad": 0.03},
    "wind": {"side_wind.side_force_n": 450.0, "side_wind.yaw_moment_nm": 250.0},
    "mass": {"mass.relative_error": 0.12},
    "yaw inertia": {"yaw_inertia.relative_error": 0.25},
    "centre of gravity": {"cg_position.shift_rearward_m": 0.08},
    "lever arm": {"imu_lever_arm.forward_m": 0.5},
    "bias": {"accelerometer_bias.ay_mps2": 0.25},
}


def hidden(values: dict[str, float]) -> Model:
    model = Model(example_vehicle())
    for effect in dict.fromkeys(name.split(".")[0] for name in values):
        model = model.add(effect)
    return model.with_values(values)


@pytest.fixture(scope="module")
def calm() -> Drive:
    """A lap that sensors without noise watched."""
    return drive_truth(hidden({}), manoeuvres.lap(), seed=1, noise=SensorNoise.none())


def test_the_lap_is_followed(calm: Drive) -> None:
    wanted, yaw_rate = calm.references, calm.states[:, 2]
    assert np.abs(calm.states[:, 0] - wanted[:, 0]).max() < 0.5
    error = yaw_rate - wanted[:, 1] * wanted[:, 0]
    assert np.sqrt(np.mean(error**2)) < 0.08 * np.abs(yaw_rate).max()
    peak = manoeuvres.peak_lateral_mps2(calm.model.vehicle)
    assert 0.74 < np.abs(calm.outputs[:, 4]).max() / peak < 0.87
    sideslip = np.arctan2(calm.states[:, 1], calm.states[:, 0])
    assert np.abs(sideslip).max() < 0.07


def test_braking_and_cornering_happen_together(calm: Drive) -> None:
    both = (calm.outputs[:, 3] < -3.0) & (np.abs(calm.outputs[:, 4]) > 4.0)
    assert both.sum() > 120  # 1.2 s


def test_the_states_obey_the_model(calm: Drive) -> None:
    """The slope of the states is what the model says at that state and input."""
    core, p = calm.model.core(), calm.model.vector()
    slope = (calm.states[2:] - calm.states[:-2]) / 0.02
    for k in range(500, 5500, 250):
        steer, force = calm.inputs[k]
        rates = core.evaluate(p, calm.states[k], steer, force)[0]
        np.testing.assert_allclose(slope[k - 1], rates[:3], atol=0.02)
        np.testing.assert_allclose(calm.outputs[k, 3:], rates[3:5], atol=1e-9)


def test_the_log_holds_every_channel(calm: Drive) -> None:
    assert calm.log.channels == tuple(CHANNELS)
    assert calm.log.name == "lap"
    assert calm.log.rate_hz == pytest.approx(100.0)
    assert calm.log.n == 6001
    np.testing.assert_array_equal(calm.log["fx_n"], calm.inputs[:, 1])
    np.testing.assert_array_equal(calm.log["steer_rad"], calm.inputs[:, 0])
    np.testing.assert_array_equal(calm.log["ay_mps2"], calm.outputs[:, 4])


def test_noise_has_the_size_it_states(calm: Drive) -> None:
    noisy = drive(calm.model, manoeuvres.lap(), seed=3)
    for field in fields(SensorNoise):
        error = noisy[field.name] - calm.log[field.name]
        stated = getattr(SensorNoise(), field.name)
        # 6001 independent draws: four standard errors of a standard deviation are 3.7 %.
        assert np.std(error) == pytest.approx(stated, rel=0.037), field.name
        assert abs(np.mean(error)) < 4.0 * stated / np.sqrt(6001)
        assert abs(np.corrcoef(error[1:], error[:-1])[0, 1]) < 4.0 / np.sqrt(6000)
    np.testing.assert_array_equal(noisy["fx_n"], calm.log["fx_n"])


def test_the_seed_decides() -> None:
    model, course = hidden({}), manoeuvres.lap(8.0)
    push = RoadDisturbance(fy_n=100.0)
    first = drive(model, course, seed=5, disturbance=push)
    again = drive(model, course, seed=5, disturbance=push)
    other = drive(model, course, seed=6, disturbance=push)
    handed = drive(model, course, seed=np.random.default_rng(5), disturbance=push)
    for channel in CHANNELS:
        np.testing.assert_array_equal(first[channel], again[channel])
        np.testing.assert_array_equal(first[channel], handed[channel])
    assert (first["vy_mps"] != other["vy_mps"]).mean() > 0.99


@pytest.mark.parametrize("seed", [None, -1, 1.5, True, "one"])
def test_a_seed_that_repeats_nothing_is_refused(seed: object) -> None:
    with pytest.raises(InvalidInput, match=r"seed = .*whole number"):
        drive(hidden({}), manoeuvres.lap(5.0), seed=seed)  # type: ignore[arg-type]


def test_a_disturbance_has_the_size_and_the_memory_it_states() -> None:
    rng = np.random.default_rng(11)
    road = RoadDisturbance(fx_n=50.0, fy_n=200.0, mz_nm=80.0, correlation_time_s=0.25)
    x = road.sample(200_000, 100.0, rng)
    np.testing.assert_allclose(x.std(axis=0), [50.0, 200.0, 80.0], rtol=0.04)
    lag = 25  # one correlation time
    for column in x.T:
        kept = np.corrcoef(column[lag:], column[:-lag])[0, 1]
        assert kept == pytest.approx(np.exp(-1.0), abs=0.04)
    assert abs(np.corrcoef(x[:, 0], x[:, 1])[0, 1]) < 0.05


def test_a_disturbance_begins_in_its_stationary_state() -> None:
    road = RoadDisturbance(fy_n=100.0)
    first = [road.sample(2, 100.0, np.random.default_rng(k))[0, 1] for k in range(2000)]
    assert np.std(first) == pytest.approx(100.0, rel=0.07)


def test_a_side_force_pushes_the_car_sideways() -> None:
    model, course = hidden({}), manoeuvres.straight_acceleration()
    pushed = drive_truth(model, course, seed=1, disturbance=RoadDisturbance(fy_n=300.0))
    assert np.abs(pushed.disturbance[:, 1]).max() > 600.0
    assert not pushed.disturbance[:, [0, 2]].any()
    together = np.corrcoef(pushed.disturbance[:, 1], pushed.outputs[:, 4])[0, 1]
    assert together > 0.5


def test_gravity_on_a_slope_moves_the_car_and_no_accelerometer_feels_it() -> None:
    road = RoadDisturbance(slope_rad=0.03)
    model = hidden({})
    wavy = drive_truth(model, manoeuvres.lap(30.0), seed=1, disturbance=road)
    gravity = wavy.disturbance[:, 3:]
    assert not wavy.disturbance[:, :3].any()
    np.testing.assert_allclose(gravity.std(axis=0), 9.80665 * 0.03, rtol=0.6)
    v_x, v_y, r = wavy.states.T
    along = np.gradient(v_x, 0.01) - v_y * r - wavy.outputs[:, 3]
    across = np.gradient(v_y, 0.01) + v_x * r - wavy.outputs[:, 4]
    for found, wanted in ((along, gravity[:, 0]), (across, gravity[:, 1])):
        off = (found - wanted)[20:-20]
        assert np.std(off) < 0.1 * np.std(wanted)


def test_the_steering_lag_shows_in_the_yaw_rate() -> None:
    """Open-loop steering is the same; the car with the lag answers by that much later."""
    course = manoeuvres.sine_sweep()
    plain = drive_truth(hidden({}), course, seed=1)
    slow = drive_truth(hidden(HIDDEN["lag"]), course, seed=1)
    np.testing.assert_array_equal(plain.inputs[:, 0], slow.inputs[:, 0])
    early = slice(100, 1000)  # slow part of the sweep, where a lag is a delay
    best = min(
        range(20),
        key=lambda k: float(
            np.sum((slow.states[early, 2] - plain.states[100 - k : 1000 - k, 2]) ** 2)
        ),
    )
    assert best == pytest.approx(6, abs=1)  # samples of 10 ms


@pytest.mark.parametrize("name", tuple(manoeuvres.all()))
@pytest.mark.parametrize("effect", ["nothing", *HIDDEN])
def test_no_hidden_effect_makes_the_car_spin(name: str, effect: str) -> None:
    model = hidden(HIDDEN.get(effect, {}))
    finished = drive_truth(model, manoeuvres.all()[name], seed=1)
    sideslip = np.arctan2(finished.states[:, 1], finished.states[:, 0])
    assert np.abs(sideslip).max() < 0.12
    assert finished.log.n == len(finished.references)


def test_a_spin_is_reported_with_its_time() -> None:
    truth = Model(example_vehicle()).with_values({"B_rear": 5.0, "D_rear": 0.6})
    with pytest.raises(NumericalError, match=r"step_steer: the car spun at t = \d+\.?\d* s .*less"):
        drive(truth, manoeuvres.step_steer(), seed=1)


def test_a_car_that_cannot_climb_is_reported_as_stopped() -> None:
    truth = hidden({"mass.relative_error": 1.0, "road_grade.grade_rad": 0.5})
    with pytest.raises(NumericalError, match=r"the car stopped at t = \d+\.?\d* s"):
        drive(truth, manoeuvres.sine_sweep(lateral_mps2=0.5, speed_mps=12.0), seed=1)


def test_a_lap_is_the_same_at_another_rate(calm: Drive) -> None:
    fine = drive_truth(
        calm.model, manoeuvres.lap(), seed=1, noise=SensorNoise.none(), rate_hz=200.0
    )
    assert fine.log.rate_hz == pytest.approx(200.0)
    np.testing.assert_allclose(fine.states[::2, 2], calm.states[:, 2], atol=0.02)


@pytest.mark.parametrize(
    ("kind", "values", "message"),
    [
        (SensorNoise, {"ay_mps2": -0.1}, "SensorNoise: ay_mps2 = -0.1; give zero or a positive"),
        (SensorNoise, {"vx_mps": float("nan")}, "SensorNoise: vx_mps = nan"),
        (RoadDisturbance, {"fy_n": -1.0}, "RoadDisturbance: fy_n = -1.0"),
        (RoadDisturbance, {"correlation_time_s": 0.0}, "must be more than zero"),
        (RoadDisturbance, {"slope_time_s": 0.0}, "slope_time_s must be more than zero"),
    ],
)
def test_sizes_that_cannot_be_are_refused(
    kind: type, values: dict[str, float], message: str
) -> None:
    with pytest.raises(InvalidInput, match=re.escape(message)):
        kind(**values)


def test_noise_can_be_scaled_and_switched_off() -> None:
    assert SensorNoise().scaled(2.0).ay_mps2 == pytest.approx(0.12)
    assert SensorNoise().scaled(0.0) == SensorNoise.none()


def test_a_drive_prints_and_draws(calm: Drive) -> None:
    text = str(calm)
    assert text.startswith("lap with sports saloon (no effect): 60 s at 100 Hz")
    assert "lateral acceleration up to" in text
    assert calm._repr_html_().startswith("<pre>lap with")
    ax = calm.plot()
    assert len(ax.lines) == 2
    assert len(ax.figure.axes) == 2


def test_a_drive_draws_beside_others(calm: Drive) -> None:
    from matplotlib import pyplot

    _, (left, right) = pyplot.subplots(1, 2)
    calm.plot(left)
    assert not right.lines
    assert len(left.lines) == 2


def test_the_example_understeers() -> None:
    car = example_vehicle()
    assert manoeuvres.understeer_gradient(car) > 5e-4
    assert car.drive_front_share == 0.0


@pytest.mark.parametrize("delay_s", [0.03, -0.03])
def test_steering_acts_after_the_log_says_so_or_before(delay_s: float) -> None:
    """Of the driver's angle the car and the log have one in time, the other 30 ms later."""
    course = manoeuvres.sine_sweep()
    quiet = SensorNoise.none()
    prompt = drive_truth(hidden({}), course, seed=1, noise=quiet)
    shifted = drive_truth(hidden({"steer_delay.delay_s": delay_s}), course, seed=1, noise=quiet)
    steer, before = shifted.log["steer_rad"], prompt.log["steer_rad"]
    if delay_s > 0.0:
        # The force follows the speed that the driver sees, so the car is the same but for that.
        np.testing.assert_array_equal(steer, before)
        np.testing.assert_allclose(shifted.states[3:, 2], prompt.states[:-3, 2], atol=2e-3)
        assert np.abs(shifted.states[:, 2] - prompt.states[:, 2]).max() > 0.02
    else:
        np.testing.assert_array_equal(shifted.states, prompt.states)
        np.testing.assert_allclose(steer[3:], before[:-3], atol=1e-12)


_ICE = Tyre(B=10.0, C=1.4, D=0.15, E=0.0)


def test_brakes_that_ask_more_than_ice_holds_are_told() -> None:
    car = example_vehicle().replace(tyre_front=_ICE, tyre_rear=_ICE, drive_front_share=0.5)
    course = manoeuvres.straight_acceleration()
    with pytest.warns(
        SysidWarning, match=r"straight_acceleration: at t = .* front wheels brake"
    ) as told:
        drive(Model(car), course, seed=1, noise=SensorNoise.none())
    said = re.search(
        r"t = (\S+) s .* with (\S+) N, .* hold (\S+) N \(D_front = 0.15\)", str(told[0].message)
    )
    assert said is not None
    at_s, force_n, held_n = map(float, said.groups())
    found = drive_truth(Model(car), course, seed=1, noise=SensorNoise.none())
    k = int(np.argmin(np.abs(found.log["time_s"] - at_s)))
    assert force_n == pytest.approx(-car.brake_front_share * found.inputs[k, 1], rel=1e-3)
    assert found.outputs[k, 3] < -0.15 * GRAVITY_MPS2
    load = GRAVITY_MPS2 * (car.lr_m + 0.15 * car.cg_height_m)
    assert held_n == pytest.approx(0.15 * car.mass_kg * load / car.wheelbase_m, rel=5e-3)


def test_a_drive_axle_that_would_spin_is_told() -> None:
    car = example_vehicle().replace(tyre_rear=Tyre(B=10.0, C=1.4, D=0.3, E=0.0))
    with pytest.warns(SysidWarning, match=r"the rear wheels drive .* would spin"):
        drive(Model(car), manoeuvres.straight_acceleration(), seed=1)


def test_downforce_holds_more() -> None:
    car = example_vehicle().replace(tyre_front=Tyre(B=10.0, C=1.4, D=0.66, E=0.0))
    course, winged = manoeuvres.straight_acceleration(), Model(car).add("aero_downforce")
    wings = {f"aero_downforce.cl_a_{axle}_m2": 3.0 for axle in ("front", "rear")}
    with pytest.warns(SysidWarning, match=r"the front wheels brake .* would lock"):
        drive(winged, course, seed=1)
    drive(winged.with_values(wings), course, seed=1)


@pytest.mark.parametrize("name", sorted(manoeuvres.all()))
def test_no_manoeuvre_asks_a_dry_road_for_too_much(name: str) -> None:
    """Warnings are errors here."""
    drive(Model(example_vehicle()), manoeuvres.all()[name], seed=1)
