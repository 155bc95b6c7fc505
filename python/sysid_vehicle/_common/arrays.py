"""The one place where arrays are converted for the compiled core."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

ComplexArray = npt.NDArray[np.complex128]
FloatArray = npt.NDArray[np.float64]


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
