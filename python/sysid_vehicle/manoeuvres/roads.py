"""Usual roads: straights and bends drawn at random, driven without testing anything."""

from __future__ import annotations

from typing import Literal, NamedTuple

import numpy as np

from .._common.arguments import check_positive, generator
from .._common.typed import typed
from ..errors import InvalidInput
from .curves import Knots
from .manoeuvre import Manoeuvre

RoadKind = Literal["motorway", "country", "town"]

_BEND_IN_S = 1.2  # into a bend, and out of it
_LAST_BEND_S = 15.0  # before the end of the drive no further straight begins


class _Usual(NamedTuple):
    """From the least to the largest, each drawn uniformly."""

    speed_mps: tuple[float, float]
    straight_s: tuple[float, float]
    lateral_mps2: tuple[float, float]
    bend_s: tuple[float, float]


_ROADS: dict[str, _Usual] = {
    "motorway": _Usual((25.0, 36.0), (20.0, 60.0), (0.4, 2.0), (3.0, 12.0)),
    "country": _Usual((14.0, 27.0), (4.0, 20.0), (1.0, 5.5), (2.0, 6.0)),
    "town": _Usual((6.0, 14.0), (3.0, 10.0), (1.5, 4.5), (1.5, 4.0)),
}


@typed
def usual_road(
    kind: RoadKind = "country", duration_s: float = 100.0, seed: int | np.random.Generator = 0
) -> Manoeuvre:
    """Straights and bends of a motorway, a country road or a town, as in every day's driving.

    A motorway has 25 to 36 m/s and at most 2 m/s2 to the side, a country road 14 to 27 m/s and
    5.5 m/s2, a town 6 to 14 m/s and 4.5 m/s2. The speed changes by at most a third of its range
    from one bend to the next. For hills and crossfalls see `slope_rad` of
    :class:`~sysid_vehicle.RoadDisturbance`.

    Parameters
    ----------
    kind : {"motorway", "country", "town"}
        Which road.
    duration_s : float
        Length.
    seed : int or numpy.random.Generator
        Draws the road; the same seed gives the same road.

    Raises
    ------
    InvalidInput
        If there is no road of that kind, or the duration is not positive.
    """
    if kind not in _ROADS:
        raise InvalidInput(f"kind = {kind!r}; give one of {', '.join(_ROADS)}")
    check_positive("usual_road", duration_s=duration_s)
    rng = generator(seed)
    usual = _ROADS[kind]
    slow, fast = usual.speed_mps
    speed = rng.uniform(slow, fast)
    ends, speeds = [0.0], [speed]
    knots, sides = [0.0], [0.0]
    time_s = 0.0
    while len(ends) == 1 or time_s < duration_s - _LAST_BEND_S:
        time_s += rng.uniform(*usual.straight_s)
        speed = float(np.clip(speed + rng.uniform(-0.35, 0.35) * (fast - slow), slow, fast))
        side = rng.uniform(*usual.lateral_mps2) * rng.choice([-1.0, 1.0])
        end = time_s + 2.0 * _BEND_IN_S + rng.uniform(*usual.bend_s)
        knots += [time_s, time_s + _BEND_IN_S, end - _BEND_IN_S, end]
        sides += [0.0, side, side, 0.0]
        ends += [time_s, end]
        speeds += [speed, speed]
        time_s = end
    return Manoeuvre(
        name=kind,
        purpose="straights and bends of every day's driving",
        duration_s=duration_s,
        speed_mps=Knots(tuple(ends), tuple(speeds), smooth=True),
        lateral_mps2=Knots(tuple(knots), tuple(sides), smooth=True),
    )
