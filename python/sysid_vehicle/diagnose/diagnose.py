"""Rank the physical effects that a fitted model may be missing."""

from __future__ import annotations

import time
from collections.abc import Collection, Sequence
from dataclasses import replace

import numpy as np

from .._common.arguments import duration
from .._common.threads import Workers
from .._common.typed import typed
from ..compare import one_step_error
from ..effects import Effect
from ..errors import InvalidInput
from ..estimate import Driving
from ..identify import Fit, explaining
from ..log import Log
from ..rules import USUAL, Rules, bic
from .candidates.candidate import Candidate
from .candidates.clocks import shifts
from .candidates.diagnosis import Diagnosis
from .candidates.on_the_level import may_be_the_drivers
from .candidates.possible import beside_what_they_refine, considered
from .candidates.posterior import causes_of
from .candidates.refitting import Refitting
from .candidates.rivals import score_rivals, with_refit_rivals
from .candidates.score import score_board_of
from .evidence.evidence import Evidence, evident
from .unexplained.omnibus import Unknown, omnibus_of

REFITS = 5


@typed
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
    follow_all: bool = True,
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
        Effects to refit beside them where there is evidence, as is done with what refines an effect
        of the model; such as those whose refits gained much in a poorer model: where a model is
        wrong in several ways, a refit may gain ten times what the score tells, as the noise that
        took up the effect is learned anew.
    follow_all : bool
        Whether what noise may hide is refitted to its maximum however far below the best effect it
        ends, and what scores far less where the best one has a value that no car can have. A search
        that adds the best one asks again beside it.
    workers : int, optional
        Threads; by default as many as there are cores. The result is the same for any number.
    time_limit_s : float, optional
        After so many seconds refits end: what was not refitted by then is ranked by its score,
        and not named.
    seed : int
        Of the draws that p-values over all effects together come from.
    progress : bool, optional
        Show progress; by default in a terminal or a notebook.
    """
    ends = time.perf_counter() + duration(time_limit_s, "time_limit_s")
    rules = rules.at(alpha)
    if fit.horizon_s:
        raise InvalidInput(
            f"the fit is one to predictions {fit.horizon_s:g} s ahead, and evidence is of the "
            "likelihood; identify without horizon_s"
        )
    driving = evident(fit, logs)
    possible = considered(fit.model, candidates)
    # Whatever leads may stand in for what refines an effect that the model has.
    finer = beside_what_they_refine((e for e in possible if e.refines), fit.model)
    again = {*again, *(e.id for e in finer)}
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
            indistinguishable_from=score_rivals(board, s, 2.0 * rules.apart),
        )
        for s in board.scores
    ]
    with Workers(workers) as pool:
        chosen = Refitting(fit, driving, rules, again, pool, ends, progress)
        finished, far = chosen.leading([c for c in ranked if c.p_value < rules.alpha], refits)
        finished.sort(key=lambda c: -_merit(c, driving.samples))
        unfollowed: tuple[str, ...] = ()
        if refits:
            more, unfollowed = chosen.beside_the_leading(
                ranked, finished, far, refits, left, board, follow_all
            )
            finished += more
            on_the_level = chosen.hidden_by_the_road(ranked, [*finished, *far])
            found = {c.id for c in on_the_level}
            finished = [*on_the_level, *(c for c in finished if c.id not in found)]
        told = _told(finished, far, ranked, chosen)
    if refits:
        unfollowed += tuple(c.id for c in told if c.fit is None and c.p_value < rules.alpha)
    dx = _with_errors(
        Diagnosis(
            fit,
            driving,
            told,
            left,
            rules,
            board.scores,
            family | {c.id: 1.0 for c in told if c.fit is not None and c.p_value == 1.0},
            proposed=proposed,
            unfollowed=unfollowed,
        )
    )
    if follow_all and unfollowed and not told[0].can_be(rules):
        return with_unfollowed(dx, ends)
    return dx


def with_unfollowed(dx: Diagnosis, ends: float = np.inf) -> Diagnosis:
    """The same with evidence for what it had not followed, as it came nowhere near the best effect.

    It may be what is missing even so, where the best one holds nowhere else.

    Parameters
    ----------
    dx : Diagnosis
    ends : float
        When refits end [s of `time.perf_counter`].
    """
    with Workers(None) as pool:
        chosen = Refitting(dx.fit, dx.driving, dx.rules, (), pool, ends, False)
        more = chosen.left_out(dx.ranking, dx.unfollowed)
        if not more:
            return replace(dx, unfollowed=())
        new = {c.id for c in more}
        known = [c for c in dx.ranking if c.fit is not None and c.id not in new]
        finished = [*more, *(c for c in known if c.finished)]
        far = [c for c in known if not c.finished]
        told = _told(finished, far, dx.ranking, chosen)
    return _with_errors(replace(dx, ranking=told, unfollowed=()))


def _told(
    finished: Sequence[Candidate],
    far: Sequence[Candidate],
    ranked: Sequence[Candidate],
    by: Refitting,
) -> tuple[Candidate, ...]:
    """All candidates, those with noise of their own first, with what cannot be told from each."""
    samples = by.driving.samples
    finished, far = ([_proven(c, by.fit) for c in some] for some in (finished, far))
    likeliest_first = sorted(finished, key=lambda c: -_merit(c, samples))
    best = with_refit_rivals(likeliest_first, far, by.driving, by.rules, by.pool, by.ends)
    done = {c.id for c in best}
    poorer = [c for c in far if c.id not in done]
    done |= {c.id for c in poorer}
    return (*best, *poorer, *(c for c in ranked if c.id not in done))


def _proven(c: Candidate, before: Fit) -> Candidate:
    """The candidate, without evidence where that may be none of it."""
    return replace(c, p_value=1.0) if may_be_the_drivers(c, before) else c


def _with_errors(dx: Diagnosis) -> Diagnosis:
    """The same with errors, all at one noise floor."""
    errors = dx.errors_on(dx.driving, dx.floor)
    ranking = tuple(replace(c, error=errors.get(c.id, c.error)) for c in dx.ranking)
    return replace(dx, ranking=ranking, error=one_step_error(dx.fit, dx.driving, dx.floor))


def _merit(c: Candidate, samples: int) -> float:
    """Gain in log-likelihood less the Bayesian price of its parameters."""
    return bic(0.5 * c.statistic, len(c.effect.parameters), samples)
