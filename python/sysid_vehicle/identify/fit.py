"""What identification returns."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .._arrays import FloatArray
from .._text import html_paragraph, html_table, number, text_table
from ..estimate import Driving, NoiseModel
from ..model import Model

__all__ = ["Estimate", "Fit", "Start"]


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
        for e in self.estimates:
            if e.name == name:
                return e
        raise KeyError(name)

    @property
    def undetermined(self) -> tuple[str, ...]:
        """Parameters that this driving does not determine."""
        return tuple(e.name for e in self.estimates if e.note)

    @property
    def derived(self) -> tuple[Estimate, ...]:
        """What the tyre coefficients mean together: cornering stiffness and slip at the peak.

        Driving that never reaches the peak determines these, or only the stiffness, long before it
        determines B, C, D and E one by one.
        """
        return tuple(self._stiffness(axle) for axle in ("front", "rear"))

    def _stiffness(self, axle: str) -> Estimate:
        v = self.model.vehicle
        arm = v.lr_m if axle == "front" else v.lf_m
        load = v.mass_kg * 9.80665 * arm / v.wheelbase_m
        names = [f"{letter}_{axle}" for letter in "BCD"]
        values = np.array([self.model.value(n) for n in names])
        stiffness = float(np.prod(values) * load)
        where = [e.name for e in self.estimates]
        gradient = np.zeros(len(where))
        for n, x in zip(names, values, strict=True):
            if n in where:
                gradient[where.index(n)] = stiffness / x
        std = float(np.sqrt(max(float(gradient @ self.covariance @ gradient), 0.0)))
        return Estimate(f"cornering stiffness {axle}", stiffness, std, "N/rad")

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
