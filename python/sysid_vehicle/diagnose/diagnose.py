"""Rank the physical effects that a fitted model may be missing."""

from __future__ import annotations

import time
from collections.abc import Collection, Sequence
from dataclasses import replace

import numpy as np

from .._common.arguments import duration
from .._common.progress import with_progress
from .._common.threads import Workers
from ..compare import one_step_error
from ..effects import Effect
from ..errors import InvalidInput
from ..estimate import Driving
from ..identify import Fit, driving_of, explaining
from ..log import Log
from ..rules import USUAL, Rules, bic
from .candidates.candidate import Candidate
from .candidates.clocks import shifts
from .candidates.confirm import hopeless
from .candidates.diagnosis import Diagnosis
from .candidates.possible import considered
from .candidates.posterior import causes_of
from .candidates.refits import finished as finished_of
from .candidates.refits import from_typical, in_time, is_hidden_by_noise, refitted
from .candidates.reservation import beside
from .candidates.score import Score, ScoreBoard, score_board_of
from .evidence.evidence import Evidence
from .unexplained.omnibus import Omnibus, Unknown, omnibus, omnibus_of

REFITS = 5
# Of the best statistic: what scores less than this share does not overtake it. States of their own
# make a refit slow, and what has some is scored at its typical size, not far from the refit.
_HOPELESS = 0.15
_HOPELESS_WITH_STATES = 0.6
_RIVALS = 0.3  # of the score of the best, with which one that acts like it may overtake it


@explaining
def diagnose(
    fit: Fit,
    logs: Log | Sequence[Log] | Driving | None = None,
    *,
    candidates: Sequence[str | Effect] | None = None,
    alpha: float | None = None,
    rules: Rules = USUAL,
    refits: int = REFITS,
    again: Collection[str] = (),
    workers: int | None = None,
    time_limit_s: float | None = None,
    seed: int = 0,
    progress: bool | None = None,
) -> Diagnosis:
    """Rank the effects a fitted model may lack.

    All candidates are scored at once (`score.py`); the best few are refitted with exact dynamics
    and ordered by likelihood.

    Parameters
    ----------
    fit : Fit
    logs : Log, sequence of Log, or Driving, optional
        What the model was fitted to; by default what `fit` remembers.
    candidates : sequence of str, optional
        Effects to consider; by default all that the model lacks.
    alpha : float
        Rate of false claims accepted, over all effects together; by default that of the rules.
    rules : Rules
        By which effects are claimed.
    refits : int
        How many of the best to refit; 0 ranks by score alone, and then none is named.
    again : collection of str
        Effects to refit beside them where there is evidence, such as those whose refits gained much
        in a poorer model: where a model is wrong in several ways, a refit may gain ten times what
        the score tells, as the noise that took up the effect is learned anew.
    workers : int, optional
        Threads; by default as many as there are cores. The result is the same for any number.
    time_limit_s : float, optional
        After so many seconds refits end: what was not refitted by then is ranked by its score,
        and not named.
    """
    ends = time.perf_counter() + duration(time_limit_s, "time_limit_s")
    rules = rules.at(alpha)
    if fit.horizon_s:
        raise InvalidInput(
            f"the fit is one to predictions {fit.horizon_s:g} s ahead, and evidence is of the "
            "likelihood; identify without horizon_s"
        )
    driving = fit.driving if logs is None else driving_of(fit, logs)
    possible = considered(fit.model, candidates)
    evidence = Evidence(fit, driving)
    board = score_board_of(evidence, possible, rules, Unknown(evidence), *shifts(evidence))
    left = omnibus_of(evidence, rules, board.projected)
    proposed = causes_of(board, evidence, rules)
    family = board.family_p_values(seed=seed)
    ranked = [
        Candidate(
            s.effect,
            s.statistic,
            family[s.effect.id],
            s.value,
            s.std,
            s.retained,
            s.variance_ratio,
            indistinguishable_from=_score_rivals(board, s, 2.0 * rules.apart),
        )
        for s in board.scores
    ]
    with Workers(workers) as pool:
        significant = [c for c in ranked if c.p_value < rules.alpha]
        few = _worth_refitting(significant, refits, again)
        more = _of_the_other_motion(significant, few)
        finished, far = _refitted(fit, driving, few, more, again, pool, ends, progress, rules)
        finished.sort(key=lambda c: -_merit(c, driving.samples))
        known = {c.id for c in finished}
        hidden = [c for c in ranked if is_hidden_by_noise(c.effect) and c.id not in known]
        hidden += _hidden_by_tyres(ranked, finished)
        if refits and hidden and time.perf_counter() < ends:
            n = len(ranked)
            if _leaves_more(finished[:1], left, driving, rules):
                work = in_time(lambda c: from_typical(fit, c, n, rules.alpha), ends)
                tried = pool.map(work, hidden)
                finished += [c for c in tried if c.finished and c.p_value < rules.alpha]
            else:
                suspects = _suspected(hidden, finished, board, rules)
                tried = pool.map(in_time(lambda c: from_typical(fit, c, n), ends), suspects)
                finished += [c for c in tried if c.finished]
    finished.sort(key=lambda c: -_merit(c, driving.samples))
    finished = [_with_refit_rivals(c, finished, 2.0 * rules.apart) for c in finished]
    done = {c.id for c in finished}
    far = [c for c in far if c.id not in done]
    done |= {c.id for c in far}
    ranked = finished + far + [c for c in ranked if c.id not in done]
    return _with_errors(
        Diagnosis(fit, driving, tuple(ranked), left, rules, board.scores, family, proposed=proposed)
    )


