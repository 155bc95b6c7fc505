"""What effects are made of: parameters and states."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from .._common.arrays import FloatArray, as_float64

Steps = tuple[Any, ...]


@dataclass(frozen=True)
class Parameter:
    """One parameter: its unit, its box, the value that changes nothing, and telling sizes.

    Attributes
    ----------
    null_value : float
        Value at which the model is exactly the one without the effect.
    typical, matters : float
        A size met in practice, and the smallest one worth acting on.
    lower, upper : float
        Bounds of the search.
    column : int
        Place in the core's parameter vector; no part of what the parameter is.
    typical_low, typical_high : float
        Where most cars lie that have the effect.
    mirrored : bool
        Whether it changes its sign in a mirror that swaps left and right.
    scan : str
        Of a parameter that means nothing while the effect is null: sought over the `time` of the
        log, or over its typical `range`. Otherwise empty.
    """

    name: str
    unit: str
    null_value: float
    typical: float
    matters: float
    lower: float
    upper: float
    typical_low: float
    typical_high: float
    mirrored: bool
    scan: str
    column: int = field(compare=False)

    @property
    def one_sided(self) -> bool:
        """Whether the null value lies on a bound, so that only one sign is possible."""
        return self.null_value in (self.lower, self.upper)

    def another_dynamics(self, value: float) -> bool:
        """Whether at a value the car does not move as at the typical one: a lag that hardly lags.

        What is linear there leads to no size of that kind.
        """
        return self.one_sided and not 0.5 * self.typical <= value <= 2.0 * self.typical

    def grid(self, duration_s: float) -> FloatArray:
        """Values at which a scanned parameter is tried in a log of this duration."""
        if self.scan == "time":
            return as_float64(duration_s * np.arange(1, 8) / 8.0)
        ratio = self.typical_high / self.typical_low
        return as_float64(self.typical_low * ratio ** np.array([0.0, 0.5, 1.0]))


@dataclass(frozen=True)
class OwnState:
    """A state of an effect that a user defined.

    Attributes
    ----------
    name, unit : str
    rate : tuple
        Steps of the formula of its derivative by time.
    decay : tuple
        Minus the derivative of the rate by the state itself.
    initial : tuple or None
        Where a run begins; None where it would rest.
    """

    name: str
    unit: str
    rate: Steps
    decay: Steps
    initial: Steps | None = None
