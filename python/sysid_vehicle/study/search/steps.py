"""One step of the way to a better model: what is added, exchanged, or dropped again."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from ..._common.memo import remembered
from ..._common.threads import before, in_parallel
from ...diagnose import Candidate, Diagnosis, refused
from ...diagnose.candidates.possible import possible_in
from ...diagnose.candidates.refits import finished
from ...effects import Parameter
from ...errors import NumericalError
from ...estimate import Driving
from ...identify import (
    Estimate,
    Fit,
    far_below,
    lost_to_input_noise,
    refine,
    refine_beside,
    with_exact_inputs,
)
from ...rules import USUAL, Measures, Rules, accept, bic, worse
from ..validation import (
    as_sure,
    changes_ahead,
    error_falls,
    fall_in_error,
    foreseen,
    gain_in_log_likelihood,
    gain_with_exact_inputs,
)

ALTERNATIVES = 2  # tried in place of one effect


def first_that_holds(
    dx: Diagnosis, fit: Fit, test: Driving, ends: float = np.inf, judged_by: float = np.inf
) -> tuple[Candidate, Fit] | None:
    """The likeliest candidate that fits better and predicts the validation data better.

    One with a value that a car can have comes before one that only acts like something else. Among
    those that the training data cannot tell apart the validation data have a say too. With it
    comes its fit, without what is not significant then; where that takes longer than `ends`, by
    `time.perf_counter`, the candidate is not judged. Nor is it where validation data have not
    answered at `judged_by`.
    """
    rules = dx.rules
    likely = sorted(dx.significant, key=lambda c: not c.can_be(rules))
    first: Candidate | None = None
    holding: dict[str, tuple[float, Candidate, Fit]] = {}
    for c in likely:
        if first and (
            c.id not in first.indistinguishable_from or c.can_be(rules) != first.can_be(rules)
        ):
            continue
        c = before(ends, partial(_at_its_maximum, dx, c), c)
        if c.fit is None or not _sound(c, rules):
            continue
        # Validation data come first: what they do not confirm need not be made simpler.
        found = before(
            judged_by, partial(speaks_for, fit, c.fit, c.can_be(rules), test, rules), None
        )
        lean: Fit | None = c.fit
        if found is not None and insignificant(c.fit, rules):
            lean = before(ends, partial(without_insignificant, c.fit, rules), None)
        if found is None or lean is None or c.id not in lean.model.effects:
            continue
        first = first or c
        gain = found.gain.value + lost_to_input_noise(c.fit, test)
        holding[c.id] = (merit(c.fit) + gain, c, lean)
    if not holding:
        return None
    _, chosen, lean = max(holding.values(), key=lambda h: h[0])
    return chosen, lean


def _at_its_maximum(dx: Diagnosis, c: Candidate) -> Candidate:
    """The candidate with its fit at the maximum: the diagnosis leaves those far below the best."""
    if c.fit is None or c.fit.converged or not c.finished:
        return c
    best = max(o.fit.log_likelihood for o in dx.ranking if o.finished and o.fit is not None)
    return finished(dx.fit, c) if far_below(c.fit.log_likelihood, best) else c


def likeliest(dx: Diagnosis) -> Candidate | None:
    """The candidate that fits best, of those with evidence for them and a value a car can have."""
    return next((c for c in dx.significant if _sound(c, dx.rules) and c.can_be(dx.rules)), None)


def _sound(c: Candidate, rules: Rules) -> bool:
    """Whether it was refitted, and gained more than its price could be by chance.

    By a value that nothing known beforehand refuses.
    """
    if c.fit is None or refused(c.effect, c.value, c.fit.model):
        return False
    return c.statistic >= rules.price * float(np.log(c.fit.driving.samples))


def _measures(fit: Fit, found: Fit, plausible: bool, test: Driving) -> Measures:
    """What a richer model changes on validation data."""
    foreseen(fit, found, test)
    return Measures(
        gain_in_log_likelihood(fit, found, test, same_noise=True),
        gain_in_log_likelihood(fit, found, test),
        fall_in_error(fit, found, test),
        plausible,
        as_sure(fit, found, test),
    )


def speaks_for(
    fit: Fit, found: Fit, plausible: bool, test: Driving, rules: Rules
) -> Measures | None:
    """What a richer model changes on validation data, where that speaks for it."""
    measures = _measures(fit, found, plausible, test)
    if not accept(measures, rules):
        return None
    measures = replace(measures, changes=changes_ahead(fit, found, test))
    return measures if accept(measures, rules) else None


def foretold_better(fit: Fit, found: Fit, test: Driving, rules: Rules) -> bool:
    """Whether validation data speak for a richer model, whatever errors some seconds ahead do."""
    return accept(_measures(fit, found, True, test), rules)


def alternatives(dx: Diagnosis, chosen: Candidate) -> tuple[Candidate, ...]:
    """Effects that act like the chosen one and nearly were, or are as likely, the likeliest first.

    Of those that were refitted: the others came nowhere near, or would take for ever. The catalogue
    says what acts like what, and the driving may add to it. What is not significant by its score,
    and as likely by its price, need not act alike. What fits to the last digit as the chosen one
    does is the same thing by another name: an alternative only if there is an effect already that
    it may make needless, as rolling resistance does a slope with a sensor's bias.
    """
    same = 0.0 if dx.fit.model.effects else dx.rules.same
    likely = np.inf if chosen.fit is None else _as_searched(chosen.fit) - dx.rules.apart

    def near(c: Candidate, fit: Fit) -> bool:
        if c not in dx.significant:
            return _as_searched(fit) > likely
        alike = c.effect.is_like(chosen.effect) or c.id in chosen.indistinguishable_from
        return alike and c.statistic > dx.rules.near * chosen.statistic

    others = [c for c in dx.ranking if c.id != chosen.id]
    apart = [c for c in others if abs(c.statistic - chosen.statistic) >= same]
    return tuple([c for c in apart if c.fit is not None and near(c, c.fit)][:ALTERNATIVES])


def in_common(
    fit: Fit, chosen: Sequence[str], ranking: Sequence[Candidate]
) -> dict[str, tuple[Candidate, ...]]:
    """Candidates in place of effects of a model that are confounded with each other.

    Two such may together be a third one: all motion read elsewhere and the speed read where it was
    are an accelerometer elsewhere.

    Parameters
    ----------
    fit : Fit
    chosen : sequence of str
        What was added last; others were asked when they were.
    ranking : sequence of Candidate
        Of what the model lacked before.
    """
    found = {}
    parts = {e.id: e for e in fit.model.sought if e.id not in fit.model.nuisances}
    for name, part in parts.items():
        for other in parts.keys() & {*part.confounded_with}:
            if {name, other} & {*chosen}:
                some = ({*part.confounded_with} | {*parts[other].confounded_with}) - parts.keys()
                found[name] = tuple(c for c in ranking if c.id in some)
    return found


def exchanged(
    fit: Fit,
    nearly: Mapping[str, Sequence[Candidate]],
    test: Driving,
    *,
    most_effects: int,
    rules: Rules = USUAL,
    ends: float = np.inf,
) -> Fit:
    """The fit with others in place of effects that they explain away, one or two for each.

    Where several effects are missing, one that is not there can stand in for two of them: a head
    wind for drag and rolling resistance. It is chosen first, as either alone explains less.

    Parameters
    ----------
    fit : Fit
    nearly : mapping
        By effect of the model, what was nearly chosen instead.
    test : Driving
        Validation data, which have a say (`better`).
    most_effects : int
        That the model may have.
    rules : Rules
    ends : float
        When refits end, by `time.perf_counter`.

    Returns
    -------
    Fit
    """
    seen = {frozenset(fit.model.effects)}
    while True:
        best = fit
        asked = [
            partial(_with_others, fit, name, others, test, rules)
            for name, others in _exchanges(fit, nearly, most_effects)
        ]
        for trial in in_parallel(lambda work: before(ends, work, None), asked):
            if trial is None or frozenset(trial.model.effects) in seen:
                continue
            if before(ends, partial(better, trial, best, test, rules), False):
                best = before(ends, partial(_to_its_end, trial, rules), trial)
        if best is fit:
            return fit
        fit = best
        seen.add(frozenset(fit.model.effects))


def _to_its_end(fit: Fit, rules: Rules) -> Fit:
    """The fit at its maximum, and without what is not significant then."""
    if not fit.converged:  # far below in training data, and validation data are for it all the same
        fit = refine(fit.model, fit.driving, fit.noise)
    return without_insignificant(fit, rules)


def _exchanges(
    fit: Fit, nearly: Mapping[str, Sequence[Candidate]], most_effects: int
) -> Iterator[tuple[str, tuple[Candidate, ...]]]:
    """Effects of a model, and what may take the place of each."""
    for name in fit.model.effects:
        near = [c for c in nearly.get(name, ()) if c.id not in fit.model.effects]
        for others in dict.fromkeys([*((c,) for c in near), tuple(near)]):
            if others and len(fit.model.effects) - 1 + len(others) <= most_effects:
                yield name, others


def _with_others(
    fit: Fit, name: str, others: Sequence[Candidate], test: Driving, rules: Rules
) -> Fit | None:
    """The fit with others in place of an effect, and without what is not significant then.

    None where the search fails, or ends far below, by training data or by all that speak for it.
    """
    model = fit.model.drop(name)
    for c in others:
        values = zip(c.effect.parameters, c.value, strict=True)
        model = model.add(c.effect).with_values({f"{c.id}.{p.name}": v for p, v in values})
    # The first of all effects was tried against the same ones before it was chosen.
    known = next((c.fit for c in others if c.finished and c.fit is not None), None)
    same = known is not None and set(known.model.effects) == set(model.effects)
    if known is not None and same and known.driving is fit.driving:
        return without_insignificant(known, rules)
    # As simple as the model without all that is sought, it would need as much to be as good.
    bare = [e for e in fit.estimates if "." not in e.name or _part(e) in model.nuisances]
    least = _as_searched(fit) - bic(0.0, len(bare), fit.driving.samples)
    try:
        found = refine_beside(
            model, fit.driving, fit, least, lambda near: not far_below(lead(near, fit, test), 0.0)
        )
        if found is None or far_below(found.log_likelihood, least):
            return found
        return without_insignificant(found, rules)
    except (NumericalError, np.linalg.LinAlgError):
        return None


def _part(found: Estimate) -> str:
    """Id of the effect that an estimate is of."""
    return found.name.split(".")[0]


def better(one: Fit, other: Fit, test: Driving, rules: Rules = USUAL) -> bool:
    """Whether one fit is to be preferred, and what is new in it has values that a car can have.

    All driving speaks: that of the fit, less the Bayesian price of the parameters, and the
    validation data, where the error must fall too. Of two that are as good the one with fewer
    effects of a size that matters is preferred, and then the one with fewer effects.
    """
    ones, others = set(one.model.effects), set(other.model.effects)
    if not all(real(one, name, rules) for name in ones - others):
        return False
    ahead = lead(one, other, test)
    simpler = (_mattering(one), len(ones)) < (_mattering(other), len(others))
    if not (ahead > 0.0 if simpler else ahead > rules.apart and error_falls(other, one, test)):
        return False
    return not worse(changes_ahead(other, one, test), rules)


def lead(one: Fit, other: Fit, test: Driving) -> float:
    """Log-likelihood, less the price of the parameters, that one fit is ahead on all driving."""
    return merit(one) - merit(other) + gain_with_exact_inputs(other, one, test, same_noise=True)


def _mattering(fit: Fit) -> int:
    """How many effects of the model have a size worth acting on."""
    parameters = fit.model.parameters
    return sum(
        any(
            abs(e.value - parameters[e.name].null_value) >= parameters[e.name].matters
            for e in fit.estimates
            if e.name.startswith(f"{part.id}.")
        )
        for part in fit.model.parts
    )


def real(fit: Fit, name: str, rules: Rules) -> bool:
    """Whether an effect of the model has a value that a car can have."""
    found = next(e for e in fit.model.parts if e.id == name)
    return possible_in(fit, found, rules)


# A candidate is asked when it is chosen, and when it is tried in place of another one.
@remembered(32)
def without_insignificant(fit: Fit, rules: Rules = USUAL) -> Fit:
    """The fit without effects that have become indistinguishable from nothing, and unnecessary.

    Of two effects that act alike neither may be told from nothing while the model needs one of
    them: an effect goes only where the model without it is as good for its number of parameters.
    """
    kept: set[str] = set()
    while True:
        weak = insignificant(fit, rules) - kept
        if not weak:
            return fit
        weakest = min(sorted(weak), key=lambda name: strength(fit, name))
        poorer = fit.model.drop(weakest)
        price = bic(0.0, len(poorer.free_names), fit.driving.samples)
        least = _as_searched(fit) - rules.apart - price
        without = refine(poorer, fit.driving, fit.noise, least=least)
        if merit(without) + rules.apart < merit(fit):
            kept.add(weakest)
        else:
            fit = without


def way(fits: Sequence[Fit], ends: float = np.inf) -> list[Fit]:
    """The fits of a story that leads to the last one: one effect more each time.

    Effects that were dropped or exchanged on the way are no part of it; where one was, the steps
    after it are fitted anew. Those that take longer than `ends`, by `time.perf_counter`, are left
    out: the next step has several effects more.
    """
    baseline, final = fits[0], fits[-1]
    known = {frozenset(f.model.effects): f for f in fits}
    story, earlier = [final], final.model
    while len(earlier.effects) > len(baseline.model.effects):
        later = story[0]
        earlier = earlier.drop(earlier.effects[-1])
        found = known.get(frozenset(earlier.effects))
        if found is None:
            found = before(ends, partial(refine, earlier, later.driving, later.noise), None)
        if found is not None:
            story.insert(0, found)
            earlier = found.model
    return story if story[0] is baseline else [baseline, *story]


def insignificant(fit: Fit, rules: Rules = USUAL) -> set[str]:
    """Effects of the model that cannot be told from nothing, by the parameters of each."""
    sought = (e.id for e in fit.model.sought if e.id not in fit.model.nuisances)
    return {name for name in sought if strength(fit, name) < rules.insignificant}


def merit(fit: Fit) -> float:
    """Log-likelihood with exact inputs less the Bayesian price of the parameters."""
    return bic(with_exact_inputs(fit), len(fit.estimates), fit.driving.samples)


def _as_searched(fit: Fit) -> float:
    """The same with inputs as they were measured, which searches maximise."""
    return bic(fit.log_likelihood, len(fit.estimates), fit.driving.samples)


def strength(fit: Fit, name: str) -> float:
    """Largest distance of the effect's parameters from their null values, in standard errors."""
    return max(
        _distance(e, fit.model.parameters[e.name])
        for e in fit.estimates
        if e.name.startswith(f"{name}.") and not fit.model.parameters[e.name].scan
    )


def _distance(found: Estimate, parameter: Parameter) -> float:
    # Of what is at a bound, or was never felt, only the model without it can tell.
    off = abs(found.value - parameter.null_value)
    return off / found.std if np.isfinite(found.std) else 0.0
