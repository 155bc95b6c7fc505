"""Searches from a space-filling set of starts, and where each of them ended."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt
import scipy

from ..._common.arrays import FloatArray, as_float64
from ..._common.progress import with_progress
from ..._common.style import AFTER, BEFORE, axes_or_new, tidy
from ..._common.threads import Workers
from ...errors import NumericalError
from ...model import Model
from .search import Box

if TYPE_CHECKING:
    from matplotlib.axes import Axes

SAME_OPTIMUM = 1.0
"""Ends whose log-likelihood differs by less than this [nats] are the same optimum."""

SAME_VALLEY = 1e-2
"""Share of the box: ends less far apart lie in one valley."""

_SAME_POINT = 1e-4  # of the box's width
_FOLLOWED = 2  # ends of searches that are followed with noise of their own

Search = Callable[[FloatArray], tuple[FloatArray, float]]
"""From all parameters at a start to those at its end, and the log-likelihood there."""


@dataclass(frozen=True)
class Start:
    """One start of the search and where it ended."""

    begin: dict[str, float]
    end: dict[str, float]
    log_likelihood: float
    agrees: bool


@dataclass(frozen=True, eq=False)
class Starts:
    """Every start of a search and where it ended; a sequence of `Start`.

    Attributes
    ----------
    names : tuple of str
        The free parameters.
    begin, end : array, shape (starts, parameters)
    log_likelihood : array, shape (starts,)
        At the ends, all under the same noise, on the thinned data that decide between starts; minus
        infinity where the search broke down.
    """

    names: tuple[str, ...]
    begin: FloatArray
    end: FloatArray
    log_likelihood: FloatArray

    @classmethod
    def none(cls, names: tuple[str, ...]) -> Starts:
        """No start at all: of a search that went on from an earlier one."""
        empty = np.empty((0, len(names)))
        return cls(names, empty, empty, np.empty(0))

    def __len__(self) -> int:
        return len(self.log_likelihood)

    def __getitem__(self, i: int) -> Start:
        begin, end = (
            dict(zip(self.names, map(float, points[i]), strict=True))
            for points in (self.begin, self.end)
        )
        return Start(begin, end, float(self.log_likelihood[i]), bool(self.agrees[i]))

    def __iter__(self) -> Iterator[Start]:
        return (self[i] for i in range(len(self)))

    @property
    def agrees(self) -> npt.NDArray[np.bool_]:
        """Which starts ended within one unit of log-likelihood of the best."""
        best = np.max(self.log_likelihood, initial=-np.inf)
        return np.asarray(self.log_likelihood > best - SAME_OPTIMUM)

    @property
    def share(self) -> float:
        """Share of the starts that ended at the best optimum."""
        return float(self.agrees.mean())

    @property
    def agreement(self) -> str:
        """How many starts ended at the best optimum, in words."""
        several = len(self) > 1
        return (
            f"{int(self.agrees.sum())} of {len(self)} start{'s' * several} "
            f"{'end' if several else 'ends'} at the best optimum"
        )

    def __str__(self) -> str:
        return f"{self.agreement} (log-likelihood {np.max(self.log_likelihood):.1f})"

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


def space_filling(
    given: FloatArray,
    low: FloatArray,
    high: FloatArray,
    starts: int,
    seed: int,
    moved: list[int] | None = None,
) -> FloatArray:
    """The given point, then points that fill a box evenly (Sobol sequence).

    Parameters
    ----------
    given, low, high : array, shape (free,)
    starts, seed : int
    moved : list of int, optional
        Which of the parameters the points spread over; the others stay as given. All of them if
        left out.

    Returns
    -------
    array, shape (starts, free)
    """
    points = np.tile(given, (starts, 1))
    where = list(range(len(given))) if moved is None else moved
    if starts > 1 and where:
        unit = scipy.stats.qmc.Sobol(len(where), seed=seed).random(1 << (starts - 1).bit_length())
        points[1:, where] = low[where] + unit[: starts - 1] * (high - low)[where]
    return as_float64(points)


@dataclass(frozen=True)
class Runner:
    """Runs searches side by side; starts that have met share the rest of their way.

    Parameters
    ----------
    box : Box
    workers : int or None
    progress : bool or None
    same : float
        Points no farther apart have met, as a share of the box.
    """

    box: Box
    workers: int | None
    progress: bool | None
    same: float = _SAME_POINT

    def all_of(self, search: Search, points: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Ends and their log-likelihoods, from points of shape (starts, parameters).

        Raises
        ------
        NumericalError
            None of them led anywhere.
        """
        above = points[:, self.box.columns] - self.box.lower
        place = np.round(above / self.box.width / self.same)
        _, first, which = np.unique(place, axis=0, return_index=True, return_inverse=True)
        with Workers(self.workers) as pool:
            found = pool.map(lambda i: _guarded(search, points[i]), first)
            bar = with_progress(found, "starts", total=len(first), shown=self.progress)
            ends, values = zip(*bar, strict=True)
        if not np.isfinite(values).any():
            raise NumericalError(
                "no start led to a finite likelihood; check units, signs and the timing of the "
                "inputs"
            )
        back = which.ravel()  # NumPy 2.0 gives it another shape
        return as_float64(np.array(ends)[back]), as_float64(np.array(values)[back])


def _guarded(search: Search, p: FloatArray) -> tuple[FloatArray, float]:
    try:
        # A car that spins in the model on its way costs numbers beyond all range.
        with np.errstate(over="ignore", invalid="ignore"):
            end, value = search(p)
    except (NumericalError, np.linalg.LinAlgError):
        return p, -np.inf
    return end, value if np.isfinite(value) else -np.inf


def apart(ends: FloatArray, values: FloatArray, box: Box) -> list[FloatArray]:
    """The best few ends of searches, each in a valley of its own."""
    found: list[FloatArray] = []
    for i in np.argsort(-values, kind="stable"):
        known = any(box.near(ends[i], other, SAME_VALLEY) for other in found)
        if np.isfinite(values[i]) and not known:
            found.append(ends[i])
        if len(found) == _FOLLOWED:
            break
    return found


def at_typical_sizes(model: Model, p: FloatArray) -> Iterator[FloatArray]:
    """Parameters with one effect at its typical size, for each that is far from it.

    A lag that hardly lags has dynamics of its own, and noise is learned to suit them: from there
    no search leads back.
    """
    for e in model.parts:
        lead = e.parameters[0]
        if e.id in model.nuisances or f"{e.id}.{lead.name}" not in model.free_names:
            continue
        if lead.another_dynamics(float(p[lead.column])):
            other = p.copy()
            other[lead.column] = lead.typical
            yield other
