"""Drives that excite mass and inertia: an urban cycle, a swept steer, a rough road."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy

from .. import _core
from .._common.arguments import duration, generator
from .._common.arrays import FloatArray, as_float64
from .._common.text import brief
from .._common.typed import typed
from ..errors import InvalidInput, NumericalError
from ..manoeuvres import Manoeuvre
from .car import Load, TwinCar
from .checks import checked_step

WHEELS = ("fl", "fr", "rl", "rr")
INPUTS = (
    "steer_fl_rad",
    "steer_fr_rad",
    *(f"drive_{w}_nm" for w in WHEELS),
    *(f"brake_{w}_nm" for w in WHEELS),
    *(f"road_{w}_m" for w in WHEELS),
    *(f"road_rate_{w}_mps" for w in WHEELS),
    *(f"force_{a}_n" for a in "xyz"),
    *(f"moment_{a}_nm" for a in "xyz"),
)
"""Names of the columns of the inputs."""
OUTPUTS = (
    *(f"a{a}_mps2" for a in "xyz"),
    "roll_rate_radps",
    "pitch_rate_radps",
    "yaw_rate_radps",
    *(f"wheel_speed_{w}_radps" for w in WHEELS),
    "roll_acceleration_radps2",
    "pitch_acceleration_radps2",
    "yaw_acceleration_radps2",
    "vx_mps",
    "vy_mps",
    "sideslip_rad",
    *(f"fx_{w}_n" for w in WHEELS),
    *(f"fy_{w}_n" for w in WHEELS),
    *(f"fz_{w}_n" for w in WHEELS),
    *(f"travel_{w}_m" for w in WHEELS),
    "roll_rad",
    "pitch_rad",
    "plane_ax_mps2",
    "plane_ay_mps2",
    "steer_rad",
    "wheel_force_n",
)
"""Names of the columns of the outputs; an accelerometer sits at the centre of mass."""
_ROAD = 10  # first road column of the inputs


@dataclass(frozen=True, eq=False)
class Drive14:
    """A finished drive of the fourteen-degree-of-freedom car.

    Attributes
    ----------
    name : str
        What was driven.
    dt_s : float
        Step.
    inputs : ndarray, shape (n, 24)
        What acted on the car, columns as `INPUTS`.
    states : ndarray, shape (n, 28)
        Position, angles, velocities, wheels.
    outputs : ndarray, shape (n, 38)
        What could be read without noise, columns as `OUTPUTS`.
    """

    name: str
    dt_s: float
    inputs: FloatArray
    states: FloatArray
    outputs: FloatArray

    @property
    def time_s(self) -> FloatArray:
        """Time of each sample."""
        return as_float64(np.arange(len(self.inputs)) * self.dt_s)

    __iter__ = None  # numbers are no names

    def __getitem__(self, name: str) -> FloatArray:
        """An output or an input by name."""
        if name in OUTPUTS:
            return self.outputs[:, OUTPUTS.index(name)]
        return self.inputs[:, INPUTS.index(name)]

    __repr__ = brief

    def __str__(self) -> str:
        v, ay = self["vx_mps"], self["plane_ay_mps2"]
        return (
            f"{self.name}: {len(v) * self.dt_s:g} s, {v.min():.1f} to {v.max():.1f} m/s, "
            f"lateral acceleration up to {np.abs(ay).max():.1f} m/s2"
        )


@typed
def drive14(
    car: TwinCar,
    load: Load | None,
    references: FloatArray,
    *,
    driver: _core.Driver | None = None,
    base: FloatArray | None = None,
    drive_front_share: float = 0.0,
    brake_front_share: float = 0.65,
    dt_s: float = 1e-3,
    name: str = "drive",
) -> Drive14:
    """Drive a car along references.

    Parameters
    ----------
    car, load : TwinCar, Load
        The car; None takes the load it was designed for.
    references : ndarray, shape (n, 3)
        Wanted speed [m/s], path curvature [1/m], open-loop steering [rad] at every step.
    driver : Driver, optional
        Who drives; by default one who holds the speed and steers open loop.
    base : ndarray, shape (n, 24), optional
        Road and wrench, columns as `INPUTS`; flat and calm if left out.
    drive_front_share, brake_front_share : float
        Share of the front axle.
    dt_s : float
        Step.
    name : str
        Name of the drive.

    Raises
    ------
    InvalidInput
        If the references have another shape or hold a number that is not finite, or the step is no
        step.
    NumericalError
        If the car spun, stopped or overturned; the message names the time.
    """
    dt_s = checked_step(dt_s)
    references = as_float64(references)
    if references.ndim != 2 or references.shape[1] != 3 or not np.isfinite(references).all():
        raise InvalidInput(
            f"references have shape {references.shape}; give (n, 3) finite numbers: speed [m/s], "
            f"curvature [1/m], steering [rad]"
        )
    n = len(references)
    if driver is None:
        driver = _core.Driver()
        driver.tracks_path = False
        driver.reaction_s = 0.0
    inputs, states, outputs, lost_at = car.core(load).drive(
        driver,
        [drive_front_share, brake_front_share],
        references,
        np.zeros((n, len(INPUTS))) if base is None else np.ascontiguousarray(base),
        dt_s,
    )
    if lost_at < n:
        raise NumericalError(
            f"{name}: the car was lost at sample {lost_at}, t = {lost_at * dt_s:.6g} s; ask for "
            f"less speed or curvature"
        )
    return Drive14(name, dt_s, inputs, states, outputs)


def _times(duration_s: float, dt_s: float) -> FloatArray:
    steps = round(duration(duration_s, "duration_s") / checked_step(dt_s))
    return as_float64(np.arange(steps) * dt_s)


def _references(n: int, speed_mps: FloatArray | float, steer_rad: FloatArray | float) -> FloatArray:
    out = np.zeros((n, 3))
    out[:, 0] = speed_mps
    out[:, 2] = steer_rad
    return out


@typed
def urban_cycle(
    car: TwinCar, load: Load | None = None, *, duration_s: float = 180.0, dt_s: float = 1e-3
) -> Drive14:
    """Stop-and-go speeds between 5 and 19 m/s with a bend now and then; excites the mass."""
    t = _times(duration_s, dt_s)
    speed = 12.0 + 4.0 * np.sin(2.0 * np.pi * t / 23.0) + 3.0 * np.sin(2.0 * np.pi * t / 9.1 + 1.0)
    phase = np.mod(t, 20.0)
    side = np.where(np.mod(t, 40.0) < 20.0, 1.0, -1.0)
    bend = np.where(phase < 3.0, np.sin(np.pi * phase / 3.0), 0.0)
    return drive14(
        car, load, _references(len(t), speed, 0.05 * side * bend), dt_s=dt_s, name="urban cycle"
    )


@typed
def swept_steer(
    car: TwinCar,
    load: Load | None = None,
    *,
    speed_mps: float = 22.0,
    steer_rad: float = 0.02,
    top_hz: float = 4.0,
    sweep_s: float = 30.0,
    repeats: int = 4,
    dt_s: float = 1e-3,
) -> Drive14:
    """Sine sweeps from 0 to `top_hz`; excite roll and yaw inertia."""
    t = _times(sweep_s * repeats, dt_s)
    own = np.mod(t, sweep_s)
    steer = steer_rad * np.sin(np.pi * top_hz / sweep_s * own**2)
    return drive14(car, load, _references(len(t), speed_mps, steer), dt_s=dt_s, name="swept steer")


@typed
def rough_road(
    car: TwinCar,
    load: Load | None = None,
    *,
    seed: int | np.random.Generator,
    speed_mps: float = 20.0,
    duration_s: float = 120.0,
    rms_m: float = 0.0346,
    dt_s: float = 1e-3,
) -> Drive14:
    """Straight on over an uneven road; excites the pitch inertia.

    The profile is integrated white noise, eq. (16) of Dettu et al. (2023), with a leak at 0.02
    cycles/m and a low-pass at 15 Hz, which the paper needs but does not give; the rear axle meets
    it wheelbase/speed later (the paper prints the inverse).
    """
    rng = generator(seed)
    t = _times(duration_s, dt_s)
    leak = np.exp(-2.0 * np.pi * 0.02 * speed_mps * dt_s)
    profile = scipy.signal.lfilter([1.0], [1.0, -leak], rng.standard_normal(len(t)))
    low = scipy.signal.butter(2, 15.0, fs=1.0 / dt_s, output="sos")
    profile = scipy.signal.sosfilt(low, profile)
    profile *= rms_m / np.std(profile) * np.clip(t / 2.0, 0.0, 1.0)
    base = np.zeros((len(t), len(INPUTS)))
    lag = car.numbers()["wheelbase_m"] / speed_mps
    put_road(base, profile, np.interp(t - lag, t, profile, left=0.0), dt_s)
    return drive14(
        car, load, _references(len(t), speed_mps, 0.0), base=base, dt_s=dt_s, name="rough road"
    )


@typed
def on_manoeuvre(
    car: TwinCar,
    load: Load | None,
    manoeuvre: Manoeuvre,
    *,
    driver: _core.Driver | None = None,
    dt_s: float = 1e-3,
) -> Drive14:
    """Drive one of the package's manoeuvres: a driver follows its speed and its path.

    Raises
    ------
    InvalidInput
        If the manoeuvre is steered open loop, which is in proportion to a single track's steering.
    NumericalError
        If the car was lost.
    """
    if not manoeuvre.tracks_path:
        raise InvalidInput(f"{manoeuvre.name} is steered open loop; take one that follows a path")
    time_s = as_float64(np.arange(round(manoeuvre.duration_s / dt_s)) * dt_s)
    speed = manoeuvre.speed_mps(time_s)
    references = np.zeros((len(time_s), 3))
    references[:, 0] = speed
    references[:, 1] = manoeuvre.lateral_mps2(time_s) / speed**2
    if driver is None:
        driver = _core.Driver()
        driver.drive_limit_n, driver.power_limit_w = 12000.0, 400e3
    return drive14(car, load, references, driver=driver, dt_s=dt_s, name=manoeuvre.name)


def put_road(inputs: FloatArray, front_m: FloatArray, rear_m: FloatArray, dt_s: float) -> None:
    """Write road heights of the axles, and their rates, into inputs."""
    for wheel, height in enumerate((front_m, front_m, rear_m, rear_m)):
        inputs[:, _ROAD + wheel] = height
        inputs[:, _ROAD + 4 + wheel] = np.gradient(height, dt_s)
