"""What manoeuvres ask for: curves, steady steering, references."""

import re
from dataclasses import FrozenInstanceError

import numpy as np
import pytest

from sysid_vehicle import _core, manoeuvres
from sysid_vehicle.errors import InvalidInput
from sysid_vehicle.manoeuvres import Curvature, Knots, Manoeuvre, Pulse, Pulses, Sweep
from sysid_vehicle.model import Model
from sysid_vehicle.simulate import example_vehicle
from sysid_vehicle.vehicle import Vehicle

NAMES = tuple(manoeuvres.all())
OPEN_LOOP = {"step_steer", "ramp_steer", "sine_sweep", "sine_with_dwell"}
STRAIGHT = {"straight_acceleration"}


@pytest.fixture
def car() -> Vehicle:
    return example_vehicle()


def test_all_gives_each_manoeuvre_under_its_name() -> None:
    made = manoeuvres.all()
    assert len(made) == 11
    for name, manoeuvre in made.items():
        assert manoeuvre == getattr(manoeuvres, name)()
        assert manoeuvre.name == name


@pytest.mark.parametrize("name", NAMES)
def test_references_are_smooth_enough_to_drive(name: str, car: Vehicle) -> None:
    manoeuvre = manoeuvres.all()[name]
    wanted = manoeuvre.references(car, 100.0)
    assert wanted.shape == (round(manoeuvre.duration_s * 100.0) + 1, 3)
    assert np.isfinite(wanted).all()
    assert wanted[:, 0].min() > 3.0
    assert np.abs(np.diff(wanted[:, 0])).max() * 100.0 < 8.0  # m/s2
    assert np.abs(np.diff(wanted[:, 2])).max() * 100.0 < 1.0  # the driver's hands, rad/s
    assert manoeuvre.tracks_path == (name not in OPEN_LOOP)
    if not manoeuvre.tracks_path:
        assert not wanted[:, 1].any()


@pytest.mark.parametrize("name", sorted(set(NAMES) - STRAIGHT))
def test_references_go_to_both_sides_alike(name: str, car: Vehicle) -> None:
    manoeuvre = manoeuvres.all()[name]
    time_s = np.arange(0.0, manoeuvre.duration_s, 0.01)
    lateral = manoeuvre.lateral_mps2(time_s)
    assert lateral.max() == pytest.approx(-lateral.min(), rel=0.06)
    assert np.abs(lateral).max() < 0.95 * manoeuvres.peak_lateral_mps2(car)


def test_the_lap_brakes_hard_while_cornering_and_bends_the_tyre_curve(car: Vehicle) -> None:
    wanted = manoeuvres.lap().references(car, 100.0)
    braking = np.gradient(wanted[:, 0], 0.01)
    lateral = np.abs(wanted[:, 1]) * wanted[:, 0] ** 2
    both = (braking < -3.0) & (lateral > 4.0)
    assert both.sum() > 150  # 1.5 s
    assert 0.85 < lateral.max() / manoeuvres.peak_lateral_mps2(car) < 0.93
    assert wanted[:, 0].min() < 14.0
    assert wanted[:, 0].max() > 32.0


def test_the_handling_course_is_not_the_lap(car: Vehicle) -> None:
    lap = manoeuvres.lap().references(car, 50.0)
    course = manoeuvres.handling_course().references(car, 50.0)
    assert abs(np.corrcoef(lap[:, 1], course[:, 1])[0, 1]) < 0.5


def test_the_lap_goes_round_again() -> None:
    lap = manoeuvres.lap(150.0)
    first = np.arange(0.0, 30.0, 0.01)
    for curve in (lap.speed_mps, lap.lateral_mps2):
        np.testing.assert_allclose(curve(first + 120.0), curve(first), atol=1e-9)


def test_steady_steering_holds_the_yaw_rate_of_the_core(car: Vehicle) -> None:
    """With this steering the core's car must be in balance, its slip angles as assumed."""
    lateral, speed = 6.0, 24.0
    steer = float(manoeuvres.steady_steer(car, speed, lateral))
    core, p = Model(car).core(), Model(car).vector()
    rate = lateral / speed
    # The lateral velocity follows from the rear slip angle, found here by bisection on its force.
    low, high = -3.0, 3.0
    drag = 0.5 * car.air_density_kgpm3 * car.drag_area_m2 * speed**2
    for _ in range(60):
        vy = 0.5 * (low + high)
        out = core.evaluate(p, np.array([speed, vy, rate]), steer, drag)[0]
        low, high = (vy, high) if out[1] > 0.0 else (low, vy)
    # Small angles in the formula: a few percent of the yaw moment of one axle.
    assert abs(out[2]) < 0.05 * car.lf_m * 0.5 * car.mass_kg * lateral / car.yaw_inertia_kgm2
    assert out[5] - out[6] == pytest.approx(steer - car.wheelbase_m * rate / speed, abs=2e-3)


