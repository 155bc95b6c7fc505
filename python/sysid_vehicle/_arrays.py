"""The one place where arrays are converted for the compiled core."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

__all__ = ["ComplexArray", "FloatArray", "as_float64", "filled"]

ComplexArray = npt.NDArray[np.complex128]
FloatArray = npt.NDArray[np.float64]


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
