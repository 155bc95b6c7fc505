"""How the residuals answer to the fitted parameters and to effects the model lacks.

The filter runs once, at the fit; its gains stay. Nothing is refitted.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from .. import _core
from .._arrays import FloatArray
from ..effects import Effect
from ..estimate import Driving, NoiseModel
from ..identify import Fit

__all__ = ["Sensitivities", "duration", "sensitivities"]

_AT_ONCE = 8  # directions that the core differentiates in one pass


@dataclass(frozen=True, eq=False)
class Sensitivities:
    """Whitened residuals and minus their derivatives.

    Attributes
    ----------
    candidates : tuple of Effect
        Those that this driving can show at all.
    residual : array, shape (5 n,)
        Sample by sample, channel by channel.
    fitted : array, shape (5 n, parameters)
        By the fit's free parameters.
    effects : dict of str to array, shape (5 n, parameters of the effect)
        At the effects' null values.
    """

    candidates: tuple[Effect, ...]
    residual: FloatArray
    fitted: FloatArray
    effects: dict[str, FloatArray]


def sensitivities(
    fit: Fit, driving: Driving, candidates: Sequence[Effect], noise: NoiseModel | None = None
) -> Sensitivities:
    """Differentiate the residuals of a fit on some driving.

    Parameters
    ----------
    fit : Fit
    driving : Driving
    candidates : sequence of Effect
        Effects that the model lacks.
    noise : NoiseModel, optional
        Other noise than the fit's.
    """
    possible = tuple(e for e in candidates if driving.force_known or not e.needs_force)
    base = driving.problem(fit.model)
    p = fit.model.vector()
    frozen = base.freeze(p, (fit.noise if noise is None else noise).vector())
    e = base.residuals(p, frozen).ravel()
    known = fit.model.parameters
    G = base.sensitivities(p, frozen, [known[n].column for n in fit.model.free_names])
    return Sensitivities(possible, e, G, _of_effects(fit, driving, base, possible, p, frozen, e))


def _of_effects(
    fit: Fit,
    driving: Driving,
    base: _core.Problem,
    candidates: tuple[Effect, ...],
    p: FloatArray,
    frozen: _core.FrozenFilter,
    e: FloatArray,
) -> dict[str, FloatArray]:
    regular = tuple(c for c in candidates if not c.scored_at_typical and c.scanned is None)
    known = driving.force_known
    found: dict[str, FloatArray] = {}
    for few in _groups(regular):
        wide = base.with_model(fit.model.core(force_known=known, also=few))
        all_columns = wide.sensitivities(p, frozen, [i for c in few for i in c.columns])
        at = 0
        for c in few:
            found[c.id] = all_columns[:, at : at + len(c.columns)]
            at += len(c.columns)
    for c in candidates:
        if c in regular:
            continue
        one = base.with_model(fit.model.core(force_known=known, also=(c,)))
        if c.scored_at_typical:
            # No derivative at zero: the finite steps to the typical sizes are the directions.
            steps = []
            for parameter in c.parameters:
                there = p.copy()
                there[parameter.column] = parameter.typical
                steps.append((e - one.residuals(there, frozen).ravel()) / parameter.typical)
            found[c.id] = np.column_stack(steps)
        elif c.scanned is not None:
            # At its null value the effect knows nothing of this parameter: one column for each
            # value of a grid. Their joint test needs no supremum.
            first = c.parameters[0]
            step = 0.1 * first.matters  # small enough to stand for the derivative
            columns = []
            for value in c.scanned.grid(duration(driving)):
                there = p.copy()
                there[c.scanned.column] = value
                there[first.column] = first.null_value + step
                columns.append((e - one.residuals(there, frozen).ravel()) / step)
            found[c.id] = np.column_stack(columns)
    return found


def _groups(effects: tuple[Effect, ...]) -> list[tuple[Effect, ...]]:
    """Effects that the core differentiates in one pass: the others need not act meanwhile."""
    groups: list[list[Effect]] = [[]]
    for effect in effects:
        if sum(len(e.columns) for e in (*groups[-1], effect)) > _AT_ONCE:
            groups.append([])
        groups[-1].append(effect)
    return [tuple(g) for g in groups if g]


def duration(driving: Driving) -> float:
    """Of the longest log [s]."""
    return max(float(s.where.stop / driving.logs[s.log].rate_hz) for s in driving.stretches)