def _refitted(
    fit: Fit,
    driving: Driving,
    few: Sequence[Candidate],
    more: Sequence[Candidate],
    again: Collection[str],
    pool: Workers,
    ends: float,
    progress: bool | None,
    rules: Rules,
) -> tuple[list[Candidate], list[Candidate]]:
    """Those near the best with noise of their own, and the others under that of the fit.

    `more` are of another motion than the best one: those are left of which nothing remains beside
    that.
    """
    if not few:
        return [], []
    # What the best one gains tells which of the others cannot come near it, but for some.
    work = in_time(lambda c: refitted(fit, driving, c), ends)
    sure = [c for c in few[1:] if c.effect.along_alone == few[0].effect.along_alone]
    sure = [c for c in sure if not _too_fast(c) and (c.id in again or _rivals(c, few[0]))]
    first, *begun = pool.map(work, [few[0], *sure])
    known = {c.id: c for c in begun}
    if more and first.fit is not None:
        price = rules.price * float(np.log(driving.samples))
        left = beside(first.fit, driving, set(), rules)
        none = hopeless(left, more, price)
        more = [c for c in more if c.id not in none]
    few = [*few, *more]
    best = max(first.statistic, few[0].statistic)
    leaders = {c.effect.along_alone: c for c in reversed(few)}

    def hopeful(c: Candidate) -> bool:
        leader = leaders[c.effect.along_alone]
        most = best if leader is few[0] else leader.statistic
        return c.id in again or c.statistic > _hopeless(c) * most or _rivals(c, leader)

    others = [c for c in few[1:] if not _too_fast(c) and hopeful(c)]
    tried = [
        first,
        *with_progress(
            pool.map(lambda c: known.get(c.id) or work(c), others),
            "refits",
            total=len(others),
            shown=progress,
        ),
    ]
    # Under the noise of the poorer model they differ less than they really do.
    top = dict.fromkeys(leaders, 0.0)
    for c in tried:
        top[c.effect.along_alone] = max(top[c.effect.along_alone], c.statistic)
    near = [c for c in tried if c.statistic > 0.4 * top[c.effect.along_alone]]
    finished = list(pool.map(in_time(lambda c: finished_of(fit, c), ends), near))
    if any(c is begun and c.fit for c, begun in zip(finished, near, strict=True)):
        finished = near  # with noise of their own only some would seem the likelier ones
    done = {c.id for c in finished}
    far = sorted((c for c in tried if c.id not in done), key=lambda c: -c.statistic)
    return finished, far


