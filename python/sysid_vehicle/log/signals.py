"""Small operations on one channel, all on a uniform grid and aware of NaN."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from .._common.arrays import NORMAL_MAD, FloatArray, filled

# A spike stands out this many times from the local noise, from the quantum of the channel and
# (as a fraction) from its range: below, it could be a quick but true movement.
_SPIKE_NOISE, _SPIKE_QUANTA, _SPIKE_RANGE = 8.0, 3.0, 0.05
_SPIKE_NEIGHBOURS = 0.3  # the neighbours of a spike differ by less than this part of it
_SPIKE_APPROACH = 3.0  # and it exceeds by this factor the steps just before and just after
_SPIKE_WINDOW = 51
# A sensor that drops out stands at one value, which it jumps to and from this many times as far as
# it steps anywhere else; of all samples these are at most that share.
STANDS_JUMP, _STANDS_SHARE = 5.0, 0.05
# Speeds at which the model is run, and the share of its usual top speed for a slow car.
_LEAST_MPS, _LEAST_ANY_MPS, _LEAST_SHARE = 3.0, 1.0, 0.4


def least_speed_mps(speed_mps: FloatArray) -> float:
    """Slowest speed at which the model is run: 3 m/s, less where all the driving is slow.

    Tyres slip little below, and slip angles are noise. Cars on a scale slip at less: it is 0.4 of a
    speed that is seldom exceeded then, and 1 m/s at least.
    """
    usual = float(np.nanpercentile(np.append(speed_mps, 0.0), 95.0))
    return min(_LEAST_MPS, max(_LEAST_SHARE * usual, _LEAST_ANY_MPS))


def runs(mask: np.ndarray) -> list[tuple[int, int]]:
    """Return the half-open index ranges ``(start, stop)`` in which `mask` is true."""
    edges = np.flatnonzero(np.diff(np.concatenate(([False], mask, [False])).astype(np.int8)))
    return [(int(a), int(b)) for a, b in zip(edges[::2], edges[1::2], strict=True)]


def fill_short_gaps(values: FloatArray, longest: int) -> tuple[FloatArray, list[tuple[int, int]]]:
    """Interpolate inner NaN runs of at most `longest` samples; return the runs filled too."""
    gaps = [
        (a, b) for a, b in runs(np.isnan(values)) if b - a <= longest and a > 0 and b < values.size
    ]
    if not gaps:
        return values, []
    dense, result = filled(values), values.copy()
    for a, b in gaps:
        result[a:b] = dense[a:b]
    return result, gaps


def smoothed(values: FloatArray, width: int) -> FloatArray:
    """Return the centred moving average over about `width` samples, NaN interpolated first."""
    half = min(width // 2, (values.size - 1) // 2)
    if half < 1:
        return filled(values)
    padded = np.pad(filled(values), half, mode="edge")
    total = np.concatenate(([0.0], np.cumsum(padded)))
    span = 2 * half + 1
    averaged: FloatArray = (total[span:] - total[:-span]) / span
    return averaged


def median_of_five(values: FloatArray) -> FloatArray:
    """Return the centred running median of five samples."""
    windows = np.lib.stride_tricks.sliding_window_view(np.pad(values, 2, mode="edge"), 5)
    medians: FloatArray = np.median(windows, axis=1)
    return medians


def _local_median(values: FloatArray, at: np.ndarray) -> FloatArray:
    """Return the median of `values` in a window around each index of `at`."""
    half = _SPIKE_WINDOW // 2
    starts = np.clip(at - half, 0, max(values.size - _SPIKE_WINDOW, 0))
    return np.array([np.median(values[s : s + _SPIKE_WINDOW]) for s in starts])


def spikes(values: FloatArray) -> np.ndarray:
    """Return the indices of isolated one-sample spikes.

    A sample is one if its two neighbours agree with each other and it deviates from the median
    of five by far more than the local noise, which is taken as the median magnitude of the second
    difference: that is also large where the channel moves quickly for good reason.
    """
    if values.size < 7:
        return np.empty(0, dtype=np.intp)
    x = filled(values)
    deviation = np.abs(x - median_of_five(x))
    steps = np.abs(np.diff(x))
    quantum = np.min(steps[steps > 0.0], initial=np.inf)
    low, high = np.percentile(x, (1, 99))
    floor = max(_SPIKE_RANGE * (high - low), _SPIKE_QUANTA * quantum if quantum < np.inf else 0.0)
    inner = slice(2, -2)  # only there are both neighbours and the steps beside them known
    candidates = np.flatnonzero((deviation[inner] > floor) & np.isfinite(values[inner])) + 2
    if candidates.size == 0:
        return candidates
    size = deviation[candidates]
    apart = np.abs(x[candidates + 1] - x[candidates - 1])
    beside = np.maximum(steps[candidates - 2], steps[candidates + 1])
    candidates = candidates[(apart < _SPIKE_NEIGHBOURS * size) & (_SPIKE_APPROACH * beside < size)]
    second = np.pad(np.abs(np.diff(x, 2)), 1, mode="edge")
    noise = _local_median(second, candidates)
    return candidates[deviation[candidates] > _SPIKE_NOISE * noise]


def standing(values: FloatArray, fewest: int = 3) -> np.ndarray:
    """Return the samples at which a channel stands at a value that it jumps to and from.

    So reads a sensor that drops out: zero, its last value, or one that says "not available". Both
    jumps, in opposite directions, are far longer than any other step of the channel, and each is
    one step: what moves there and back quickly, such as a steering robot, does it in several.

    Parameters
    ----------
    values : ndarray, shape (n,)
        NaN is missing.
    fewest : int
        Samples that stand together at least.

    Returns
    -------
    ndarray of int, shape (k,)
        Sorted.
    """
    known = np.flatnonzero(np.isfinite(values))
    none = np.empty(0, dtype=np.intp)
    step = np.diff(values[known])
    size = np.abs(step)
    tail = np.sort(size[size > 0.0])[-max(3, round(_STANDS_SHARE * size.size)) :]
    ratio = tail[1:] / tail[:-1] if tail.size > 1 else tail[:0]
    if ratio.size == 0 or ratio.max() < STANDS_JUMP:
        return none
    jump = np.where(size >= tail[1 + int(np.argmax(ratio))], np.sign(step), 0.0)
    jumps = np.flatnonzero(jump)
    before, after = np.roll(jump, 1), np.roll(jump, -1)
    found = [
        known[a + 1 : b + 1]
        for a, b in pairwise(jumps)
        if b - a >= fewest
        and jump[b] == -jump[a] != before[a]
        and after[b] != jump[b]
        and not step[a + 1 : b].any()
    ]
    stands = np.concatenate([none, *found])
    return stands if stands.size <= _STANDS_SHARE * known.size else none


def disorder(values: FloatArray) -> float:
    """Return how much of a channel's variance changes from sample to sample: 1 if it is white."""
    variance = float(np.var(values)) if values.size > 1 else 0.0
    return float(np.mean(np.diff(values) ** 2)) / (2.0 * variance) if variance > 0.0 else 0.0


def white_noise(values: FloatArray) -> float:
    """Return the standard deviation of a channel's white noise, from its second differences."""
    if values.size < 3:
        return 0.0
    return NORMAL_MAD * float(np.median(np.abs(np.diff(values, 2)))) / float(np.sqrt(6.0))
