"""Level and colour of a sensor's noise: an autoregressive process on the sensor's own samples."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy

from ..._common.arrays import NORMAL_MAD, FloatArray
from .motion import IntArray

_LONGEST = 8
_CLIP = 5.0  # deviations beyond so many standard deviations teach no colour


@dataclass(frozen=True, eq=False)
class Colour:
    """``e_t = phi_1 e_(t-1) + ... + w_t``, with w white.

    Attributes
    ----------
    std : float
        Standard deviation of e, in the unit of the channel.
    white_std : float
        Standard deviation of w.
    phi : ndarray, shape (p,)
        Coefficients.
    """

    std: float
    white_std: float
    phi: FloatArray

    def whitener(self, run: IntArray) -> scipy.sparse.csr_matrix:
        """Matrix that turns n errors into white ones of unit variance.

        Parameters
        ----------
        run : ndarray of int, shape (n,)
            How many samples before this one follow each other regularly.
        """
        n, p = run.size, self.phi.size
        full = run >= p
        scale = np.where(full, 1.0 / self.white_std, 1.0 / self.std)
        diagonals = [scale]
        for k, phi in enumerate(self.phi, start=1):
            diagonals.append(np.where(full, -phi / self.white_std, 0.0)[k:])
        return scipy.sparse.diags(diagonals, -np.arange(p + 1), shape=(n, n), format="csr")

    def whitened(self, run: IntArray, *of: Any) -> Iterator[Any]:
        """Vectors or matrices of n rows times the whitener, which is a number of white noise."""
        a = self.whitener(run) if self.phi.size else 1.0 / self.white_std
        return (a @ rows if self.phi.size else a * rows for rows in of)

    def words(self, rate_hz: float) -> str:
        """Say where in frequency the noise lies."""
        if not self.phi.size:
            return "white"
        frequency = np.linspace(0.0, 0.5 * rate_hz, 200)
        power = self.spectrum(frequency, rate_hz)
        peak = int(np.argmax(power))
        if power[peak] < 3.0 * float(np.median(power)):
            return "nearly white"
        if peak == 0:
            half = frequency[int(np.argmax(power < 0.5 * power[0]))]
            return f"below {half:.2g} Hz"
        return f"around {frequency[peak]:.2g} Hz"

    def spectrum(self, frequency_hz: FloatArray, rate_hz: float) -> FloatArray:
        """Power spectral density [unit^2/Hz], one-sided."""
        z = np.exp(-2j * np.pi * np.outer(frequency_hz, np.arange(1, self.phi.size + 1)) / rate_hz)
        response: FloatArray = np.abs(1.0 - z @ self.phi) ** -2.0
        return 2.0 * self.white_std**2 / rate_hz * response


def neighbours(stretch: IntArray, time_s: FloatArray) -> IntArray:
    """Number of samples before each one that follow each other at the channel's own period."""
    if time_s.size < 2:
        return np.zeros(time_s.size, dtype=np.intp)
    step = np.diff(time_s)
    period = float(np.median(step))
    regular = (np.abs(step - period) < 0.3 * period) & (np.diff(stretch) == 0)
    index = np.arange(time_s.size)
    starts = np.concatenate(([0], np.where(regular, 0, index[1:])))
    return index - np.maximum.accumulate(starts)


def fit_colour(errors: FloatArray, run: IntArray, floor: float, longest: int = _LONGEST) -> Colour:
    """Fit by the equations of Yule and Walker; the order by Akaike's criterion.

    Parameters
    ----------
    errors : ndarray, shape (k, n)
        Draws of the errors of n samples.
    run : ndarray of int, shape (n,)
        See :func:`neighbours`.
    floor : float
        Least standard deviation: what the quantum of the channel leaves.
    longest : int
        Highest order.
    """
    n = errors.shape[1]
    scale = NORMAL_MAD * float(np.median(np.abs(errors))) + floor
    kept = np.clip(errors, -_CLIP * scale, _CLIP * scale)
    longest = min(longest, n // 30)
    lagged = [float(np.mean(kept**2))]
    for k in range(1, longest + 1):
        usable = run[k:] >= k
        products = kept[:, k:][:, usable] * kept[:, :-k][:, usable]
        lagged.append(float(products.mean()) if products.size else 0.0)
    variance = max(lagged[0], floor**2)
    best: tuple[float, FloatArray, float] = (n * np.log(variance), np.empty(0), variance)
    for p in range(1, longest + 1):
        r = np.array(lagged[: p + 1])
        r[0] = variance * (1.0 + 1e-6)
        phi = scipy.linalg.solve_toeplitz(r[:-1], r[1:])
        white = r[0] - float(phi @ r[1:])
        if white <= 0.0:
            break
        white = max(white, floor**2)
        criterion = n * np.log(white) + 2.0 * p
        if criterion < best[0]:
            best = (criterion, phi, white)
    return Colour(float(np.sqrt(variance)), float(np.sqrt(best[2])), best[1])
