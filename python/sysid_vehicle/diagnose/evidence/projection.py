"""Linear algebra of directions: what columns span, what remains of them, how evenly it adds up.

Columns are sensitivities of whitened residuals, sample by sample, channel by channel; residuals of
a complete model are white with variance 1 along every direction.
"""

from __future__ import annotations

import numpy as np

from ... import _core
from ..._common.arrays import FloatArray, as_float64

COPIED = 1e-7  # of the largest singular value, below which a direction is a copy of others
_SINGULAR = 1e-6  # the same of the eigenvalues of an information matrix
_LAGS = (10, 30, 100)
_ROWS = 256  # samples at once, which stay in the cache
_TERMS = 8192  # terms at once


def orthonormal_basis(columns: FloatArray) -> FloatArray:
    """Orthonormal basis of the columns; directions that are copies of others are left out.

    Parameters
    ----------
    columns : array, shape (n, m)

    Returns
    -------
    array, shape (n, rank)
    """
    if not columns.shape[1]:
        return columns
    scaled = columns / np.maximum(np.linalg.norm(columns, axis=0), 1e-300)
    u, s, _ = np.linalg.svd(scaled, full_matrices=False)
    kept: FloatArray = u[:, s > COPIED * s[0]]
    return kept


def pseudo_inverse(information: FloatArray, least: float = _SINGULAR) -> tuple[FloatArray, int]:
    """Inverse of an information matrix without directions it says nothing of, and its rank.

    It says nothing of those whose eigenvalue is below so much of the largest.
    """
    scale = np.sqrt(np.maximum(np.diag(information), 1e-300))
    if len(scale) == 1:
        return 1.0 / np.outer(scale, scale), 1
    values, vectors = np.linalg.eigh(information / np.outer(scale, scale))
    kept = values > least * values[-1]
    inverse = (vectors[:, kept] / values[kept]) @ vectors[:, kept].T
    return inverse / np.outer(scale, scale), int(kept.sum())


def variance_ratio(direction: FloatArray, e: FloatArray) -> float:
    """Long-run over naive variance of the score along one direction, at least 1.

    Parameters
    ----------
    direction, e : array, shape (5 n,)
    """
    return max(long_run_ratio(direction[:, None], e), 1.0)


def long_run_ratio(directions: FloatArray, e: FloatArray) -> float:
    """Long-run over naive variance of the score, the largest over some directions.

    Parameters
    ----------
    directions : array, shape (5 n, m)
    e : array, shape (5 n,)
        Residuals without what the directions explain of them.
    """
    by_sample = (-1, _core.CHANNELS)
    terms = np.einsum(
        "kcj,kc->kj", directions.reshape(*by_sample, directions.shape[1]), e.reshape(by_sample)
    )
    return float(np.max(long_run_ratios(terms, np.einsum("ij,ij->j", directions, directions))))


def score_terms(
    directions: FloatArray, e: FloatArray, sizes: FloatArray, along: FloatArray | None = None
) -> FloatArray:
    """What each sample adds to the score along each of many directions, by chance.

    Parameters
    ----------
    directions : array, shape (5 n, m)
    e : array, shape (5 n,)
    sizes : array, shape (m, k)
        `directions @ sizes[:, j]` is taken off before the score along direction j.
    along : array, shape (m, k), optional
        The score is along `directions @ along`; else along each of the directions.

    Returns
    -------
    array, shape (n, k)
    """
    channels = _core.CHANNELS
    samples, width = len(e) // channels, sizes.shape[1]
    terms = np.empty((samples, width))
    for begin in range(0, samples, _ROWS):
        rows = slice(channels * begin, channels * (begin + _ROWS))
        R = directions[rows]
        adds = (e[rows, None] - R @ sizes) * (R if along is None else R @ along)
        terms[begin : begin + _ROWS] = adds.reshape(len(adds) // channels, channels, width).sum(
            axis=1
        )
    return terms


class LongRun:
    """Long-run over naive variance of sums of terms that come piece by piece.

    Bartlett weights over 10, 30 and 100 samples (Newey & West, Econometrica 1987), which are those
    of sums over all windows of so many; the largest counts, each less what it may be by chance: few
    lags see little of slow disturbances, and many scatter too much to see what does not.

    Parameters
    ----------
    samples, width : int
        Of all pieces; columns.
    """

    def __init__(self, samples: int, width: int) -> None:
        self._samples, self._most = samples, min(max(_LAGS), samples // 10)
        self._sums = np.zeros((self._most + 1, width))  # up to the last samples
        self._squares = {min(lags, self._most): np.zeros(width) for lags in _LAGS}

    def add(self, terms: FloatArray) -> None:
        """Go on with terms without their mean, shape (n, width)."""
        for first in range(0, len(terms), _TERMS):
            some = terms[first : first + _TERMS]
            sums = np.concatenate([self._sums, some])
            np.cumsum(some, axis=0, out=sums[self._most + 1 :])
            sums[self._most + 1 :] += self._sums[-1]
            for lags, squares in self._squares.items():
                begin = self._most - lags
                windows = sums[self._most + 1 :] - sums[begin : begin + len(some)]
                squares += np.einsum("ij,ij->j", windows, windows)
            self._sums = sums[len(some) :].copy()

    def ratios(self, naive: FloatArray) -> FloatArray:
        """After the last terms; `naive` is the variance of their sums, were they independent."""
        self.add(np.zeros((self._most, self._sums.shape[1])))
        found = np.zeros(self._sums.shape[1])
        for lags, squares in self._squares.items():
            # An estimate from so many lags scatters: what it cannot tell from 1 counts as 1.
            uncertainty = float(np.sqrt(4.0 * lags / (3.0 * self._samples)))
            np.maximum(found, squares / (lags + 1) / (1.0 + 2.0 * uncertainty), out=found)
        return as_float64(found / np.maximum(naive, 1e-300))


def long_run_ratios(terms: FloatArray, naive: FloatArray) -> FloatArray:
    """Long-run over naive variance (`LongRun`) of sums of terms, column by column.

    Parameters
    ----------
    terms : array, shape (n, m)
    naive : array, shape (m,)
        Variance of their sums, were they independent.
    """
    found = LongRun(*terms.shape)
    found.add(terms - terms.mean(axis=0))
    return found.ratios(naive)
