"""Intervals from the profile likelihood: how far a value may move before the data object.

The other parameters are fitted anew at every value (Raue et al., Bioinformatics 25, 2009). Where
B, C, D and E copy each other along a bent valley the information matrix, which sees only its
direction at the optimum, promises far too much; the profile follows the valley.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ..._common.arrays import FloatArray, as_float64
from ..._common.progress import with_progress
from ..._common.style import AFTER, FLOOR, axes_or_new, tidy
from ..._common.text import number
from ..._common.threads import Workers
from .quantities import Quantity
from .side import LEVEL, Optimum, moved, pinned, side_of

if TYPE_CHECKING:
    from matplotlib.axes import Axes


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


def profile(at: Optimum, what: Quantity) -> tuple[Profile, FloatArray | None]:
    """Profile one quantity around an optimum.

    Returns
    -------
    profile : Profile
    better : array, shape (parameters,), or None
        A point of higher likelihood, where one was come upon.
    """
    sides = [side_of(at, what, s) for s in (-1.0, 1.0)]
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


def lost_at(at: Optimum, what: Quantity, value: float) -> float:
    """Log-likelihood lost where the quantity is held at `value`, searched for from the optimum."""
    across, variance = at.across(what)
    if not (np.isfinite(variance) and variance > 0.0):
        return np.inf
    along = at.box.on_scales(at.p, across / variance)
    start = moved(at.p, at.box, along, what, value)
    return pinned(at, start, what, value, float(np.sqrt(variance)))[1]
