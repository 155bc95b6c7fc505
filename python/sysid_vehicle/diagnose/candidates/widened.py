"""How sure parameters are where the model lacks something.

A fit's covariance is that of a complete model. What is missing acts on the residuals as unknown
forces and readings G b do, beside the change d of the fitted parameters,

    e = F d + G b + white noise,

and the fit takes for d what it can of G b. What it cannot is seen: from it come the sizes of b, one
variance for each kind of unknown, by restricted maximum likelihood (Harville, J. American
Statistical Association 1977; by EM, Dempster, Laird & Rubin, J. Royal Statistical Society B 1977).
What the fit took is then no larger or smaller than that by rule: the parameters are off by
cov(d) F'G b in addition to noise, as by any error of the model whose shape alone is known (Kennedy
& O'Hagan, J. Royal Statistical Society B 2001). A variance is known from as many directions as tell
of it, so Student's distribution counts.

The scatter of scores over blocks of the driving says nothing of this: it is that of a wrong value,
not how wrong it is. Nor does anything of what parameters copy whole, in all of the driving: a
factor on the steering angle, on masses and forces, or on an accelerometer.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from ..._common.arrays import FloatArray, as_float64
from ...estimate import Driving
from ...identify import Fit
from ...identify.ahead.ahead import of_few
from ...identify.intervals.estimates import spread_of
from ...identify.search.box import free_box
from ..evidence.directions import Directions
from ..evidence.evidence import Evidence
from .instead import Rivals

_ROUNDS, _SETTLED = 200, 1e-3
_FELT = 1e-9  # of the largest column: what is less acts on no residual


def widened(fit: Fit, driving: Driving) -> FloatArray:
    """Covariance of a fit's parameters where something unknown is missing in the model.

    Parameters
    ----------
    fit : Fit
    driving : Driving
        What it was fitted to.

    Returns
    -------
    array, shape (parameters, parameters)
        In the order of `fit.estimates`. That of the fit where nothing is seen to be left.
    """
    if not len(fit.covariance):
        return fit.covariance
    evidence = Evidence(fit, driving)
    rivals = Rivals(evidence, ())
    projected = Directions(evidence, rivals)
    size = np.sqrt(projected.before)
    felt = np.flatnonzero(size > _FELT * size.max(initial=0.0))
    if not len(felt):
        return fit.covariance
    scale, kinds = size[felt], rivals.kinds[felt]
    information = projected.information[np.ix_(felt, felt)] / np.outer(scale, scale)
    variance, told = _variances(information, projected.score[felt] / scale, kinds)
    copied = np.zeros((len(fit.covariance), rivals.width))
    for section in evidence.sections():
        copied += section.apart.T @ rivals.of(section)
    off = fit.by_noise @ (copied[:, felt] / scale)
    return as_float64(
        fit.covariance + _within(fit, of_few(told + 1) ** 2 * (off * variance) @ off.T)
    )


def _within(fit: Fit, covariance: FloatArray) -> FloatArray:
    """Covariance of what the parameters are off by, given that they lie in their bounds."""
    spread = spread_of(free_box(fit.model), np.array([e.value for e in fit.estimates]))
    own = covariance / np.outer(spread, spread)
    found = np.linalg.solve(np.eye(len(own)) + own, own)
    return as_float64(0.5 * (found + found.T) * np.outer(spread, spread))


def _variances(
    information: FloatArray, score: FloatArray, kinds: npt.NDArray[np.intp]
) -> tuple[FloatArray, int]:
    """Variance of the size of each column, alike within a kind, and how many directions tell.

    Parameters
    ----------
    information, score : array, shape (n, n), (n,)
        Of columns that the fitted parameters cannot copy.
    kinds : array of int, shape (n,)
    """
    every = np.unique(kinds)
    alike = [kinds == k for k in every]
    # As if all were one kind, told by how far the scores are from nothing.
    start = float(score @ score) / max(float(np.sum(information**2)), 1e-300)
    variance = np.full(len(score), max(start, 1e-12))
    seen = np.zeros(len(score))
    for _ in range(_ROUNDS):
        root = np.sqrt(variance)
        inner = root[:, None] * information * root
        left = np.linalg.inv(np.eye(len(score)) + inner)
        seen = 1.0 - np.diag(left)
        mean = root * (left @ (root * score))
        square = mean**2 + variance * np.diag(left)
        new = np.zeros(len(score))
        for own in alike:
            new[own] = max(float(square[own].mean()), 1e-12)
        settled = bool(np.max(np.abs(np.log(new / variance))) < _SETTLED)
        variance = new
        if settled:
            break
    return as_float64(variance), max(round(float(seen.sum())), 1)
