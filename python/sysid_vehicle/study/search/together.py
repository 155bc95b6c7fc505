"""Several effects that are added in one step, as none of them shows alone what it takes away."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from ..._common.threads import before, in_parallel
from ...diagnose import Candidate, Diagnosis, Size
from ...diagnose.candidates.possible import possible_in
from ...diagnose.candidates.refits import refitted
from ...diagnose.candidates.reservation import beside
from ...effects import Effect
from ...errors import NumericalError
from ...estimate import Driving
from ...identify import Fit, refine, refine_while, refit, with_exact_inputs
from ...model import Model
from ...rules import USUAL, Rules, bic
from ..ahead.own_share import without
from .steps import (
    ALTERNATIVES,
    better,
    merit,
    real,
    speaks_for,
    strength,
    without_insignificant,
)

_SUBSETS = 2  # that are refitted
_LEAST = 1.0  # standard errors from nothing, below which the refit of a subset does not go on


def first_together(
    dx: Diagnosis,
    test: Driving,
    single: Fit | None,
    most_effects: int,
    ends: float = np.inf,
    judged_by: float = np.inf,
) -> tuple[tuple[str, ...], Fit] | None:
    """Effects that are added together: the posterior names them, refit and validation confirm them.

    Of the leading subsets those with two effects or more are refitted with their exact dynamics,
    the scores being linearised at a fit that lacks all of them. One is added in place of the best
    single effect where it is `better` than that; where no single effect holds, where validation
    data confirm it.

    `single` is the fit with the single effect that holds; the model may have `most_effects`. Refits
    end at `ends`, by `time.perf_counter`; validation data have answered at `judged_by`.
    """
    rules, fit = dx.rules, dx.fit
    known = [f for f in (single, *(c.fit for c in dx.ranking if c.finished)) if f is not None]
    for names in _leading_subsets(dx, most_effects - len(fit.model.effects)):
        # One after the other: those that are not added mostly end soon, and one is all it takes.
        found = before(ends, partial(_with_subset, dx, names, known), None)
        if found is not None:
            known.append(found)
        if found is None or not set(names) <= set(found.model.effects):
            continue
        if not all(real(found, name, rules) for name in names):
            continue
        if single is not None:
            if before(judged_by, partial(better, found, single, test, rules), False):
                return names, found
        elif merit(found) > merit(fit) + rules.apart and before(
            judged_by, partial(speaks_for, fit, found, True, test, rules), None
        ):
            return names, found
    return None


@dataclass(frozen=True)
class InPlace:
    """What would do in the place of an effect of a model.

    Attributes
    ----------
    rivals : tuple of Candidate
        Refitted, no less likely than the effect by more than `Rules.apart`; of values that a car
        can have.
    leads : tuple of float
        How much more likely each is, less the BIC penalty of its parameters [nats].
    """

    rivals: tuple[Candidate, ...] = ()
    leads: tuple[float, ...] = ()

    @property
    def names(self) -> tuple[str, ...]:
        """Ids of the rivals."""
        return tuple(c.id for c in self.rivals)

    @property
    def sizes(self) -> dict[str, Size]:
        """Parameters of the rivals in the effect's place, and their standard errors."""
        return {c.id: (c.value, c.std) for c in self.rivals}

    @property
    def likeliest(self) -> tuple[Candidate, ...]:
        """As many rivals as are tried in the effect's place, the likeliest ones."""
        led = zip(self.leads, self.rivals, strict=True)
        return tuple(c for _, c in sorted(led, key=lambda of: -of[0])[:ALTERNATIVES])

    def better(self, rules: Rules = USUAL) -> tuple[Candidate, ...]:
        """Rivals that are more likely by `Rules.apart`."""
        led = zip(self.rivals, self.leads, strict=True)
        return tuple(c for c, lead in led if lead > rules.apart)


