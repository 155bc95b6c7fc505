"""Calibration of an observer's gains on a drive whose truth is known: Algorithm 1 of the paper.

The search is behind ask and tell, so that any optimiser plugs in. Dettu et al. (2023), sec. 5.1.
"""

from __future__ import annotations

import dataclasses
import math
import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Protocol, runtime_checkable

import numpy as np

from .._common.arguments import generator, whole
from .._common.arrays import FloatArray
from .._common.printed import Told
from .._common.style import AFTER, MEASURED, axes_or_new, tidy
from .._common.typed import typed, typed_fields
from ..errors import InvalidInput, NumericalError

if TYPE_CHECKING:
    from matplotlib.axes import Axes

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

    @typed_fields
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
        self._seed = seed
        self._places: list[FloatArray] = []
        self._logs: list[float] = []
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
        self._places.append(np.array(place, dtype=np.float64))
        self._logs.append(math.log(max(cost, 1e-12)))
        named = dict(zip(self._names, map(float, place), strict=True))
        self._inner.register(params=named, target=-math.log(max(cost, 1e-12)))

    def best_predicted(self) -> tuple[FloatArray, float]:
        """Give the place of least posterior mean, and the cost that it predicts there.

        The least of many noisy costs is low by luck as well; the mean of a Gaussian process with
        noise of its own, fitted to all that was told, has no part in that luck.
        """
        from scipy.optimize import minimize
        from sklearn.gaussian_process import GaussianProcessRegressor
        from sklearn.gaussian_process.kernels import (
            ConstantKernel,
            Matern,
            WhiteKernel,
        )

        x, y = np.array(self._places), np.array(self._logs)
        kernel = ConstantKernel(1.0) * Matern(
            np.full(x.shape[1], 0.5), (0.05, 20.0), nu=2.5
        ) + WhiteKernel(0.01, (1e-6, 1.0))
        process = GaussianProcessRegressor(
            kernel, normalize_y=True, n_restarts_optimizer=2, random_state=self._seed
        )
        with warnings.catch_warnings():
            # A length at its bound says that a gain hardly matters, which is no fault.
            warnings.simplefilter("ignore")
            process.fit(x, y)
        rng = np.random.default_rng(self._seed)
        best = x[np.argsort(y)[:5]]
        near = best[rng.integers(len(best), size=500)]
        near = near + 0.05 * rng.standard_normal(near.shape)
        starts = np.vstack([x, np.clip(near, 0.0, 1.0), rng.uniform(size=(500, x.shape[1]))])
        start = starts[np.argmin(process.predict(starts))]
        found = minimize(
            lambda place: float(process.predict(place[None])[0]),
            start,
            method="L-BFGS-B",
            bounds=[(0.0, 1.0)] * x.shape[1],
        )
        place = found.x if found.fun <= float(process.predict(start[None])[0]) else start
        return place, float(np.exp(process.predict(place[None])[0]))


@dataclass(frozen=True)
class Candidate:
    """Gains that may be the best.

    Attributes
    ----------
    how : {"observed", "predicted"}
        The least cost of a trial, or the least that the optimiser's model predicts.
    gains : dict
        By name.
    cost : float
        What the trial cost, or what the model predicts.
    fresh : tuple of float
        Costs on seeds that no trial had; infinite where the twin was lost.
    """

    how: str
    gains: dict[str, float]
    cost: float
    fresh: tuple[float, ...] = ()

    @property
    def fresh_mean(self) -> float:
        """Mean cost on fresh seeds; not a number without any."""
        return float(np.mean(self.fresh)) if self.fresh else math.nan

    def to_dict(self) -> dict[str, Any]:
        """All figures, for a file."""
        return {"gains": self.gains, "cost": self.cost, "fresh": list(self.fresh)}

    def __str__(self) -> str:
        fresh = ""
        if self.fresh:
            fresh = (
                f", on {len(self.fresh)} fresh seeds {self.fresh_mean:.4g} "
                f"({min(self.fresh):.4g} .. {max(self.fresh):.4g})"
            )
        return f"best {self.how}: cost {self.cost:.4g}{fresh}"


@dataclass(frozen=True, eq=False, repr=False)
class Calibration(Told):
    """Gains that were found.

    Attributes
    ----------
    gains : dict
        Those of the candidate that costs least on fresh seeds; without fresh seeds, the best that
        were tried.
    cost : float
        Least cost of a trial.
    candidates : tuple of Candidate
        The best that was tried, and the best that the optimiser's model predicts, if it has one.
    tried : tuple of (dict, float)
        Every trial with its cost, in order; infinite where the twin was lost.
    lost : int
        Trials in which the twin was lost.
    """

    gains: dict[str, float]
    cost: float
    tried: tuple[tuple[dict[str, float], float], ...]
    lost: int
    candidates: tuple[Candidate, ...] = ()

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
        lines += [
            f"  {candidate}{', taken' if candidate.gains is self.gains else ''}"
            for candidate in self.candidates
        ]
        lines += [f"  {name:12s} {value:.5g}" for name, value in self.gains.items()]
        return "\n".join(lines)


@typed
def calibrate(
    cost: Callable[[dict[str, float]], float],
    box: Box,
    *,
    trials: int = 150,
    optimiser: Optimiser | None = None,
    seed: int = 0,
    tell: Callable[[int, float], None] | None = None,
    fresh: Sequence[Callable[[dict[str, float]], float]] = (),
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
    fresh : sequence of callable
        The cost with other seeds than the trials'. The best trial and, if the optimiser has
        ``best_predicted``, the best that its model predicts are judged by them.

    Raises
    ------
    InvalidInput
        If `trials` is less than one.
    NumericalError
        If every trial lost the twin.
    """
    whole(trials, "trials", 1)
    size = len(box.ranges)
    who = BayesianSearch(size, seed=seed, first=min(20, trials)) if optimiser is None else optimiser
    tried: list[tuple[dict[str, float], float]] = []
    paid: list[float] = []
    for i in range(trials):
        place = np.clip(np.asarray(who.ask(), dtype=np.float64), 0.0, 1.0)
        gains = box.gains(place)
        value = _cost(cost, gains)
        if math.isfinite(value):
            paid.append(value)
        who.tell(place, value if math.isfinite(value) else _LOST * max(paid, default=_UNKNOWN))
        tried.append((gains, value))
        if tell is not None:
            tell(i, min(paid, default=math.inf))
    if not paid:
        raise NumericalError(f"all {trials} trials lost the twin; look at smaller gains")
    best = min(tried, key=lambda t: t[1])
    candidates = [Candidate("observed", *best)]
    predict = getattr(who, "best_predicted", None)
    if predict is not None and len(paid) > size:
        place, predicted = predict()
        candidates.append(Candidate("predicted", box.gains(place), predicted))
    judged = tuple(
        dataclasses.replace(c, fresh=tuple(_cost(again, c.gains) for again in fresh))
        for c in candidates
    )
    taken = min(judged, key=lambda c: c.fresh_mean) if fresh else judged[0]
    return Calibration(taken.gains, best[1], tuple(tried), trials - len(paid), judged)


def _cost(cost: Callable[[dict[str, float]], float], gains: dict[str, float]) -> float:
    """A cost, infinite where the twin is lost."""
    try:
        value = cost(gains)
    except NumericalError:
        return math.inf
    return value if math.isfinite(value) else math.inf
