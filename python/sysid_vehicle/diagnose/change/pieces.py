"""What a reference says of how far estimates move with the kind of driving, and how new it is.

What a model lacks acts otherwise at another speed or lateral acceleration, and an effect that
stands in for it is estimated otherwise. So what an estimate is off by is taken as a smooth random
function of the kind of driving, Gaussian with a squared-exponential covariance. Between two drives
it makes estimates differ by its variance times the squared distance of their mean embeddings
(Gretton et al., JMLR 2012), which is nothing where the same is driven. The variance is told by
pieces of the reference: by what their estimates differ beyond white noise (DerSimonian & Laird,
Controlled Clinical Trials 1986), for the distance that the pieces have.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from ..._common.arrays import FloatArray, as_float64
from ...estimate import Driving
from ..evidence.coordinates import BLOCK_S, blocks

_PIECES = 6  # at least, of a short reference
_POINTS = 1500  # of each driving, evenly, of which kinds are compared
_OUTERMOST = 0.005  # at either end: a spike of a sensor is no driving


@dataclass(frozen=True)
class Alike:
    """How like the reference later driving is, in speed and lateral acceleration.

    Attributes
    ----------
    beyond : float
        Share of the later driving at speeds or lateral accelerations that the reference lacks.
    unlike : float
        Squared distance of the mean embeddings: 0 where the same is driven, 2 at most.
    """

    beyond: float
    unlike: float

    def __str__(self) -> str:
        return (
            f"{100.0 * self.beyond:.0f} % of the later driving is at speeds or lateral "
            "accelerations that the reference does not have"
        )


class Pieces:
    """A reference in short pieces, and their kinds of driving.

    Attributes
    ----------
    first : array of int
        First samples.
    """

    def __init__(self, driving: Driving, like: Pieces | None = None) -> None:
        first = blocks(driving, min(BLOCK_S, driving.usable_s / _PIECES))
        self._known = known = _Kind(driving)
        own = np.maximum(known.spread, 1e-9)
        self._width: FloatArray = own if like is None else like._width
        self._among = self._kernel(known.points, known.points)
        every = np.searchsorted(first, np.arange(driving.samples), "right") - 1
        self.cuts = (every, _by_kind(driving))
        self._apart = [self._between(cut[known.at]) for cut in self.cuts]

    def _between(self, of: npt.NDArray[np.intp]) -> float:
        """Mean squared distance of pieces from the whole."""
        apart = []
        for k in np.unique(of):
            own = np.where(of == k, self._known.weights, 0.0)
            off = own / own.sum() - self._known.weights
            apart.append(float(off @ self._among @ off))
        return max(float(np.mean(apart)), 1e-9) if apart else 1.0

    def _kernel(self, a: FloatArray, b: FloatArray) -> FloatArray:
        off = (a[:, None] - b[None]) / self._width
        return as_float64(np.exp(-0.5 * (off**2).sum(axis=2)))

    def variance(self, cut: int, score: FloatArray, information: FloatArray) -> FloatArray:
        """Of what estimates are off by from one kind of driving to the other, as one cut tells.

        Parameters
        ----------
        score, information : array, shape (pieces, k)
            Of each estimate, of each piece alone.

        Returns
        -------
        array, shape (k,)
        """
        whole = np.maximum(information.sum(axis=0), 1e-300)
        told = information > 1e-12 * whole
        own = np.where(told, score / np.where(told, information, 1.0), 0.0)
        mean = score.sum(axis=0) / whole
        Q = (information * (own - mean) ** 2).sum(axis=0)
        excess = np.maximum(Q - np.maximum(told.sum(axis=0) - 1.0, 0.0), 0.0)
        spread = whole - (information**2).sum(axis=0) / whole
        return as_float64(excess / np.maximum(spread, 1e-12 * whole) / self._apart[cut])

    def alike(self, later: Driving) -> Alike:
        """Compare later driving.

        Samples count by the seconds that they last, whatever the rates of the logs.
        """
        known, new = self._known, _Kind(later)
        if not len(known.at) or not len(new.at):
            return Alike(0.0, 0.0)
        low, high = known.range
        beyond = ((new.points < low) | (new.points > high)).any(axis=1)
        own, other = known.weights, new.weights
        cross = self._kernel(new.points, known.points)
        apart = other @ self._kernel(new.points, new.points) @ other - 2.0 * other @ cross @ own
        unlike = float(apart + own @ self._among @ own)
        return Alike(float(other[beyond].sum()), max(unlike, 0.0))


def _by_kind(driving: Driving) -> npt.NDArray[np.intp]:
    """Of each sample the kind: slow to fast by left to right, three of each."""
    speed = driving.channel("vx_mps")
    of = np.zeros(driving.samples, dtype=np.intp)
    for values in (speed, speed * driving.channel("yaw_rate_radps")):
        told = np.isfinite(values)
        if told.any():
            edges = np.quantile(values[told], [1.0 / 3.0, 2.0 / 3.0])
            of = 3 * of + np.searchsorted(edges, np.where(told, values, edges[0]))
    return of


class _Kind:
    """Speed and lateral acceleration v_x r of some driving, with weights that add up to 1."""

    def __init__(self, driving: Driving) -> None:
        speed = driving.channel("vx_mps")
        every = np.column_stack([speed, speed * driving.channel("yaw_rate_radps")])
        told = np.flatnonzero(np.isfinite(every).all(axis=1))
        if len(told) > _POINTS:
            told = told[np.linspace(0, len(told) - 1, _POINTS).astype(np.intp)]
        self.at: npt.NDArray[np.intp] = told
        self.points = as_float64(every[told])
        seconds = 1.0 / np.broadcast_to(driving.sample_rate_hz, driving.samples)[told]
        self.weights = as_float64(seconds / max(float(seconds.sum()), 1e-300))

    @property
    def spread(self) -> FloatArray:
        """Standard deviations."""
        mean = self.weights @ self.points
        return as_float64(np.sqrt(self.weights @ (self.points - mean) ** 2))

    @property
    def range(self) -> FloatArray:
        """Nearly the least and the most, shape (2, 2)."""
        found = []
        for values in self.points.T:
            order = np.argsort(values)
            reached = np.cumsum(self.weights[order])
            at = np.searchsorted(reached, [_OUTERMOST, 1.0 - _OUTERMOST])
            found.append(values[order][np.minimum(at, len(order) - 1)])
        return as_float64(np.transpose(found))
