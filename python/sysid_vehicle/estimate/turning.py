"""When the car turns: elsewhere there is no lateral motion to predict."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from .._common.arrays import FloatArray, as_float64
from .._common.memo import remembered
from .driving import Driving

_AROUND_S = 0.5  # on either side
# Of the root mean square over all driving; set on the V40 of benchmarks/real_driving, and judged by
# benchmarks/exam, whose manoeuvres turn all the time.
_LEAST = 0.25
_BLOCK_S, _FEWEST = 5.0, 6
_MOST_MPS2 = 15.0  # of v_x r that counts: a spin is no measure of corners

_Bools = npt.NDArray[np.bool_]


@remembered(16)
def turning(driving: Driving) -> _Bools:
    """At which samples the car turns.

    There the yaw rate, or the lateral acceleration v_x r, has in the second around the sample a
    quarter at least of its root mean square over all the driving. A log that is straight for most
    of the time would else be judged by what every model predicts: that nothing happens.

    Parameters
    ----------
    driving : Driving

    Returns
    -------
    array of bool, shape (samples,)
        All samples, where the car never turns more than its sensors scatter.
    """
    r = driving.channel("yaw_rate_radps")
    v = driving.channel("vx_mps")
    least = min(log.least_speed_mps for log in driving.logs)
    v = np.maximum(np.where(np.isfinite(v), v, 0.0), least)
    side = np.clip(v * r, -_MOST_MPS2, _MOST_MPS2)
    found = np.zeros(driving.samples, dtype=bool)
    for motion in (side / v, side):
        found |= moving(as_float64(motion**2), driving)
    return found


def moving(squares: FloatArray, driving: Driving) -> _Bools:
    """At which samples something moves.

    In the second around them it has a quarter at least of its root mean square over all the
    driving.

    Parameters
    ----------
    squares : array, shape (samples,)
        NaN where nothing is known.
    driving : Driving

    Returns
    -------
    array of bool, shape (samples,)
    """
    known = np.isfinite(squares)
    squares = as_float64(np.where(known, squares, 0.0))
    least = _LEAST**2 * float(squares.sum()) / max(int(known.sum()), 1)
    return _around(squares, known.astype(float), driving) >= least


def _around(squares: FloatArray, known: FloatArray, driving: Driving) -> FloatArray:
    """Mean square in the second around each sample, within its stretch."""
    out = np.zeros(len(squares))
    for begin, end, rate in driving.spans:
        reach = max(round(_AROUND_S * rate), 1)
        k = np.arange(end - begin)
        first, last = np.maximum(k - reach, 0), np.minimum(k + reach + 1, end - begin)
        sums, counts = (np.concatenate([[0.0], np.cumsum(x[begin:end])]) for x in (squares, known))
        out[begin:end] = (sums[last] - sums[first]) / np.maximum(counts[last] - counts[first], 1.0)
    return out


@remembered(16)
def turning_blocks(driving: Driving) -> npt.NDArray[np.intp]:
    """First samples of blocks that hold about five seconds of turning each.

    Where the car turns for less than half a minute there are six shorter ones.
    """
    return equal_blocks(as_float64(turning(driving)), driving)


def equal_blocks(share: FloatArray, driving: Driving) -> npt.NDArray[np.intp]:
    """First samples of blocks that hold about five seconds each; six blocks at least.

    Parameters
    ----------
    share : array, shape (samples,)
        Of each sample, that counts.
    driving : Driving
    """
    seconds = np.cumsum(share / driving.sample_rate_hz)
    count = max(round(float(seconds[-1]) / _BLOCK_S), _FEWEST)
    middle = seconds - 0.5 / driving.sample_rate_hz
    block = np.maximum(np.floor(count * middle / seconds[-1]), 0.0)
    return np.concatenate([[0], np.flatnonzero(np.diff(block)) + 1])
