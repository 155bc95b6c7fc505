"""Which candidates the driving cannot tell from one another."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import combinations

import numpy as np

from ..._common.threads import Workers, before
from ...errors import NumericalError
from ...estimate import Driving
from ...identify import refit
from ...rules import Rules
from .candidate import Candidate
from .score import Score, ScoreBoard


def score_rivals(board: ScoreBoard, score: Score, apart: float) -> tuple[str, ...]:
    """Rivals which leave nothing for the effect, and for which the effect leaves nothing."""
    own = board.joint_statistic(score.effect.id)
    confounded = []
    if own < apart:
        return ()
    for rival in board.scores:
        if rival.effect.id == score.effect.id:
            continue
        theirs = board.joint_statistic(rival.effect.id)
        if abs(theirs - own) >= apart:
            continue  # together they tell at least as much as either
        both = board.joint_statistic(score.effect.id, rival.effect.id)
        if both - theirs < apart and both - own < apart:
            confounded.append(rival.effect.id)
    return tuple(confounded)


def with_refit_rivals(
    finished: Sequence[Candidate],
    far: Sequence[Candidate],
    driving: Driving,
    rules: Rules,
    pool: Workers,
    ends: float,
) -> list[Candidate]:
    """Among refitted effects the likelihood itself says which cannot be told apart.

    Those that gain as much, unless a model with both gains more than either: what is missing twice
    may by chance weigh the same. Effects of which the catalogue or the scores say that they act
    alike are not asked for that: two stand-ins of a third gain by each other.

    Parameters
    ----------
    finished : sequence of Candidate
        Refitted, with the rivals of their scores.
    far : sequence of Candidate
        Refitted too, and too far behind the best ones to be rivals of these.
    driving : Driving
    rules : Rules
    pool : Workers
    ends : float
        When refits end [s of `time.perf_counter`].
    """
    likeliest_first = sorted(finished, key=lambda c: -c.statistic)
    near = [p for p in combinations(likeliest_first, 2) if _as_likely(*p, 2.0 * rules.apart)]
    asked = [p for p in near if not _act_alike(*p)]
    price = rules.price * float(np.log(driving.samples))

    def told_apart(pair: tuple[Candidate, Candidate]) -> bool:
        return before(ends, lambda: _gain_of_both(*pair, driving), 0.0) > price

    both = pool.map(told_apart, asked)
    apart = {(one.id, other.id) for (one, other), told in zip(asked, both, strict=True) if told}
    refitted = {c.id for c in (*finished, *far)}
    pairs = [p for p in near if (p[0].id, p[1].id) not in apart]

    def rivals(c: Candidate) -> tuple[str, ...]:
        likely = [o.id for p in pairs if c in p for o in p if o is not c]
        order = [o.id for o in finished if o.id in likely]
        return (*order, *(t for t in c.indistinguishable_from if t not in refitted))

    return [replace(c, indistinguishable_from=rivals(c)) for c in finished]


def _as_likely(one: Candidate, other: Candidate, apart: float) -> bool:
    """Whether the likelihood does not tell which of two it is.

    A lag filters noise of the inputs. What that is worth is told to first order, before noise is
    learned anew: it may be as wrong as it is large.
    """
    lags = one.effect.states or other.effect.states
    unsure = abs(other.of_inputs - one.of_inputs) if lags else 0.0
    return abs(other.statistic - one.statistic) < apart + unsure


def _act_alike(one: Candidate, other: Candidate) -> bool:
    return (
        one.effect.is_like(other.effect)
        or other.id in one.indistinguishable_from
        or one.id in other.indistinguishable_from
    )


def _gain_of_both(likelier: Candidate, other: Candidate, driving: Driving) -> float:
    """Twice what a model with both effects gains over the one with the first, under its noise."""
    fit, theirs = likelier.fit, other.fit
    if fit is None or theirs is None:
        return 0.0
    sizes = {n: theirs[n].value for n in other.effect.named}
    try:
        both = refit(fit.model.add(other.effect).with_values(sizes), driving, fit.noise)
    except (NumericalError, np.linalg.LinAlgError):
        return 0.0
    return 2.0 * (both.log_likelihood - fit.log_likelihood)
