"""What is known of the model that a search has led to, and the verdict that follows."""

from __future__ import annotations

import math
import time
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

from ..._common.arrays import FloatArray
from ..._common.threads import before, in_parallel
from ...compare import Comparison, compare
from ...diagnose import Instead, Omnibus, Verdicts, instead, judge, omnibus, widened
from ...estimate import Driving
from ...identify import Fit, driving_of
from ...log import unexcited
from ...rules import LACKING, Facts, Rules, incomplete, standing, verdict
from ...sensors import Kinematics, backed
from ..ahead.beyond import Beyond
from ..ahead.own_share import (
    alike,
    own_shares,
    shares_of_groups,
    shown_together,
    sure_of,
    together_by_motion,
    without_idle,
)
from ..limit import TOGETHER, Judging
from ..results.added import added_by, of_one_step
from ..results.widened import as_unsure, estimates_of
from ..search.steps import insignificant, way
from ..search.together import in_place_of
from ..search.trail import Trail
from ..study import Study
from ..validation import at_its_best, beyond_noise_ahead, serving, together
from .answers import answers_of
from .cautions import cautions
from .contested import spoken_against
from .foretold import foretold
from .matters import buried, negligible, sufficient
from .one_for_all import OneForAll, one_for_all
from .slow import slow_forces
from .structure import structure
from .useful import NONE, useless
from .verdict import facts_of, in_the_light_of

# What a time limit may leave unknown, in words.
_RIVALS = "whether an unknown force would explain as much as the effects added"
_UNSHOWN = "whether training and validation data together show a remaining error"
_FORETOLD = "whether the validation error is larger than the training data predict"
_TOGETHER = "the share of the error 1 to 5 s ahead that the effects remove together"
_ALONE = "the share of the error 1 to 5 s ahead that is due to {} alone"
_CONTESTED = "whether validation data or confounded effects contradict the effects named"
_STRUCTURE = "how much of the remaining error depends on the driving"
_SMALL = "whether the errors of the baseline are large enough to matter"
_STEPS = "how much of the validation error each of {} removes"


