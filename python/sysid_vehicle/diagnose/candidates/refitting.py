"""Which candidates are refitted with exact dynamics, and how far: refits are what takes time."""

from __future__ import annotations

import time
from collections.abc import Callable, Collection, Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from ..._common.progress import with_progress
from ..._common.threads import Workers
from ...estimate import Driving
from ...identify import Fit
from ...rules import Rules
from ..unexplained.omnibus import Omnibus, omnibus
from .candidate import Candidate
from .confirm import hopeless
from .on_the_level import needs_road, shown_on_the_level
from .refits import (
    finished,
    from_size,
    from_typical,
    in_time,
    is_hidden_by_noise,
    predicted_size,
    refitted,
)
from .reservation import beside
from .score import ScoreBoard

# Of the best statistic: what scores less than this share does not overtake it. States of their own
# make a refit slow, and what has some is scored at its typical size, not far from the refit.
_HOPELESS = 0.15
_HOPELESS_WITH_STATES = 0.6
_RIVALS = 0.3  # of the score of the best, with which one that acts like it may overtake it
_NEAR = 0.4  # of the best refit, with which one is finished with noise of its own


@dataclass(frozen=True, eq=False)
class Refitting:
    """Refits of the candidates of one diagnosis.

    Attributes
    ----------
    fit : Fit
        What lacks them.
    driving : Driving
    rules : Rules
    again : collection of str
        Effects to refit beside the best ones where there is evidence.
    pool : Workers
    ends : float
        When refits end [s of `time.perf_counter`].
    progress : bool or None
    """

    fit: Fit
    driving: Driving
    rules: Rules
    again: Collection[str]
    pool: Workers
    ends: float
    progress: bool | None

    def leading(
        self, significant: Sequence[Candidate], refits: int
    ) -> tuple[list[Candidate], list[Candidate]]:
        """Those near the best with noise of their own, and the others under that of the fit.

        Of another motion than the best one those are left of which nothing remains beside that.
        """
        few = self._worth_refitting(significant, refits)
        more = _of_the_other_motion(significant, few)
        if not few:
            return [], []
        # What the best one gains tells which of the others cannot come near it, but for some.
        work = in_time(lambda c: refitted(self.fit, self.driving, c), self.ends)
        sure = [c for c in few[1:] if c.effect.along_alone == few[0].effect.along_alone]
        sure = [c for c in sure if not _too_fast(c) and self._is_asked_for(c, few[0])]
        first, *begun = self.pool.map(work, [few[0], *sure])
        known = {c.id: c for c in begun}
        few = [*few, *self._left_beside(first, more)]
        hopeful = self._hopeful(first, few)
        others = [c for c in few[1:] if not _too_fast(c) and hopeful(c)]
        rest = self.pool.map(lambda c: known.get(c.id) or work(c), others)
        shown = with_progress(rest, "refits", total=len(others), shown=self.progress)
        return self._finished([first, *shown])

    def beside_the_leading(
        self,
        ranked: Sequence[Candidate],
        known: Sequence[Candidate],
        far: Sequence[Candidate],
        most: int,
        left: Omnibus,
        board: ScoreBoard,
        follow_all: bool = True,
    ) -> tuple[list[Candidate], tuple[str, ...]]:
        """Refits of rivals of the best one, and of what no score shows, all side by side.

        Parameters
        ----------
        ranked : sequence of Candidate
            All of them.
        known, far : sequence of Candidate
            Refitted already, the best one first.
        most : int
            Rivals that are refitted.
        left : Omnibus
            Of the fit.
        board : ScoreBoard
        follow_all : bool
            Whether what no score shows is followed that comes nowhere near the best one.

        Returns
        -------
        refitted : list of Candidate
        unfollowed : tuple of str
            `hidden` tells whether there is evidence for them.
        """
        if time.perf_counter() >= self.ends:
            return [], ()
        rivals = _rivals_of_the_best(ranked, known, far, most)
        asked = {c.id for c in rivals}
        hidden = [c for c in self._hidden(ranked, known, left, board) if c.id not in asked]
        best = max((c.fit for c in known if c.fit), key=lambda f: f.log_likelihood, default=None)
        again = in_time(lambda c: refitted(self.fit, self.driving, c), self.ends)
        end = self._at_its_maximum(-np.inf if best is None else best.log_likelihood)
        shown = self._shown(len(ranked), None if follow_all else best)
        jobs: list[tuple[Callable[[Candidate], Candidate], Candidate]] = []
        jobs += [(lambda c: end(again(c)), c) for c in rivals]
        jobs += [(shown, c) for c in hidden]
        tried = list(self.pool.map(lambda job: job[0](job[1]), jobs))
        found = [c for c in tried[: len(rivals)] if c.fit is not None]
        found += self._significant(tried[len(rivals) :])
        unfollowed = [c.id for c in tried[len(rivals) :] if c.fit is not None and not c.finished]
        return found, tuple(unfollowed)

    def hidden(self, ranked: Sequence[Candidate], names: Collection[str]) -> list[Candidate]:
        """Refits of what no score shows, where they are evidence, whatever else there is."""
        work = self._shown(len(ranked), None)
        return self._significant(self.pool.map(work, [c for c in ranked if c.id in names]))

    def left_out(self, ranked: Sequence[Candidate], names: Collection[str]) -> list[Candidate]:
        """Refits of what had not been followed, where they are evidence, as nothing else holds.

        What is missing may have bent the fit so much that what it would explain scores next to
        nothing there: a refit with the noise of the fit tells in no time which gains the most.
        """
        few = [c for c in ranked if c.id in names]
        scored = [
            c for c in few if c.p_value < self.rules.alpha and not is_hidden_by_noise(c.effect)
        ]
        found = self.hidden(ranked, {c.id for c in few} - {c.id for c in scored})
        again = in_time(lambda c: refitted(self.fit, self.driving, c), self.ends)
        most = max((c.statistic for c in ranked if c.fit is not None), default=0.0)
        tried = self.pool.map(again, [c for c in scored if not _too_fast(c)])
        near = [c for c in tried if c.fit is not None and c.statistic > _NEAR * most]
        return found + self._significant(self.pool.map(self._at_its_maximum(), near))

    def _shown(self, tests: int, rival: Fit | None) -> Callable[[Candidate], Candidate]:
        alpha = self.rules.alpha
        return in_time(lambda c: from_typical(self.fit, c, tests, alpha, rival), self.ends)

    def _significant(self, tried: Iterable[Candidate]) -> list[Candidate]:
        return [c for c in tried if c.finished and c.p_value < self.rules.alpha]

    def _hidden(
        self,
        ranked: Sequence[Candidate],
        known: Sequence[Candidate],
        left: Omnibus,
        board: ScoreBoard,
    ) -> list[Candidate]:
        """What noise or tyres that are wrong may hide."""
        done = {c.id for c in known}
        hidden = [c for c in ranked if is_hidden_by_noise(c.effect) and c.id not in done]
        hidden += _hidden_by_tyres(ranked, known)
        if hidden and not self._leaves_more(known[:1], left):
            return _suspected(hidden, known, board, self.rules)
        return hidden

    def hidden_by_the_road(
        self, ranked: Sequence[Candidate], known: Sequence[Candidate]
    ) -> list[Candidate]:
        """Refits of what a road whose slope varies may hide, from the sizes that a level one shows.

        A body that leans in corners reads as a bank would: under noise that has learned such a road
        neither score nor refit shows it. The likelihood, with noise of its own, tells which it is.
        """
        if not self.fit.noise.sloping or time.perf_counter() >= self.ends:
            return []
        done = {c.id: c.fit for c in known if c.fit is not None}
        shown = shown_on_the_level(self.fit, self.driving, ranked, self.rules)
        asked = [c for c in shown if c.id not in done or needs_road(done[c.id], self.fit)]
        n, alpha = len(ranked), self.rules.alpha
        work = in_time(lambda c: from_size(self.fit, c, predicted_size(c), n, alpha), self.ends)
        best = {c.id: c.statistic for c in known}
        tried = self._significant(self.pool.map(work, asked))
        return [c for c in tried if c.statistic > best.get(c.id, 0.0)]

    def _worth_refitting(self, significant: Sequence[Candidate], refits: int) -> list[Candidate]:
        """The best few, those asked for, and what the catalogue says acts like the very best."""
        few = list(significant[:refits])
        more = {*few[0].effect.confounded_with, *self.again} if few else set()
        return few + [c for c in significant[refits:] if c.id in more]

    def _is_asked_for(self, c: Candidate, best: Candidate) -> bool:
        return c.id in self.again or _rivals(c, best)

    def _left_beside(self, first: Candidate, more: Sequence[Candidate]) -> list[Candidate]:
        """Those that may gain something beside the first one."""
        if not more or first.fit is None:
            return list(more)
        price = self.rules.price * float(np.log(self.driving.samples))
        none = hopeless(beside(first.fit, self.driving, set(), self.rules), more, price)
        return [c for c in more if c.id not in none]

    def _hopeful(self, first: Candidate, few: Sequence[Candidate]) -> Callable[[Candidate], bool]:
        """Whether one may come near the best of its motion, by what the first one gained."""
        best = max(first.statistic, few[0].statistic)
        leaders = {c.effect.along_alone: c for c in reversed(few)}

        def hopeful(c: Candidate) -> bool:
            leader = leaders[c.effect.along_alone]
            most = best if leader is few[0] else leader.statistic
            return c.statistic > _hopeless(c) * most or self._is_asked_for(c, leader)

        return hopeful

    def _finished(self, tried: Sequence[Candidate]) -> tuple[list[Candidate], list[Candidate]]:
        """Those near the best of their motion with noise of their own, and the others."""
        # Under the noise of the poorer model they differ less than they really do.
        top: dict[bool, float] = {}
        for c in tried:
            top[c.effect.along_alone] = max(top.get(c.effect.along_alone, 0.0), c.statistic)
        near = [c for c in tried if c.statistic > _NEAR * top[c.effect.along_alone]]
        near.sort(key=lambda c: -c.statistic)
        # The first ones of both motions tell how far the others have to come.
        leaders = [*{c.effect.along_alone: c for c in reversed(near)}.values()]
        near = [*leaders, *(c for c in near if c not in leaders)]
        done = list(self.pool.map(self._at_its_maximum(), leaders))
        least = {c.effect.along_alone: _height(c) for c in done}

        def follow(c: Candidate) -> Candidate:
            return self._at_its_maximum(least[c.effect.along_alone])(c)

        done += self.pool.map(follow, near[len(leaders) :])
        if any(c is begun and c.fit for c, begun in zip(done, near, strict=True)):
            done = near  # with noise of their own only some would seem the likelier ones
        ids = {c.id for c in done}
        far = sorted((c for c in tried if c.id not in ids), key=lambda c: -c.statistic)
        return done, far

    def _at_its_maximum(self, least: float = -np.inf) -> Callable[[Candidate], Candidate]:
        return in_time(lambda c: finished(self.fit, c, least), self.ends)

    def _leaves_more(self, best: Sequence[Candidate], left: Omnibus) -> bool:
        """Whether something is left with the best candidate, or where there is none."""
        for c in best:
            if c.fit is not None:
                left = omnibus(c.fit, self.driving, self.rules)
        return left.p_value < self.rules.strict


def _height(c: Candidate) -> float:
    return -np.inf if c.fit is None else c.fit.log_likelihood


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


def _rivals_of_the_best(
    ranked: Sequence[Candidate], known: Sequence[Candidate], far: Sequence[Candidate], most: int
) -> list[Candidate]:
    """What scores say cannot be told from the best one, where it has not been refitted.

    Scores are of the fit, which what is missing has bent: the likelihood often tells them apart. Of
    many such rivals a few are refitted.
    """
    done = {c.id for c in (*known, *far)}
    names = set(known[0].indistinguishable_from) - done if known else set()
    return [c for c in ranked if c.id in names and not _too_fast(c)][:most]


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