def _hidden_by_tyres(ranked: Sequence[Candidate], finished: Sequence[Candidate]) -> list[Candidate]:
    """What acts like the best along the car, and may have no score beside tyres that are wrong.

    A mass moves the car along and divides its side forces: the score adds what the speed says and
    what tyres say that are not those of the car.
    """
    best = next((c for c in finished if c.effect.along_alone), None)
    if best is None:
        return []
    few = [c for c in ranked if c.id in best.effect.confounded_with and c.effect.along_alone]
    known = {c.id for c in finished}
    return [c for c in few if len(c.effect.parameters) == 1 and c.id not in known]


def _suspected(
    hidden: Sequence[Candidate], finished: Sequence[Candidate], board: ScoreBoard, rules: Rules
) -> list[Candidate]:
    """Those that a test of each alone tells apart from nothing, and that score as the best does.

    Noise may hide most of what they do.
    """
    scores = {s.effect.id: s for s in board.scores}
    least = _RIVALS * max((scores[c.id].statistic for c in finished), default=0.0)
    alone = [c for c in hidden if scores[c.id].p_value < 1.0 - rules.credible]
    return [c for c in alone if scores[c.id].statistic > least]


def _leaves_more(best: Sequence[Candidate], left: Omnibus, driving: Driving, rules: Rules) -> bool:
    """Whether something is left with the best candidate, or where there is none."""
    for c in best:
        if c.fit is not None:
            left = omnibus(c.fit, driving, rules)
    return left.p_value < rules.strict


def _with_errors(dx: Diagnosis) -> Diagnosis:
    """The same with errors, all at one noise floor."""
    errors = dx.errors_on(dx.driving, dx.floor)
    ranking = tuple(replace(c, error=errors.get(c.id, c.error)) for c in dx.ranking)
    return replace(dx, ranking=ranking, error=one_step_error(dx.fit, dx.driving, dx.floor))


def _worth_refitting(
    significant: list[Candidate], refits: int, again: Collection[str]
) -> list[Candidate]:
    """The best few, those asked for, and what the catalogue says acts like the very best."""
    few = significant[:refits]
    more = {*few[0].effect.confounded_with, *again} if few else set()
    return few + [c for c in significant[refits:] if c.id in more]


def _of_the_other_motion(
    significant: Sequence[Candidate], few: Sequence[Candidate]
) -> list[Candidate]:
    """The best that moves the car otherwise than the very best, and what acts like it.

    What the lateral model lacks says nothing of a mass, and several lateral effects may lead of
    which validation data confirm none.
    """
    if not few:
        return []
    along = not few[0].effect.along_alone
    leader = next((c for c in significant if c.effect.along_alone == along), None)
    if leader is None:
        return []
    known = {c.id for c in few}
    alike = {leader.id, *leader.effect.confounded_with}
    return [c for c in significant if c.id in alike and c.id not in known]


def _hopeless(c: Candidate) -> float:
    return _HOPELESS_WITH_STATES if c.effect.states > 1 else _HOPELESS


def _rivals(c: Candidate, best: Candidate) -> bool:
    """Whether it acts like the best one and scores nearly as well.

    Score is held against score: at the fit a refit starts from, such effects lead it astray alike,
    and what the first one gains when it is refitted the others may gain too.
    """
    return c.effect.is_like(best.effect) and c.statistic > _RIVALS * best.statistic


def _too_fast(c: Candidate) -> bool:
    """Whether its states would be so fast that they matter to nothing but the time they take."""
    pairs = zip(c.effect.parameters, c.value, strict=True)
    small = all(abs(v - p.null_value) < p.matters for p, v in pairs)
    return c.effect.states > 1 and c.effect.scored_at_typical and small


def _merit(c: Candidate, samples: int) -> float:
    """Gain in log-likelihood less the Bayesian price of its parameters."""
    return bic(0.5 * c.statistic, len(c.effect.parameters), samples)


def _score_rivals(board: ScoreBoard, score: Score, apart: float) -> tuple[str, ...]:
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


def _with_refit_rivals(c: Candidate, all_: list[Candidate], apart: float) -> Candidate:
    """Among refitted effects the likelihood itself says which cannot be told apart."""
    near = tuple(o.id for o in all_ if o is not c and abs(o.statistic - c.statistic) < apart)
    refitted = {o.id for o in all_}
    confounded = (*near, *(t for t in c.indistinguishable_from if t not in refitted))
    return replace(c, indistinguishable_from=confounded)
