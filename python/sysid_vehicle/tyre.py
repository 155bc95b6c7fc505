"""The tyre of an axle, and ranges in which its numbers and those of the car must be."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from ._common.arguments import real
from ._common.arrays import FloatArray
from ._common.files import refuse_unknown
from ._common.typed import typed, typed_fields
from .errors import InvalidInput

_CURVE_POINTS = 3001


@dataclass(frozen=True)
class Range:
    """Closed range of a key (`above` makes the lower end open), and what to check outside it."""

    low: float
    high: float
    meaning: str
    above: bool = False

    def complaint(self, key: str, value: object) -> str | None:
        """Return what is wrong with the value of a key, and the remedy; None if nothing is."""
        number = real(value)
        if number is None:
            return f"{key} = {value!r} is not a number; give the {self.meaning} as a plain number"
        low_ok = number > self.low if self.above else number >= self.low
        if low_ok and number <= self.high:
            return None
        sign = ">" if self.above else ">="
        return (
            f"{key} = {number:g} is out of range ({sign} {self.low:g} and <= {self.high:g}); "
            f"give the {self.meaning}"
        )


def check_ranges(ranges: Mapping[str, Range], values: Mapping[str, object], where: str) -> None:
    """Raise one :class:`InvalidInput` that lists every value of `values` outside its range."""
    found = (ranges[key].complaint(key, value) for key, value in values.items())
    complaints = [text for text in found if text is not None]
    if complaints:
        raise InvalidInput(f"{where}: " + "; ".join(complaints))


TYRE_RANGES = {
    "B": Range(0.0, 200.0, "stiffness factor of the magic formula in 1/rad", above=True),
    "C": Range(0.0, 4.0, "shape factor of the magic formula, about 1.4", above=True),
    "D": Range(0.0, 5.0, "peak friction coefficient, about 1.0 on dry asphalt", above=True),
    "E": Range(-50.0, 1.0, "curvature factor of the magic formula, at most 1"),
}


def magic_formula(slip_rad: npt.ArrayLike, B: float, C: float, D: float, E: float) -> FloatArray:
    """Lateral force per vertical load [-] at slip angles [rad], whatever the coefficients are."""
    x = B * np.asarray(slip_rad, dtype=float)
    return np.asarray(D * np.sin(C * np.arctan(x - E * (x - np.arctan(x)))), dtype=float)


@dataclass(frozen=True)
class Tyre:
    """Magic-formula tyre of one axle: ``F_y = D F_z sin(C atan(Ba - E (Ba - atan(Ba))))``.

    Parameters
    ----------
    B : float
        Stiffness factor [1/rad].
    C, D, E : float
        Shape factor, peak friction coefficient, curvature factor [-].

    Raises
    ------
    InvalidInput
        If a coefficient is out of its range (B, C, D > 0, E <= 1).

    Notes
    -----
    H. B. Pacejka, *Tire and Vehicle Dynamics*, eq. (4.6), without shifts; ``Ba`` is B times the
    slip angle in radians.
    """

    B: float = 10.0
    C: float = 1.4
    D: float = 1.0
    E: float = 0.0

    @typed_fields
    def __post_init__(self) -> None:
        check_ranges(TYRE_RANGES, dataclasses.asdict(self), "tyre")
        for key in TYRE_RANGES:
            object.__setattr__(self, key, float(getattr(self, key)))

    @property
    def cornering_stiffness_per_load(self) -> float:
        """Cornering stiffness per vertical load, ``B C D`` [1/rad]."""
        return self.B * self.C * self.D

    @typed
    def friction(self, slip_rad: npt.ArrayLike) -> FloatArray:
        """Lateral force per vertical load [-] at slip angles [rad]."""
        return magic_formula(slip_rad, self.B, self.C, self.D, self.E)

    @typed
    def peak_slip_rad(self, largest_rad: float = 0.6) -> float:
        """Slip angle of the curve's peak [rad], at most `largest_rad`."""
        slip = np.linspace(0.0, largest_rad, _CURVE_POINTS)
        return float(slip[int(np.argmax(self.friction(slip)))])

    @typed
    def replace(self, **changes: float) -> Tyre:
        """Return a copy with some coefficients changed."""
        refuse_unknown(changes, TYRE_RANGES, "tyre")
        return dataclasses.replace(self, **changes)


USUAL_TYRE = Tyre()
"""Where a search begins that knows nothing of the tyres."""