def in_place_of(
    fit: Fit, chosen: Sequence[str], dx: Diagnosis, ends: float = np.inf
) -> dict[str, InPlace]:
    """Find what fits as well in the place of each of several effects of a model.

    What was found step by step, or by the posterior, is known beside what the model had then: of
    two effects that only the others show to be alike, or to be apart, either may know one. Here
    each is taken out of the model with the others, and what acts like it, by the catalogue, is
    refitted in its place.

    Parameters
    ----------
    fit : Fit
        With the effects.
    chosen : sequence of str
    dx : Diagnosis
        That they were chosen in.
    ends : float
        When to end, by `time.perf_counter`; effects for which there was no time are left out.
    """
    found = {}
    for name in (e for e in chosen if e in fit.model.effects):
        rivals = before(ends, partial(_in_place, fit, name, dx), None)
        if rivals is not None:
            found[name] = rivals
    return found


def _in_place(fit: Fit, name: str, dx: Diagnosis) -> InPlace:
    poorer, rules = without(fit, (name,)), dx.rules
    if poorer is None:
        return InPlace()
    parts = {e.id: e for e in fit.model.parts}
    alike = {e.id for e in poorer.model.candidates if e.id in dx.family and e.is_like(parts[name])}
    if not alike:
        return InPlace()
    scores = beside(poorer, poorer.driving, {name, *alike}, rules).board.scores
    by = {s.effect.id: s.statistic * max(s.variance_ratio, 1.0) for s in scores}
    # An effect that parameters of the poorer model can copy has no score there.
    least = rules.near * by.get(name, 0.0)
    near = [s for s in scores if s.effect.id in alike and by[s.effect.id] > least]
    gained = 2.0 * (with_exact_inputs(fit) - with_exact_inputs(poorer))
    rivals, leads = [], []
    for s in sorted(near, key=lambda s: -by[s.effect.id]):
        told = s.statistic, s.p_value, s.value, s.std, s.retained, s.variance_ratio
        c = refitted(poorer, poorer.driving, Candidate(s.effect, *told))
        more = len(c.effect.parameters) - len(parts[name].parameters)
        if c.statistic <= gained - 2.0 * rules.apart and parts[name].along_alone:
            c, others = _undone_sideways(c, poorer, name, dx)
            more += others
        as_well = c.statistic > gained - 2.0 * rules.apart
        if as_well and c.can_be(rules):
            rivals.append(c)
            leads.append(bic(0.5 * (c.statistic - gained), more, fit.driving.samples))
    return InPlace(tuple(rivals), tuple(leads))


def _undone_sideways(
    c: Candidate, poorer: Fit, left_out: str, dx: Diagnosis
) -> tuple[Candidate, int]:
    """A candidate beside what undoes its lateral action, and how many parameters more that takes.

    A mass in place of a gain of the wheel force turns the car more slowly, too: with a yaw inertia
    that is larger by as much it turns as before. Noise is learned anew, as that of the model with
    the gain has what it does.
    """
    best, more = c, 0
    if c.fit is None:
        return best, more
    for e in c.fit.model.candidates:
        beside_it = e.is_like(c.effect) and not e.along_alone and not e.states
        if not beside_it or e.id == left_out or e.id not in dx.family:
            continue
        with suppress(NumericalError, np.linalg.LinAlgError):
            both = refine(c.fit.model.add(e), poorer.driving, c.fit.noise)
            gained = 2.0 * (with_exact_inputs(both) - with_exact_inputs(poorer))
            if gained > best.statistic and possible_in(both, e, dx.rules):
                told = [both[n] for n in c.effect.named]
                value, std = tuple(v.value for v in told), tuple(v.std for v in told)
                best = replace(c, statistic=gained, value=value, std=std, fit=both)
                more = len(e.parameters)
    return best, more


def _leading_subsets(dx: Diagnosis, room: int) -> list[tuple[str, ...]]:
    """Subsets of two effects or more with more evidence than any single one, the best first."""
    named = [s for s in dx.proposed.known if len(s.effects) <= room]
    alone = max((s.log_odds for s in named if len(s.effects) == 1), default=0.0)
    least = max(alone, 0.0) + dx.rules.apart
    several = [s for s in named if len(s.effects) > 1 and s.log_odds > least]
    return [s.effects for s in several[:_SUBSETS]]


