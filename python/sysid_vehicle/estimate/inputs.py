"""Measured inputs without their white noise, corners kept.

Noise on the steering angle enters the predicted acceleration. A model that lags, filters that noise
and predicts better for the wrong reason: on complete data it is found as a false relaxation length.
So the noise is taken out where the signal is smooth enough to tell: each sample is a local
polynomial over the longest symmetric window that agrees with all shorter ones (intersection of
confidence intervals; Goldenshluger & Nemirovski, Mathematical Methods of Statistics 1997;
Katkovnik, IEEE Transactions on Signal Processing 1999). At a corner the window shrinks to the
sample itself.

The polynomial is of sixth degree: one of second degree flattens the crests of a fast sweep by less
than it can notice in one place, but everywhere alike, and a test over the whole drive notices.

A coarse count makes stairs of a smooth signal, whose corners would be kept: a lag that smooths them
predicts better, too. So a reading is first put where its neighbours ask for, within half a count.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from .._common.arrays import NORMAL_MAD, FloatArray, as_float64
from ..sensors import quantum

_HALF_WIDTHS = (4, 6, 9, 12)
_DEGREE = 6
_AGREES = 1.8  # standard deviations


def white_noise_std(y: FloatArray, block: int | None = None) -> float:
    """White noise of a signal from its third differences, which smooth driving hardly enters.

    NaN stands for missing samples, whose neighbours count as such; 0 where there are too few to
    tell. Noise that pauses is a
    mixture whose median tells little: with `block`, the root mean variance of stretches of so many
    samples is returned.
    """
    d = np.diff(y[np.isfinite(y)], n=3)
    parts = [d] if block is None else np.array_split(d, max(len(d) // block, 1))
    # 20 = 1 + 9 + 9 + 1; the median stands a few corners in the signal.
    variances = [
        (NORMAL_MAD * np.median(np.abs(part - np.median(part)))) ** 2 / 20.0
        for part in parts
        if len(part) >= 20
    ]
    return float(np.sqrt(np.mean(variances))) if variances else 0.0


def quiet(y: FloatArray) -> FloatArray:
    """The signal with its white noise and its stairs reduced; shape (n,), no gaps."""
    y = without_stairs(y)
    noise = white_noise_std(y)
    out = y.copy()
    if noise == 0.0:
        return out
    low, high = y - _AGREES * noise, y + _AGREES * noise
    growing = np.ones(len(y), dtype=bool)
    for half in _HALF_WIDTHS:
        if len(y) <= 2 * half:
            break
        weights = _weights(half)
        local = np.convolve(y, weights, "valid")
        spread = _AGREES * noise * float(np.linalg.norm(weights))
        inner = slice(half, len(y) - half)
        low[inner] = np.maximum(low[inner], local - spread)
        high[inner] = np.minimum(high[inner], local + spread)
        growing[inner] &= low[inner] <= high[inner]
        growing[:half] = growing[len(y) - half :] = False
        out[inner] = np.where(growing[inner], local, out[inner])
    return out


def without_stairs(y: FloatArray) -> FloatArray:
    """The signal between the counts of its sensor, within half a count of each; shape (n,).

    Where a reading goes on by one count, the signal is half-way; the middle of a crest is the
    crest, and what goes on by more is what it reads.
    """
    count = quantum(y)
    change = np.diff(y)
    at = np.flatnonzero(change)
    if count == 0.0 or at.size == 0:
        return y
    single = np.abs(change[at]) < 1.5 * count
    slow, quick = at[single], at[~single]
    turns = np.flatnonzero(np.diff(np.sign(change[at])))
    crests = 0.5 * (at[turns] + 1 + at[turns + 1])
    places = np.concatenate([[0.0, y.size - 1.0], slow + 0.5, quick, quick + 1.0, crests])
    values = np.concatenate(
        [y[[0, -1]], 0.5 * (y[slow] + y[slow + 1]), y[quick], y[quick + 1], y[at[turns] + 1]]
    )
    order = np.argsort(places, kind="stable")
    between = np.interp(np.arange(y.size), places[order], values[order])
    return as_float64(np.clip(between, y - 0.5 * count, y + 0.5 * count))


@lru_cache
def _weights(half: int) -> FloatArray:
    """Of the value in the middle of a polynomial by least squares (Savitzky & Golay, 1964)."""
    powers = np.vander(np.linspace(-1.0, 1.0, 2 * half + 1), _DEGREE + 1)
    return as_float64(np.linalg.pinv(powers)[-1])
