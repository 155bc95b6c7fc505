"""Calibration of an observer's gains on a drive whose truth is known: Algorithm 1 of the paper.

The search is behind ask and tell, so that any optimiser plugs in. Dettu et al. (2023), sec. 5.1.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from html import escape
from typing import TYPE_CHECKING, Any, Protocol, runtime_checkable

import numpy as np

from .._arguments import generator
from .._arrays import FloatArray
from .._style import AFTER, MEASURED, axes_or_new, tidy
from ..errors import InvalidInput, NumericalError
from .drives import Drive14
from .observer import Observation

if TYPE_CHECKING:
    from matplotlib.axes import Axes

__all__ = [
    "BayesianSearch",
    "Box",
    "Calibration",
    "Optimiser",
    "calibrate",
    "sideslip_and_mass_cost",
]

_LOST = 10.0  # a run that fails costs so many times the dearest that did not
_UNKNOWN = 1e3  # or, before any was found, so many times this


@dataclass(frozen=True)
class Box:
    """Where gains are looked for: `(lower, upper)` by name; by their logarithm where both are > 0.

    Raises
    ------
    InvalidInput
        If a range is empty.
    """

    ranges: Mapping[str, tuple[float, float]]

    def __post_init__(self) -> None:
        for name, (lower, upper) in self.ranges.items():
            if not lower < upper:
                raise InvalidInput(f"{name}: the range {lower!r} to {upper!r} is empty")

    def gains(self, place: FloatArray) -> dict[str, float]:
        """Gains at a place in the unit cube."""
        out = {}
        for (name, (lower, upper)), u in zip(self.ranges.items(), place, strict=True):
            if lower > 0.0:
                out[name] = float(lower * (upper / lower) ** u)
            else:
                out[name] = float(lower + (upper - lower) * u)
        return out


@runtime_checkable
class Optimiser(Protocol):
    """Who proposes gains. Ten lines make one of any optimiser with an interface of this kind."""

    def ask(self) -> FloatArray:
        """Give the next place to try, in the unit cube."""

    def tell(self, place: FloatArray, cost: float) -> None:
        """Hear what it costs there."""


class BayesianSearch:
    """Bayesian optimisation: a Gaussian process and expected improvement.

    Parameters
    ----------
    size : int
        Number of gains.
    first : int
        Random places before the first model, ``n_seed`` of the paper.
    seed : int
        Of the places and of the search.

    Raises
    ------
    InvalidInput
        If the package ``bayesian-optimization`` is not installed.

    Notes
    -----
    The process sees the logarithm of the cost: between gains that work and gains that lose the
    twin there are orders of magnitude, which no stationary process follows.
    """

    def __init__(self, size: int, *, first: int = 20, seed: int = 0) -> None:
        try:
            from bayes_opt import BayesianOptimization, acquisition
        except ImportError as error:
            raise InvalidInput(
                "calibration by Bayesian optimisation needs the package bayesian-optimization: "
                "pip install 'sysid-vehicle[calibrate]', or pass an optimiser of your own"
            ) from error
        self._names = [f"g{i:02d}" for i in range(size)]
        self._first = first
        self._random = generator(seed)
        self._told = 0
        self._inner: Any = BayesianOptimization(
            f=None,
            pbounds=dict.fromkeys(self._names, (0.0, 1.0)),
            acquisition_function=acquisition.ExpectedImprovement(xi=0.01),
            random_state=seed,
            verbose=0,
            allow_duplicate_points=True,
        )

    def ask(self) -> FloatArray:
        """Give the next place to try, in the unit cube."""
        if self._told < self._first:
            return self._random.uniform(size=len(self._names))
        found = self._inner.suggest()
        return np.array([float(found[name]) for name in self._names])

    def tell(self, place: FloatArray, cost: float) -> None:
        """Hear what it costs there."""
        self._told += 1
        named = dict(zip(self._names, map(float, place), strict=True))
        self._inner.register(params=named, target=-math.log(max(cost, 1e-12)))


@dataclass(frozen=True, eq=False)
class Calibration:
    """Gains that were found.

    Attributes
    ----------
    gains : dict
        The best that were tried.
    cost : float
        Their cost.
    tried : tuple of (dict, float)
        Every trial with its cost, in order; infinite where the twin was lost.
    lost : int
        Trials in which the twin was lost.
    """

    gains: dict[str, float]
    cost: float
    tried: tuple[tuple[dict[str, float], float], ...]
    lost: int

    def plot(self, *, ax: Axes | None = None) -> Axes:
        """Draw every trial's cost, and the best so far."""
        ax = axes_or_new(ax, 6.0, 3.0)
        cost = np.array([c for _, c in self.tried])
        trial = np.arange(1, len(cost) + 1)
        lost = np.isinf(cost)
        cost[lost] = np.nan
        ax.semilogy(trial, cost, ".", color=MEASURED, label="tried")
        ax.semilogy(
            trial,
            np.fmin.accumulate(cost),
            color=AFTER,
            drawstyle="steps-post",
            label="best so far",
        )
        if lost.any():
            top = ax.get_xaxis_transform()
            ones = np.ones(lost.sum())
            ax.plot(
                trial[lost], ones, "x", color=MEASURED, transform=top, clip_on=False, label="lost"
            )
        ax.legend(frameon=False)
        return tidy(ax, xlabel="trial", ylabel="cost")

    def __str__(self) -> str:
        lines = [f"Cost {self.cost:.4g} after {len(self.tried)} trials, {self.lost} lost the twin"]
        lines += [f"  {name:12s} {value:.5g}" for name, value in self.gains.items()]
        return "\n".join(lines)

    def _repr_html_(self) -> str:
        return f"<pre>{escape(str(self))}</pre>"


