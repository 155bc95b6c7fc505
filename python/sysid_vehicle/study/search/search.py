"""The way to a better model: effects are added one by one, and earlier ones exchanged."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from functools import partial

import numpy as np

from ..._common.text import unit_after
from ..._common.threads import before, in_parallel
from ...diagnose import (
    Candidate,
    Diagnosis,
    Size,
    beside_what_they_refine,
    diagnose,
    with_unfollowed,
)
from ...diagnose.diagnose import REFITS
from ...effects import Effect
from ...errors import Interrupted, NumericalError
from ...estimate import Driving
from ...identify import Fit, beside_noise, refine, with_own_offsets
from ...rules import Rules, harmful, worse
from ..ahead.along_the_car import changes_of
from ..ahead.own_share import own_shares
from ..validation import AHEAD, serving
from .steps import (
    alternatives,
    exchanged,
    first_that_holds,
    foretold_better,
    in_common,
    lead,
    likeliest,
)
from .together import InPlace, first_together, in_place_of

_UNSEEN = 3  # effects that the training data alone lead to, before validation data confirm one more


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
    sizes : dict
        Parameters of rivals and their standard errors, each refitted in place of what was chosen.
    stopped : tuple of str
        Effects with evidence that the time limit left untried.
    unpaired : bool
        Whether the time limit ended the search for effects that hold only together.
    full : tuple of str
        Effects with evidence that would have been one more than may be added.
    short : bool
        Whether the length of the training data says how many these are, not the user.
    taken_back : tuple of str
        Effects of last steps without which the model predicts better (`without_harm`).
    harmful : tuple of str
        Effects taken out of the last model, as errors ahead are larger with them.
    """

    fits: list[Fit]
    diagnoses: list[Diagnosis] = field(default_factory=list)
    p_values: dict[str, float] = field(default_factory=dict)
    rivals: dict[str, tuple[str, ...]] = field(default_factory=dict)
    nearly: dict[str, tuple[Candidate, ...]] = field(default_factory=dict)
    sizes: dict[str, Size] = field(default_factory=dict)
    stopped: tuple[str, ...] = ()
    unpaired: bool = False
    full: tuple[str, ...] = ()
    short: bool = False
    taken_back: tuple[str, ...] = ()
    harmful: tuple[str, ...] = ()

    @property
    def fit(self) -> Fit:
        """Where it leads."""
        return self.fits[-1]

    @property
    def refitted(self) -> tuple[str, ...]:
        """Effects near the best of the last diagnosis, by refits with noise of their own."""
        return tuple(c.id for dx in self.diagnoses[-1:] for c in dx.significant if c.finished)

    @property
    def confounded(self) -> dict[str, tuple[str, ...]]:
        """By effect of the last model, its rivals that are not in the model beside it."""
        there = self.fit.model.effects
        found = {e: names for e, names in self.rivals.items() if e in there}
        return {e: tuple(n for n in names if n not in there) for e, names in found.items()}

    @property
    def told(self) -> str:
        """The effects so far with their sizes, in words."""
        effects = [e for e in self.fit.model.effects if e not in self.fits[0].model.effects]
        if not effects:
            found = ", ".join(c.id for dx in self.diagnoses[:1] for c in dx.significant[:3])
            return f"no effect was added yet; there is evidence for {found or 'none'}"
        return "; ".join(f"{e}: {_sizes(self.fit, [e])}" for e in effects)

    def without_harm(self, test: Driving, rules: Rules) -> None:
        """Take back last steps while the model errs more ahead than the baseline, as it is fitted.

        Each step was judged by the parameters that predict best: what they show an effect to take
        away, those of the likelihood may lose where the effects that belong to it are not found.
        What the fit left open does not speak against it: tyres that never met a slip angle take
        any value, with an effect and without.
        """
        last = self.fit.model.effects

        def harms() -> bool:
            one, other = in_parallel(lambda fit: serving(fit, test), (self.fits[0], self.fit))
            return bool(worse(changes_of(one, other, test, AHEAD), rules))

        while len(self.fits) > 1 and harms():
            self.fits.pop()
            self.diagnoses.pop()
        self.taken_back = tuple(e for e in last if e not in self.fit.model.effects)

    def note_several(
        self, dx: Diagnosis, chosen: Sequence[str], rivals: Mapping[str, InPlace]
    ) -> None:
        """Remember what was chosen together, and what is confounded with each of it.

        So by the posterior, and as `in_place_of` finds.
        """
        self.sizes |= dx.sizes
        for name in chosen:
            self.p_values[name] = dx.family[name]
            shared = dx.proposed.of(name)
            others = () if shared is None else shared.effects
            known = set(dx.family) - set(chosen)
            in_place = rivals.get(name, InPlace())
            alike = dict.fromkeys((*others, *in_place.names))
            self.rivals[name] = tuple(e for e in alike if e in known)
            self.sizes |= in_place.sizes

    def note(self, dx: Diagnosis, chosen: Candidate) -> None:
        """Remember what was chosen, and what nearly was."""
        near = alternatives(dx, chosen)
        self.nearly[chosen.id] = near
        self.p_values |= {c.id: c.p_value for c in (chosen, *near)}
        for c in near:
            self.nearly.setdefault(c.id, alternatives(dx, c))
            self.rivals.setdefault(c.id, c.indistinguishable_from)
        self.rivals[chosen.id] = chosen.indistinguishable_from
        self.sizes |= dx.sizes


@contextmanager
def kept(trail: Trail) -> Iterator[None]:
    """Say after Ctrl-C in the block what is known by then.

    Raises
    ------
    Interrupted
    """
    try:
        yield
    except KeyboardInterrupt as signal:
        told = Interrupted(
            f"after {len(trail.fits) - 1} step(s): {trail.told}. The models so far, the baseline "
            "first, are the `fits` of this exception (sys.last_value.fits)"
        )
        told.fits = tuple(trail.fits)
        raise told from signal


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
            effects = set(found.model.effects)
            # One more than allowed may make another needless.
            if len(effects) > self.most_effects:
                trail.full = tuple(sorted(effects - set(trail.fit.model.effects)))
                return
            if any(set(f.model.effects) == effects for f in trail.fits):
                return
            known = set(trail.fit.model.effects)
            trail.fits.append(beside_noise(found))
            self.say(_step(found, known))

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


def _step(found: Fit, known: Collection[str]) -> str:
    """What a step put into the model, with sizes, and what it took out of it, in words.

    A step may exchange what was there before, and drop what it began with itself.
    """
    new = [e for e in found.model.effects if e not in known]
    gone = sorted(e for e in known if e not in found.model.effects)
    said = [f"Added {' and '.join(new)}: {_sizes(found, new)}."] if new else []
    said += [f"Removed {' and '.join(gone)}."] if gone else []
    return " ".join(said)


def _sizes(fit: Fit, effects: Sequence[str]) -> str:
    """Parameters of effects with standard errors, in words."""
    found = [e for e in fit.estimates if e.name.split(".")[0] in effects]
    several = len(effects) > 1
    return ", ".join(
        f"{e.name if several else e.name.split('.')[1]} {e.size}{unit_after(e.unit)}" for e in found
    )
