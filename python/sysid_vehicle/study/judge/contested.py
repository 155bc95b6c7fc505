"""What speaks against a name that would stand beside something that is missing.

Intervals and likelihoods are those of a complete model. Where something is left they are not to be
relied on: a stand-in is known as closely as the effect itself. So such a name is asked more.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace

import numpy as np

from ..._common.arrays import FloatArray
from ..._common.text import few, number, unit_after
from ...diagnose import possible
from ...diagnose.candidates.possible import sizes
from ...effects import Effect
from ...estimate import Driving
from ...identify import Fit
from ...rules import USUAL, Rules
from ..ahead.horizons import LOST, horizons, moved_by
from ..results.widened import estimates_of
from ..search.steps import insignificant
from ..search.together import InPlace
from ..validation import gain_with_exact_inputs
from .disagree import Disagreement, disagreements


def spoken_against(
    first: Fit,
    final: Fit,
    asked: Collection[str],
    alone: Collection[str],
    in_place: Mapping[str, InPlace],
    test: Driving,
    rules: Rules = USUAL,
    wide: FloatArray | None = None,
) -> dict[str, str]:
    """Find what speaks against names of added effects: by effect, in words.

    Its value itself, not an end of its interval, is one that no car has, or too small to matter.
    Its interval at `Rules.level`, what is missing included, holds no effect at all.
    The errors ahead of what it moves grow with all that was added. Validation data by themselves
    tell another value. Or an effect that acts like it is likelier in its place, on training and on
    validation data.

    Parameters
    ----------
    first, final : Fit
        The baseline, and the model with the effects.
    asked : collection of str
        Effects whose names would stand.
    alone : collection of str
        Those that would stand by themselves: sizes of a group add up.
    in_place : mapping
        What would do in the place of each.
    test : Driving
        Validation data.
    rules : Rules
    wide : array, shape (parameters, parameters), optional
        Covariance of the final model's parameters that includes what is missing.
    """
    parts = {part.id: part for part in final.model.parts}
    found = {e: of_no_use(parts[e], final, rules, small=e in alone) for e in asked}
    unfelt = set() if wide is None else _unfelt(final, wide, rules)
    for effect in unfelt.intersection(alone):
        if not found[effect]:
            found[effect] = (
                f"its {100.0 * (1.0 - rules.level):g} % interval, with what is missing included, "
                "does not exclude zero"
            )
    for effect in asked:
        if not found[effect] and errors_grow(first, final, test, moved_by(parts[effect])):
            found[effect] = "as fitted, the errors 0.5 to 5 s ahead of the channels it moves grow"
    for effect, others in other_values(disagreements(final, test, rules), final, rules).items():
        if not found.get(effect, "told"):
            found[effect] = f"validation data alone give another value ({others})"
    for effect, rivals in in_place.items():
        if not found.get(effect, "told"):
            known = {*final.model.effects}
            better = [
                " with ".join((c.id, *(e for e in c.fit.model.effects if e not in known | {c.id})))
                for c in rivals.better(rules)
                if c.fit is not None and gain_with_exact_inputs(final, c.fit, test) > 0.0
            ]
            if better:
                found[effect] = (
                    f"{few(better)} in its place would fit training and validation data better"
                )
    return {e: because for e, because in found.items() if because}


def _unfelt(fit: Fit, wide: FloatArray, rules: Rules) -> set[str]:
    """Effects that are shown to be off nothing only if nothing else is missing."""
    known = estimates_of(fit, wide)[: len(fit.estimates)]
    return insignificant(replace(fit, estimates=known), rules) - insignificant(fit, rules)


def of_no_use(effect: Effect, fit: Fit, rules: Rules = USUAL, *, small: bool = True) -> str:
    """Why the value of an effect, as it is, is none to name; empty where it may be one.

    Parameters
    ----------
    effect : Effect
        Of the fit.
    fit : Fit
    rules : Rules
    small : bool
        Whether one that does not matter counts.
    """
    values = [fit[name].value for name in effect.named]
    exact = [0.0] * len(values)
    told = ", ".join(
        f"{p.name} {number(v, 3)}{unit_after(p.unit)}"
        for p, v in zip(effect.parameters, values, strict=True)
    )
    if not possible(effect, values, exact, rules):
        return f"the value is physically implausible ({told})"
    if small and all(abs(off) < p.matters for p, off, _ in sizes(effect, values, exact, rules)):
        return f"it is too small to matter ({told})"
    return ""


def other_values(found: Sequence[Disagreement], fit: Fit, rules: Rules = USUAL) -> dict[str, str]:
    """Effects that training and validation data do not show to be one thing, and what they tell.

    Beside a model that is not the car, two drives never tell the same to within what noise
    explains. A value that is there stays off nothing all the same, by how much the two differ
    (DerSimonian & Laird, Controlled Trials 1986, of two studies alike); that of a stand-in is near
    nothing on the one, or of the other sign.

    Parameters
    ----------
    found : sequence of Disagreement
        What both tell, differently beyond doubt.
    fit : Fit
        To the training data.
    rules : Rules
        `insignificant` standard errors from nothing are felt, on training data and on both.
    """
    told: dict[str, list[str]] = {}
    null_of = {n: p.null_value for part in fit.model.parts for n, p in part.named.items()}
    for d in found:
        if d.train.name not in null_of:
            continue
        null = null_of[d.train.name]
        here, there = d.train.value - null, d.validation.value - null
        felt = abs(here) > rules.insignificant * d.train.std
        # The mean of two, and half their difference.
        if felt and abs(here + there) < rules.insignificant * abs(here - there):
            told.setdefault(d.train.name.split(".")[0], []).append(str(d))
    return {e: "; ".join(some) for e, some in told.items()}


def errors_grow(first: Fit, final: Fit, test: Driving, channels: Collection[str]) -> bool:
    """Whether the errors ahead of some channels grow, in the mean over these and all horizons.

    Shares are asked of parameters that predict best (`at_its_best`). What a study prints, and its
    user gets, is the model as it was fitted.

    Parameters
    ----------
    first, final : Fit
    test : Driving
        Validation data.
    channels : collection of str
        As `moved_by` finds them.
    """
    found = horizons((first, final), ("first", "final"), test)
    moved = [c in channels for c in found.channels]
    before, after = (error[:, moved] for error in found.error)
    with np.errstate(divide="ignore", invalid="ignore"):
        grown = np.log(after) - np.log(before)
    # Of what both models lose, or neither predicts, there is nothing to be learnt.
    grown = np.clip(grown[~np.isnan(grown)], -LOST, LOST)
    return bool(grown.size and grown.mean() > 0.0)
