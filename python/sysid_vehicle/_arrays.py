"""The one place where arrays are converted for the compiled core."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

__all__ = ["FloatArray", "as_float64"]

FloatArray = npt.NDArray[np.float64]


def as_float64(values: npt.ArrayLike) -> FloatArray:
    """Contiguous float64 array of `values`; a copy only where one is needed."""
    return np.ascontiguousarray(values, dtype=np.float64)
