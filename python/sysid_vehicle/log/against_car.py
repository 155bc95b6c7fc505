"""A log against the car's own numbers: wheel force over mass, steering angle over wheelbase.

Channels may agree with each other and not with the vehicle file: a mass in pounds, a steering ratio
that is not the car's, a length in feet. Identification would put all of that into the tyres.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from .._common.arrays import FloatArray
from ..errors import InvalidInput, warn
from ..vehicle import GRAVITY_MPS2
from .laws.laws import CLEARLY, EXCITED, LINEAR_MPS2, OFFSET, WINDOW_S, Drive, fit, ones, spread_of
from .laws.longitudinal import DRAG_PER_M, ramp_on
from .laws.motion import Motion
from .laws.regression import size_of
from .laws.steered_axle import steered_behind
from .laws.wheelbase import longest_wheelbase
from .log import Log

_MOVING = 5.0  # m/s, with a wheelbase of `_USUAL_M`: slip and curvature are alike at like v^2 / L
_USUAL_M = 2.6
_LEAST_M = 0.1  # the shortest wheelbase
_MAGNITUDE = 4.0
_FAR_LONGER = 1.5  # times the longest wheelbase that the log allows for
_OTHER_CAR = "the vehicle file is that of another car, or in other units; give the one of this car"
_MIN_WINDOWS = 12
_FEWEST = 4  # windows in which the car brakes
_SETTLING = 1  # windows before and after harder driving
_FAR = 2.5  # times the usual steering: beyond it an angle counts as that much
_SURE = 3.0  # deviations
_COHERENT = 0.6
# What logs of good cars are off by: the commanded force by its gain and by slopes, the steering by
# compliance and by tyres.
_FORCE_STD, _FORCE_FACTOR = 0.45, 1.7
_STEER_STD = 0.2
_STEER_NEVER = 2.8  # whatever the differential
_UNDERSTEER, _UNDERSTEER_STD = 0.002, 0.003  # rad of road wheels per m/s2
_UNDERSTEER_MOST = 0.008  # rad per m/s2 either way: 4.5 deg/g, more than cars have
_RATIOS = np.geomspace(1.0 / 128.0, 128.0, 281)
_BLOCK, _FITTED = 6, 4  # windows that are taken as dependent; what is fitted to them
# Squares left of the steering, as a multiple of the least and as a share of all, with which a ratio
# is not excluded: that much may be the curvature of tyres' curves. With more no ratio is told.
_LEFT, _UNEXPLAINED, _INCOHERENT = 4.0, 0.05, 0.7
_TINY = 1e-12
_NEAR = 0.2  # a unit is named where the factor is so near, as a logarithm

_WEIGHT = (
    "fx_n seems to be in kilograms: put factor = 9.80665 for it in the channel map; or mass_kg "
    "seems to be a weight in newtons: multiply it by 0.102"
)
_MASS_SLIPS = (
    (1.0 / 0.45359237, "mass_kg seems to be in pounds: multiply it by 0.4536"),
    (1e-3, "mass_kg seems to be in tonnes: multiply it by 1000"),
    (4.4482216, "fx_n seems to be in pounds: put factor = 4.448222 for it in the channel map"),
    (GRAVITY_MPS2, _WEIGHT),
    (0.1, "fx_n seems to be ten times too large: put factor = 0.1 for it in the channel map"),
)
_LENGTH_SLIPS = (
    (1.0 / 3.2808, "lf_m and lr_m seem to be in feet: multiply them by 0.3048"),
    (1.0 / 39.37, "lf_m and lr_m seem to be in inches: multiply them by 0.0254"),
)


@dataclass(frozen=True)
class _Told:
    """A ratio that should be one, and the interval that surely holds it."""

    ratio: float
    low: float
    high: float
    place: str

    def off(self, factor: float, usual: float) -> bool:
        """Whether it is surely beyond a factor, where good cars are off by `usual`."""
        size = abs(math.log(self.ratio))
        towards_one = math.log(
            self.ratio / self.low if self.ratio > 1.0 else self.high / self.ratio
        )
        return size > math.log(factor) and size > math.hypot(math.log1p(usual), towards_one)

    @property
    def deviation(self) -> float:
        """Standard deviation of its logarithm."""
        return math.log(self.high / self.low) / (2.0 * _SURE)


def check_car(log: Log, *, mass_kg: float, wheelbase_m: float, lf_m: float | None = None) -> None:
    """Refuse a log that is not one of this car: by its mass, by its wheelbase.

    Of a steering angle that is off by less than a steering ratio or a unit it is warned, as soon as
    it surely is: a locked differential asks for up to twice the angle as well. So it is of a car
    that steers its rear axle, where it is said how far ahead the front axle lies.

    Raises
    ------
    InvalidInput
        The message names key and channel, what the log tells, and the likely remedy.
    """
    columns = {name: log[name] for name in log.channels if name not in log.extras}
    motion = _motion(columns, log.rate_hz)
    drive = _driven(motion, wheelbase_m)
    if drive is not None:
        _check_numbers(log, drive, mass_kg, wheelbase_m)
    elif (slow := _driven(motion, _LEAST_M)) is not None:
        _check_magnitudes(log, slow, mass_kg, wheelbase_m)
    behind = "" if lf_m is None else steered_behind(motion, lf_m, wheelbase_m - lf_m)
    if behind:
        warn(f"{log.name}: {behind}")


def _check_magnitudes(log: Log, slow: Drive, mass_kg: float, wheelbase_m: float) -> None:
    """Refuse the log of a car of quite another size, which never drives as fast as this car does.

    So slowly slopes and backlash tell much of force and steering: less than a magnitude says
    nothing.
    """
    mass = _mass(slow, mass_kg) if log.has("fx_n") else None
    if mass is not None and mass.off(_MAGNITUDE, _FORCE_STD):
        raise InvalidInput(
            f"{log.name}: mass_kg = {mass_kg:g}, but fx_n moves the car as if it had "
            f"{mass_kg / mass.ratio:.4g} kg, {mass.place}; {_OTHER_CAR}"
        )
    steer = _steer(slow, wheelbase_m)
    if steer is not None and steer.off(_MAGNITUDE, _STEER_STD):
        raise InvalidInput(
            f"{log.name}: it turns as a car with a wheelbase of about "
            f"{steer.ratio * wheelbase_m:.2g} m does, {steer.place}, and lf_m + lr_m are "
            f"{wheelbase_m:g} m; {_OTHER_CAR}, or mend the unit of steer_rad"
        )


def _check_numbers(log: Log, drive: Drive, mass_kg: float, wheelbase_m: float) -> None:
    if log.has("fx_n"):
        _refuse_without_brakes(log, drive, mass_kg)
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
    _check_steer(log, drive, wheelbase_m)


def check_steering_of(log: Log, wheelbase_m: float) -> None:
    """Refuse, or warn of, a steering angle that is not that of road wheels of this car.

    What `check_car` says of the steering, for those whom the force does not matter.

    Raises
    ------
    InvalidInput
        The message names what the log tells, and the likely remedy.
    """
    columns = {name: log[name] for name in log.channels if name not in log.extras}
    drive = _driven(_motion(columns, log.rate_hz), wheelbase_m)
    if drive is not None:
        _check_steer(log, drive, wheelbase_m)


def _check_steer(log: Log, drive: Drive, wheelbase_m: float) -> None:
    steer = _steer(drive, wheelbase_m)
    if steer is None:
        _refuse_far_longer(log, drive, wheelbase_m)
    if steer is not None and steer.off(1.0, _STEER_STD):
        likely = _likely(steer, _LENGTH_SLIPS) or (
            f"if it was made from the angle of the steering wheel, the steering ratio is about "
            f"{steer.ratio:.2g} times the one that was taken: put factor = {1.0 / steer.ratio:.3g} "
            f"times the present one in the channel map; else check lf_m and lr_m"
            f"{'; a locked differential asks for more angle, too' if steer.ratio > 1.0 else ''}"
        )
        said = (
            f"{log.name}: steer_rad is {steer.ratio:.3g} times ({steer.low:.2g} to "
            f"{steer.high:.2g}) what a wheelbase of "
            f"{wheelbase_m:g} m (lf_m + lr_m) asks for, {steer.place}; {likely}"
        )
        if abs(math.log(steer.ratio)) > math.log(_STEER_NEVER):
            raise InvalidInput(said)
        warn(said)


def _refuse_far_longer(log: Log, drive: Drive, wheelbase_m: float) -> None:
    """Refuse the file of a far longer car, where too little driving is gentle to tell a ratio."""
    told = longest_wheelbase(drive, _UNDERSTEER_MOST)
    if told is not None and told[0] * _FAR_LONGER < wheelbase_m:
        raise InvalidInput(
            f"{log.name}: it turns as a car with a wheelbase of {told[0]:.2g} m at most does, "
            f"{told[1]}, and lf_m + lr_m are {wheelbase_m:g} m; {_OTHER_CAR}, or mend the unit of "
            f"steer_rad"
        )


def times_wheelbase(
    columns: Mapping[str, FloatArray], rate_hz: float, wheelbase_m: float
) -> tuple[float, float] | None:
    """Steering angle over the one that a wheelbase asks for at low a_y; None where nothing tells.

    Beside it stands the factor, either way, that it may be off by: where the speed hardly changes
    understeer looks like another wheelbase.

    Parameters
    ----------
    columns : mapping of ndarray, shape (n,)
        `time_s`, `vx_mps`, `yaw_rate_radps`, `ay_mps2` and `steer_rad` on a uniform grid.
    rate_hz : float
        Rate of the grid.
    wheelbase_m : float
    """
    drive = _driven(_motion(columns, rate_hz), wheelbase_m)
    told = None if drive is None else _steer(drive, wheelbase_m)
    return None if told is None else (told.ratio, math.exp(told.deviation))


def _motion(columns: Mapping[str, FloatArray], rate_hz: float) -> Motion:
    motion = Motion(columns, rate_hz)
    motion.windows(WINDOW_S)
    return motion


def _driven(motion: Motion, wheelbase_m: float) -> Drive | None:
    moving = _MOVING * math.sqrt(min(wheelbase_m / _USUAL_M, 1.0))
    rows = motion.usable & (motion.mean(motion.channels["vx_mps"]) > moving)
    return Drive(motion, rows) if np.count_nonzero(rows) >= _MIN_WINDOWS else None


def _mass(drive: Drive, mass_kg: float) -> _Told | None:
    """Mass of the vehicle file over that of the log, ``dv/dt = F / m - ...``.

    Whoever holds a speed answers slopes with the force, which then moves the car less than its mass
    asks for. The inverse lies between that of the regression and that of force on acceleration
    (Klepper & Leamer, Econometrica 52 (1984)).
    """
    ramp, force, found = ramp_on(drive, "fx_n")
    inverse = float(found.coefficients[0])
    if spread_of(ramp) < EXCITED or found.coherence < _COHERENT or inverse <= 0.0:
        return None
    ratio, deviation = mass_kg * inverse, _SURE * float(found.deviations[0]) / inverse
    low, high = ratio / (1.0 + deviation), ratio * (1.0 + deviation)
    return _Told(ratio, low, high / found.coherence, drive.place(force))


def _refuse_without_brakes(log: Log, drive: Drive, mass_kg: float) -> None:
    """Refuse a wheel force that drives the car as its mass asks for, and hardly brakes it.

    It is that of the engine or motor: with one mass for both, the car would seem to be lighter.
    """
    ramp, force, _ = ramp_on(drive, "fx_n")
    columns = [force, drive.mean(drive.motion.channels["vx_mps"] ** 2), ones(drive)]
    pulled = ramp > -EXCITED
    if np.count_nonzero(pulled) < _MIN_WINDOWS:
        return
    law = fit(ramp[pulled], [c[pulled] for c in columns], [np.inf, DRAG_PER_M, np.inf])
    inverse, drag, slope = law.coefficients
    if law.coherence < _COHERENT or not 1.0 < _FORCE_FACTOR * inverse * mass_kg < _FORCE_FACTOR**2:
        return
    braked = drag * columns[1] + slope - ramp
    hard = braked > CLEARLY
    if np.count_nonzero(hard) < _FEWEST:
        return
    share = -float(inverse * force[hard] @ braked[hard]) / float(np.sum(braked[hard] ** 2))
    if share * _FORCE_FACTOR > 1.0:
        return
    instead = ', or leave it out, as log.without("fx_n") does: ax_mps2 takes its place'
    place = drive.place(np.where(hard, braked, 0.0))
    raise InvalidInput(
        f"{log.name}: fx_n holds what drives the car in full, and {100.0 * max(share, 0.0):.2g} % "
        f"of what brakes it, {place}: the force of the brakes is missing; add it to fx_n"
        f"{instead if log.has('ax_mps2') else ''}"
    )


def _steer(drive: Drive, wheelbase_m: float) -> _Told | None:
    """Steering angle over the one of a wheelbase, ``delta = L r / v + K a_y`` at low a_y."""
    c = drive.motion.channels
    ay = drive.mean(c["ay_mps2"])
    hard = np.abs(ay) >= LINEAR_MPS2
    # A car that slides, or catches itself, does not steer by the wheelbase, whatever its a_y is.
    gentle = np.convolve(hard, np.ones(2 * _SETTLING + 1), mode="same") < 0.5
    spare = float(np.count_nonzero(gentle)) / _BLOCK - _FITTED
    if spare < 1.0 or size_of(ay[gentle]) < EXCITED:
        return None
    steer = drive.mean(c["steer_rad"])
    curvature = drive.mean(c["yaw_rate_radps"] / np.clip(c["vx_mps"], 1.0, None))
    yaw = drive.change(c["yaw_rate_radps"])
    # Front tyres that slip ask for any angle at little a_y: no bend decides alone.
    size = np.abs(steer)
    usual = _FAR * float(np.median(size[gentle & (np.abs(ay) >= EXCITED)]))
    even = np.minimum(1.0, usual / np.maximum(size, _TINY))[gentle, None]
    columns = np.column_stack([steer, wheelbase_m * curvature, ay, np.ones(ay.size)])[gentle]
    columns *= even
    yaw = even * yaw[gentle, None]
    columns -= yaw * (yaw.T @ columns / max(float(np.sum(yaw**2)), _TINY))
    squares = columns.T @ columns
    offset = OFFSET * size_of(steer[gentle])
    noise = float(_left(squares, offset, 0.0).min()) / spare
    left = _left(squares, offset, noise)
    best = int(np.argmin(left))
    whole = float(squares[0, 0])
    if best in (0, _RATIOS.size - 1) or left[best] > _INCOHERENT * whole:
        return None
    most = max(_LEFT * left[best], left[best] + _SURE**2 * noise, _UNEXPLAINED * whole)
    inside = _RATIOS[left <= most]
    return _Told(
        float(_RATIOS[best]), float(inside[0]), float(inside[-1]), drive.place(steer[gentle])
    )


def _left(squares: FloatArray, offset: float, noise: float) -> FloatArray:
    """Return the squares that each of `_RATIOS` leaves of the steering.

    Beside the ratio stand an understeer gradient, which the ratio scales too, and an offset, both
    within what cars have: at one speed understeer looks like another wheelbase, on one radius an
    offset does. Between ratios that explain the steering alike the usual understeer decides, with
    the weight of the noise.

    Parameters
    ----------
    squares : ndarray, shape (4, 4)
        Products of the steering angle, the one of the wheelbase, a_y, and one.
    offset : float
        At most, either way [rad].
    noise : float
        Squares that one independent reading leaves [rad2]; zero leaves the usual understeer out.
    """
    s = _RATIOS
    weight = noise / (s * _UNDERSTEER_STD) ** 2
    k, o = _UNDERSTEER_MOST * np.maximum(s, 1.0), np.full(s.size, offset)
    aa, ao, oo = squares[2, 2] + weight, squares[2, 3], squares[3, 3]
    ra = squares[0, 2] - s * squares[1, 2] + weight * s * _UNDERSTEER
    ro = squares[0, 3] - s * squares[1, 3]
    alone = squares[0, 0] - 2.0 * s * squares[0, 1] + s**2 * squares[1, 1]
    alone += weight * (s * _UNDERSTEER) ** 2

    def left(understeer: FloatArray, shift: FloatArray) -> FloatArray:
        both = aa * understeer**2 + 2.0 * ao * understeer * shift + oo * shift**2
        result: FloatArray = alone + both - 2.0 * (ra * understeer + ro * shift)
        return result

    # A convex function over a rectangle is least at its minimum or on an edge.
    free = np.maximum(aa * oo - ao**2, _TINY * aa * oo)
    understeer, shift = (oo * ra - ao * ro) / free, (aa * ro - ao * ra) / free
    inside = (np.abs(understeer) <= k) & (np.abs(shift) <= o)
    edges = [left(e, np.clip((ro - ao * e) / oo, -o, o)) for e in (-k, k)]
    edges += [left(np.clip((ra - ao * e) / aa, -k, k), e) for e in (-o, o)]
    return np.where(inside, left(understeer, shift), np.min(edges, axis=0))


def _likely(told: _Told, slips: tuple[tuple[float, str], ...]) -> str:
    near = [(abs(math.log(told.ratio / factor)), text) for factor, text in slips]
    off, text = min(near)
    return text if off < max(_NEAR, told.deviation) else ""
