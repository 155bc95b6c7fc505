"""The way to a better model: effects are added one by one, and the choices thought over again."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field

from ..diagnose import Candidate, Diagnosis, considered, diagnose
from ..diagnose.score import score_board
from ..estimate import Driving
from ..identify import Fit
from .steps import (
    alternatives,
    better,
    exchanged,
    first_that_holds,
    lead,
    with_others,
    without_idle,
)

__all__ = ["Search", "Trail"]

_ROUNDS = 2  # of second thoughts


@dataclass(eq=False)
class Trail:
    """How a model came about.

    Attributes
    ----------
    fits : list of Fit
        After each step; the first is the baseline.
    diagnoses : list of Diagnosis
        Before each step, and the last one, which found nothing more to add.
    p_values : dict
        By effect, when it was chosen or nearly chosen.
    rivals : dict
        By effect that was chosen, what the driving could not tell from it.
    nearly : dict
        By effect, what was nearly chosen in its place.
    """

    fits: list[Fit]
    diagnoses: list[Diagnosis] = field(default_factory=list)
    p_values: dict[str, float] = field(default_factory=dict)
    rivals: dict[str, tuple[str, ...]] = field(default_factory=dict)
    nearly: dict[str, tuple[Candidate, ...]] = field(default_factory=dict)

    @property
    def fit(self) -> Fit:
        """Where it leads."""
        return self.fits[-1]

    def to(self, fit: Fit) -> Trail:
        """Another one, with this one behind it."""
        return Trail(
            [*self.fits, fit],
            list(self.diagnoses),
            dict(self.p_values),
            dict(self.rivals),
            dict(self.nearly),
        )

    def note(self, dx: Diagnosis, chosen: Candidate) -> None:
        """Remember what was chosen, and what nearly was."""
        near = alternatives(dx, chosen)
        for c in near:
            self.nearly.setdefault(c.id, alternatives(dx, c))
        self.nearly[chosen.id] = near
        self.p_values |= {c.id: c.p_value for c in (chosen, *near)}
        self.rivals[chosen.id] = chosen.indistinguishable_from


@dataclass(frozen=True)
class Search:
    """Looks for the effects that a model lacks.

    Attributes
    ----------
    test : Driving
        What no fit sees, and every step must predict better.
    """

    test: Driving
    candidates: Sequence[str] | None
    most_effects: int
    alpha: float
    seed: int
    progress: bool
    say: Callable[[str], None]

    def from_baseline(self, baseline: Fit) -> Trail:
        """Add what is missing until nothing more is, then think the choices over.

        What is chosen first is chosen while all else is still missing: an alternative that was
        nearly as good may lead further.
        """
        best = self._grown(Trail([baseline]))
        for _ in range(_ROUNDS):
            last = best.diagnoses[-1]
            if not (last.significant or last.omnibus.rejects):
                break  # nothing is left to be explained better
            other = next(self._second_thoughts(best), None)
            if other is None:
                break
            gone = ", ".join(sorted(set(best.fit.model.effects) - set(other.fit.model.effects)))
            self.say(f"Better without {gone}: the model is {', '.join(other.fit.model.effects)}.")
            best = other
        return best

    def _grown(self, trail: Trail) -> Trail:
        """The trail led on until nothing more is missing that the driving can show."""
        while True:
            dx = self._diagnosis(trail.fit)
            trail.diagnoses.append(dx)
            chosen = first_that_holds(dx, trail.fit, self.test) if self.most_effects else None
            if chosen is None:
                return trail
            assert chosen.fit is not None
            trail.note(dx, chosen)
            found = exchanged(
                without_idle(chosen.fit), trail.nearly, self.test, most_effects=self.most_effects
            )
            effects = set(found.model.effects)
            # One more than allowed may make another needless.
            if len(effects) > self.most_effects:
                return trail
            if any(set(f.model.effects) == effects for f in trail.fits):
                return trail
            gone = set(trail.fit.model.effects) - effects
            trail.fits.append(found)
            self.say(f"Added {chosen.id}: {chosen.size}." + _instead(found, gone))

    def _second_thoughts(self, trail: Trail) -> Iterator[Trail]:
        """Better ways that begin with an alternative in place of one of the effects."""
        fit = trail.fit
        for name in fit.model.effects:
            for c in trail.nearly.get(name, ()):
                if c.id in fit.model.effects:
                    continue
                start = with_others(fit, name, (c,))
                if start is None or not self._promises(start, fit):
                    continue
                other = self._grown(trail.to(start))
                if better(other.fit, fit, self.test):
                    yield other

    def _promises(self, start: Fit, fit: Fit) -> bool:
        """Whether what it still lacks could bring one fit before another, on both drivings."""
        board = score_board(start, start.driving, considered(start.model, self.candidates))
        gains = [0.5 * s.statistic * max(s.variance_ratio, 1.0) for s in board.scores]
        return lead(start, fit, self.test) + 2.0 * max(gains, default=0.0) > 0.0

    def _diagnosis(self, fit: Fit) -> Diagnosis:
        return diagnose(
            fit,
            candidates=self.candidates,
            alpha=self.alpha,
            seed=self.seed,
            progress=self.progress,
        )


def _instead(fit: Fit, gone: set[str]) -> str:
    """What the step took out of the model, and what came in its place, in words."""
    if not gone:
        return ""
    return f" Without {', '.join(sorted(gone))} the model is {', '.join(fit.model.effects)}."
