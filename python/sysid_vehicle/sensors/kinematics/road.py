"""How much the slope of a road changes: its maximum likelihood, beside a motion that settles."""

from __future__ import annotations

import math

import numpy as np
import scipy

from ..._common.arrays import FloatArray
from .system import Band

_BEGIN_MPS2 = 0.05  # change of gravity along or across within a second
# Half of what a road of class A of ISO 8608 does at 20 m/s. Few are more even, and intervals that
# take one for a plane are too narrow.
_LEAST_MPS2 = 0.003
_LONGEST = math.log(4.0)  # step of the logarithm of the standard deviation
_AT_REST = 0.02  # the same, of a step that no fault feels
_FASTER = 8.0  # than the fixed point alone: secants of close points are rough


class Unevenness:
    """Standard deviation of the change of a slope from knot to knot, found in steps.

    The steps of EM are far too short where a road is even: they take a tenth of what is left, and
    a scale that acts like the road follows slowly. The fixed point is that of D. J. C. MacKay,
    Neural Computation 4 (1992), 415-447: the mean square of the changes, over the share of them
    that the readings tell. Its logarithm, which is zero there, is followed by secants.

    Parameters
    ----------
    rows : csr_matrix
        The changes, of the coefficients of the motion.
    """

    def __init__(self, rows: scipy.sparse.csr_matrix) -> None:
        self.rows = rows
        self.std_mps2 = _BEGIN_MPS2
        self.at_rest = not rows.shape[0]
        self._last: tuple[float, float] | None = None

    def improve(self, x: FloatArray, band: Band) -> None:
        """Take a step.

        Parameters
        ----------
        x : ndarray, shape (n,)
            Coefficients of a motion that has come to terms with the last step.
        band : Band
            Their information.
        """
        if not self.rows.shape[0]:
            return
        now, score = math.log(self.std_mps2), self._score(x, band)
        step = 0.5 * score
        if self._last is not None:
            then, before = self._last
            rises = (score - before) / (now - then)
            step *= min(_FASTER, -2.0 / rises) if rises < 0.0 else _FASTER
        to = max(now + float(np.clip(step, -_LONGEST, _LONGEST)), math.log(_LEAST_MPS2))
        self.at_rest = abs(to - now) < _AT_REST
        if not self.at_rest:
            self._last = now, score
            self.std_mps2 = math.exp(to)

    def _score(self, x: FloatArray, band: Band) -> float:
        change = self.rows @ x
        variance = self.std_mps2**2
        told = change.size - float(band.variances(self.rows).sum()) / variance
        tiny = np.finfo(float).tiny
        ratio = float(change @ change) / variance / max(told, change.size * np.finfo(float).eps)
        return math.log(max(ratio, tiny))
