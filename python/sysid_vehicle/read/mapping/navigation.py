"""Velocity over ground and heading in a log that nobody has mapped yet: units and beginnings."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from ..._common.arrays import as_float64
from ...log.laws.over_ground import WITH_THE_CAR
from .ground import FROM, Direction, from_east, polar, turns_of
from .look import Signal

NAMED = ("east", "north", "course", "heading")
"""Parts that are known by their own names."""

_DEG = np.pi / 180.0
_IN_DEGREES = 7.0  # an angle that goes beyond is no radian of one turn

_MOST_PAIRS = 4  # of speeds of the body that are looked at

# What makes a lateral speed; the second beside a speed.
_COMBINATIONS = (("east", "north", "heading"), ("course", "heading"))


@dataclass(frozen=True)
class Navigation:
    """What the parts are taken for.

    Attributes
    ----------
    factors : mapping of float
        To SI units, by part.
    counted_from : str
        ``"north"`` or ``"east"``.
    to_the_right : bool
        Whether the yaw rate is positive to the right.
    """

    factors: Mapping[str, float]
    counted_from: str
    to_the_right: bool


def combination(there: Mapping[str, list[str]]) -> dict[str, str]:
    """Return the columns of the first combination whose parts are all there, one column each."""
    for parts in _COMBINATIONS:
        columns = {part: there[part][0] for part in parts if there.get(part)}
        if len(columns) == len(parts) == len(set(columns.values())):
            return columns
    return {}


def twins(along: str, across: str, chosen: Mapping[str, list[str]]) -> list[tuple[str, str]]:
    """Return pairs of columns for both speeds of the body: these two, then those of one message."""
    pairs = [(along, across)]
    for name in chosen["vx_mps"]:
        message = name.rpartition("/")[0]
        other = [n for n in chosen["vy_mps"] if message and n.rpartition("/")[0] == message]
        pairs += [(name, n) for n in other[:1] if name != along]
    return pairs[:_MOST_PAIRS]


def is_over_ground(along: Signal, across: Signal, yaw_rate: Signal, unit: float | None) -> bool:
    """Tell whether two speeds are those over ground: their direction turns with the car.

    Parameters
    ----------
    along, across, yaw_rate : pair of ndarray, shape (n,)
        Times [s] and values.
    unit : float or None
        Factor of the yaw rate, if it is stated.
    """
    (time_s, x), (other_s, y) = along, across
    rate_s, rate = yaw_rate
    there, turning = np.isfinite(other_s) & np.isfinite(y), np.isfinite(rate)
    if min(np.count_nonzero(there), np.count_nonzero(turning)) < 2:
        return False
    y = np.interp(time_s, other_s[there], y[there])
    course = np.full(time_s.shape, np.nan)
    moving = np.hypot(x, y) > 0.0
    course[moving] = np.unwrap(np.arctan2(y[moving], x[moving]))
    if unit is None:
        unit = _DEG if float(np.nanmax(np.abs(rate), initial=0.0)) > _IN_DEGREES else 1.0
    rate = np.interp(time_s, rate_s[turning], unit * rate[turning])
    turns = turns_of(time_s, course, as_float64(rate), as_float64(np.hypot(x, y)))
    return WITH_THE_CAR[0] < abs(turns) < WITH_THE_CAR[1]


def ground_speed(east: Signal, north: Signal) -> Signal:
    """Return times, and the size of the velocity over ground at them, in its own unit."""
    time, values = east
    return time, as_float64(np.hypot(values, np.interp(time, *north)))


def told(
    held: Mapping[str, Signal],
    stated: Mapping[str, float],
    yaw_rate: Signal,
    speed: Signal,
    unit: float,
) -> Navigation | None:
    """Tell units of angles and where they count from, by the way the car points and turns.

    Parameters
    ----------
    held : mapping of pairs of ndarray, shape (n,)
        Times [s] and values of each part.
    stated : mapping of float
        Factors of parts whose unit is stated.
    yaw_rate, speed : pair of ndarray, shape (n,)
        Times [s] and values [rad/s, m/s].
    unit : float
        Factor of the velocities.

    Returns
    -------
    Navigation or None
        None if the car would not move the way it points, whatever is taken.
    """
    factors = dict.fromkeys(held, unit)
    angles = [part for part in held if part in ("heading", "course")]
    for part in angles:
        values = held[part][1]
        degrees = float(np.nanmax(np.abs(values), initial=0.0)) > _IN_DEGREES
        factors[part] = stated.get(part, _DEG if degrees else 1.0)
    time_s, values = held["heading"]
    compass = float(np.nanmin(values, initial=0.0)) >= 0.0 and factors["heading"] != 1.0
    best: tuple[tuple[bool, float], Navigation] | None = None
    for start in FROM:
        parts = {"speed": np.interp(time_s, *speed)}
        for part, (own_s, values) in held.items():
            x = factors[part] * values
            if part in angles:
                x = from_east(x, start)
            known = np.isfinite(x)
            parts[part] = np.interp(time_s, own_s[known], x[known])
        v, course = polar(time_s, parts)
        direction = Direction.of(v, as_float64(course - parts["heading"]))
        yaw = np.interp(time_s, *yaw_rate)
        turns = turns_of(time_s, parts["heading"], yaw, v)
        # The difference of course and heading is as small either way: a compass has no angles below
        # zero, and of others the yaw rate tells.
        likely = start == "north" if compass else not turns < 0.0
        how = ("course" not in held or likely, round(direction.length, 6))
        if direction.forward and (best is None or how > best[0]):
            best = how, Navigation(factors, start, turns < 0.0)
    return None if best is None else best[1]
