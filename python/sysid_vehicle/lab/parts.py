"""What a laboratory is made of: sensors, actuators, controller, observer, simulator."""

from __future__ import annotations

from dataclasses import dataclass, field, fields

import numpy as np

from .._common.arguments import check_not_negative
from .._common.arrays import FloatArray, as_float64
from .._common.typed import typed, typed_fields
from ..errors import InvalidInput
from ..vehicle import GRAVITY_MPS2, Vehicle
from .observer.observer import ObserverForm

_INF = float("inf")


@dataclass(frozen=True)
class Sensor:
    """One sensor.

    Parameters
    ----------
    noise_std : float
        Standard deviation of the white noise of a reading, in the unit of the channel.
    bias : float
        Constant that is added.
    delay_s : float
        Age of what is read.
    rate_hz : float
        Readings per second; 0 means one at every sample. In between there is none (NaN).
    present : bool
        False: it reads nothing at all.
    """

    noise_std: float = 0.0
    bias: float = 0.0
    delay_s: float = 0.0
    rate_hz: float = 0.0
    present: bool = True

    @typed_fields
    def __post_init__(self) -> None:
        for name in ("noise_std", "delay_s", "rate_hz"):
            value = getattr(self, name)
            if not 0.0 <= value < _INF:
                raise InvalidInput(f"Sensor: {name} = {value!r}; give zero or a positive number")


@dataclass(frozen=True)
class Sensors:
    """Every sensor of the laboratory; the defaults are the published ones, with a noisy compass.

    Parameters
    ----------
    vx_mps, vy_mps, yaw_rate_radps, ax_mps2, ay_mps2 : Sensor
        Motion. Observer and controller never see more of it than these.
    heading_rad, x_m, y_m : Sensor
        Heading and place on the ground.
    fz_front_n, fz_rear_n : Sensor
        Axle loads.
    fx_n, steer_rad : Sensor
        What the actuators report of themselves.
    ay_repeats_yaw_noise : bool
        Both draw the same random numbers, as in the published experiment.
    """

    vx_mps: Sensor = Sensor(0.1)
    vy_mps: Sensor = Sensor(1e-5**0.5)
    yaw_rate_radps: Sensor = Sensor(1e-5**0.5)
    ax_mps2: Sensor = Sensor(1e-5**0.5)
    ay_mps2: Sensor = Sensor(1e-5**0.5)
    heading_rad: Sensor = Sensor(0.002)
    x_m: Sensor = Sensor(0.02)
    y_m: Sensor = Sensor(0.02)
    fz_front_n: Sensor = Sensor()
    fz_rear_n: Sensor = Sensor()
    fx_n: Sensor = Sensor()
    steer_rad: Sensor = Sensor()
    ay_repeats_yaw_noise: bool = False

    @classmethod
    def names(cls) -> tuple[str, ...]:
        """Return the channels, in the core's order."""
        return tuple(f.name for f in fields(cls) if f.name != "ay_repeats_yaw_noise")

    def table(self) -> FloatArray:
        """Return noise, bias, delay and rate of every sensor, shape (12, 4)."""
        rows = []
        for name in self.names():
            s: Sensor = getattr(self, name)
            # A reading with noise that is no number is none.
            rows.append([s.noise_std if s.present else np.nan, s.bias, s.delay_s, s.rate_hz])
        return as_float64(rows)

    @typed
    def normal(self, n: int, rng: np.random.Generator) -> FloatArray:
        """Draw standard normal numbers for `n` samples, shape (n, 12)."""
        drawn = rng.standard_normal((n, len(self.names())))
        if self.ay_repeats_yaw_noise:
            drawn[:, self.names().index("ay_mps2")] = drawn[:, self.names().index("yaw_rate_radps")]
        return as_float64(drawn)


@dataclass(frozen=True)
class Actuator:
    """Limits of an actuator.

    Parameters
    ----------
    least, most : float
        Ends of its range, in its unit.
    rate_limit : float
        Highest rate of change per second.
    lag_s : float
        Time constant of its first-order lag.
    """

    least: float
    most: float
    rate_limit: float = _INF
    lag_s: float = 0.0

    @typed_fields
    def __post_init__(self) -> None:
        if not (self.least < self.most and self.rate_limit > 0.0 and self.lag_s >= 0.0):
            raise InvalidInput(
                f"{self}: give a range from low to high, a positive rate and no negative lag"
            )


@dataclass(frozen=True)
class Nominal:
    """The car as observer and controller believe it to be.

    Parameters
    ----------
    mass_kg, yaw_inertia_kgm2, lf_m, lr_m, cg_height_m : float
        See :class:`~sysid_vehicle.Vehicle`.
    stiffness_front, stiffness_rear : float
        Cornering stiffness per vertical load [1/rad]: a guess, which the plant need not have.
    drag_nspm : float
        Linear drag [N s/m].
    gravity_mps2 : float
        Gravity behind the static axle loads.
    """

    mass_kg: float
    yaw_inertia_kgm2: float
    lf_m: float
    lr_m: float
    cg_height_m: float
    stiffness_front: float = 50.0
    stiffness_rear: float = 50.0
    drag_nspm: float = 0.3
    gravity_mps2: float = GRAVITY_MPS2

    @typed_fields
    def __post_init__(self) -> None:
        check_not_negative(self)
        for name in ("mass_kg", "yaw_inertia_kgm2", "lf_m", "stiffness_front"):
            if getattr(self, name) == 0.0:
                raise InvalidInput(f"Nominal: {name} is zero; the controller divides by it")

    @classmethod
    @typed
    def of(cls, vehicle: Vehicle, stiffness: float | None = None) -> Nominal:
        """Take mass and geometry from a vehicle, and one stiffness for both axles or its own."""
        v = vehicle
        inertia = v.yaw_inertia_kgm2 or v.usual_inertia_kgm2
        front, rear = (
            tyre.cornering_stiffness_per_load if stiffness is None else stiffness
            for tyre in (v.tyre_front, v.tyre_rear)
        )
        return cls(v.mass_kg, inertia, v.lf_m, v.lr_m, v.cg_height_m, front, rear)


