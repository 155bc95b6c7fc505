"""Linearised equations of motion and faults, and their banded normal equations."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy

from ..._common.arrays import FloatArray, as_float64
from ...errors import NumericalError
from .colour import Colour
from .equations import Readings, predict
from .motion import Grid, IntArray

_AT_ONCE = 32  # right-hand sides that are solved for together
_OUTLIER = 4.0  # whitened errors beyond count less (Huber)


class Band:
    """Cholesky factor of a banded information matrix."""

    def __init__(self, h: scipy.sparse.csr_matrix) -> None:
        coo = scipy.sparse.tril(h, format="coo")
        self.width = int((coo.row - coo.col).max())
        self.ab = np.zeros((self.width + 1, h.shape[0]))
        self.ab[coo.row - coo.col, coo.col] = coo.data
        try:
            self.factor = scipy.linalg.cholesky_banded(self.ab, lower=True, check_finite=False)
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

        The square of what the factor makes of a row, from its first coefficient on: before it
        there is nothing.
        """
        rows = rows.sorted_indices()
        first = rows.indices[rows.indptr[:-1]]
        order = np.argsort(first, kind="stable")
        found = np.empty(rows.shape[0])
        for some in (order[k : k + _AT_ONCE] for k in range(0, order.size, _AT_ONCE)):
            begin = int(first[some[0]])
            right = np.asfortranarray(rows[some, begin:].toarray().T)
            half, info = scipy.linalg.lapack.dtbtrs(self.factor[:, begin:], right, uplo="L")
            if info:
                raise NumericalError("the posterior of the motion is singular")
            found[some] = np.sum(half**2, axis=0)
        return as_float64(found)

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

    def with_faults_at(self, other: Linearised) -> Linearised:
        """The same errors, with what faults do to the readings taken from another motion."""
        return replace(self, raw_faults=other.raw_faults, by_faults=other.by_faults)


def linearise(
    readings: Sequence[Readings],
    grid: Grid,
    x: FloatArray,
    faults: dict[str, float],
    colours: dict[str, Colour],
    runs: dict[str, IntArray],
) -> Linearised:
    """Residuals of all readings and their derivatives, at this motion and these faults."""
    names = list(faults)
    system = Linearised({}, {}, {}, {}, {}, {}, {})
    for r in readings:
        c = r.channel
        expected, j, by = predict(r, grid, x, faults)
        jt = np.column_stack([by.get(name, np.zeros(expected.size)) for name in names])
        a = colours[c].whitener(runs[c])
        error = r.values - expected
        white = a @ error
        system.errors[c], system.raw_motion[c], system.raw_faults[c] = error, j, jt
        system.motion[c], system.by_faults[c], system.white[c] = a @ j, a @ jt, white
        system.weights[c] = np.minimum(1.0, _OUTLIER / np.maximum(np.abs(white), 1e-12))
    return system


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
    h, b = (rows.T @ rows), -(rows.T @ (rows @ x))
    hxt, htt, bt = np.zeros((x.size, faults.size)), prior.copy(), -prior @ faults
    for c, j in system.motion.items():
        wj = (scipy.sparse.diags(system.weights[c]) @ j).T.tocsr()
        h = h + wj @ j
        b = b + wj @ system.white[c]
        hxt += wj @ system.by_faults[c]
        wt = system.weights[c][:, None] * system.by_faults[c]
        htt += wt.T @ system.by_faults[c]
        bt += wt.T @ system.white[c]
    band = Band(h)
    across = band.solve(hxt)
    information = as_float64(htt - hxt.T @ across)
    step = as_float64(np.linalg.solve(information, bt - across.T @ b))
    return Normal(band, across, information, step, band.solve(b))
