"""Estimates with their uncertainty: one rule for standard errors, intervals and notes."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, TypeVar

import numpy as np

from ..._common.arrays import FloatArray, as_float64
from ..._common.text import (
    UNBOUNDED,
    interval_95,
    interval_text,
    number,
    unit_after,
    with_error,
    within,
)
from ..search.objective import Objective
from ..search.search import Box
from .profile import Profile, profile_all
from .quantities import Quantity
from .side import Optimum

BETTER_FOUND = 4
"""Times that profiling may lead to a better optimum."""

INTERVALS = ("information", "profile")
"""Where intervals come from: the information matrix, or the profile likelihood."""

_SPREAD_OF_BOX = np.sqrt(1.0 / 12.0)  # standard deviation of a uniform over a box of width 1
_UNKNOWN = 0.2  # of the width
_SINGULAR = 1e-12
_WIDE = 0.5  # of the width, for an interval
_AT_BOUND = 1e-6  # of the width


@dataclass(frozen=True)
class Estimate:
    """A parameter with its uncertainty.

    Attributes
    ----------
    std : float
        Standard error; infinite where a bound holds the value, or the data never felt it.
    note : str
        Empty, or why the value says little: `not determined`, `at bound`, `no lower end`, `no upper
        end` (of the interval).
    ends : tuple of 2 floats, optional
        95 % interval of the profile likelihood, where that was asked for.
    bounds : tuple of 2 floats
        Between which it may lie; its intervals end there.
    unbounded : tuple of 2 floats, optional
        Of what a bound holds: the value that the data lead to beyond it, to first order, and its
        standard error.
    """

    name: str
    value: float
    std: float
    unit: str
    note: str = ""
    ends: tuple[float, float] | None = None
    bounds: tuple[float, float] = UNBOUNDED
    unbounded: tuple[float, float] | None = None

    @property
    def interval(self) -> tuple[float, float]:
        """95 % interval within the bounds: of the profile likelihood, or else of the std."""
        if self.ends is not None:
            return within(self.ends, self.bounds)
        return interval_95(self.value, self.std, self.bounds)

    @property
    def has_interval(self) -> bool:
        """Whether more is known than the bounds."""
        return self.ends is not None or bool(np.isfinite(self.std))

    def interval_text(self, written: Callable[[float], str] = number) -> str:
        """The interval in words, which say where it ends at a bound; a dash where there is none.

        Parameters
        ----------
        written : callable
            From a number to how it is printed.
        """
        return interval_text(self.interval, self.bounds, written) if self.has_interval else "-"

    def to_dict(self) -> dict[str, Any]:
        """Value, standard error, unit, and the interval where there is one, for JSON."""
        told = {"value": self.value, "std": self.std, "unit": self.unit}
        return {**told, "interval": list(self.interval)} if self.has_interval else told

    @property
    def size(self) -> str:
        """The value with its standard error, or with the interval where that ends at a bound."""
        return self._size(3)

    def _size(self, digits: int) -> str:
        if self.note and not np.isfinite(self.std):
            return f"{number(self.value, digits)} ({self.note})"
        return with_error(self.value, self.std, self.bounds, digits)

    def __str__(self) -> str:
        return f"{self.name} = {self._size(4)}{unit_after(self.unit)}"


def box_covariance(information: FloatArray, box: Box, x: FloatArray) -> FloatArray:
    """Covariance from the information of the data and that of having looked in the box only.

    Without the second, coefficients that copy each other would have no covariance at all, and the
    combinations that are known none either. It is that of a uniform over the box, about the
    estimate `x`: an estimate at a bound is further from the rest of the box than one amid it.
    """
    per_std = 1.0 / spread_of(box, x)
    total = information + np.diag(per_std**2)
    scale = np.sqrt(np.diag(total))
    inverse = np.linalg.inv(total / np.outer(scale, scale))
    return as_float64(0.5 * (inverse + inverse.T) / np.outer(scale, scale))


def spread_of(box: Box, x: FloatArray) -> FloatArray:
    """Root mean square distance of a uniform over the box from the estimate `x`."""
    return as_float64(np.hypot(_SPREAD_OF_BOX * box.width, x - 0.5 * (box.lower + box.upper)))


def std_of_data(information: FloatArray) -> FloatArray:
    """Standard errors by the data alone, as if there were no box."""
    scale = np.sqrt(np.diag(information))
    std = np.full(len(scale), np.inf)
    felt = scale > 0.0
    if felt.any():
        inner = information[np.ix_(felt, felt)] / np.outer(scale[felt], scale[felt])
        values, vectors = np.linalg.eigh(inner)
        variance = (vectors**2 / np.maximum(values, _SINGULAR)).sum(axis=1)
        std[felt] = np.sqrt(variance) / scale[felt]
    return std


def wald(
    names: Sequence[str],
    units: Mapping[str, str],
    x: FloatArray,
    information: FloatArray,
    box: Box,
    bounds: Sequence[tuple[float, float]] | None = None,
    descent: FloatArray | None = None,
    pushed: FloatArray | None = None,
) -> tuple[tuple[Estimate, ...], FloatArray]:
    """Estimates with the standard errors of the information matrix, and their covariance.

    `bounds` are those of the values, by default of the search: a lag is searched for from next to
    nothing, and may be none. `descent` is the gradient of the log-likelihood at `x`, by which the
    data press against bounds; columns of `pushed` are what `x` changes by where something that is
    no noise, and not sure, is one standard error off. What the data alone do not determine is
    called that, even where it ended at a bound: the bound is not what stopped it. At a bound there
    is no standard error, nor for what they never felt.
    """
    width = box.width
    of_noise = box_covariance(information, box, x)
    covariance = of_noise if pushed is None else as_float64(of_noise + pushed @ pushed.T)
    std = np.sqrt(np.diag(covariance))
    of_data = std_of_data(information)
    unknown = of_data > _UNKNOWN * width
    held = (x <= box.lower + _AT_BOUND * width) | (x >= box.upper - _AT_BOUND * width)
    silent = held | np.isinf(of_data)
    ends = list(zip(box.lower, box.upper, strict=True)) if bounds is None else bounds
    beyond: dict[int, tuple[float, float]] = {}
    if descent is not None:
        # Only bounds keep a maximum from being level: what else is left is of the search.
        off = of_noise[:, held] @ descent[held]
        beyond = {i: (float(x[i] + off[i]), float(std[i])) for i in np.flatnonzero(held).tolist()}
    estimates = tuple(
        Estimate(
            name,
            float(x[i]),
            float("inf") if silent[i] else float(std[i]),
            units[name],
            "not determined" if unknown[i] else "at bound" if held[i] else "",
            bounds=(float(ends[i][0]), float(ends[i][1])),
            unbounded=None if np.isinf(of_data[i]) else beyond.get(i),
        )
        for i, name in enumerate(names)
    )
    return estimates, covariance


class Estimated(ABC):
    """What all fits have in common: estimates, and what follows from them, by name."""

    estimates: tuple[Estimate, ...]
    covariance: FloatArray
    profiles: tuple[Profile, ...]

    __iter__ = None  # numbers are no names

    @property
    def by_noise(self) -> FloatArray:
        """The covariance by noise alone, not by times that were put right."""
        return self.covariance

    @property
    @abstractmethod
    def derived(self) -> tuple[Estimate, ...]:
        """What follows from the estimates together."""

    @property
    @abstractmethod
    def quantities(self) -> dict[str, Quantity]:
        """Estimates, then what follows from them, as functions of all parameters."""

    def __getitem__(self, name: str) -> Estimate:
        # What follows from the estimates is worked out only where it is asked for.
        known = next((e for e in self.estimates if e.name == name), None)
        return _named(name, (*self.estimates, *self.derived)) if known is None else known

    def profile(self, name: str) -> Profile:
        """Profile likelihood of an estimate, or of what follows from them."""
        return _named(name, self.profiles)

    @property
    def undetermined(self) -> tuple[str, ...]:
        """Parameters that this driving does not determine."""
        return tuple(e.name for e in self.estimates if e.note)


_Named = TypeVar("_Named", Estimate, Profile)


def _named(name: str, every: Sequence[_Named]) -> _Named:
    for one in every:
        if name in (one.name, one.name.replace(" ", "_")):
            return one
    known = ", ".join(e.name for e in every) or "none: identify with profile intervals"
    raise KeyError(f"'{name}'; there are {known}")


def profiled_estimates(
    objective: Objective,
    p: FloatArray,
    noise: FloatArray,
    box: Box,
    fit: Estimated,
    workers: int | None,
    progress: bool | None,
    held: FloatArray | None = None,
) -> tuple[tuple[Estimate, ...], tuple[Profile, ...], FloatArray | None]:
    """Intervals, and the notes that they decide, of the profile likelihood.

    Returns
    -------
    estimates : tuple of Estimate
    profiles : tuple of Profile
        Of all quantities.
    better : array, shape (parameters,), or None
        Parameters of higher likelihood, where profiling came upon some.
    """
    at = Optimum.of(objective, p, noise, box, fit.by_noise, held)
    wanted = list(fit.quantities.values())
    found, better = profile_all(at, wanted, workers=workers, progress=progress)
    estimates = tuple(
        replace(e, note=_note(e, f, float(width)), ends=f.interval)
        for e, f, width in zip(fit.estimates, found, box.width, strict=False)
    )
    return estimates, found, better


def profiled(estimate: Estimate, profiles: Sequence[Profile]) -> Estimate:
    """Replace the interval of what follows from parameters, which has no bounds of its own."""
    found = next((f for f in profiles if f.name == estimate.name), None)
    if found is None or not np.isfinite(estimate.value):
        return estimate
    low = -np.inf if found.open_below else found.low
    high = np.inf if found.open_above else found.high
    note = "no lower end" if found.open_below else "no upper end" if found.open_above else ""
    return replace(estimate, note=estimate.note or note, ends=(low, high))


def _note(estimate: Estimate, found: Profile, width: float) -> str:
    if found.high - found.low > _WIDE * width or (found.open_below and found.open_above):
        return "not determined"
    if found.open_below or found.open_above:
        return "no lower end" if found.open_below else "no upper end"
    return "" if estimate.note == "not determined" else estimate.note
