"""Sizes of effects in cars that are much smaller, or much larger, than ordinary ones.

The catalogue's sizes are those of ordinary cars. A relaxation length that hardly matters there is a
fifth of the wheelbase of a model car, and a side wind of 60 N overturns it. Cars that are alike in
shape, on the same ground and at speeds as the root of their lengths, move alike in time that goes
as that root, too (Froude's law of similarity): lengths go with the wheelbase, forces with the mass,
and all others follow from their units.
"""

from __future__ import annotations

import math
from dataclasses import replace

from .catalogue import Effect, catalogue
from .parts import Parameter

ORDINARY_WHEELBASE_M = (2.0, 3.5)
ORDINARY_MASS_KG = (700.0, 3000.0)
"""Cars within both have the catalogue's sizes; others are compared with the nearer end."""

# Powers of the length and of the mass. An area stands for what air does to it at like speeds.
_POWERS = {
    "m": (1.0, 0.0),
    "m2": (-1.0, 1.0),
    "N": (0.0, 1.0),
    "N m": (1.0, 1.0),
    "N m2": (2.0, 1.0),
    "rad/N": (0.0, -1.0),
    "1/kW": (-0.5, -1.0),
    "s/m": (-0.5, 0.0),
}
# Servos, sensors and the wind do not know how large the car is. What they matter does.
_MATTER = {"s": (0.5, 0.0), "m/s": (0.5, 0.0), "rad/s": (-0.5, 0.0)}


def in_car(e: Effect, *, wheelbase_m: float, mass_kg: float) -> Effect:
    """An effect of the catalogue with the sizes that it has in a car.

    Parameters
    ----------
    e : Effect
        One that is not the catalogue's own, with other bounds or defined by a user, stays as it is.
    wheelbase_m : float
    mass_kg : float
    """
    length = length_beyond(wheelbase_m)
    mass = _beyond(mass_kg, ORDINARY_MASS_KG)
    if (length, mass) == (1.0, 1.0) or e.acts or e not in [o for o in catalogue() if o.id == e.id]:
        return e
    return replace(e, parameters=tuple(_sized(p, length, mass) for p in e.parameters))


def matters_in(unit: str, wheelbase_m: float) -> float:
    """How many times as large as in ordinary cars a length, a time or a speed is before it matters.

    1 for units that know no length.
    """
    power = _MATTER.get(unit, _POWERS["m"] if unit == "m" else (0.0, 0.0))[0]
    return math.pow(length_beyond(wheelbase_m), power)


def length_beyond(wheelbase_m: float) -> float:
    """How many times as long as the nearer end of what is ordinary a car is; 1 within."""
    return _beyond(wheelbase_m, ORDINARY_WHEELBASE_M)


def _beyond(size: float, ordinary: tuple[float, float]) -> float:
    return size / min(max(size, ordinary[0]), ordinary[1])


def _sized(p: Parameter, length: float, mass: float) -> Parameter:
    def factor(powers: tuple[float, float]) -> float:
        return math.pow(length, powers[0]) * math.pow(mass, powers[1])

    if p.scan:
        return p
    if p.unit in _MATTER:
        return replace(p, matters=factor(_MATTER[p.unit]) * p.matters)
    by = factor(_POWERS.get(p.unit, (0.0, 0.0)))
    return replace(
        p,
        typical=by * p.typical,
        matters=by * p.matters,
        lower=by * p.lower,
        upper=by * p.upper,
        typical_low=by * p.typical_low,
        typical_high=by * p.typical_high,
    )
