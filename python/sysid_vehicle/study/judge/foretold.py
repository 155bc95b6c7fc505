"""Whether validation data err as much as a fit foretells that they do.

The noise of a fit holds disturbances: with it the residuals of driving like that of the fit have
squares of one in the mean, whatever the road is like. Validation data with larger ones show what
the training data did not: a force that no manoeuvre of theirs brings about, or another road. No
shape of it is assumed, as a test against forces that depend on the driving has to.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy

from ..._common.arrays import FloatArray, as_float64
from ...compare import compare
from ...diagnose import blocks
from ...errors import NumericalError
from ...estimate import Driving
from ...identify import Fit, driving_of
from ...rules import USUAL, Rules, unforeseen
from ..validation import as_elsewhere

_BLOCK_S, _FEWEST_BLOCKS = 2.0, 6


@dataclass(frozen=True)
class Foretold:
    """Mean squares of whitened residuals on validation data beside those on training data.

    Attributes
    ----------
    ratio : float
        Of the mean squares; infinite where the model loses the car.
    p_value : float
        Of validation data that are like the training data.
    rules : Rules
        By which they are not.
    error : float
        On validation data one step ahead, with the parameters that serve both, in units of the
        noise floor; NaN where that is not known.
    """

    ratio: float
    p_value: float
    rules: Rules = USUAL
    error: float = np.nan

    @property
    def unforeseen(self) -> bool:
        """Whether validation data are shown to err by more than the fit foretells."""
        return unforeseen(self.ratio, self.p_value, self.rules)

    def __str__(self) -> str:
        ratio = f"{np.sqrt(self.ratio):.2g}" if np.isfinite(self.ratio) else "infinitely many"
        return (
            f"the validation error is {ratio} times the one that the training data predict "
            f"(p = {self.p_value:.2g})"
        )

    def to_dict(self) -> dict[str, float | None]:
        """Both figures, ready for JSON."""
        ratio = self.ratio if np.isfinite(self.ratio) else None
        return {"ratio": ratio, "p_value": self.p_value}


def foretold(fit: Fit, test: Driving, rules: Rules = USUAL) -> Foretold:
    """Compare validation data with what a fit foretells of them.

    With the parameters that serve both (`identify.predict`), as tyres that no training data showed
    are no disturbance, and the noise of other driving (`NoiseModel.elsewhere`). The scatter is that
    of blocks of the training data: what errs in one corner alone scatters as much as it errs.

    Parameters
    ----------
    fit : Fit
    test : Driving
        Validation data.
    rules : Rules
    """
    try:
        other = as_elsewhere(fit, test)
        known, new = _squares(fit, fit.driving), _squares(other, driving_of(other, test))
    except (NumericalError, np.linalg.LinAlgError):
        return Foretold(np.inf, 0.0, rules)
    n, m = len(known), len(new)
    std = float(np.std(known, ddof=1)) * np.sqrt(1.0 / n + 1.0 / m)
    apart = float(np.mean(new) - np.mean(known))
    p_value = float(scipy.stats.t.sf(apart / max(std, 1e-12), n - 1))
    error = compare(other, test, noise=fit.noise).error
    return Foretold(float(np.mean(new) / np.mean(known)), p_value, rules, error)


def _squares(fit: Fit, driving: Driving) -> FloatArray:
    """Mean squares of whitened residuals, of what was measured, block by block."""
    trace = driving.problem(fit.model).trace(fit.model.vector(), fit.noise.vector(), False)
    # Of one length: a few samples at the end would scatter more than all others.
    pieces = max(round(driving.usable_s / _BLOCK_S), _FEWEST_BLOCKS)
    starts = blocks(driving, driving.usable_s / pieces)
    squares = np.add.reduceat(np.sum(trace["whitened"] ** 2, axis=1), starts)
    count = np.add.reduceat(np.isfinite(driving.measured).sum(axis=1), starts)
    seen = count > 0
    return as_float64(squares[seen] / count[seen])
