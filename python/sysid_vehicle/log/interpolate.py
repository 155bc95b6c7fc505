"""A channel between its samples, so that noise that was white stays so.

A straight line averages the noise of two samples: what is read off it half way has half the
variance and correlates with its neighbours, as if the sensor had a low-pass.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from .._common.arrays import FloatArray

_HALF_TAPS = 8  # of the interpolation, on either side
_KAISER = 6.0  # its window's shape
_JITTER = 0.5  # of the period, below which the place of each sample is known
_SAME = 1e-6  # of the period: as near a sample it is that sample
_ROWS = 1 << 15  # that are worked on at once
# What times are written in: decimals, or the bits that numbers of 32 bits have after hours.
_QUANTA = (*(10.0**-k for k in range(2, 7)), *(2.0**-k for k in range(4, 16)))
ROUNDED = 0.55
"""Of a quantum, by which times that are written in it are off a straight line."""

_LAGS = np.arange(-_HALF_TAPS + 1, _HALF_TAPS + 1)


def quantum_of(time_s: FloatArray) -> float:
    """Return the largest quantum of which all times are multiples; 0 if there is none."""
    for quantum in _QUANTA:
        ticks = time_s / quantum
        if np.abs(ticks - np.round(ticks)).max() < 1e-3:
            return quantum
    return 0.0


@dataclass(frozen=True)
class Even:
    """Times at a rate, ``begin_s + period_s place + late_s``.

    Attributes
    ----------
    begin_s, period_s : float
    place : ndarray of int, shape (n,)
        Rising; places may be left out, as where samples are lost.
    late_s : ndarray, shape (n,)
        What is left, less than half a period; nothing where the times were only rounded.
    """

    begin_s: float
    period_s: float
    place: npt.NDArray[np.intp]
    late_s: FloatArray


def evenness(time_s: FloatArray) -> Even | None:
    """Return rising times, shape (n,), as those of a rate; None where they have none."""
    if time_s.size < 2 * _HALF_TAPS:
        return None
    usual = float(np.median(np.diff(time_s)))
    place = np.concatenate(([0.0], np.cumsum(np.round(np.diff(time_s) / usual))))
    period, offset = (float(x) for x in np.polyfit(place, time_s - time_s[0], 1))
    late = time_s - time_s[0] - offset - period * place
    off = float(np.abs(late).max())
    if off <= ROUNDED * quantum_of(time_s) < 0.5 * period:
        late = np.zeros(time_s.size)
    elif off >= _JITTER * period:
        return None
    if (np.diff(place) < 1.0).any():
        return None
    return Even(float(time_s[0]) + offset, period, place.astype(np.intp), late)


def interpolated(time_s: FloatArray, values: FloatArray, at_s: FloatArray) -> FloatArray:
    """Return the values of a channel at other times, by a sinc in a Kaiser window.

    Samples that are a little early or late are moved to their even times along the slope there,
    which adds little noise. Where the window reaches beyond the ends or over a hole, and of samples
    at no rate, a straight line takes its place. Beyond the ends nothing is known.

    Parameters
    ----------
    time_s, values : ndarray, shape (n,)
        Rising times and values, all finite.
    at_s : ndarray, shape (m,)

    Returns
    -------
    ndarray, shape (m,)

    Notes
    -----
    A. V. Oppenheim, R. W. Schafer, *Discrete-Time Signal Processing*, 3rd ed., sections 4.2 (ideal
    interpolation) and 7.5.3 (the Kaiser window).
    """
    result: FloatArray = np.interp(at_s, time_s, values, np.nan, np.nan)
    even = evenness(time_s)
    if even is None:
        return result
    dense = np.full(int(even.place[-1]) + 1, np.nan)
    dense[even.place] = values
    if even.late_s.any():
        dense[even.place] -= even.late_s * np.gradient(values, time_s)
    beyond = np.full(_HALF_TAPS, np.nan)
    windows = np.lib.stride_tricks.sliding_window_view(
        np.concatenate((beyond, dense, beyond)), _LAGS.size
    )
    u = (at_s - even.begin_s) / even.period_s
    inside = np.flatnonzero((u > -1.0) & (u < dense.size))
    for k in range(0, inside.size, _ROWS):
        rows = inside[k : k + _ROWS]
        first = np.floor(u[rows]).astype(np.intp)
        part = u[rows] - first
        between = (part > _SAME) & (part < 1.0 - _SAME)
        rows, first, part = rows[between], first[between], part[between]
        sharp = np.einsum("ij,ij->i", windows[first + 1], _taps(part))
        whole = np.isfinite(sharp) & np.isfinite(result[rows])
        result[rows[whole]] = sharp[whole]
    return result


def _taps(part: FloatArray) -> FloatArray:
    """Weights of the samples around each time, shape (n, taps); `part` of a period behind one.

    What the window takes from constants and straight lines is given back.
    """
    constant = part.size > 1 and np.ptp(part) < _SAME
    place = _LAGS - (part[:1] if constant else part)[:, None]
    inside = np.sqrt(np.maximum(1.0 - (place / (_HALF_TAPS + 0.5)) ** 2, 0.0))
    window = np.i0(_KAISER * inside)
    taps = np.sinc(place) * window
    taps /= taps.sum(axis=1, keepdims=True)
    w0, w1, w2 = (np.sum(window * place**k, axis=1, keepdims=True) for k in range(3))
    off = np.sum(taps * place, axis=1, keepdims=True)
    taps += off * window * (w1 - w0 * place) / (w0 * w2 - w1**2)
    weights: FloatArray = np.broadcast_to(taps, (part.size, _LAGS.size))
    return weights
