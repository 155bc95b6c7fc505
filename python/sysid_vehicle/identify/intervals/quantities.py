"""What is asked of a fit: parameters, and what the coefficients of a tyre mean together."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from ..._common.arrays import FloatArray, as_float64
from ..loads import LoadAtRest
from ..search.tyre_shape import slope_of


@dataclass(frozen=True)
class Quantity:
    """A parameter or a function of parameters.

    Parameters
    ----------
    name : str
    of : callable
        From all parameters to the value.
    slope : callable
        From all parameters to its gradient; NaN or infinite where it has none.
    column : int, optional
        The parameter that it is.
    """

    name: str
    of: Callable[[FloatArray], float]
    slope: Callable[[FloatArray], FloatArray]
    column: int | None = None


def parameter(name: str, column: int) -> Quantity:
    """A parameter itself."""
    return Quantity(
        name, lambda p: float(p[column]), lambda p: np.eye(len(p))[column], column=column
    )


def tyre_quantity(
    name: str,
    columns: Sequence[int],
    function: Callable[[FloatArray], float],
    load: LoadAtRest | None = None,
) -> Quantity:
    """A function of the B, C, D, E that stand in `columns`, times a load where one is given."""
    where = list(columns)

    def of(p: FloatArray) -> float:
        value = function(as_float64(p[where]))
        return value if load is None else load(p) * value

    def slope(p: FloatArray) -> FloatArray:
        out = np.zeros(len(p))
        out[where] = slope_of(function, as_float64(p[where]))
        if load is not None:
            out *= load(p)
            for column, by in load.slope(p).items():
                out[column] = by * function(as_float64(p[where]))
        return out

    return Quantity(name, of, slope)


def std_of(what: Quantity, p: FloatArray, columns: list[int], covariance: FloatArray) -> float:
    """Standard error by the delta method; infinite where the quantity has no value or no slope.

    Parameters
    ----------
    what : Quantity
    p : array, shape (parameters,)
    columns : list of int
        The free parameters.
    covariance : array, shape (free, free)
    """
    slope = what.slope(p)[columns]
    if not np.all(np.isfinite(slope)):
        return float(np.inf)
    variance = float(slope @ covariance @ slope)
    if not (np.isfinite(what.of(p)) and np.isfinite(variance)):
        return float("inf")
    return float(np.sqrt(max(variance, 0.0)))