def test_understeer_gradient_is_the_slope_of_steady_steering(car: Vehicle) -> None:
    a = 1e-3
    beyond_path = manoeuvres.steady_steer(car, 20.0, a) - car.wheelbase_m * a / 20.0**2
    # The tyre curves are tabulated, so their slope at zero is that of the first step.
    assert manoeuvres.understeer_gradient(car) == pytest.approx(float(beyond_path) / a, rel=1e-2)
    assert manoeuvres.understeer_gradient(car) > 0.0


def test_peak_is_that_of_the_weaker_axle(car: Vehicle) -> None:
    peak = manoeuvres.peak_lateral_mps2(car)
    assert peak == pytest.approx(9.80665 * car.tyre_front.D, rel=1e-4)
    weak_rear = car.replace(tyre_rear=car.tyre_rear.replace(D=0.8))
    assert manoeuvres.peak_lateral_mps2(weak_rear) == pytest.approx(9.80665 * 0.8, rel=1e-4)
    with pytest.raises(InvalidInput, match=r"lateral_mps2: 11 m/s2 is more than the 10\.1"):
        manoeuvres.steady_steer(car, 20.0, 11.0)


def test_a_manoeuvre_beyond_the_grip_is_refused_with_its_time(car: Vehicle) -> None:
    with pytest.raises(InvalidInput, match=r"lap: asks for 11 .* at \d+\.\d+ s.*ask for less"):
        manoeuvres.lap(lateral_mps2=11.0).references(car, 100.0)


def test_step_steer_holds_its_steps_between_samples(car: Vehicle) -> None:
    """Corners lie on samples, and each step is in proportion to the largest."""
    manoeuvre = manoeuvres.step_steer((20.0,), (2.0, 4.0), rise_s=0.2, hold_s=1.0)
    steer = manoeuvre.references(car, 100.0)[:, 2]
    full = float(manoeuvres.steady_steer(car, 20.0, 4.0))
    np.testing.assert_allclose(steer[120:221], 0.5 * full, rtol=1e-12)  # 1.0 + 0.2 s
    np.testing.assert_allclose(steer[0:101], 0.0)
    assert np.ptp(np.diff(steer[100:121])) < 1e-12  # one slope all the way up
    assert steer.max() == pytest.approx(full)
    assert steer.min() == pytest.approx(-full)


def test_sine_sweep_goes_through_its_frequencies() -> None:
    sweep = Sweep(1.0, 0.0, 40.0, 0.2, 3.0)
    time_s = np.arange(0.0, 40.0, 1e-3)
    crossings = time_s[1:][np.diff(np.signbit(sweep(time_s))) != 0]
    half_periods = np.diff(crossings)
    assert 0.5 / half_periods[0] == pytest.approx(0.23, abs=0.03)
    assert 0.5 / half_periods[-1] == pytest.approx(2.95, abs=0.08)
    assert (np.diff(half_periods) < 2e-3).all()
    assert np.abs(sweep(time_s)).max() == pytest.approx(1.0, abs=1e-3)
    assert sweep(np.array([-0.1, 40.1])).tolist() == [0.0, 0.0]


def test_a_sweep_between_equal_frequencies_is_a_sine() -> None:
    time_s = np.linspace(0.0, 4.0, 400)
    expected = 2.0 * np.sin(2.0 * np.pi * 0.5 * time_s)
    np.testing.assert_allclose(Sweep(2.0, 0.0, 4.0, 0.5, 0.5)(time_s), expected, atol=1e-12)


@pytest.mark.parametrize(("low", "high"), [(0.2, 3.0), (0.3, 0.3), (3.0, 0.2)])
def test_a_sweep_of_whole_periods_ends_at_zero(low: float, high: float) -> None:
    sweep = Sweep.of_whole_periods(1.0, 2.0, 30.0, low, high)
    assert 30.0 - 2.0 / min(low, high) < sweep.duration_s <= 30.0
    end = np.array([2.0 + sweep.duration_s - 1e-9])
    assert abs(float(sweep(end)[0])) < 1e-6


def test_a_pulse_rests_at_its_second_peak() -> None:
    pulse = Pulse(1.0, 3.0, 0.5, 0.4)  # peaks at 1.5 and from 2.5 to 2.9, zero at 2 and 3.4
    curve = Pulses((pulse,))
    assert pulse.end_s == pytest.approx(3.4)
    time_s = np.array([0.5, 1.0, 1.5, 2.0, 2.5, 2.7, 2.9, 3.4, 4.0])
    expected = [0.0, 0.0, 3.0, 0.0, -3.0, -3.0, -3.0, 0.0, 0.0]
    np.testing.assert_allclose(curve(time_s), expected, atol=1e-12)


