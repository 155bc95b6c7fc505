"""Where searches for tyre coefficients look, and where they begin."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from .._arrays import FloatArray, as_float64
from ..errors import InvalidInput, near_names
from ..identify.search import Box
from .tyre_fit import PARAMETERS

_LETTERS = {"B": (1.0, 40.0), "C": (0.5, 3.0), "D": (0.1, 3.0), "E": (-3.0, 1.0)}
BOX: dict[str, tuple[float, float]] = {
    **{f"{x}_{axle}": bounds for axle in ("front", "rear") for x, bounds in _LETTERS.items()},
    "P1": (-0.01, 0.01),
    "P2": (-1.0, 1.0),
    "P3": (-10.0, 10.0),
    "mass_factor": (0.5, 2.0),
    "yaw_inertia_factor": (0.3, 3.0),
    "drag_area_m2": (0.0, 10.0),
}
"""Where a search looks. Beyond E = 1 the curve would turn back to zero at large slip."""

_TYRE = {"B": 10.0, "C": 1.4, "D": 1.0, "E": 0.0}
_CAR = {"mass_factor": 1.0, "yaw_inertia_factor": 1.0, "drag_area_m2": 0.5}
GIVEN = {f"{x}_{axle}": v for axle in ("front", "rear") for x, v in _TYRE.items()} | _CAR
"""Where a search begins that is told nothing."""


def first_point(start: Mapping[str, float]) -> FloatArray:
    """All parameters in the core's order: the given ones, `GIVEN` for the rest."""
    for name in start:
        if name not in PARAMETERS:
            raise InvalidInput(f"there is no parameter '{name}'{near_names(name, PARAMETERS)}")
    values = GIVEN | dict(start)
    return as_float64([values.get(name, 0.0) for name in PARAMETERS])


def box_of(free: Sequence[str], bounds: Mapping[str, tuple[float, float]]) -> Box:
    """Box of the free parameters; `BOX` where `bounds` says nothing."""
    for name in bounds:
        if name not in PARAMETERS:
            raise InvalidInput(f"there is no parameter '{name}'{near_names(name, PARAMETERS)}")
    table = np.array([(BOX | dict(bounds))[n] for n in free], dtype=float)
    if not np.all(table[:, 0] < table[:, 1]):
        worst = free[int(np.argmin(table[:, 1] - table[:, 0]))]
        raise InvalidInput(f"bounds of {worst} are {bounds[worst]}; give (lower, upper)")
    return Box([PARAMETERS.index(n) for n in free], table[:, 0].copy(), table[:, 1].copy())
