"""Estimates of a fit, and verdicts on its effects, with another covariance."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ..._common.arrays import FloatArray
from ...diagnose import EffectVerdict, Verdicts
from ...diagnose.candidates.judge import bound_of
from ...identify import Estimate, Fit
from ...rules import Rules


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


def as_unsure(told: Verdicts, wide: Sequence[Estimate], fit: Fit, rules: Rules) -> Verdicts:
    """Verdicts with the standard errors of wider estimates.

    A rival in the place of an effect is less sure by as many times as the effect is: what acts
    alike is moved alike by what is missing.

    Parameters
    ----------
    told : Verdicts
    wide : sequence of Estimate
        Of the fit (`estimates_of`).
    fit : Fit
    rules : Rules
    """
    by, own = {e.name: e.std for e in wide}, {e.name: e.std for e in fit.estimates}
    times = {
        effect.id: max((by[n] / own[n] for n in effect.named if own.get(n, 0.0) > 0.0), default=1.0)
        for effect in fit.model.parts
    }

    def wider(v: EffectVerdict) -> EffectVerdict:
        there = [times[e] for e in v.group if e in times]
        if v.value and v.effect.id in times:
            std = tuple(by.get(n, s) for n, s in zip(v.effect.named, v.std, strict=True))
        elif v.value and v.finding == "one of a group" and there:
            std = tuple(max(there) * s for s in v.std)
        else:
            return v
        return replace(v, std=std, bound=bound_of(v.effect, v.value, std, rules))

    return Verdicts(tuple(map(wider, told.all)))


def times_wider(wide: Sequence[Estimate], fit: Fit) -> float:
    """How many times wider intervals are than those of the fit, in the median over parameters.

    Those that the driving does not determine do not count; 1 where it determines none.
    """
    both = zip(wide, (*fit.estimates, *fit.derived), strict=True)
    found = [w.std / e.std for w, e in both if not e.note and np.isfinite(e.std)]
    return float(np.median(found)) if found else 1.0
