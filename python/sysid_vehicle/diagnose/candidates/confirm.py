"""Credible sets that exact refits confirm.

The posterior of `causes.py` is that of scores, linearised at a fit which a large missing effect has
bent: what that effect does beyond first order looks like further effects. The set of the effect
that is refitted best stands; another one stands if its likeliest effect, refitted beside those
before it, gains its price, and an unknown force or a clock if anything is left beside all of them.
Scores beside those before it are asked first: what gains next to nothing there is not refitted.
What is in no set is as probable as it is beside those that stand: a mass that is wrong by a third
made a leaning body likely that is not there.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from ..unexplained.omnibus import Unknown
from .candidate import Candidate
from .causes import Causes, CredibleSet
from .clocks import shifts
from .possible import lacking
from .posterior import causes_of
from .refits import refitted
from .reservation import Beside, beside
from .score import score_board_of

if TYPE_CHECKING:
    from .diagnosis import Diagnosis

_HOPELESS = 0.25  # of the price that a refit has to gain: a score below is not refitted


def confirmed_causes(dx: Diagnosis) -> Causes:
    """The proposed causes, without sets that no exact refit confirms.

    Where nothing was refitted, or nothing that was gains its price, they stay as proposed.
    """
    proposed, rules = dx.proposed, dx.rules
    price = rules.price * float(np.log(dx.driving.samples))
    best = next((c for c in dx.significant if c.fit is not None and c.statistic >= price), None)
    if best is None or best.fit is None or not proposed.sets:
        return proposed
    first = next((s for s in proposed.sets if best.id in s.effects), None)
    known = {c.id: c for c in dx.ranking}
    told = {
        s: next((e for e in s.effects if e in known), "") for s in proposed.sets if s is not first
    }
    # What the naming of the likeliest effect has asked already is not asked again.
    left = dx.beside if dx.beside.fit is best.fit else _left(dx, best)
    waiting = {s: known[e] for s, e in told.items() if e}
    kept, left = _one_by_one(dx, left, waiting, price)
    kept = [_leading(best, dx, first), *kept]
    if left.omnibus.rejects:
        kept += [s for s, effect in told.items() if not effect]
    return replace(proposed, rest=_rest(proposed, left)).only(kept, dx.sizes)


def _rest(proposed: Causes, left: Beside) -> dict[str, float]:
    """Probabilities of what is in no set, no larger than beside the sets that stand."""
    if not any(p > 1.0 - left.rules.credible for p in proposed.rest.values()):
        return proposed.rest
    others, evidence = lacking(left.fit.model, left.lacked), left.evidence
    board = score_board_of(evidence, others, left.rules, Unknown(evidence), *shifts(evidence))
    beside_all = causes_of(board, evidence, left.rules).inclusion
    return {e: min(p, beside_all.get(e, 0.0)) for e, p in proposed.rest.items()}


def _one_by_one(
    dx: Diagnosis, left: Beside, waiting: Mapping[CredibleSet, Candidate], price: float
) -> tuple[list[CredibleSet], Beside]:
    """Sets that gain their price one beside the other, and what is left beside all of them.

    The one that gains most comes first: beside what is still missing any effect gains something.
    """
    kept = []
    while waiting:
        none = hopeless(left, list(waiting.values()), price)
        tried = {
            s: _refitted(left, c, dx)
            for s, c in waiting.items()
            if c.id not in left.fit.model.effects and c.id not in none
        }
        waiting = {s: waiting[s] for s, c in tried.items() if c.statistic >= price}
        if not waiting:
            break
        found = max(waiting, key=lambda s: tried[s].statistic)
        kept.append(found)
        del waiting[found]
        left = _left(dx, tried[found])
    return kept, left


def _left(dx: Diagnosis, c: Candidate) -> Beside:
    assert c.fit is not None  # what gains its price is refitted
    return beside(c.fit, dx.driving, dx.lacked, dx.rules)


def hopeless(left: Beside, candidates: Sequence[Candidate], price: float) -> set[str]:
    """Effects that gain far less than the price by their scores beside what is in the model.

    Parameters
    ----------
    left : Beside
    candidates : sequence of Candidate
    price : float
        In twice the log-likelihood.
    """
    few = tuple(c.effect for c in candidates if c.id not in left.fit.model.effects)
    return {
        s.effect.id
        for s in score_board_of(left.evidence, few, left.rules).scores
        if s.statistic * max(s.variance_ratio, 1.0) < _HOPELESS * price
    }


def _refitted(left: Beside, c: Candidate, dx: Diagnosis) -> Candidate:
    """A candidate refitted beside what is in the model by now."""
    # One that is scored over a grid has no size among the scores of a sum: its own score has.
    value, std = dx.proposed.sizes.get(c.id, (c.value, c.std))
    return refitted(left.fit, dx.driving, replace(c, value=value, std=std, fit=None))


def _leading(best: Candidate, dx: Diagnosis, proposed: CredibleSet | None) -> CredibleSet:
    """The set of the best refit: what is confounded with it, weighed by the exact likelihoods."""
    scored = {} if proposed is None else proposed.weights
    near = dict.fromkeys((best.id, *best.indistinguishable_from, *scored))
    known = {c.id: c for c in dx.ranking}
    log_odds = {}
    for e in near:
        c = known.get(e)
        if c is not None and c.fit is not None:
            log_odds[e] = 0.5 * (c.statistic - best.statistic)
        elif e in scored and best.id in scored:
            log_odds[e] = float(np.log(scored[e] / scored[best.id]))
        elif e in best.indistinguishable_from:
            log_odds[e] = 0.0  # it was not refitted, and its score is no other
    return CredibleSet.of(log_odds, dx.rules.credible)
