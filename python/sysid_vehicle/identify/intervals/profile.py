"""Intervals from the profile likelihood: how far a value may move before the data object.

The other parameters are fitted anew at every value (Raue et al., Bioinformatics 25, 2009). Where
B, C, D and E copy each other along a bent valley the information matrix, which sees only its
direction at the optimum, promises far too much; the profile follows the valley.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from ..._common.arrays import FloatArray, as_float64
from ..._common.progress import with_progress
from ..._common.style import AFTER, FLOOR, axes_or_new, tidy
from ..._common.text import HALF_95, number
from ..._common.threads import Workers
from ..search.objective import Objective, Penalised
from ..search.search import Box
from ..search.valley import down_the_valley
from .quantities import Quantity

if TYPE_CHECKING:
    from matplotlib.axes import Axes

LEVEL = HALF_95
"""Root of the 95 % quantile of chi-square with one degree of freedom."""

_CLOSE = 0.04  # of the level
_POINTS = 20  # on each side
_ASTRAY = 4.0  # of the level
_ROUNDS = 20
_ENOUGH = 0.01  # nats
_STIFF = 30.0  # how much harder the wish pulls than the data
_BETTER = 0.1  # nats
_STEP = 3.0  # most by which the distance grows from one point to the next
_AIMED = 4  # times


@dataclass(frozen=True, eq=False)
class Profile:
    """Profile likelihood of one quantity.

    Attributes
    ----------
    name : str
    values : array, shape (n,)
        Where it was worked out, ascending.
    lost : array, shape (n,)
        Log-likelihood lost there.
    low, high : float
        Ends of the 95 % interval.
    open_below, open_above : bool
        The likelihood does not fall enough on that side before the search box or the model ends.
    """

    name: str
    values: FloatArray
    lost: FloatArray
    low: float
    high: float
    open_below: bool
    open_above: bool

    @property
    def interval(self) -> tuple[float, float]:
        """95 % interval."""
        return self.low, self.high

    def __str__(self) -> str:
        low = f"below {number(self.low, 5)}" if self.open_below else number(self.low, 5)
        high = f"above {number(self.high, 5)}" if self.open_above else number(self.high, 5)
        return f"{self.name}: {low} .. {high}"

    def plot(self, ax: Axes | None = None) -> Axes:
        """Draw the log-likelihood lost over the value, and the 95 % level.

        Parameters
        ----------
        ax : matplotlib Axes, optional

        Returns
        -------
        matplotlib Axes
        """
        ax = axes_or_new(ax, 4.5, 3.2)
        ax.plot(self.values, self.lost, "o-", color=AFTER, markersize=3)
        ax.axhline(0.5 * LEVEL**2, color=FLOOR, linestyle="--", linewidth=0.8)
        ax.axvspan(self.low, self.high, color=AFTER, alpha=0.12, linewidth=0)
        ax.set_ylim(0.0, 1.5 * LEVEL**2)
        return tidy(ax, xlabel=self.name, ylabel="log-likelihood lost")


@dataclass(frozen=True, eq=False)
class Optimum:
    """Where a search ended, and what it searched.

    Parameters
    ----------
    objective : Penalised
    gains : object
        Those of the problem there.
    box : Box
    p : array, shape (parameters,)
    covariance : array, shape (free, free)
        Of the free parameters.
    cost : float
        Half the sum of squares.
    """

    objective: Penalised
    gains: Any
    box: Box
    p: FloatArray
    covariance: FloatArray
    cost: float

    @classmethod
    def of(
        cls,
        objective: Objective,
        p: FloatArray,
        noise: FloatArray,
        box: Box,
        covariance: FloatArray,
    ) -> Optimum:
        """Of parameters and noise that were found."""
        gains = objective.freeze(p, noise)
        return cls(objective, gains, box, p, covariance, objective.half_sum_of_squares(p, gains))

    def cost_of(self, p: FloatArray) -> float:
        """Half the sum of squares of other parameters."""
        return self.objective.half_sum_of_squares(p, self.gains)

    def across(self, what: Quantity) -> tuple[FloatArray, float]:
        """Covariance of the free parameters with a quantity, and its variance."""
        gradient = _felt(what, self.p)[self.box.columns]
        across = self.covariance @ gradient
        return as_float64(across), float(gradient @ across)

    def bottom(self, objective: Penalised, p: FloatArray, box: Box) -> FloatArray:
        """The way down from `p`."""
        return down_the_valley(objective, p, self.gains, box, tolerance=_ENOUGH, rounds=_ROUNDS)


def profile_all(
    at: Optimum, wanted: Sequence[Quantity], *, workers: int | None, progress: bool | None
) -> tuple[tuple[Profile, ...], FloatArray | None]:
    """Profile many quantities side by side.

    Returns
    -------
    profiles : tuple of Profile
    better : array, shape (parameters,), or None
        The point of highest likelihood, where one above the optimum was come upon.
    """

    def one(what: Quantity) -> tuple[Profile, FloatArray | None]:
        with np.errstate(over="ignore", invalid="ignore"):
            return profile(at, what)

    with Workers(workers) as pool:
        found = list(
            with_progress(pool.map(one, wanted), "profiles", total=len(wanted), shown=progress)
        )
    better = [b for _, b in found if b is not None]
    return (
        tuple(f for f, _ in found),
        min(better, key=at.cost_of) if better else None,
    )


@dataclass(frozen=True, eq=False)
class _Side:
    values: list[float]
    lost: list[float]
    end: float
    unbounded: bool
    better: FloatArray | None


def profile(at: Optimum, what: Quantity) -> tuple[Profile, FloatArray | None]:
    """Profile one quantity around an optimum.

    Returns
    -------
    profile : Profile
    better : array, shape (parameters,), or None
        A point of higher likelihood, where one was come upon.
    """
    sides = [_side(at, what, s) for s in (-1.0, 1.0)]
    centre = what.of(at.p)
    values = np.array([*sides[0].values, centre, *sides[1].values])
    lost = np.array([*sides[0].lost, 0.0, *sides[1].lost])
    order = np.argsort(values)
    found = Profile(
        what.name,
        as_float64(values[order]),
        as_float64(lost[order]),
        sides[0].end,
        sides[1].end,
        sides[0].unbounded,
        sides[1].unbounded,
    )
    return found, next((s.better for s in sides if s.better is not None), None)


def _side(at: Optimum, what: Quantity, sign: float) -> _Side:
    centre, box = what.of(at.p), at.box
    across, variance = at.across(what)
    side = _Side([], [], centre, True, None)
    if not (np.isfinite(centre) and np.isfinite(variance) and variance > 0.0):
        return side
    limit = sign * np.inf
    if what.column is not None:
        i = box.columns.index(what.column)
        limit = box.upper[i] if sign > 0.0 else box.lower[i]
    std = np.sqrt(variance)
    furthest = abs(limit - centre) if np.isfinite(limit) else max(20.0 * std, 3.0 * abs(centre))
    if furthest <= 1e-9 * max(abs(centre), 1.0):
        return side
    distance = min(LEVEL * std, furthest)
    inside, outside, longest = (0.0, 0.0, at.p), (np.inf, np.inf), np.inf  # longest step
    along = box.on_scales(at.p, across / variance)
    for _ in range(_POINTS):
        start = _moved(inside[2], box, along, what, centre + sign * distance)
        there, loss = _pinned(at, start, what, centre + sign * distance, std)
        if loss < -_BETTER:
            return replace(side, better=there)
        step, distance = distance - inside[0], sign * (what.of(there) - centre)
        if not np.isfinite(loss) or not np.isfinite(distance) or distance <= 0.0:
            break
        root = np.sqrt(2.0 * max(loss, 0.0))
        if root > _ASTRAY * LEVEL:
            # The search may have lost the valley: what it found says nothing of this value.
            longest = 0.5 * step
            if longest < _CLOSE * inside[0]:
                return replace(side, end=centre + sign * inside[0], unbounded=False)
            distance = inside[0] + longest
            continue
        side.values.append(centre + sign * distance)
        side.lost.append(max(loss, 0.0))
        if abs(root - LEVEL) < _CLOSE * LEVEL:
            # The last step is small: along a straight root.
            distance *= LEVEL / root if inside[0] == 0.0 else 1.0
            return replace(side, end=centre + sign * distance, unbounded=False)
        if root < LEVEL:
            if distance <= inside[0]:
                break  # the wish is not heard any more
            # From here on the valley goes on as it came.
            came = box.apart(inside[2][box.columns], there[box.columns])
            along = came / (sign * (distance - inside[0]))
            inside = (distance, root, there)
            longest *= 2.0
            if distance >= furthest * (1.0 - 1e-9):
                break
        else:
            outside = (distance, root)
        distance = min(_next(inside, outside), inside[0] + longest, furthest)
    if np.isfinite(outside[0]):
        end = np.interp(LEVEL, [inside[1], outside[1]], [inside[0], outside[0]])
        return replace(side, end=centre + sign * float(end), unbounded=False)
    return replace(side, end=centre + sign * (furthest if np.isfinite(limit) else inside[0]))


def lost_at(at: Optimum, what: Quantity, value: float) -> float:
    """Log-likelihood lost where the quantity is held at `value`, searched for from the optimum."""
    across, variance = at.across(what)
    if not (np.isfinite(variance) and variance > 0.0):
        return np.inf
    along = at.box.on_scales(at.p, across / variance)
    start = _moved(at.p, at.box, along, what, value)
    return _pinned(at, start, what, value, float(np.sqrt(variance)))[1]


def _felt(what: Quantity, p: FloatArray) -> FloatArray:
    """Gradient of a quantity by what moves it smoothly.

    The slip at the peak changes infinitely fast where E loses the peak: there the others move it.
    """
    slope = what.slope(p)
    return as_float64(np.where(np.isfinite(slope), slope, 0.0))


def _moved(p: FloatArray, box: Box, along: FloatArray, what: Quantity, target: float) -> FloatArray:
    """From a point that is known, along the direction that costs least, to a quantity's target.

    On the parameters' scales: where B, C and D move by shares B C D stays what it is, which a
    straight line leaves.

    Parameters
    ----------
    along : array, shape (free parameters,)
        Change of the free parameters, on their scales, with the quantity.
    """
    x, now = p[box.columns], what.of(p)
    step = along * (target - now)
    there = p
    for _ in range(_AIMED):
        there = box.put(p, box.moved(x, step))
        reached = what.of(there) - now
        if not (np.isfinite(reached) and reached * (target - now) > 0.0):
            break
        step = step * min((target - now) / reached, _STEP)
    return there


def _next(inside: tuple[float, float, FloatArray], outside: tuple[float, float]) -> float:
    """Distance at which to look next for the level."""
    if np.isinf(outside[0]):
        return float(inside[0] * np.clip(LEVEL / max(inside[1], 1e-9), 1.15, _STEP))
    share = (LEVEL - inside[1]) / (outside[1] - inside[1])
    return float(inside[0] + np.clip(share, 0.1, 0.9) * (outside[0] - inside[0]))


def _pinned(
    at: Optimum, start: FloatArray, what: Quantity, target: float, std: float
) -> tuple[FloatArray, float]:
    """Best other parameters with the quantity held at `target`, and the likelihood lost."""
    box = at.box
    if what.column is not None:
        i = box.columns.index(what.column)
        others = [j for j in range(len(box.columns)) if j != i]
        there = start.copy()
        there[what.column] = float(np.clip(target, box.lower[i], box.upper[i]))
        inner = Box([box.columns[j] for j in others], box.lower[others], box.upper[others])
        there = at.bottom(at.objective, there, inner)
        return there, at.cost_of(there) - at.cost
    weight = _STIFF / std

    def wish(p: FloatArray) -> tuple[FloatArray, FloatArray]:
        error = np.array([weight * (target - what.of(p))])
        return error, weight * _felt(what, p)[None, :]

    there = at.bottom(at.objective.also(wish), start, box)
    return there, at.cost_of(there) - at.cost