@dataclass(frozen=True)
class Controller:
    """Gains and limits of the active disturbance rejection control (`cpp/.../lab/adrc.hpp`).

    Parameters
    ----------
    speed_gain_ps, yaw_rate_gain_ps, heading_gain_ps : float
        Proportional gains [1/s].
    yaw_rate_limit_radps, yaw_acceleration_limit_radps2, lateral_limit_mps2 : float
        Limits of the wanted yaw rate, of its change, and of its product with the speed.
    slip_limit_rad : float
        The steering angle keeps the estimated front slip angle below this.
    rear_slip_limit_rad, rear_slip_gain_ps : float
        The wanted yaw rate is given up where it would bring the estimated rear slip angle nearer
        to this limit than the gain [1/s] times what is left.
    brakes_from_mps2 : float
        Decelerations below this are left to drag.
    feed_forward : bool
        Use the derivatives of the references.
    coupling : bool
        Cancel the term ``v_y r`` of the longitudinal equation.
    lowest_speed_mps, added_speed_mps : float
        Speeds below the first count as it in the linearisation; the second is added there.
    """

    speed_gain_ps: float = 4.0
    yaw_rate_gain_ps: float = 30.0
    heading_gain_ps: float = 12.0
    yaw_rate_limit_radps: float = 1.2
    yaw_acceleration_limit_radps2: float = 6.0
    lateral_limit_mps2: float = _INF
    slip_limit_rad: float = 0.12
    rear_slip_limit_rad: float = 0.1
    rear_slip_gain_ps: float = 4.0
    brakes_from_mps2: float = 0.0
    feed_forward: bool = True
    coupling: bool = True
    lowest_speed_mps: float = 1.0
    added_speed_mps: float = 0.0

    @typed_fields
    def __post_init__(self) -> None:
        check_not_negative(self)


@dataclass(frozen=True)
class Online:
    """The observer in the loop (`cpp/.../lab/observer.hpp`).

    Parameters
    ----------
    process : tuple of 6 floats
        Variances per sample of v_x, v_y, r and the unknown F_x, F_y, M_z.
    sensors : tuple of 4 floats
        Variances of the readings of v_x, v_y, r, a_y.
    form : ObserverForm
        Its equations; corrected by default.
    certain_start : bool
        Begin with the drive's first speed, certain; otherwise with the first reading.
    """

    process: tuple[float, ...] = (1e-6, 1e-6, 1e-8, 50.0, 1500.0, 300.0)
    sensors: tuple[float, ...] = (1e-2, 1e-5, 1e-5, 1e-5)
    form: ObserverForm = field(default_factory=ObserverForm)
    certain_start: bool = False

    @typed_fields
    def __post_init__(self) -> None:
        for name, count in (("process", 6), ("sensors", 4)):
            given = np.asarray(getattr(self, name), dtype=float)
            if given.shape != (count,) or not ((given >= 0.0) & (given < _INF)).all():
                raise InvalidInput(
                    f"Online: {name} = {given}; give {count} variances, none below 0"
                )
        if min(self.sensors) == 0.0:
            raise InvalidInput("Online: sensors holds a zero; give every reading some noise")


@dataclass(frozen=True)
class Simulator:
    """How the plant is computed (`cpp/.../lab/plant.hpp`).

    Parameters
    ----------
    load_share : float
        Part of the axle load that the tyre law is given. 0.5 reproduces the published car, whose
        axle forces followed from the load of one wheel: it has half its physical grip.
    late_loads : bool
        The tyres feel the loads of the sample before.
    air_speed_of_both : bool
        Drag, and lift on late loads, from ``v_x^2 + v_y^2``.
    steps : int
        Runge-Kutta steps per sample; 0: as many as the car needs.
    tolerance : float
        More than 0: Dormand-Prince with this tolerance.
    gravity_mps2 : float
        Gravity behind the static axle loads.
    late_feedback : bool
        The command rests on the estimate of the sample before, without prediction.
    first_late_load_n : float
        What stands for the loads before there are any.
    load_sensors : bool
        Observer and controller take the loads from sensors, not from the car's own numbers.
    inputs_linear : bool
        Wheel force and steering angle move evenly from each sample to the next, as the rest of the
        package takes logs to be. Otherwise they jump at each sample and hold until the next.
    """

    load_share: float = 1.0
    late_loads: bool = False
    air_speed_of_both: bool = False
    steps: int = 0
    tolerance: float = 0.0
    gravity_mps2: float = GRAVITY_MPS2
    late_feedback: bool = False
    first_late_load_n: float = 0.0
    load_sensors: bool = False
    inputs_linear: bool = False

    @typed_fields
    def __post_init__(self) -> None:
        check_not_negative(self)
        if self.inputs_linear and self.late_feedback:
            raise InvalidInput(
                "Simulator: inputs_linear needs the next command early; switch late_feedback off"
            )
        if not (0.0 < self.load_share <= 1.0 and 0 <= self.steps <= 1000):
            raise InvalidInput(
                f"Simulator: load_share = {self.load_share!r}, steps = {self.steps!r}; give a "
                f"share above 0 and at most 1, and 0 to 1000 steps"
            )
