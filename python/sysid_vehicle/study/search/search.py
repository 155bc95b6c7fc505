"""The way to a better model: effects are added one by one, and earlier ones exchanged."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import partial

import numpy as np

from ..._common.threads import before
from ...diagnose import (
    Candidate,
    Diagnosis,
    beside_what_they_refine,
    diagnose,
    with_unfollowed,
)
from ...diagnose.diagnose import REFITS
from ...effects import Effect
from ...errors import NumericalError
from ...estimate import Driving
from ...identify import Fit, beside_noise, refine, with_own_offsets
from ...rules import Rules, harmful
from ..ahead.own_share import own_shares
from .steps import (
    exchanged,
    first_that_holds,
    foretold_better,
    in_common,
    lead,
    likeliest,
    without_insignificant,
)
from .together import first_together, in_place_of
from .trail import Trail, step_in_words

_UNSEEN = 3  # effects that the training data alone lead to, before validation data confirm one more


@dataclass(frozen=True)
class Search:
    """Looks for the effects that a model lacks.

    Attributes
    ----------
    test : Driving
        Validation data, which every step must predict better.
    ends : float
        When refits end, by `time.perf_counter`.
    rules : Rules
    judged_by : float
        Until when validation data are asked whether what was refitted holds.
    finer : sequence of Effect
        Candidates where the model has what they refine.
    """

    test: Driving
    candidates: Sequence[str | Effect]
    most_effects: int
    ends: float
    rules: Rules
    seed: int
    progress: bool | None
    say: Callable[[str], None]
    judged_by: float = math.inf
    finer: Sequence[Effect] = ()

    def follow(self, trail: Trail) -> None:
        """Add what is missing to the last model until nothing more is that the driving can show."""
        while True:
            in_time = time.perf_counter() < self.ends
            dx = self._diagnosis(trail.fit, trail.refitted)
            trail.diagnoses.append(dx)
            if not in_time:
                trail.stopped = tuple(c.id for c in dx.significant)
                return
            step, several = self._that_hold(dx)
            judged = self._judged(dx)
            if step is None and several is None and dx.unfollowed:
                # Where the best effect does not hold another may, however little it gains.
                ranking, dx = dx.ranking, with_unfollowed(dx, self.ends)
                trail.diagnoses[-1] = dx
                if dx.ranking is not ranking:
                    step, several = self._that_hold(dx)
                    judged |= self._judged(dx)
            beside = None
            if step is None and several is None:
                beside = before(self.ends, partial(self._beside_others, dx, trail), None)
            if several is not None:
                chosen, lean = several
                trail.note_several(dx, chosen, in_place_of(lean, chosen, dx, self.ends))
            elif beside is not None:
                chosen, lean = beside
            elif step is not None:
                chosen, lean = (step[0].id,), step[1]
                trail.note(dx, step[0])
            else:
                if time.perf_counter() > self.ends:
                    trail.stopped = tuple(c.id for c in dx.significant if c.id not in judged)
                    trail.unpaired = bool(judged)
                elif not self.most_effects:
                    trail.full = tuple(c.id for c in dx.significant)
                return
            found = exchanged(
                lean,
                {**trail.nearly, **in_common(lean, chosen, dx.ranking)},
                self.test,
                most_effects=self.most_effects,
                rules=self.rules,
                ends=self.ends,
            )
            found = self.lean(found)
            effects = set(found.model.effects)
            # One more than allowed may make another needless.
            if len(effects) > self.most_effects:
                trail.full = tuple(sorted(effects - set(trail.fit.model.effects)))
                return
            if any(set(f.model.effects) == effects for f in trail.fits):
                return
            known = set(trail.fit.model.effects)
            trail.fits.append(found)
            self.say(step_in_words(found, known))

    def _that_hold(
        self, dx: Diagnosis
    ) -> tuple[tuple[Candidate, Fit] | None, tuple[tuple[str, ...], Fit] | None]:
        """The single effect to add, and the several together; None where none holds.

        What was refitted is not lost; what takes further refits waits for another study.
        """
        step, by = None, (self.ends, self.judged_by)
        if self.most_effects:
            step = first_that_holds(dx, dx.fit, self.test, *by)
        single = None if step is None else step[1]
        return step, first_together(dx, self.test, single, self.most_effects, *by)

    def _judged(self, dx: Diagnosis) -> set[str]:
        """Effects that validation data have answered for, where that was done in time."""
        if time.perf_counter() > self.ends:
            return set()
        return {c.id for c in dx.significant if c.fit is not None}

    def take_out_harmful(self, trail: Trail) -> None:
        """Take effects out of the last model with which errors ahead are shown to be larger.

        Where they move something, on validation data, beside all others: when they came that may
        not have shown, and it hides what the others take. Where nothing is left shares are noise.
        """
        baseline = trail.fits[0].model.effects
        while len(trail.fits) > 1 and trail.diagnoses[-1].omnibus.rejects:
            fit = trail.fit
            added = [e for e in fit.model.effects if e not in baseline]
            own = own_shares(fit, added, added, self.test, self.judged_by, self.rules)
            worst = [(s.value, e) for e, (s, _) in own.items() if harmful(s, self.rules)]
            if not worst:
                return
            name = min(worst)[1]
            poorer = before(self.judged_by, partial(self._without, fit, name), None)
            if poorer is None:
                return
            trail.harmful += (name,)
            if len(added) > 1:
                trail.fits.append(beside_noise(poorer))
                trail.diagnoses.append(self._diagnosis(trail.fit, (), refits=0))
            else:
                del trail.fits[1:], trail.diagnoses[1:]
            self.say(f"Removed {name}.")

    def give_back(self, trail: Trail) -> None:
        """Find anew what nuisances are in each log, with all effects of the last model beside them.

        They were found with the baseline, and hold what they had taken up of the effects. Where all
        data prefer what the search found, it stays.
        """
        if len(trail.fits) < 2:
            return
        fit = found = trail.fit
        with suppress(NumericalError, np.linalg.LinAlgError):
            found = before(self.judged_by, partial(with_own_offsets, fit), fit)
        if found is not fit and lead(found, fit, self.test) > 0.0:
            trail.fits[-1] = beside_noise(found)
            trail.diagnoses[-1] = self._diagnosis(trail.fit, (), refits=0)

    def lean(self, fit: Fit) -> Fit:
        """The fit with standard errors beside its noise, and without what these show needless.

        With the noise held they may be half as large.
        """
        beside = beside_noise(fit)
        found = before(self.ends, partial(without_insignificant, beside, self.rules), beside)
        return found if found is beside else beside_noise(found)

    def _without(self, fit: Fit, name: str) -> Fit | None:
        try:
            return refine(fit.model.drop(name), fit.driving, fit.noise)
        except (NumericalError, np.linalg.LinAlgError):
            return None

    def _beside_others(self, dx: Diagnosis, trail: Trail) -> tuple[tuple[str, ...], Fit] | None:
        """The likeliest candidates one after the other, where they hold only together.

        What else is missing may do more to the validation data than an effect explains. So the
        training data alone lead on, until validation data confirm the whole; beyond two only while
        these are predicted better one step ahead.
        """
        noted: list[tuple[Diagnosis, Candidate]] = []
        while len(noted) < _UNSEEN:
            first = likeliest(dx)
            if first is None or first.fit is None:
                return None
            if len(first.fit.model.effects) >= self.most_effects:
                return None
            if noted and not foretold_better(trail.fit, first.fit, self.test, self.rules):
                return None
            noted.append((dx, first))
            dx = self._diagnosis(beside_noise(first.fit), trail.refitted)
            step = first_that_holds(dx, trail.fit, self.test, self.ends)
            if step is None:
                continue
            last, lean = step
            for at, c in (*noted, (dx, last)):
                trail.note(at, c)
            new = (e for e in lean.model.effects if e not in trail.fit.model.effects)
            return tuple(new), lean
        return None

    def _diagnosis(self, fit: Fit, again: Sequence[str], refits: int = REFITS) -> Diagnosis:
        """All effects scored, some refitted again; where no time is left none is refitted."""
        left = self.ends - time.perf_counter()
        finer = beside_what_they_refine(self.finer, fit.model)
        return diagnose(
            fit,
            candidates=(*self.candidates, *finer),
            rules=self.rules,
            refits=refits if left > 0.0 else 0,
            again=again if left > 0.0 else (),
            follow_all=False,
            time_limit_s=left if left > 0.0 else None,
            seed=self.seed,
            progress=self.progress,
        )