def test_a_lane_change_ends_one_lane_further(car: Vehicle) -> None:
    manoeuvre = manoeuvres.double_lane_change((20.0,), offset_m=3.5)
    dt = 1e-3
    lateral = manoeuvre.lateral_mps2(np.arange(0.0, manoeuvre.duration_s, dt))
    beside = np.cumsum(np.cumsum(lateral)) * dt**2
    assert beside.max() == pytest.approx(3.5, rel=1e-2)
    assert beside.min() == pytest.approx(-3.5, rel=1e-2)
    assert beside[-1] == pytest.approx(0.0, abs=0.05)


def test_curvature_gives_the_centripetal_acceleration() -> None:
    curve = Curvature(Knots((0.0, 1.0), (10.0, 20.0)), Knots((0.0, 1.0), (0.02, 0.02)))
    np.testing.assert_allclose(curve(np.array([0.0, 0.5, 1.0])), [2.0, 4.5, 8.0])


def test_smooth_knots_do_not_overshoot() -> None:
    knots = Knots((0.0, 1.0, 1.2, 3.0), (0.0, 0.0, 5.0, 5.0), smooth=True)
    values = knots(np.linspace(-1.0, 4.0, 1001))
    assert values.min() == 0.0
    assert values.max() == 5.0
    assert (np.diff(values) >= 0.0).all()


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Knots((0.0, 1.0, 1.0), (0.0, 1.0, 2.0)), "knot 2 (1 s) does not come after"),
        (lambda: Knots((0.0,), (0.0,)), "two knots or more"),
        (lambda: Sweep(1.0, 0.0, 10.0, 0.0, 3.0), "Sweep: from_hz = 0.0; give positive"),
        (lambda: manoeuvres.lap(0.0), "lap: duration_s = 0.0"),
        (lambda: manoeuvres.lap(lateral_mps2=float("nan")), "lap: lateral_mps2 = nan"),
        (lambda: manoeuvres.lap(top_speed_mps=2.0), "lap: the wanted speed is 1.19"),
        (lambda: manoeuvres.step_steer(()), "step_steer: speeds_mps is empty"),
        (lambda: manoeuvres.ramp_steer(rise_s=-1.0), "ramp_steer: rise_s = -1.0"),
        (lambda: manoeuvres.sine_sweep(1.0), "needs 0.967 s for one period, there are -1 s"),
        (lambda: manoeuvres.sine_with_dwell(frequency_hz=0.0), "sine_with_dwell: frequency_hz"),
        (lambda: manoeuvres.slalom(4.0), "needs 3.33 s for one period, there are 2 s"),
        (lambda: manoeuvres.double_lane_change(change_m=0.0), "double_lane_change: change_m"),
        (lambda: manoeuvres.constant_radius(duration_s=10.0), "more than 24 s"),
        (lambda: manoeuvres.brake_in_turn(radius_m=-1.0), "brake_in_turn: radius_m"),
        (lambda: manoeuvres.usual_road("alley"), "kind = 'alley'; give one of motorway, country"),  # type: ignore[arg-type]
        (lambda: manoeuvres.usual_road(duration_s=-1.0), "usual_road: duration_s = -1.0"),
    ],
)
def test_a_manoeuvre_that_cannot_be_is_refused(make: object, message: str) -> None:
    assert callable(make)
    with pytest.raises(InvalidInput, match=re.escape(message)):
        make()


@pytest.mark.parametrize("rate_hz", [0.0, float("nan"), 1e6])
def test_a_rate_that_cannot_be_is_refused(rate_hz: float, car: Vehicle) -> None:
    with pytest.raises(InvalidInput, match="rate_hz"):
        manoeuvres.lap().references(car, rate_hz)


def test_the_driver_knows_the_understeer_of_his_car(car: Vehicle) -> None:
    driver = manoeuvres.step_steer().driver(car)
    assert isinstance(driver, _core.Driver)
    assert driver.tracks_path is False
    assert driver.understeer_radps2pm == manoeuvres.understeer_gradient(car)


@pytest.mark.parametrize("name", NAMES)
def test_manoeuvres_print_and_draw(name: str) -> None:
    manoeuvre = manoeuvres.all()[name]
    text = str(manoeuvre)
    assert text.startswith(f"{name}: {manoeuvre.purpose}\n")
    assert " m/s, lateral " in text
    assert manoeuvre._repr_html_().startswith("<pre>")
    ax = manoeuvre.plot()
    assert ax.get_title() == name
    assert len(ax.figure.axes) == 2


def test_manoeuvres_cannot_be_changed() -> None:
    lap = manoeuvres.lap()
    assert isinstance(lap, Manoeuvre)
    with pytest.raises(FrozenInstanceError):
        lap.duration_s = 3.0  # type: ignore[misc]
