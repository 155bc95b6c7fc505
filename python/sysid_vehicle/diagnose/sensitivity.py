"""How the residuals answer to effects the model lacks.

The filter runs once, at the fit; its gains stay. Nothing is refitted.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from .._arrays import FloatArray
from ..effects import Effect
from ..estimate import Driving
from ..estimate.pieces import DrivingProblem
from .evidence import Evidence

_AT_ONCE = 24  # columns of one pass: each costs little more, and more are held twice meanwhile


@dataclass(frozen=True, eq=False)
class Sensitivities:
    """Minus the derivatives of the whitened residuals by the parameters of effects.

    Attributes
    ----------
    candidates : tuple of Effect
        Those that this driving can show at all.
    columns : array, shape (5 n, parameters of all of them)
        By their parameters, at the null values; sample by sample, channel by channel.
    places : dict of str to slice
        Which columns belong to which effect.
    """

    candidates: tuple[Effect, ...]
    columns: FloatArray
    places: dict[str, slice]


def sensitivities(evidence: Evidence, candidates: Sequence[Effect]) -> Sensitivities:
    """Differentiate the residuals of a fit by effects that its model lacks.

    Parameters
    ----------
    evidence : Evidence
    candidates : sequence of Effect
    """
    driving = evidence.driving
    model = evidence.fit.model
    possible = model.seated(e for e in candidates if driving.shows(e))
    long = duration(driving)
    ends = np.cumsum([0, *(_width(e, long) for e in possible)])
    places = {
        e.id: slice(int(a), int(b)) for e, (a, b) in zip(possible, pairwise(ends), strict=True)
    }
    # In place: most of the work is in passing over so many numbers.
    out = np.empty((len(evidence.residual), int(ends[-1])))
    p = model.vector(possible)

    def acting(*effects: Effect) -> DrivingProblem:
        return evidence.problem.with_model(
            model.core(force_known=driving.force_known, also=effects)
        )

    for few in _groups([c for c in possible if _regular(c)]):
        columns = [i for c in few for i in c.columns]
        found = acting(*few).sensitivities(p, evidence.frozen, columns)
        at = 0
        for c in few:
            out[:, places[c.id]] = found[:, at : at + len(c.columns)]
            at += len(c.columns)
    for c in possible:
        if not _regular(c):
            own, one = out[:, places[c.id]], acting(c)
            for i, (there, step) in enumerate(_steps(c, p, long)):
                moved = one.residuals(there, evidence.frozen).ravel()
                own[:, i] = (evidence.residual - moved) / step
    return Sensitivities(possible, out, places)


def _regular(effect: Effect) -> bool:
    return not effect.scored_at_typical and effect.scanned is None


def _width(effect: Effect, seconds: float) -> int:
    if effect.scored_at_typical or effect.scanned is None:
        return len(effect.columns)
    return len(effect.scanned.grid(seconds))


def _steps(effect: Effect, p: FloatArray, seconds: float) -> Iterator[tuple[FloatArray, float]]:
    """Where an effect without derivatives at its null value is tried, and how far that is."""
    if effect.scored_at_typical:
        # No derivative at zero: the finite steps to the typical sizes are the directions.
        for parameter in effect.parameters:
            there = p.copy()
            there[parameter.column] = parameter.typical
            yield there, parameter.typical
    elif effect.scanned is not None:
        # At its null value the effect knows nothing of this parameter: one column for each value
        # of a grid. Their joint test needs no supremum.
        first = effect.parameters[0]
        step = 0.1 * first.matters  # small enough to stand for the derivative
        for value in effect.scanned.grid(seconds):
            there = p.copy()
            there[effect.scanned.column] = value
            there[first.column] = first.null_value + step
            yield there, step


def _groups(effects: Sequence[Effect]) -> list[tuple[Effect, ...]]:
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