def sideslip_and_mass_cost(
    sideslip_rad: FloatArray,
    mass_kg: FloatArray,
    drive: Drive14,
    true_mass_kg: float,
    *,
    stride: int = 1,
) -> float:
    """Equation (26): ten times the rms of the sideslip in degrees, plus that of the mass in kg.

    The mass counts over the last ten seconds. The paper does not give the unit of the sideslip; in
    radians its term would vanish beside the mass.
    """
    error = np.degrees(sideslip_rad - drive["sideslip_rad"][::stride])
    last = round(10.0 / (drive.dt_s * stride))
    mass = mass_kg[-last:] - true_mass_kg
    return float(10.0 * np.sqrt(np.mean(error**2)) + np.sqrt(np.mean(mass**2)))


def observation_cost(found: Observation, drive: Drive14, true_mass_kg: float) -> float:
    """Equation (26) of an observation of the built-in twin."""
    stride = round(float(found.time_s[1]) / drive.dt_s)
    return sideslip_and_mass_cost(
        found.outputs["sideslip_rad"],
        found.parameters["mass_kg"],
        drive,
        true_mass_kg,
        stride=stride,
    )


def calibrate(
    cost: Callable[[dict[str, float]], float],
    box: Box,
    *,
    trials: int = 150,
    optimiser: Optimiser | None = None,
    seed: int = 0,
    tell: Callable[[int, float], None] | None = None,
) -> Calibration:
    """Look for the gains of least cost.

    Parameters
    ----------
    cost : callable
        Cost of gains by name; may raise `NumericalError` where they lose the twin.
    box : Box
        Where to look.
    trials : int
        Number of costs to find.
    optimiser : Optimiser, optional
        Who proposes; by default `BayesianSearch`.
    seed : int
        Of the default optimiser.
    tell : callable, optional
        Told the number of each trial and the best cost so far.

    Returns
    -------
    Calibration

    Raises
    ------
    InvalidInput
        If `trials` is less than one.
    NumericalError
        If every trial lost the twin.
    """
    if trials < 1:
        raise InvalidInput(f"trials = {trials!r}; give one or more")
    size = len(box.ranges)
    who = BayesianSearch(size, seed=seed, first=min(20, trials)) if optimiser is None else optimiser
    tried: list[tuple[dict[str, float], float]] = []
    paid: list[float] = []
    for i in range(trials):
        place = np.clip(np.asarray(who.ask(), dtype=np.float64), 0.0, 1.0)
        gains = box.gains(place)
        try:
            value = cost(gains)
        except NumericalError:
            value = math.nan
        if math.isfinite(value):
            paid.append(value)
        who.tell(place, value if math.isfinite(value) else _LOST * max(paid, default=_UNKNOWN))
        tried.append((gains, value if math.isfinite(value) else math.inf))
        if tell is not None:
            tell(i, min(paid, default=math.inf))
    if not paid:
        raise NumericalError(f"all {trials} trials lost the twin; look at smaller gains")
    best = min(tried, key=lambda t: t[1])
    return Calibration(best[0], best[1], tuple(tried), trials - len(paid))
