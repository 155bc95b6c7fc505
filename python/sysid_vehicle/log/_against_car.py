"""A log against the car's own numbers: wheel force over mass, steering angle over wheelbase.

Channels may agree with each other and not with the vehicle file: a mass in pounds, a steering ratio
that is not the car's, a length in feet. Identification would put all of that into the tyres.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ..errors import InvalidInput
from ._channels import FloatArray
from ._laws import EXCITED, WINDOW_S, Drive, fit, size_of, spread_of
from ._log import Log
from ._longitudinal import ramp_on
from ._motion import Motion

_MOVING = 5.0  # m/s
_MIN_WINDOWS = 12
_LINEAR_MPS2 = 5.0
_SURE = 3.0  # deviations
_COHERENT = 0.6
# What logs of good cars are off by: the commanded force by its gain and by slopes, the steering by
# compliance and by tyres.
_FORCE_STD, _FORCE_FACTOR = 0.15, 1.7
_STEER_STD, _STEER_FACTOR = 0.2, 2.0
_UNDERSTEER, _UNDERSTEER_STD = 0.002, 0.003  # rad of road wheels per m/s2
_UNDERSTEER_MOST = 0.008  # rad per m/s2 either way: 4.5 deg/g, more than cars have
_LEFT = 4.0  # times as much unexplained with this wheelbase as with another, that refuses it
_UNEXPLAINED = 0.1  # share of the steering; less may be the curvature of tyres' curves
_VARIES = 0.4  # standard deviation of the curvature over its root mean square
_NEAR = 0.2  # a unit is named where the factor is so near, as a logarithm

_MASS_SLIPS = (
    (1.0 / 0.45359237, "mass_kg seems to be in pounds: multiply it by 0.4536"),
    (1e-3, "mass_kg seems to be in tonnes: multiply it by 1000"),
    (4.4482216, "fx_n seems to be in pounds: put factor = 4.448222 for it in the channel map"),
    (9.80665, "fx_n seems to be in kilograms: put factor = 9.80665 for it in the channel map"),
    (0.1, "fx_n seems to be ten times too large: put factor = 0.1 for it in the channel map"),
)
_LENGTH_SLIPS = (
    (1.0 / 3.2808, "lf_m and lr_m seem to be in feet: multiply them by 0.3048"),
    (1.0 / 39.37, "lf_m and lr_m seem to be in inches: multiply them by 0.0254"),
)


@dataclass(frozen=True)
class _Told:
    """A ratio that should be one, and its relative standard deviation were it one."""

    ratio: float
    deviation: float
    place: str

    def off(self, factor: float, usual: float) -> bool:
        """Whether it is surely beyond a factor."""
        size = max(self.ratio, 1.0 / self.ratio)
        return size > factor and size - 1.0 > _SURE * math.hypot(usual, self.deviation)


def check_car(log: Log, *, mass_kg: float, wheelbase_m: float) -> None:
    """Refuse a log that is not one of this car: by its mass, by its wheelbase.

    Raises
    ------
    InvalidInput
        The message names key and channel, what the log tells, and the likely remedy.
    """
    columns = {name: log[name] for name in log.channels if name not in log.extras}
    motion = Motion(columns, log.rate_hz)
    motion.windows(WINDOW_S)
    rows = motion.usable & (motion.mean(motion.channels["vx_mps"]) > _MOVING)
    if np.count_nonzero(rows) < _MIN_WINDOWS:
        return
    drive = Drive(motion, rows)
    mass = _mass(drive, mass_kg) if log.has("fx_n") else None
    if mass is not None and mass.off(_FORCE_FACTOR, _FORCE_STD):
        likely = _likely(mass, _MASS_SLIPS) or (
            "check mass_kg, and that fx_n is the force of all wheels together; leave fx_n out if "
            "it is only an estimate"
        )
        raise InvalidInput(
            f"{log.name}: mass_kg = {mass_kg:g}, but fx_n moves the car as if it had "
            f"{mass_kg / mass.ratio:.4g} kg, {mass.place}; {likely}"
        )
    steer = _steer(drive, wheelbase_m)
    if steer is not None and steer.off(_STEER_FACTOR, _STEER_STD):
        likely = _likely(steer, _LENGTH_SLIPS) or (
            f"if it was made from the angle of the steering wheel, the steering ratio is about "
            f"{steer.ratio:.2g} times the one that was taken: put factor = {1.0 / steer.ratio:.3g} "
            f"times the present one in the channel map; else check lf_m and lr_m"
        )
        raise InvalidInput(
            f"{log.name}: steer_rad is {steer.ratio:.3g} times what a wheelbase of "
            f"{wheelbase_m:g} m (lf_m + lr_m) asks for, {steer.place}; {likely}"
        )


def _mass(drive: Drive, mass_kg: float) -> _Told | None:
    """Mass of the vehicle file over that of the log, ``dv/dt = F / m - ...``."""
    ramp, force, found = ramp_on(drive, "fx_n")
    inverse = float(found.coefficients[0])
    if spread_of(ramp) < EXCITED or found.coherence < _COHERENT or inverse <= 0.0:
        return None
    return _Told(mass_kg * inverse, float(found.deviations[0]) / inverse, drive.place(force))


def _steer(drive: Drive, wheelbase_m: float) -> _Told | None:
    """Steering angle over the one of a wheelbase, ``delta = L r / v + K a_y`` at low a_y.

    At one speed nothing tells wheelbase from understeer but what understeer cars have.
    """
    c = drive.motion.channels
    ay = drive.mean(c["ay_mps2"])
    curvature = drive.mean(c["yaw_rate_radps"] / np.clip(c["vx_mps"], 1.0, None))
    gentle = np.abs(ay) < _LINEAR_MPS2
    if np.count_nonzero(gentle) < _MIN_WINDOWS or size_of(ay[gentle]) < EXCITED:
        return None
    steer = drive.mean(c["steer_rad"])
    yaw = drive.change(c["yaw_rate_radps"])
    scale = size_of(steer)
    if scale <= 0.0:
        return None

    def asked(s: float) -> tuple[float, float, float]:
        # Everything the steering does has its scale, understeer too: the prior is scaled with it.
        columns: list[FloatArray] = [wheelbase_m * curvature[gentle], ay[gentle], yaw[gentle]]
        columns.append(np.ones(np.count_nonzero(gentle)))
        spread = [np.inf, s * _UNDERSTEER_STD, s * 0.05, 0.3 * scale]
        found = fit(steer[gentle], columns, spread, [0.0, s * _UNDERSTEER, 0.0, 0.0])
        # What the prior leaves open of the first coefficient where the speed hardly varies.
        x = columns[0]
        shared = float(x @ ay[gentle] / max(float(x @ x), 1e-12))
        rest = ay[gentle] - shared * x
        open_ = float(np.sum(rest**2) / max(np.sum(ay[gentle] ** 2), 1e-12))
        deviation = abs(shared) * s * _UNDERSTEER_STD * (1.0 if open_ < 0.05 else 0.3)
        ratio = float(found.coefficients[0])
        return ratio, math.hypot(float(found.deviations[0]), deviation), found.coherence

    ratio, deviation, coherence = asked(1.0)
    for _ in range(3):
        if ratio <= 0.0:
            return None
        ratio, deviation, coherence = asked(ratio)
    if ratio <= 0.0 or coherence < 0.3:
        return None
    columns = [wheelbase_m * curvature[gentle], ay[gentle], yaw[gentle]]
    if not _excluded(steer[gentle], columns, ratio):
        return None
    return _Told(ratio, deviation / ratio, drive.place(steer))


def _excluded(steer: FloatArray, columns: list[FloatArray], ratio: float) -> bool:
    """Whether no understeer that cars have explains the steering with this wheelbase.

    The columns are L r / v, a_y and dr/dt. Where the speed hardly varies the first two are one, and
    understeer can stand for any wheelbase.
    """
    from scipy.optimize import lsq_linear

    def left(scale: float) -> float:
        rest = steer - scale * columns[0]
        x = np.column_stack([*columns[1:], np.ones(rest.size)])
        most = np.array([_UNDERSTEER_MOST * max(scale, 1.0), np.inf, np.inf])
        return float(2.0 * lsq_linear(x, rest, (-most, most)).cost)

    varies = float(np.sum((steer - np.mean(steer)) ** 2))
    if np.std(columns[0]) < _VARIES * np.sqrt(np.mean(columns[0] ** 2)):
        return False  # an offset of the steering would look the same
    return left(1.0) > max(_LEFT * left(ratio), _UNEXPLAINED * varies)


def _likely(told: _Told, slips: tuple[tuple[float, str], ...]) -> str:
    near = [(abs(math.log(told.ratio / factor)), text) for factor, text in slips]
    off, text = min(near)
    return text if off < max(_NEAR, told.deviation) else ""
