"""Units and signs of channels that say nothing of them, from how a car moves.

``a_y = v r`` and ``a_x = dv/dt`` tell how the scales of channels go together, what cars usually do
tells which of several ways is meant, and at low lateral acceleration the steering angle of the road
wheels over the path curvature is a wheelbase.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from ..._common.arrays import FloatArray, as_float64
from ...log import times_wheelbase
from ...log.laws.laws import LINEAR_MPS2, cosine, fit, turns_as_steered
from ...log.laws.motion import Windows
from ...vehicle import GRAVITY_MPS2
from .look import with_gaps
from .sideslip import against_the_rear_axle, factor_by_the_rear_axle, usual_sideslip

_DEG, _G = math.pi / 180.0, GRAVITY_MPS2
_WINDOW_S, _SHORT_S = 1.0, 0.2
_MOVING = 0.15  # of the usual speed
_SIDESLIP = 0.03  # rad, where nothing tells what is usual
# Factors that are tried where no unit is stated.
_TRIED = {
    "vx_mps": (1.0, 1.0 / 3.6, 0.44704),
    "yaw_rate_radps": (1.0, _DEG),
    "ax_mps2": (1.0, _G),
    "ay_mps2": (1.0, _G),
}
# What 95 % of a drive stay below, and the spread of its logarithm between drives.
_USUAL = {
    "vx_mps": (28.0, 0.6),
    "yaw_rate_radps": (0.35, 0.8),
    "ax_mps2": (3.0, 0.9),
    "ay_mps2": (5.0, 0.9),
}
_LAW_STD = 0.15
_UNDERSTEER = 0.002  # that lengthens a wheelbase by K v^2 [s^2/m]
_WHEELBASE_M, _WHEELBASE_STD = 2.9, 0.35
_RATIO, _RATIO_STD = 15.0, 0.25  # of steering gears
_FORCES, _MASS_KG = (1.0, 1e3), 1300.0
_SURE = 3.0  # deviations
_FOLLOWS = 0.5  # cosine from which two channels are taken to go together


@dataclass(frozen=True)
class Scales:
    """Factors by channel, and what was noticed."""

    factors: dict[str, float]
    notes: dict[str, str]
    swapped: bool


def scales(
    time_s: FloatArray,
    columns: Mapping[str, FloatArray],
    stated: Mapping[str, float],
    wheelbase_m: float | None = None,
    *,
    of_full_lock: bool = False,
) -> Scales:
    """Find factors and signs of the channels of a drive.

    Parameters
    ----------
    time_s : ndarray, shape (n,)
        Even times.
    columns : mapping of ndarray, shape (n,)
        Channels as the file has them, without gaps.
    stated : mapping of float
        Factors of those whose unit is known.
    wheelbase_m : float, optional
        Of the car, where it is known.
    of_full_lock : bool
        Whether the steering is a share of its largest angle.
    """
    drive = _Windows(time_s, columns)
    notes: dict[str, str] = {}
    swapped = _swapped(drive)
    if swapped:
        drive.swap("ax_mps2", "ay_mps2")
        notes["ax_mps2"] = notes["ay_mps2"] = (
            "swapped against its name: this column goes with the other acceleration"
        )
    factors = _likeliest(drive, stated, notes)
    _signs(drive, factors, notes)
    if "steer_rad" in columns:
        factors["steer_rad"] = _steer(
            drive, factors, stated.get("steer_rad"), wheelbase_m, notes, of_full_lock=of_full_lock
        )
    if drive.has("fx_n", "ax_mps2"):
        factors["fx_n"] = _force(drive, factors, stated.get("fx_n"), notes)
    return Scales(factors, notes, swapped)


def sideways(
    time_s: FloatArray,
    columns: Mapping[str, FloatArray],
    factors: Mapping[str, float],
    stated: Mapping[str, float],
    *,
    angle: bool,
) -> tuple[float, str]:
    """Find factor and sign of the lateral speed, or of the sideslip angle, and what to say of it.

    Parameters
    ----------
    time_s, columns, stated
        As for `scales`.
    factors : mapping of float
        Of the other channels.
    angle : bool
        Whether the column is the angle.
    """
    drive, longer = _Windows(time_s, columns, _SHORT_S), _Windows(time_s, columns)
    moves = drive.has("vx_mps", "yaw_rate_radps")
    column = drive.mean("vy_mps")
    usual, speed, yaw, rows = np.array(_SIDESLIP), column, column, np.ones(len(column), bool)
    if moves:
        speed = factors["vx_mps"] * drive.mean("vx_mps")
        yaw = factors["yaw_rate_radps"] * drive.mean("yaw_rate_radps")
        rows = (speed > _MOVING * float(np.median(speed))) & (np.abs(speed * yaw) < LINEAR_MPS2)
        usual = usual_sideslip(np.maximum(speed, 1.0), yaw)[rows]
    factor, said = stated.get("vy_mps"), []
    if angle:
        said.append("sideslip angle: the lateral speed is vx_mps tan(angle)")
    if factor is None:
        told = None if angle or not moves else _lateral_unit(longer, factors)
        as_vx = abs(factors.get("vx_mps", 1.0))
        if told is None and moves and not angle and as_vx != 1.0:
            slow = column[rows], speed[rows], yaw[rows], 0.5 * _SHORT_S
            told = factor_by_the_rear_axle(*slow, (1.0, as_vx))
        factor = as_vx if told is None else told
        if angle:
            ratio = _large(column[rows]) / _large(usual)
            factor = min((1.0, _DEG), key=lambda f: abs(math.log(max(f * ratio, 1e-9))))
        if factor != 1.0 or as_vx != 1.0:
            by_law = "unit found by the laws of motion" if told else "unit as that of vx_mps"
            said.append("unit found by its size" if angle else by_law)
    lateral = factor * column * (speed if angle else 1.0)
    if not moves:
        return factor, "; ".join(said)
    own = columns["vy_mps"] * (factors["vx_mps"] * columns["vx_mps"] if angle else 1.0)
    law = _lateral_law(_Windows(time_s, {**columns, "vy_mps": own}), factors)
    told = law is not None and abs(law[0]) > _SURE * law[1]
    if told and law is not None and law[0] * factor < 0.0:
        factor = -factor
        said.append("turned round: it changes against what a_y - v_x r asks for")
    elif not told and against_the_rear_axle(lateral[rows], speed[rows], yaw[rows], 0.5 * _SHORT_S):
        factor = -factor
        said.append("turned round: it moves against the path of the rear axle")
    return factor, "; ".join(said)


def _lateral_unit(drive: _Windows, factors: Mapping[str, float]) -> float | None:
    """The factor by which a lateral speed changes as ``a_y - v_x r`` asks; None where few do."""
    law = _lateral_law(drive, factors)
    if law is None:
        return None
    return min(_TRIED["vx_mps"], key=lambda f: abs(math.log(f * abs(law[0]))))


def _lateral_law(drive: _Windows, factors: Mapping[str, float]) -> tuple[float, float] | None:
    """The change of a lateral speed over the one that ``a_y - v_x r`` asks for, +- what.

    None where they do not go together.
    """
    if not drive.has("ay_mps2"):
        return None
    turn = factors["vx_mps"] * factors["yaw_rate_radps"] * drive.mean("vx_mps", "yaw_rate_radps")
    # The small difference of two large readings, each with a scale and a lever arm of its own.
    asked = factors["ay_mps2"] * drive.mean("ay_mps2") - turn
    spin = factors["yaw_rate_radps"] * drive.change("yaw_rate_radps")
    change = drive.change("vy_mps")
    # In the unit of the column, whatever it is, the terms beside may be as large.
    unit = _slope(change, asked)
    if not unit > 0.0:  # a column that is filled with one number
        return None
    columns = [asked, turn, spin, np.ones(turn.size)]
    found = fit(change, columns, [np.inf, 0.06 * unit, unit, np.inf])
    if found.coherence < _FOLLOWS or not found.coefficients[0]:
        return None
    return float(found.coefficients[0]), float(found.deviations[0])


def _large(values: FloatArray) -> float:
    return max(float(np.percentile(np.abs(values), 95)), 1e-9) if values.size else 1.0


class _Windows:
    """Means and changes of channels over short windows."""

    def __init__(
        self, time_s: FloatArray, columns: Mapping[str, FloatArray], window_s: float = _WINDOW_S
    ) -> None:
        dt = float(np.median(np.diff(time_s)))
        half = max(1, round(0.5 * window_s / dt))
        self._windows = Windows(time_s.size, half, 1.0 / dt)
        self._columns = dict(columns)
        self._time_s = time_s

    def swap(self, a: str, b: str) -> None:
        self._columns[a], self._columns[b] = self._columns[b], self._columns[a]

    def has(self, *names: str) -> bool:
        return all(name in self._columns for name in names)

    def in_units(self, factors: Mapping[str, float]) -> tuple[dict[str, FloatArray], float]:
        """Channels times their factors with their times, gaps as missing, and their rate."""
        known = {n: f * self._columns[n] for n, f in factors.items() if n in self._columns}
        known.setdefault("ay_mps2", known["vx_mps"] * known["yaw_rate_radps"])
        return with_gaps(self._time_s, known, self._windows.rate_hz), self._windows.rate_hz

    def mean(self, name: str, by: str | None = None) -> FloatArray:
        values = self._columns[name] if by is None else self._columns[name] * self._columns[by]
        return self._windows.mean(values)

    def change(self, name: str) -> FloatArray:
        return self._windows.change(self._columns[name])


def _cosine(x: FloatArray, y: FloatArray) -> float:
    return cosine(as_float64(x - np.median(x)), as_float64(y - np.median(y)))


def _force(
    drive: _Windows, factors: Mapping[str, float], stated: float | None, notes: dict[str, str]
) -> float:
    """Newton or kilonewton, by the mass that the force moves; its sign, by the acceleration."""
    force, ax = drive.mean("fx_n"), factors.get("ax_mps2", 1.0) * drive.mean("ax_mps2")
    told = _cosine(force, ax)
    if abs(told) < _FOLLOWS:
        return 1.0 if stated is None else stated
    factor = stated
    if factor is None:
        mass = _slope(force, ax)
        factor = min(_FORCES, key=lambda f: abs(math.log(f * mass / _MASS_KG)))
        if factor != 1.0:
            notes["fx_n"] = "unit found by the mass that it moves"
    if told < 0.0:
        notes["fx_n"] = "turned round: it is positive where the car is braked"
        return -factor
    return factor


def _slope(y: FloatArray, x: FloatArray) -> float:
    """Size of the slope of y over x, errors in both."""
    return float(np.std(y) / max(float(np.std(x)), 1e-300))


def _swapped(drive: _Windows) -> bool:
    if not drive.has("vx_mps", "yaw_rate_radps", "ax_mps2", "ay_mps2"):
        return False
    turn, ramp = drive.mean("vx_mps", "yaw_rate_radps"), drive.change("vx_mps")
    ax, ay = drive.mean("ax_mps2"), drive.mean("ay_mps2")
    as_named = abs(_cosine(turn, ay)) + abs(_cosine(ramp, ax))
    other = abs(_cosine(turn, ax)) + abs(_cosine(ramp, ay))
    return other > as_named + _FOLLOWS and abs(_cosine(turn, ax)) > _FOLLOWS


def _likeliest(
    drive: _Windows, stated: Mapping[str, float], notes: dict[str, str]
) -> dict[str, float]:
    """The factors of speed, yaw rate and accelerations that explain the drive best together."""
    names = [name for name in _TRIED if drive.has(name)]
    size = {name: float(np.percentile(np.abs(drive.mean(name)), 95)) for name in names}
    laws: list[tuple[dict[str, float], float]] = []
    if drive.has("vx_mps", "yaw_rate_radps", "ay_mps2"):
        turn, ay = drive.mean("vx_mps", "yaw_rate_radps"), drive.mean("ay_mps2")
        if abs(_cosine(turn, ay)) > _FOLLOWS:
            exponents = {"ay_mps2": 1.0, "vx_mps": -1.0, "yaw_rate_radps": -1.0}
            laws.append((exponents, math.log(_slope(ay, turn))))
    if drive.has("vx_mps", "ax_mps2"):
        ramp, ax = drive.change("vx_mps"), drive.mean("ax_mps2")
        if abs(_cosine(ramp, ax)) > _FOLLOWS:
            laws.append(({"ax_mps2": 1.0, "vx_mps": -1.0}, math.log(_slope(ax, ramp))))
    best, least = dict.fromkeys(names, 1.0), math.inf
    for tried in itertools.product(*(_choices(name, stated) for name in names)):
        factors = dict(zip(names, tried, strict=True))
        cost = sum(
            ((sum(e * math.log(factors[n]) for n, e in law.items()) + told) / _LAW_STD) ** 2
            for law, told in laws
        )
        for name in names:
            usual, spread = _USUAL[name]
            cost += (math.log(max(size[name] * factors[name], 1e-9) / usual) / spread) ** 2
        if cost < least:
            best, least = factors, cost
    for name in names:
        if name not in stated and best[name] != 1.0:
            notes.setdefault(name, "unit found by the laws of motion and by what cars do")
    return best


def _choices(name: str, stated: Mapping[str, float]) -> tuple[float, ...]:
    return (abs(stated[name]),) if name in stated else _TRIED[name]


def _signs(drive: _Windows, factors: dict[str, float], notes: dict[str, str]) -> None:
    """Turn round what moves against the others."""

    def turn_round(name: str, why: str) -> None:
        factors[name] = -factors[name]
        notes[name] = f"turned round: {why}"

    parts = "vx_mps", "steer_rad", "yaw_rate_radps"
    at_odds = not (drive.has(*parts) and turns_as_steered(*map(drive.mean, parts)))
    if at_odds and "vx_mps" in factors and float(np.median(drive.mean("vx_mps"))) < 0.0:
        turn_round("vx_mps", "it is negative for most of the drive")
    forward = math.copysign(1.0, factors.get("vx_mps", 1.0))
    if drive.has("vx_mps", "ax_mps2"):
        told = _cosine(forward * drive.change("vx_mps"), drive.mean("ax_mps2"))
        if told < -_FOLLOWS:
            turn_round("ax_mps2", "it moves against the change of the speed")
    if not drive.has("vx_mps", "yaw_rate_radps", "ay_mps2"):
        return
    turn = forward * drive.mean("vx_mps", "yaw_rate_radps")
    ay = drive.mean("ay_mps2")
    if _cosine(turn, ay) < -_FOLLOWS:
        against = drive.has("steer_rad") and _cosine(drive.mean("steer_rad"), turn) < 0.0
        odd = "yaw_rate_radps" if against else "ay_mps2"
        turn_round(
            odd,
            "it moves against the other two of yaw rate, a_y and steering; where these are "
            "positive to the right, turn round all of them instead",
        )


def _steer(
    drive: _Windows,
    factors: Mapping[str, float],
    stated: float | None,
    wheelbase_m: float | None,
    notes: dict[str, str],
    *,
    of_full_lock: bool,
) -> float:
    """The factor to road wheels: by the car's wheelbase, or by the one that would answer so."""
    own = (1.0, _DEG) if stated is None else (abs(stated),)
    if not drive.has("vx_mps", "yaw_rate_radps"):
        return own[0]
    speed = factors["vx_mps"] * drive.mean("vx_mps")
    yaw = factors["yaw_rate_radps"] * drive.mean("yaw_rate_radps")
    rows = (speed > _MOVING * float(np.median(speed))) & (np.abs(speed * yaw) < LINEAR_MPS2)
    if not rows.any():
        notes["steer_rad"] = "the car does not drive: nothing tells its unit and sign"
        return own[0]
    speed, steer = np.maximum(speed[rows], 1.0), drive.mean("steer_rad")[rows]
    curvature = yaw[rows] / speed
    alike = _cosine(curvature, steer)
    if abs(alike) < _FOLLOWS:
        notes["steer_rad"] = "does not turn with the car: check the column"
        return own[0]
    sign = math.copysign(1.0, alike)
    usual = (wheelbase_m or _WHEELBASE_M) + _UNDERSTEER * float(np.median(speed)) ** 2
    times, std, off = _slope(steer, curvature) / usual, _WHEELBASE_STD, 1.0
    if wheelbase_m is not None:
        about = {**factors, "steer_rad": sign / times}
        asked = times_wheelbase(*drive.in_units(about), wheelbase_m)
        if asked is None:
            wheelbase_m = None
        else:
            times, std, off = times * asked[0], _LAW_STD, asked[1]
    if of_full_lock:
        factor = float(f"{sign / times:.3g}")
        notes["steer_rad"] = (
            f"a share of the full angle; the factor is what the car's curves ask for, within "
            f"{100.0 * (math.exp(std) - 1.0):.0f} %: put in the largest angle of the road wheels "
            f"[rad] over the reading there"
        )
        return factor
    ways = [(f, 1.0, std) for f in own]
    ways += [(f, _RATIO, math.hypot(std, _RATIO_STD)) for f in own]
    factor, ratio, _ = min(ways, key=lambda way: abs(math.log(times * way[0] / way[1])) / way[2])
    found = times * factor
    said = [] if sign > 0.0 else ["turned round: it moves against yaw rate and a_y"]
    within = f"({found / off:.3g} to {found * off:.3g})"
    if ratio != 1.0:
        told = f"{found:.2g} was found"
        if wheelbase_m is not None:
            told = f"{found:.3g} {within} was found by a wheelbase of {wheelbase_m:.3g} m"
        said.append(
            f"angle of the steering wheel; a steering ratio of about {told}: put in the car's own"
        )
        factor /= float(f"{found:.3g}")
    elif wheelbase_m is not None:
        check = ": check both" if abs(math.log(found)) > 2.0 * _LAW_STD else ""
        said.append(
            f"about {found:.2g} {within} times what a wheelbase of {wheelbase_m:.3g} m asks for"
            f"{check}"
        )
    notes["steer_rad"] = "; ".join(said)
    return sign * factor
