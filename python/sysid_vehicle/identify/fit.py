"""What identification returns."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.optimize import brentq

from .._arrays import FloatArray, as_float64
from .._text import html_paragraph, html_table, number, text_table
from ..estimate import Driving, NoiseModel
from ..model import Model

__all__ = ["Estimate", "Fit", "Start"]

GRAVITY = 9.80665


def _stiffness(bcde: FloatArray) -> float:
    return float(bcde[0] * bcde[1] * bcde[2])


def _peak(bcde: FloatArray) -> float:
    return float(bcde[2] * np.sin(0.5 * np.pi * min(bcde[1], 1.0)))


def _peak_slip(bcde: FloatArray) -> float:
    """Where C atan(x - E (x - atan x)) is a right angle, over B."""
    b, c, _, e = map(float, bcde)
    if c <= 1.0 or b <= 0.0:
        return np.inf
    wanted = np.tan(0.5 * np.pi / c)

    def left(x: float) -> float:
        return float(x - e * (x - np.arctan(x)) - wanted)

    high = 1.0
    while left(high) < 0.0:
        high *= 2.0
        if high > 1e9:
            return np.inf
    return float(brentq(left, 0.0, high, xtol=1e-14)) / b


_MEANINGS: tuple[tuple[str, str, Callable[[FloatArray], float]], ...] = (
    ("cornering stiffness", "N/rad", _stiffness),
    ("peak friction", "1", _peak),
    ("slip at the peak", "rad", _peak_slip),
)


def _slope(function: Callable[[FloatArray], float], bcde: FloatArray, i: int) -> float:
    """Central difference by one coefficient."""
    step = np.zeros(4)
    step[i] = 1e-5 * max(abs(float(bcde[i])), 0.1)
    with np.errstate(invalid="ignore"):
        return float((function(bcde + step) - function(bcde - step)) / (2.0 * step[i]))


@dataclass(frozen=True)
class Estimate:
    """A parameter with its uncertainty.

    Attributes
    ----------
    std : float
        Standard error; infinite where the data say nothing.
    note : str
        Empty, `at bound`, or `not determined`.
    """

    name: str
    value: float
    std: float
    unit: str
    note: str = ""

    @property
    def interval(self) -> tuple[float, float]:
        """95 % interval."""
        return self.value - 1.96 * self.std, self.value + 1.96 * self.std

    def to_dict(self) -> dict[str, float | str]:
        """Value, standard error and unit, ready for JSON."""
        return {"value": self.value, "std": self.std, "unit": self.unit}

    def __str__(self) -> str:
        return f"{self.name} = {number(self.value)} +- {number(self.std, 2)} {self.unit}"


@dataclass(frozen=True)
class Start:
    """One start of the search and where it ended."""

    begin: dict[str, float]
    end: dict[str, float]
    cost: float
    agrees: bool


@dataclass(frozen=True, eq=False)
class Fit:
    """A model fitted to driving.

    Attributes
    ----------
    model : Model
        The model at the estimated values.
    noise : NoiseModel
        Noise learned together with it.
    estimates : tuple of Estimate
        Free parameters.
    covariance : array, shape (n, n)
        Of the estimates, in their order.
    log_likelihood : float
    driving : Driving
        What it was fitted to.
    starts : tuple of Start
        Every start of the search; empty when it went on from an earlier fit.
    converged : bool
    """

    model: Model
    noise: NoiseModel
    estimates: tuple[Estimate, ...]
    covariance: FloatArray
    log_likelihood: float
    driving: Driving
    starts: tuple[Start, ...]
    converged: bool

    def __getitem__(self, name: str) -> Estimate:
        every = (*self.estimates, *self.derived)
        for e in every:
            if name in (e.name, e.name.replace(" ", "_")):
                return e
        raise KeyError(f"'{name}'; there are {', '.join(e.name for e in every)}")

    @property
    def undetermined(self) -> tuple[str, ...]:
        """Parameters that this driving does not determine."""
        return tuple(e.name for e in self.estimates if e.note)

    @property
    def derived(self) -> tuple[Estimate, ...]:
        """What the tyre coefficients of an axle mean together.

        Cornering stiffness [N/rad], highest friction [1] and slip angle of that peak [rad], which
        is infinite where the curve has none. Driving that never reaches the peak determines the
        stiffness long before it determines B, C, D and E one by one. Each is found by the name it
        is printed with, and by that name with underscores.
        """
        return tuple(
            self._combined(axle, name, unit, function)
            for axle in ("front", "rear")
            for name, unit, function in _MEANINGS
        )

    def _combined(
        self, axle: str, name: str, unit: str, function: Callable[[FloatArray], float]
    ) -> Estimate:
        v = self.model.vehicle
        arm = v.lr_m if axle == "front" else v.lf_m
        scale = v.mass_kg * GRAVITY * arm / v.wheelbase_m if unit == "N/rad" else 1.0
        names = [f"{letter}_{axle}" for letter in "BCDE"]
        bcde = as_float64([self.model.value(n) for n in names])
        where = [e.name for e in self.estimates]
        gradient = np.zeros(len(where))
        for i, n in enumerate(names):
            if n in where:
                gradient[where.index(n)] = scale * _slope(function, bcde, i)
        value = scale * function(bcde)
        variance = float(gradient @ self.covariance @ gradient)
        known = bool(np.isfinite(value) and np.isfinite(variance))
        std = float(np.sqrt(max(variance, 0.0))) if known else np.inf
        return Estimate(f"{name} {axle}", value, std, unit, "" if known else "no peak")

    def _rows(self) -> list[list[str]]:
        rows = []
        for e in (*self.estimates, *self.derived):
            low, high = e.interval
            spread = f"{number(low)} .. {number(high)}" if np.isfinite(e.std) else "-"
            std = number(e.std, 2) if np.isfinite(e.std) else "-"
            rows.append([e.name, number(e.value), std, spread, e.unit, e.note])
        return rows

    _HEAD = ("parameter", "value", "std", "95 % interval", "unit", "note")

    def _headline(self) -> str:
        effects = ", ".join(self.model.effects) or "baseline"
        text = f"Fit of {effects} to {self.driving}; log-likelihood {self.log_likelihood:.1f}"
        if self.starts:
            agree = sum(s.agrees for s in self.starts)
            text += f"; {agree} of {len(self.starts)} starts agree"
        if not self.converged:
            text += "; NOT CONVERGED"
        return text

    def __str__(self) -> str:
        return f"{self._headline()}\n{text_table(self._HEAD, self._rows())}\nNoise\n{self.noise}"

    def _repr_html_(self) -> str:
        return (
            html_paragraph(self._headline())
            + html_table(self._HEAD, self._rows())
            + self.noise._repr_html_()
        )
