"""Searches from a space-filling set of starts, and where each of them ended."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING

import numpy as np
from scipy.stats import qmc
from tqdm.auto import tqdm

from .._arrays import FloatArray, as_float64
from .._style import AFTER, BEFORE, axes_or_new, tidy
from .._threads import Workers
from ..errors import NumericalError
from ..identify.search import Box
from .descent import descend, settle, walk
from .likelihood import Likelihood

if TYPE_CHECKING:
    from matplotlib.axes import Axes

__all__ = ["Ends", "multistart", "start_points"]

_SAME_OPTIMUM = 1.0  # nats
_SAME_POINT = 1e-4  # of the box's width


@dataclass(frozen=True, eq=False)
class Ends:
    """Every start of a search and where it ended.

    Attributes
    ----------
    names : tuple of str
        The free parameters.
    begin, end : array, shape (starts, parameters)
    log_likelihood : array, shape (starts,)
        At the ends, all under the same noise; minus infinity where the search broke down.
    """

    names: tuple[str, ...]
    begin: FloatArray
    end: FloatArray
    log_likelihood: FloatArray

    @property
    def agrees(self) -> FloatArray:
        """1 where a start ended within one unit of log-likelihood of the best, 0 elsewhere."""
        return as_float64(self.log_likelihood > np.max(self.log_likelihood) - _SAME_OPTIMUM)

    @property
    def share(self) -> float:
        """Share of the starts that ended at the best optimum."""
        return float(self.agrees.mean())

    def __str__(self) -> str:
        several = len(self.end) > 1
        return (
            f"{int(self.agrees.sum())} of {len(self.end)} start{'s' * several} "
            f"{'end' if several else 'ends'} at the best optimum "
            f"(log-likelihood {np.max(self.log_likelihood):.1f})"
        )

    def plot(self, name: str, ax: Axes | None = None) -> Axes:
        """Draw where one parameter began and ended.

        Parameters
        ----------
        name : str
            One of `names`.
        ax : matplotlib Axes, optional

        Returns
        -------
        matplotlib Axes
        """
        ax = axes_or_new(ax, 5.0, 3.2)
        i = self.names.index(name)
        for begin, end, there in zip(self.begin[:, i], self.end[:, i], self.agrees, strict=True):
            colour = AFTER if there else BEFORE
            ax.plot([0.0, 1.0], [begin, end], "-o", color=colour, markersize=3, linewidth=0.7)
        ax.set_xticks([0.0, 1.0], ["start", "end"])
        return tidy(ax, ylabel=name)


def start_points(
    given: FloatArray, box: Box, moved: list[int], starts: int, seed: int
) -> FloatArray:
    """The given point, then points that fill the whole box evenly (Sobol sequence).

    Parameters
    ----------
    given : array, shape (free,)
    box : Box
    moved : list of int
        Which of the free parameters the points spread over; the others stay as given.
    starts, seed : int

    Returns
    -------
    array, shape (starts, free)
    """
    points = np.tile(np.clip(given, box.lower, box.upper), (starts, 1))
    if starts > 1:
        unit = qmc.Sobol(len(moved), seed=seed).random(1 << (starts - 1).bit_length())
        low, high = box.lower[moved], box.upper[moved]
        points[1:, moved] = low + unit[: starts - 1] * (high - low)
    return as_float64(points)


_Search = Callable[[FloatArray], tuple[FloatArray, float]]


@dataclass(frozen=True)
class _Runner:
    """Runs searches side by side; starts that have met share the rest of their way."""

    box: Box
    workers: int
    progress: bool

    def all_of(self, search: _Search, points: FloatArray) -> tuple[FloatArray, FloatArray]:
        width = self.box.upper - self.box.lower
        place = np.round((points[:, self.box.columns] - self.box.lower) / width / _SAME_POINT)
        _, first, which = np.unique(place, axis=0, return_index=True, return_inverse=True)
        with Workers(self.workers) as pool:
            found = pool.map(lambda i: _guarded(search, points[i]), first)
            bar = tqdm(found, total=len(first), desc="searches", disable=not self.progress)
            ends, values = zip(*bar, strict=True)
        back = which.ravel()  # NumPy 2.0 gives it another shape
        return as_float64(np.array(ends)[back]), as_float64(np.array(values)[back])


def _guarded(search: _Search, p: FloatArray) -> tuple[FloatArray, float]:
    try:
        # A car that spins in the model on its way costs numbers beyond all range.
        with np.errstate(over="ignore", invalid="ignore"):
            end, value = search(p)
    except (NumericalError, np.linalg.LinAlgError):
        return p, -np.inf
    return end, value if np.isfinite(value) else -np.inf


def multistart(
    objective: Likelihood,
    rough: Likelihood,
    regression: _Search,
    p: FloatArray,
    box: Box,
    begins: FloatArray,
    names: tuple[str, ...],
    loose: FloatArray,
    *,
    method: str,
    workers: int,
    progress: bool,
) -> tuple[FloatArray, FloatArray, Ends, list[FloatArray]]:
    """Search from every start, in three rounds, each from where the one before ended.

    A regression on the smoothed motion is quick and has few valleys that lead astray. A filter that
    follows the readings closely (`rough`, noise `loose`) has less bias. The likelihood itself, with
    the noise learned at the best end, decides; there each end is also tried along the tyres that
    look alike.

    Returns
    -------
    p : array, shape (parameters,)
        The best end.
    noise : array, shape (7,)
    ends : Ends
    others : list of array
        Other optima found on the way, for a closer look.
    """
    runner = _Runner(box, workers, progress)
    points = np.tile(p, (len(begins), 1))
    points[:, box.columns] = begins
    ends, _ = runner.all_of(regression, as_float64(points))
    ends, values = runner.all_of(lambda x: descend(rough, x, loose, box, method=method), ends)
    noise = loose
    others: dict[float, list[FloatArray]] = {}
    # The noise learned at a poor end hides better ones: it is learned again as ends get better. To
    # walk takes long, and is for ends that are as good as they get without.
    for walks in (False, True, False, True, False, True):
        if not np.isfinite(values).any():
            raise NumericalError(
                "no start led to a finite likelihood; check units, signs and the timing of the "
                "inputs"
            )
        if not walks:
            _, noise, _ = settle(objective, ends[int(np.argmax(values))], noise, box, method=method)
            go = partial(descend, objective, noise=noise, box=box, method=method)
            ends, values = runner.all_of(go, ends)
            continue

        def search(x: FloatArray, told: FloatArray = noise) -> tuple[FloatArray, float]:
            value = objective.problem.freeze(x, told).log_likelihood - objective.prior_cost(x)
            end, value, found = walk(objective, x, value, told, box)
            others[value] = found
            return end, value

        before = float(np.max(values))
        ends, values = runner.all_of(search, ends)
        if np.max(values) < before + _SAME_OPTIMUM:
            break
    best = int(np.argmax(values))
    table = Ends(names, begins, as_float64(ends[:, box.columns]), values)
    return ends[best], noise, table, others.get(float(values[best]), [])
