"""Linearised equations of motion and faults, and their banded normal equations."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy

from ... import _core
from ..._common.arrays import FloatArray, as_float64
from ...errors import NumericalError
from .colour import Colour
from .equations import Readings, expected_of, predict
from .motion import Grid, IntArray

_OUTLIER = 4.0  # whitened errors beyond count less (Huber)


class Band:
    """Cholesky factor of a banded information matrix.

    Parameters
    ----------
    rows : csr_matrix, shape (m, n)
        Whitened equations: the information is their product with themselves.

    Raises
    ------
    NumericalError
        They leave something of the motion open.
    """

    def __init__(self, rows: scipy.sparse.csr_matrix) -> None:
        lower = _core.banded_gram(rows.indptr, rows.indices, rows.data, rows.shape[1]).T
        try:
            self.factor = scipy.linalg.cholesky_banded(
                lower, lower=True, overwrite_ab=True, check_finite=False
            )
        except scipy.linalg.LinAlgError as error:
            raise NumericalError(
                "the motion cannot be told from these channels; check that vx_mps, "
                "yaw_rate_radps and ay_mps2 hold values"
            ) from error

    def solve(self, b: FloatArray) -> FloatArray:
        """Solve with the factorised information."""
        x: FloatArray = scipy.linalg.cho_solve_banded((self.factor, True), b, check_finite=False)
        return x

    def variances(self, rows: scipy.sparse.csr_matrix) -> FloatArray:
        """Variances of sums of coefficients, one for each row.

        The square of what the factor makes of a row.
        """
        return _core.banded_squares(self.factor.T, rows.indptr, rows.indices, rows.data)

    def draw(self, z: FloatArray) -> FloatArray:
        """Solve with the transposed factor: normal numbers become draws of the posterior."""
        return drawn(self.factor, z)


def drawn(factor: FloatArray, z: FloatArray) -> FloatArray:
    """Solve with the transposed factor of a banded matrix."""
    x, info = scipy.linalg.lapack.dtbtrs(factor, z, uplo="L", trans="T")
    if info:
        raise NumericalError("the posterior of the motion is singular")
    drawn: FloatArray = x
    return drawn


@dataclass(frozen=True, eq=False)
class Linearised:
    """Whitened linearised equations of all channels, and what is drawn from them."""

    errors: dict[str, FloatArray]
    raw_motion: dict[str, scipy.sparse.csr_matrix]
    raw_faults: dict[str, FloatArray]
    motion: dict[str, scipy.sparse.csr_matrix]
    by_faults: dict[str, FloatArray]
    white: dict[str, FloatArray]
    weights: dict[str, FloatArray]


def linearise(
    readings: Sequence[Readings],
    grid: Grid,
    x: FloatArray,
    faults: dict[str, float],
    colours: dict[str, Colour],
    runs: dict[str, IntArray],
    *,
    calm: FloatArray | None = None,
) -> Linearised:
    """Residuals of all readings and their derivatives, at this motion and these faults.

    What faults do to the readings is taken from the motion `calm`, where it is given.
    """
    names = list(faults)
    system = Linearised({}, {}, {}, {}, {}, {}, {})
    for r in readings:
        c = r.channel
        expected, j, by = predict(r, grid, x, faults, calm)
        jt = np.column_stack([by.get(name, np.zeros(expected.size)) for name in names])
        error = r.values - expected
        system.errors[c], system.raw_motion[c], system.raw_faults[c] = error, j, jt
        motion, by_faults, white = colours[c].whitened(runs[c], j, jt, error)
        system.motion[c], system.by_faults[c], system.white[c] = motion, by_faults, white
        system.weights[c] = _weights(white)
    return system


def whitened_errors(
    readings: Sequence[Readings],
    grid: Grid,
    x: FloatArray,
    faults: dict[str, float],
    colours: dict[str, Colour],
    runs: dict[str, IntArray],
) -> dict[str, tuple[FloatArray, FloatArray]]:
    """As :func:`linearise`: the whitened errors of each channel and their weights alone."""
    found = {}
    for r in readings:
        error = r.values - expected_of(r, grid, x, faults)
        (white,) = colours[r.channel].whitened(runs[r.channel], error)
        found[r.channel] = white, _weights(white)
    return found


def _weights(white: FloatArray) -> FloatArray:
    return as_float64(np.minimum(1.0, _OUTLIER / np.maximum(np.abs(white), 1e-12)))


@dataclass(frozen=True, eq=False)
class Normal:
    """Normal equations of the faults, the motion eliminated.

    Attributes
    ----------
    band : Band
        Of the motion's information, the faults held.
    across : ndarray, shape (grid.size, n)
        How the motion moves against the faults.
    information : ndarray, shape (n, n)
        Schur complement: of the faults, whatever the motion is.
    step, motion_step : ndarray
        Gauss-Newton step of the faults, and what the motion needs on its own.
    """

    band: Band
    across: FloatArray
    information: FloatArray
    step: FloatArray
    motion_step: FloatArray

    def step_beside(self, fixed: dict[int, float]) -> FloatArray:
        """Gauss-Newton step of the faults where some take a step that is given."""
        free = np.array([i for i in range(self.step.size) if i not in fixed], dtype=np.intp)
        step = np.zeros(self.step.size)
        for i, value in fixed.items():
            step[i] = value
        left = self.information @ (self.step - step)
        step[free] = np.linalg.solve(self.information[np.ix_(free, free)], left[free])
        return step


def normal_equations(
    system: Linearised,
    rows: scipy.sparse.csr_matrix,
    x: FloatArray,
    prior: FloatArray,
    faults: FloatArray,
) -> Normal:
    """Eliminate the motion.

    Parameters
    ----------
    system : Linearised
    rows : csr_matrix
        Prior of the motion, whitened.
    x : ndarray
        Coefficients of the motion.
    prior : ndarray, shape (n, n)
        Information of the prior of the faults, about zero.
    faults : ndarray, shape (n,)
    """
    # With the roots of the weights all channels are one product.
    roots = {c: np.sqrt(weight) for c, weight in system.weights.items()}
    j = scipy.sparse.vstack(
        [rows, *(_scaled(m, roots[c]) for c, m in system.motion.items())], format="csr"
    )
    jt = np.concatenate([np.zeros((rows.shape[0], faults.size)), *_rooted(system.by_faults, roots)])
    left = np.concatenate([-(rows @ x), *_rooted(system.white, roots)])
    back = j.T
    b, hxt = back @ left, back @ jt
    htt, bt = prior + jt.T @ jt, jt.T @ left - prior @ faults
    band = Band(j)
    across = band.solve(hxt)
    information = as_float64(htt - hxt.T @ across)
    step = as_float64(np.linalg.solve(information, bt - across.T @ b))
    return Normal(band, across, information, step, band.solve(b))


def _scaled(rows: scipy.sparse.csr_matrix, by: FloatArray) -> scipy.sparse.csr_matrix:
    """Rows times a number each: a product with a diagonal matrix takes several times as long."""
    values = rows.data * np.repeat(by, np.diff(rows.indptr))
    return scipy.sparse.csr_matrix((values, rows.indices, rows.indptr), shape=rows.shape)


def _rooted(of: dict[str, FloatArray], roots: dict[str, FloatArray]) -> list[FloatArray]:
    """Rows of each channel, times the roots of their weights."""
    return [as_float64((values.T * roots[c]).T) for c, values in of.items()]
