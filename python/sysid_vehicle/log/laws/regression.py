"""Robust regression with priors, and the lag at which one side of an equation fits the other."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from ..._common.arrays import NORMAL_MAD, FloatArray

# Of a ratio; a wrong unit leaves 70 % of corners and more within it, spins 20 to 40 %.
_ALIKE = 0.2
_PASSES = 5
_HUBER = 2.5  # residuals beyond so many robust deviations lose weight
_BLOCK = 6  # windows that are taken as dependent when deviations are estimated
_STEP_S = 0.01
_REACH_S = 0.28
_COARSE_S = 0.04
SURE = 3.0  # deviations of what is sure
_ROUNDS = 6  # of two-stage least squares, whose coefficients begin at those of the other
_MOMENT = 3  # windows, each half over the next
_LASTS = 0.5  # of a lag, that changes within a moment show as well
_TINY = 1e-12

Sides = Callable[[float], tuple[FloatArray, FloatArray]]


@dataclass(frozen=True)
class Regression:
    """``y = X b`` fitted robustly.

    Attributes
    ----------
    coefficients : ndarray, shape (p,)
        The maximum of the posterior.
    deviations : ndarray, shape (p,)
        Their standard deviations, from the scores of blocks of rows (White, *Econometrica* 48
        (1980), for dependent rows).
    weights : ndarray, shape (n,)
        Huber weights of the rows.
    scale : float
        Robust standard deviation of the residuals.
    coherence : float
        Squared correlation of `y` with the first column, the other columns taken out of both.
    remaining : float
        Size of `y` once the other columns are taken out, which few rows exceed.
    driving : float
        The same of the first column.
    """

    coefficients: FloatArray
    deviations: FloatArray
    weights: FloatArray
    scale: float
    coherence: float
    remaining: float
    driving: float


@dataclass(frozen=True)
class Lag:
    """Lag at which two sides of an equation fit, with standard deviation, both in s.

    `gain` is the misfit without a lag over that with it, `evidence` their difference in units of
    the variance of the residuals.
    """

    seconds: float
    deviation: float
    gain: float
    evidence: float

    def beyond(self, late_s: float, early_s: float) -> bool:
        """Whether the lag surely leaves ``-early_s .. late_s`` and lies inside what was tried."""
        sure = abs(self.seconds) - SURE * self.deviation
        limit = late_s if self.seconds > 0.0 else early_s
        return sure > limit and abs(self.seconds) < _REACH_S - 0.5 * _COARSE_S


def regress(y: FloatArray, x: FloatArray, mean: FloatArray, spread: FloatArray) -> Regression:
    """Fit ``y = x b`` with Huber's weights and independent normal priors.

    Parameters
    ----------
    y : ndarray, shape (n,)
    x : ndarray, shape (n, p)
    mean, spread : ndarray, shape (p,)
        Prior of each coefficient; an infinite spread leaves it free.
    """
    b, weights, scale = fitted(y, x, mean, spread)
    _, deviations = _sandwich(x, y - x @ b, spread, weights, scale)
    return Regression(b, deviations, weights, scale, *_alone(y, x, weights))


def fitted(
    y: FloatArray, x: FloatArray, mean: FloatArray, spread: FloatArray
) -> tuple[FloatArray, FloatArray, float]:
    """Coefficients, weights and scale of `regress`, without the rest: half of its time."""
    weights, scale, b = np.ones(y.size), float(np.std(y)) + _TINY, mean
    for _ in range(_PASSES):
        b = _solve(y, x, mean, spread, weights, scale)
        residual = y - x @ b
        scale = NORMAL_MAD * _median(np.abs(residual - _median(residual))) + _TINY
        weights = np.minimum(1.0, _HUBER * scale / np.maximum(np.abs(residual), _TINY))
    return b, weights, scale


def _median(values: FloatArray) -> float:
    """Of numbers: that of NumPy, which looks for NaN as well, takes three times as long."""
    middle = (values.size - 1) // 2, values.size // 2
    low, high = np.partition(values, middle)[list(middle)]
    return 0.5 * (float(low) + float(high))


def find_lag(
    sides: Sides,
    mean: FloatArray,
    spread: FloatArray,
    usable: np.ndarray,
    instruments: FloatArray | None = None,
    enough: Callable[[Lag], bool] = lambda lag: True,
) -> Lag:
    """Return the lag at which both sides fit best.

    Parameters
    ----------
    sides : callable
        Gives ``y`` and ``X`` for a lag [s].
    mean, spread : ndarray, shape (p,)
        As in :func:`regress`.
    usable : ndarray of bool, shape (n,)
        Rows to use.
    instruments : ndarray, shape (n, k), optional
        What moves the columns of ``X`` and is not moved by the residuals. Where columns answer to
        what the equation leaves out the least misfit is at another lag than the true one; with
        instruments that is tested (Hausman, *Econometrica* 46 (1978)), and if it is so, or if
        they lose nothing, the lag is the one of two-stage least squares.
    enough : callable
        Whether gain and evidence of a lag are such that the instruments are to be asked.

    Notes
    -----
    The misfit is profiled over lags from -0.28 to 0.28 s; from its least value Gauss-Newton goes
    on, with the lag as one more coefficient, from which its deviation comes too.
    """

    def rows(lag_s: float) -> tuple[FloatArray, FloatArray]:
        y, x = sides(lag_s)
        return y[usable], x[usable]

    _, weights, scale = fitted(*rows(0.0), mean, spread)

    def misfit(lag_s: float) -> float:
        y, x = rows(lag_s)
        b = _solve(y, x, mean, spread, weights, scale)
        prior = _precision(spread) @ np.square(b - mean)
        return float(weights @ np.square(y - x @ b) + scale**2 * prior)

    lags = coarse_lags()
    profile = [misfit(lag) for lag in lags]
    lag = float(lags[int(np.argmin(profile))])
    deviation = 0.0
    for _ in range(2):
        _, step, deviation = _stepped(rows, lag, mean, spread)
        lag = _moved(lag, step)
    best = max(misfit(lag), _TINY)
    worse = misfit(0.0)
    # The weights' sum stands for the number of rows that count.
    variance = best / max(float(weights.sum()), 1.0)
    found = Lag(lag, deviation, worse / best, (worse - best) / variance)
    if instruments is None or not enough(found):
        return found
    other = _two_stage(rows, lag, mean, spread, instruments[usable])
    lost = math.sqrt(max(other[1] ** 2 - deviation**2, 0.0))
    if abs(other[0] - lag) <= SURE * lost:
        return found
    return replace(found, seconds=other[0], deviation=other[1])


def in_changes(
    lag: Lag,
    sides: Sides,
    mean: FloatArray,
    spread: FloatArray,
    usable: np.ndarray,
    instruments: FloatArray | None = None,
) -> Lag | None:
    """Return a lag, or the surer one of what changes within a moment; None if that hardly lags.

    A driver answers to a road that leans, so that its bank looks like a lag of what turns the car.
    A bank hardly changes in a moment, and a clock that is late is late for quick changes, too.
    Arguments are those of :func:`find_lag`, whose rows are windows in their order.
    """

    def changes(lag_s: float) -> tuple[FloatArray, FloatArray]:
        y, x = sides(lag_s)
        return y[_MOMENT:] - y[:-_MOMENT], x[_MOMENT:] - x[:-_MOMENT]

    moved = None if instruments is None else instruments[_MOMENT:] - instruments[:-_MOMENT]
    both = usable[_MOMENT:] & usable[:-_MOMENT]
    quick = find_lag(changes, mean, spread, both, moved)
    if quick.seconds / lag.seconds < _LASTS:
        return None
    return min(lag, quick, key=lambda found: found.deviation)


def _two_stage(
    rows: Sides, lag: float, mean: FloatArray, spread: FloatArray, instruments: FloatArray
) -> tuple[float, float]:
    """Lag and deviation by what of the columns follows the instruments, from another lag on."""
    b, deviation = None, 0.0
    for _ in range(_ROUNDS):
        b, step, deviation = _stepped(rows, lag, mean, spread, b, instruments)
        b, lag = b + step[:-1], _moved(lag, step)
    return lag, deviation


def _stepped(
    rows: Sides,
    lag: float,
    mean: FloatArray,
    spread: FloatArray,
    b: FloatArray | None = None,
    instruments: FloatArray | None = None,
) -> tuple[FloatArray, FloatArray, float]:
    """Coefficients, those of a regression if none are given; a step of them and the lag beside it.

    Last comes the deviation of the lag.
    """
    y, x = rows(lag)
    (y1, x1), (y0, x0) = rows(lag + _STEP_S), rows(lag - _STEP_S)
    found, weights, scale = fitted(y, x, mean, spread)
    b = found if b is None else b
    slope = ((y1 - x1 @ b) - (y0 - x0 @ b)) / (2.0 * _STEP_S)
    step, deviations = _sandwich(
        np.column_stack([x, -slope]),
        y - x @ b,
        np.append(spread, np.inf),
        weights,
        scale,
        np.append(mean - b, 0.0),
        instruments,
    )
    return b, step, float(deviations[-1])


def _moved(lag: float, step: FloatArray) -> float:
    return float(np.clip(lag + np.clip(step[-1], -_COARSE_S, _COARSE_S), -0.4, 0.4))


def coarse_lags() -> FloatArray:
    """Return the lags at which the misfit is profiled [s]."""
    return np.arange(-_REACH_S, _REACH_S + 0.5 * _COARSE_S, _COARSE_S)


def _precision(spread: FloatArray) -> FloatArray:
    return np.where(np.isfinite(spread), 1.0 / np.square(spread), 0.0)


def _solve(
    y: FloatArray,
    x: FloatArray,
    mean: FloatArray,
    spread: FloatArray,
    weights: FloatArray,
    scale: float,
) -> FloatArray:
    """Return the coefficients for given weights and scale."""
    prior = _precision(spread)
    matrix = x.T @ (x * weights[:, None]) / scale**2 + np.diag(prior)
    matrix += np.diag(_TINY * np.diag(matrix) + 1e-200)
    right = x.T @ (weights * y) / scale**2 + prior * mean
    return np.asarray(np.linalg.lstsq(matrix, right, rcond=None)[0], dtype=np.float64)


def _sandwich(
    x: FloatArray,
    residual: FloatArray,
    spread: FloatArray,
    weights: FloatArray,
    scale: float,
    offset: FloatArray | None = None,
    instruments: FloatArray | None = None,
) -> tuple[FloatArray, FloatArray]:
    """Return the step to the best coefficients, and their deviations from blocks of scores."""
    prior = _precision(spread)
    root = np.sqrt(weights)[:, None]
    rows = root * x
    if instruments is not None:
        first = root * instruments
        rows = first @ np.linalg.lstsq(first, rows, rcond=None)[0]
    matrix = rows.T @ rows / scale**2 + np.diag(prior)
    inverse = np.linalg.pinv(matrix, hermitian=True)
    scores = rows * root * residual[:, None] / scale**2
    right = scores.sum(axis=0) + (0.0 if offset is None else prior * offset)
    starts = np.arange(0, residual.size, _BLOCK)
    blocks = np.add.reduceat(scores, starts, axis=0)
    # Few blocks have fitted residuals that are too small.
    few = starts.size / max(starts.size - x.shape[1], 1)
    covariance = inverse @ (few * blocks.T @ blocks + np.diag(prior)) @ inverse
    return inverse @ right, np.sqrt(np.maximum(np.diag(covariance), 0.0))


def _alone(y: FloatArray, x: FloatArray, weights: FloatArray) -> tuple[float, float, float]:
    """Return coherence, remaining and driving: `y` and the first column without the others."""
    root = np.sqrt(weights)
    pair = np.column_stack([y, x[:, 0]])
    weighted = pair * root[:, None]
    if x.shape[1] > 1:
        taken = np.linalg.lstsq(x[:, 1:] * root[:, None], weighted, rcond=None)[0]
        pair, weighted = pair - x[:, 1:] @ taken, weighted - x[:, 1:] * root[:, None] @ taken
    size = float(weighted[:, 0] @ weighted[:, 0]) * float(weighted[:, 1] @ weighted[:, 1])
    product = float(weighted[:, 0] @ weighted[:, 1]) ** 2
    remaining, driving = (size_of(column) for column in pair.T)
    return product / size if size > 0.0 else 0.0, remaining, driving


def size_of(values: FloatArray) -> float:
    """A size that few values exceed."""
    return float(np.percentile(np.abs(values), 95))


def in_most(ratio: float, x: FloatArray, y: FloatArray, least: float) -> bool:
    """Whether ``y = ratio x`` holds in most places, where either is at least so large.

    A wrong unit has one ratio; a car that spins has any.
    """
    large = np.maximum(np.abs(x), np.abs(y)) > least
    alike = np.abs(y[large] - ratio * x[large]) < _ALIKE * ratio * np.abs(x[large])
    return 2 * int(np.count_nonzero(alike)) > alike.size
