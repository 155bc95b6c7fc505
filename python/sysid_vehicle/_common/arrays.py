"""Arrays for the compiled core, and what is done to those with gaps or drawn anew."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt

ComplexArray = npt.NDArray[np.complex128]
FloatArray = npt.NDArray[np.float64]

_TOGETHER = 20_000  # elements that are drawn at once

NORMAL_MAD = 1.4826
"""Standard deviation of a normal variable over its median absolute deviation."""


def as_float64(values: npt.ArrayLike) -> FloatArray:
    """Contiguous float64 array of `values`; a copy only where one is needed."""
    return np.ascontiguousarray(values, dtype=np.float64)


def filled(values: FloatArray) -> FloatArray:
    """Return `values` with NaN replaced by linear interpolation (held at both ends)."""
    good = np.isfinite(values)
    if good.all() or not good.any():
        return values
    index = np.arange(values.size)
    return np.interp(index, index[good], values[good])


def in_turn(
    work: Callable[[npt.NDArray[np.intp]], FloatArray], draws: npt.NDArray[np.intp]
) -> FloatArray:
    """What `work` makes of each draw, a row each; some of them together, which takes memory."""
    some = max(_TOGETHER // draws.shape[1], 1)
    return np.concatenate([work(draws[i : i + some]) for i in range(0, len(draws), some)])


def usual_range(values: FloatArray) -> tuple[float, float]:
    """Where nearly all values lie, 99.6 % of them; a range where all are one, too."""
    low, high = (float(x) for x in np.percentile(values, [0.2, 99.8]))
    return (low, high) if high > low else (low - 0.5, low + 0.5)


def median_of_known(values: FloatArray, axis: int) -> FloatArray:
    """Median of what is known; as `numpy.nanmedian`, which takes each column by itself."""
    ordered = np.sort(values, axis=axis)  # what is unknown comes last
    known = np.sum(~np.isnan(values), axis=axis, keepdims=True)
    low, high = (
        np.take_along_axis(ordered, np.maximum(at, 0), axis)
        for at in ((known - 1) // 2, known // 2)
    )
    return as_float64(np.squeeze(0.5 * (low + high), axis))


def mean_of_known(values: FloatArray, axis: int) -> FloatArray:
    """Mean of what is known, and NaN where nothing is.

    As `numpy.nanmean` without its warning: filters of warnings belong to the whole process, and
    must not be changed in a thread.
    """
    known = ~np.isnan(values)
    number = np.sum(known, axis=axis)
    total = np.sum(values, axis=axis, where=known)
    return as_float64(np.where(number > 0, total / np.maximum(number, 1), np.nan))


def spread_of_known(values: FloatArray, axis: int) -> FloatArray:
    """Standard deviation of what is known, and NaN where nothing is; never with a warning."""
    middle = np.expand_dims(mean_of_known(values, axis), axis)
    return as_float64(np.sqrt(mean_of_known(as_float64((values - middle) ** 2), axis)))


def as_array(values: Any) -> np.ndarray:
    """Return a column as an array; masked values become NaN, ragged ones an array of objects."""
    if isinstance(values, np.ma.MaskedArray) and values.dtype.kind in "biuf":
        return np.ma.filled(values.astype(np.float64), np.nan)
    try:
        raw = np.asarray(values)
        if raw.dtype.kind == "O" and hasattr(values, "to_numpy") and _is_nullable(values):
            return np.asarray(values.to_numpy(dtype=np.float64, na_value=np.nan))
        return raw
    except ValueError:
        ragged = np.empty(len(values), dtype=object)
        ragged[:] = list(values)
        return ragged


def _is_nullable(values: Any) -> bool:
    """Whether a pandas series holds numbers beside a mask, which numpy does not know."""
    kind = getattr(values, "dtype", None)
    return hasattr(kind, "na_value") and getattr(kind, "kind", "O") in tuple("biuf")