def _with_subset(dx: Diagnosis, names: Sequence[str], known: Sequence[Fit] = ()) -> Fit | None:
    """The model with several effects, refitted; None where that fails, or no car has the values.

    It is not refitted with lags that were lost alone (`_lost`).

    Parameters come first, under the noise of the model that they begin at: that shows where they
    lead at a fraction of the time. Where an effect comes to nothing on the way the refit does not
    go on. It never ends below the likeliest of the models `known` that it contains.
    """
    if any(_lost(c) for c in dx.ranking if c.id in names):
        return None
    effects = {c.id: c.effect for c in dx.ranking}
    values: dict[str, float] = {}
    for name in (n for n in names if n in dx.proposed.sizes):
        for p, v in zip(effects[name].parameters, dx.proposed.sizes[name][0], strict=True):
            values[f"{name}.{p.name}"] = float(np.clip(v, p.lower, p.upper))
    bare = dx.fit.model.add(*(effects[n] for n in names))
    contained = _likeliest_within(dx.fit, names, known)
    begins = dict.fromkeys((dx.fit, contained))
    try:
        ends = in_parallel(partial(_from_within, bare, values), begins)
        real_ones = [f for f in ends if f is not None and _all_real(f, names, dx)]
        if not real_ones:
            return None
        near = max(real_ones, key=_height)
        some = partial(_none_at_nothing, names)
        found = refine_while(near.model, near.driving, near.noise, some)
        if found is None or found.log_likelihood < contained.log_likelihood:
            return None
        return without_insignificant(found, dx.rules)
    except (NumericalError, np.linalg.LinAlgError):
        return None


def _likeliest_within(fit: Fit, names: Sequence[str], known: Sequence[Fit]) -> Fit:
    """The likeliest of some fits, and of one more, that lack only effects `names`."""
    base = set(fit.model.effects)
    inside = [
        f
        for f in known
        if base <= set(f.model.effects) <= base | set(names) and f.driving is fit.driving
    ]
    return max([fit, *inside], key=_height)


def _from_within(bare: Model, foretold: Mapping[str, float], contained: Fit) -> Fit | None:
    """Parameters of a model refitted from one that it contains; None where that fails.

    Its other effects begin at sizes that were foretold. These come from a poorer model and may lead
    below the contained one: then they begin at nothing. Of several lags none is there.
    """
    there = {e.name: e.value for e in contained.estimates}
    new = [e for e in bare.parts if e.id not in contained.model.effects]
    ends: list[Fit] = []
    for sizes in (foretold,) if any(map(_several_lags, new)) else (foretold, {}):
        with suppress(NumericalError, np.linalg.LinAlgError):
            model = bare.with_values({**sizes, **there})
            ends.append(refit(model, contained.driving, contained.noise, scanned=new))
            if ends[-1].log_likelihood >= contained.log_likelihood:
                break
    return max(ends, key=_height, default=None)


def _several_lags(effect: Effect) -> bool:
    return effect.scored_at_typical and len(effect.parameters) > 1


def _lost(c: Candidate) -> bool:
    """Whether no search led back from several lags to none of them, which it began amid alone.

    It begins there beside other effects too.
    """
    return _several_lags(c.effect) and c.fit is not None and c.statistic <= 0.0


def _height(fit: Fit) -> float:
    return fit.log_likelihood


def _all_real(fit: Fit, names: Sequence[str], dx: Diagnosis) -> bool:
    """Whether effects have values that a car can have."""
    return all(real(fit, name, dx.rules) for name in names)


def _none_at_nothing(names: Sequence[str], fit: Fit) -> bool:
    """Whether every one of some effects is away from nothing, if not yet significant."""
    return all(strength(fit, name) > _LEAST for name in names)
