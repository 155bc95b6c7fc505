"""Axle loads at rest of a model: those of its vehicle file, and of what it found beside that."""

from __future__ import annotations

from .._common.arrays import FloatArray
from ..model import Model
from ..vehicle import AXLES, static_loads

LOADING = ("mass", "cg_position")
"""Effects that change the axle loads at rest."""

_MASS, _SHIFT = (
    f"{e}.{name}" for e, name in zip(LOADING, ("relative_error", "shift_rearward_m"), strict=True)
)


class LoadAtRest:
    """Load of an axle at rest as a function of the core's parameter vector [N].

    Parameters
    ----------
    model : Model
        Its vehicle, and the effects of `LOADING` that it has.
    axle : str
        `front` or `rear`.
    """

    def __init__(self, model: Model, axle: str) -> None:
        known = model.parameters
        self._vehicle, self._axle = model.vehicle, AXLES.index(axle)
        self._columns = {n: known[n].column for n in (_MASS, _SHIFT) if n in known}

    def __call__(self, p: FloatArray) -> float:
        """Load [N] with parameters `p`, shape (parameters,)."""
        error, shift_m = (
            float(p[self._columns[n]]) if n in self._columns else 0.0 for n in (_MASS, _SHIFT)
        )
        car = self._vehicle
        loads = static_loads(car.mass_kg * (1.0 + error), car.lf_m + shift_m, car.lr_m - shift_m)
        return loads[self._axle]

    def slope(self, p: FloatArray) -> dict[int, float]:
        """Derivatives by the columns that change it; exact, as it is linear in each of them."""
        found = {}
        for column in self._columns.values():
            high, low = p.copy(), p.copy()
            high[column] += 0.5
            low[column] -= 0.5
            found[column] = self(high) - self(low)
        return found
