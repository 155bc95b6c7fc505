"""What a user should know before taking a study for granted."""

from __future__ import annotations

from collections.abc import Sequence

from ..._common.text import few, number, unit_after
from ...errors import warn
from ...estimate import Driving
from ...identify import Estimate
from ...rules import USUAL, Rules
from ..results.next_steps import SHORT_S
from ..search.trail import Trail
from ..validation import twice


def cautions(
    trail: Trail, late: Sequence[str], test: Driving, rules: Rules = USUAL, one: str = ""
) -> tuple[str, ...]:
    """Find what a user should know before taking a study for granted, in words, and warn.

    Parameters
    ----------
    trail : Trail
        Of the search.
    late : sequence of str
        What the time limit left unknown.
    test : Driving
        Validation data.
    rules : Rules
    one : str
        What explains all that was found, if anything does.
    """
    fit, driving = trail.fit, trail.fit.driving
    found = twice(driving.logs, test.logs)
    if one:
        found.append(one)
        warn(one)
    if trail.stopped or late:
        found.append(_cut_short(trail.stopped, late))
        warn(found[-1])
    if trail.full:
        most, remedy = "", "raise `most_effects` (`--max-effects`)"
        if trail.short:
            most, remedy = f", one for each {rules.lasts:g} s of training data", "record more"
        found.append(
            f"the search ended with as many effects as may be added{most}; there is evidence for "
            f"{few(trail.full)}: {remedy}"
        )
    if trail.harmful:
        found.append(
            f"{' and '.join(trail.harmful)} removed again: where such an effect acts, errors 1 to "
            "5 s ahead of validation data are larger with it, beside the others"
        )
    if trail.taken_back:
        found.append(
            f"{' and '.join(trail.taken_back)} removed again: errors 1 to 5 s ahead fall with the "
            "parameters that predict best, but grow with those of the likelihood, whatever the "
            "driving leaves open"
        )
    if driving.usable_s < SHORT_S:
        found.append(
            f"{driving}: too short to tell many effects apart; record {SHORT_S:.0f} s or more, "
            "with steps, sweeps and corners near the limit"
        )
        warn(found[-1])
    for log in driving.logs:
        found += [f"{log.name}: {text}" for text in log.missing().values()]
    found += map(str, fit.against_priors)
    given = {n for n, told in fit.model.settings.items() if told.bounds is not None}
    found += [_noted(e, e.name in given) for e in fit.estimates if e.note]
    if not fit.converged:
        found.append("the final fit did not converge; its intervals may be too short")
        warn(found[-1])
    return tuple(dict.fromkeys(found))


def _noted(e: Estimate, bounded: bool) -> str:
    """Why an estimate says little, in words; of a user's bound, what lies beyond it."""
    if e.note != "at bound":
        return f"{e.name}: {e.note} with this driving"
    unit = unit_after(e.unit)
    text = f"{e.name}: ends at its bound {number(e.value)}{unit} with this driving"
    if e.unbounded is None or not bounded:
        return text
    return f"{text}; the data lead beyond it, to about {number(e.unbounded[0])}{unit}"


def _cut_short(stopped: Sequence[str], late: Sequence[str]) -> str:
    """What the time limit left out, in one line."""
    cut = []
    if stopped:
        cut.append(f"ended the search with {few(stopped)} still to be tried")
    if late:
        cut.append(f"left open {'; '.join(late)}")
    unsure = "; without that neither the verdict nor the effects named are certain" if late else ""
    return f"the time limit {', and '.join(cut)}{unsure}"
