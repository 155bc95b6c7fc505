"""The way to a better model: effects are added one by one, and earlier ones exchanged."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

from ..diagnose import Candidate, Diagnosis, diagnose
from ..estimate import Driving
from ..identify import Fit
from .steps import alternatives, exchanged, first_that_holds

__all__ = ["Search", "Trail"]


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
        By effect that was chosen or nearly chosen, what the driving could not tell from it.
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

    def note(self, dx: Diagnosis, chosen: Candidate) -> None:
        """Remember what was chosen, and what nearly was."""
        near = alternatives(dx, chosen)
        self.nearly[chosen.id] = near
        self.p_values |= {c.id: c.p_value for c in (chosen, *near)}
        for c in near:
            self.nearly.setdefault(c.id, alternatives(dx, c))
            self.rivals.setdefault(c.id, c.indistinguishable_from)
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
        """Add what is missing until nothing more is that the driving can show."""
        trail = Trail([baseline])
        while True:
            dx = self._diagnosis(trail.fit)
            trail.diagnoses.append(dx)
            step = first_that_holds(dx, trail.fit, self.test) if self.most_effects else None
            if step is None:
                return trail
            chosen, lean = step
            trail.note(dx, chosen)
            found = exchanged(lean, trail.nearly, self.test, most_effects=self.most_effects)
            effects = set(found.model.effects)
            # One more than allowed may make another needless.
            if len(effects) > self.most_effects:
                return trail
            if any(set(f.model.effects) == effects for f in trail.fits):
                return trail
            gone = set(trail.fit.model.effects) - effects
            trail.fits.append(found)
            self.say(f"Added {chosen.id}: {chosen.size}." + _instead(found, gone))

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