@dataclass(frozen=True, eq=False)
class Judge:
    """Asks what the verdict on a final model depends on.

    Attributes
    ----------
    trail : Trail
        Of the search.
    test : Driving
        Validation data.
    asks : Judging
        In time, or not at all.
    lacked : collection of str
        Effects that were considered.
    sizes : mapping or None
        Errors that matter, where a user said which.
    kinematics : Kinematics
        Of the sensors: what it settles is in no doubt.
    """

    trail: Trail
    test: Driving
    asks: Judging
    rules: Rules
    lacked: Collection[str]
    sizes: Mapping[str, float] | None
    seed: int
    kinematics: Kinematics

    @property
    def fit(self) -> Fit:
        """The final one."""
        return self.trail.fit

    @property
    def outer(self) -> list[Fit]:
        """The baseline and the final model; one and the same where nothing was found."""
        return list(dict.fromkeys((self.trail.fits[0], self.fit)))

    @cached_property
    def added(self) -> tuple[str, ...]:
        """Effects that the final model has and the baseline lacks."""
        return tuple(e for e in self.fit.model.effects if e not in self.outer[0].model.effects)

    @cached_property
    def fitted(self) -> Omnibus:
        """Whether the final model leaves anything of what it was fitted to."""
        last = self.trail.diagnoses[-1]
        if last.fit is self.fit:
            return last.omnibus
        return omnibus(self.fit, self.fit.driving, self.rules)

    def study(self, began: float, *, checked: bool) -> Study:
        """Judge the final model.

        Parameters
        ----------
        began : float
            When the study did, by `time.perf_counter`.
        checked : bool
            Whether the logs were put right by a check of the sensors.
        """
        fit, outer, asks, rules = self.fit, self.outer, self.asks, self.rules
        on_train = self._compared(outer)
        slow = slow_forces(fit, rules)
        endless = math.isinf(asks.ends)
        rivals, explained, expected, pattern, small, story = asks.side_by_side(
            (_RIVALS if self.added else _UNSHOWN, self._rivals),
            (_TOGETHER, self._explained) if self.added else None,
            (_FORETOLD, lambda: foretold(fit, self.test, rules)),
            (_STRUCTURE, lambda: structure(fit, self.test)),
            (_SMALL, lambda: self._small(slow)),
            (_STEPS, lambda: way(self.trail.fits)) if endless else None,
        )
        alone = self._alone(rivals)
        known = backed(fit.estimates, self.kinematics.left, rules)
        facts = facts_of(
            outer,
            alone,
            on_train[fit],
            explained,
            fitted=self.fitted,
            together=None if rivals is None else rivals.omnibus,
            candidate=min((c.p_value for c in self.trail.diagnoses[-1].ranking), default=1.0),
            excited=not unexcited(fit.driving.logs),
            structure=1.0 if pattern is None else pattern.anywhere,
            small=bool(small),
            unopposed=bool(self.added) and rivals is None,
            unforeseen=expected is not None and expected.unforeseen,
            slow=slow,
            unfelt=insignificant(fit, rules),
            backed=known,
        )
        if self.added and incomplete(facts, rules):
            facts = self._with_shares(facts, explained)
            alone, facts = self._contested(rivals, alone, facts)
        one = before(asks.ends, self._one_for_all, OneForAll(""))
        facts = replace(facts, one_for_all=one.effect)
        decision = verdict(facts, rules)
        fits, shared = (story, ()) if endless else self._way()
        on_train |= self._compared([f for f in fits if f not in on_train])
        on_test = self._compared(fits, self.test)
        late = (*([TOGETHER] if self.trail.unpaired else []), *asks.left_out)
        wide = self._wide if decision.verdict in LACKING else None
        told = in_the_light_of(decision, alone)
        if wide is not None:
            told = as_unsure(told, estimates_of(fit, wide), fit, rules)
        idle = before(asks.ends, lambda: useless(fits, self.test, explained, rules), NONE)
        return Study(
            verdict=decision.verdict,
            fits=tuple(fits),
            diagnoses=tuple(self.trail.diagnoses),
            train=tuple(on_train[f] for f in fits),
            test=tuple(on_test[f] for f in fits),
            validation=self.test,
            added=added_by(
                self.trail,
                fits,
                [on_test[f] for f in fits],
                told,
                alone,
                decision,
                facts,
                self.added if one.said else shared,
                rules,
                estimates_of(fit, wide),
                idle,
                known,
            ),
            omnibus=self.fitted,
            omnibus_together=None if rivals is None else rivals.omnibus,
            verdicts=told,
            warnings=cautions(self.trail, late, self.test, rules, one.said),
            seconds=time.perf_counter() - began,
            rules=rules,
            explained=explained,
            structure=pattern,
            foretold=expected,
            slow=slow,
            stopped=self.trail.stopped,
            full=self.trail.full,
            late_facts=late,
            checked=checked,
            matters=self.sizes,
            buried=facts.buried,
            answers=answers_of(fits, self.test),
            widened=wide,
        )

    def _one_for_all(self) -> OneForAll:
        asked = {*self.lacked, *self.kinematics.settles}
        return one_for_all(self.trail.fits[0], self.fit, self.added, asked, self.rules)

    def _explained(self) -> Beyond:
        return beyond_noise_ahead(self.outer, self.test, self.rules)

    @cached_property
    def _wide(self) -> FloatArray | None:
        """Covariance of the parameters that includes what is missing; None where time ran out."""
        return before(self.asks.ends, lambda: widened(self.fit, self.fit.driving), None)

    def _compared(
        self, fits: Sequence[Fit], driving: Driving | None = None
    ) -> dict[Fit, Comparison]:
        """Errors of fits at the noise floor of the final model, by default of their own driving."""
        noise = self.fit.noise
        found = in_parallel(lambda f: compare(f, driving or f.driving, noise=noise), fits)
        return dict(zip(fits, found, strict=True))

    def _way(self) -> tuple[list[Fit], tuple[str, ...]]:
        """From the baseline to the final model, an effect more each time.

        Under a time limit it comes last: the fits between are a story, and may take longer than
        all that is claimed.
        The second are effects of one step, as there was no time for the fits between them: nobody
        knows which of them takes little of the error.
        """
        fits = way(self.trail.fits, self.asks.ends)
        shared = of_one_step(fits) if time.perf_counter() > self.asks.ends else ()
        self.asks.note(shared, _STEPS)
        return fits, shared

    def _rivals(self) -> Instead:
        both = serving(self.fit, self.test)
        everywhere = together(self.fit.driving, driving_of(both, self.test))
        return instead(both, everywhere, self.added, self.rules)

    def _alone(self, rivals: Instead | None) -> Verdicts:
        """What is to be said of every effect, each for itself."""
        trail, last = self.trail, self.trail.diagnoses[-1]
        return judge(
            self.fit,
            scored=(last.scores, last.family, last.sizes) if last.fit is self.fit else None,
            lacked={*self.lacked},
            groups=trail.confounded,
            acted={c.id for dx in trail.diagnoses for c in dx.significant},
            rules=self.rules,
            seed=self.seed,
            refitted=trail.sizes,
            settled=True,
            untried=trail.stopped,
            away={} if rivals is None else rivals.away,
        )

    def _contested(
        self, rivals: Instead | None, alone: Verdicts, facts: Facts
    ) -> tuple[Verdicts, Facts]:
        """What is said of each effect, and known of all, where names that stand are asked more.

        Rivals are those beside all else of the final model.
        """
        first = verdict(facts, self.rules)
        asked = standing(facts, first)
        if not asked:
            return alone, facts
        last, fit, ends = self.trail.diagnoses[-1], self.fit, self.asks.ends
        in_place = in_place_of(fit, sorted(asked), last, ends)
        own = asked - first.groups.keys()
        told = self.asks.asked(
            _CONTESTED,
            lambda: spoken_against(
                self.outer[0], fit, asked, own, in_place, self.test, self.rules, self._wide
            ),
        )
        facts = facts.with_against(told or {})
        stands = {e: r for e, r in in_place.items() if r.names and not (told or {}).get(e)}
        if not stands:
            return alone, facts
        known = self.trail.rivals
        known |= {e: tuple(dict.fromkeys((*known.get(e, ()), *stands[e].names))) for e in stands}
        for r in stands.values():
            self.trail.sizes.update(r.sizes)
        alone = self._alone(rivals)
        told_again = {v.effect.id: v for v in alone.all}
        added = (
            replace(a, finding=told_again[a.id].finding, group=told_again[a.id].group)
            for a in facts.added
        )
        return alone, replace(facts, added=tuple(added))

    def _small(self, slow: tuple[str, ...]) -> bool:
        """Whether no error of the baseline matters; slow forces err by more the further ahead."""
        first = self.outer[0]
        if self.sizes is not None:
            return sufficient(first, self.test, self.sizes) is not None
        best = at_its_best(first, self.test)
        return not slow and negligible(first, best, self.test, self.fit.noise)

    def _with_shares(self, facts: Facts, explained: Beyond | None) -> Facts:
        """What is known, with what each effect takes off the errors ahead, and all together."""
        fit, test, ends = self.fit, self.test, self.asks.ends
        named = {a.id for a in facts.added if a.named}
        shares = own_shares(fit, self.added, named, test, ends, self.rules)
        unknown = [e for e in self.added if e not in shares]

        below = bool(named) and before(
            ends, lambda: buried(at_its_best(fit, test), test, fit.noise), False
        )
        sure = sure_of(fit, sorted(named), test, self.rules, ends) if below else frozenset()
        facts = replace(facts.with_own(shares, unknown, sure), buried=below)
        self.asks.note(unknown, _ALONE)
        groups = without_idle(alike(fit, named), shares, self.rules)
        facts = facts.with_groups(shares_of_groups(fit, groups, test, ends, self.rules))
        if explained is None:
            return facts
        low = self.asks.asked(_TOGETHER, lambda: shown_together(explained, self.outer, self.test))
        facts = replace(facts, taken_low=low)
        motions = self.asks.asked(
            _TOGETHER, lambda: together_by_motion(self.outer, self.added, self.test, self.rules)
        )
        return facts if motions is None else facts.with_motions(motions)
