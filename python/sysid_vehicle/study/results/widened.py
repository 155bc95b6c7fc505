"""Estimates of a fit with another covariance."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ..._common.arrays import FloatArray
from ...identify import Estimate, Fit


def estimates_of(fit: Fit, covariance: FloatArray | None) -> tuple[Estimate, ...]:
    """Parameters of a fit, then what follows from them, with standard errors of a covariance.

    Parameters
    ----------
    fit : Fit
    covariance : array, shape (parameters, parameters), or None
        Of its estimates; its own where there is none.
    """
    if covariance is None:
        return (*fit.estimates, *fit.derived)
    std = np.sqrt(np.diag(covariance))
    # What has no standard error, at a bound or never felt, has none now either.
    found = tuple(
        replace(e, std=float(s)) if np.isfinite(e.std) else e
        for e, s in zip(fit.estimates, std, strict=True)
    )
    return (*found, *replace(fit, covariance=covariance, estimates=found).derived)


def times_wider(wide: Sequence[Estimate], fit: Fit) -> float:
    """How many times wider intervals are than those of the fit, in the median over parameters.

    Those that the driving does not determine do not count; 1 where it determines none.
    """
    both = zip(wide, (*fit.estimates, *fit.derived), strict=True)
    found = [w.std / e.std for w, e in both if not e.note and np.isfinite(e.std)]
    return float(np.median(found)) if found else 1.0
