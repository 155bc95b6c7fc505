"""The verdict of a study in words."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ..._common.text import few
from ...rules import NONE_GONE
from ..limit import TOGETHER
from .sentences import (
    disturbance,
    elsewhere,
    in_training,
    only_elsewhere,
    share_beyond_noise,
    slow,
    structured,
    undetermined,
)

if TYPE_CHECKING:
    from ..study import Study

_COMPLETE = "no effect is missing that this driving can show"
_EXPLAINED = "the effects found explain all that depends on the driving"
_NOT_TESTABLE = (
    "this driving does not excite the lateral motion, and shows next to nothing of tyres, "
    "steering and load transfer; drive corners, steps and sweeps of the steering"
)


def meaning(study: Study) -> str:
    """The verdict of a study in words."""
    if study.verdict == "unknown":
        return _unknown(study)
    if study.verdict == "partly_explained":
        return _partly_explained(study)
    if study.verdict == "adequate":
        return _adequate(study)
    return _EXPLAINED if study.verdict == "explained" else _NOT_TESTABLE


def _unknown(study: Study) -> str:
    taken, names = study.explained, [a.id for a in study.added]
    if study.stopped and (not names or taken is None):
        return "something is missing; the time limit ended the search for what explains it"
    if TOGETHER in study.late_facts and not names:
        return (
            "something is missing; no single effect of the catalogue explains it, and the time "
            "limit ended the search for several together"
        )
    if names and taken is not None:
        if not taken.share > 0.0:
            return f"something is missing; the effects added are not confirmed: {NONE_GONE}"
        if len(names) == 1:
            return (
                f"something is missing; {names[0]} explains {taken} of the error 1 to 5 s ahead, "
                "but beside the remaining error it is not confirmed as the cause"
            )
        return (
            f"something is missing; {' and '.join(names)} together explain {taken} of the error 1 "
            "to 5 s ahead; this driving does not show which of them, if any, the car has"
        )
    if not names and only_elsewhere(study):
        return f"something is missing that shows in the validation data; it {in_training(study)}"
    if study.full and not names:
        return (
            "something is missing; no effect was to be added, and there is evidence for "
            f"{few(study.full)}"
        )
    if not study.diagnoses[-1].ranking:
        return "something is missing, and no effect was considered"
    return "something is missing and no effect of the catalogue explains it"


def _partly_explained(study: Study) -> str:
    named, taken = _named(study), study.explained
    if study.buried:
        part = "part of it"
        if taken is not None and not taken.share > 0.0:
            part = "part of the error one step ahead alone"
        return (
            f"{named}the effects added explain {part}; the errors that remain 0.5 to 5 s ahead "
            "are below the noise of the sensors"
        )
    if not taken:
        return f"{named}the effects added explain part of it; something else is missing"
    part = f"{taken} of the error 1 to 5 s ahead"
    if not taken.low > 0.0 and study.shares.whole.low > 0.0:
        part = (
            f"{study.shares.whole} of what any function of the driving could explain of the error "
            "1 to 5 s ahead"
        )
    rest = "the rest is disturbance, and something else that is missing"
    if not taken.share < study.rules.most:
        rest = "something else is missing that takes little of it"
    return f"{named}the effects added explain {part}; {rest}"


def _adequate(study: Study) -> str:
    if study.added:
        return (
            "the effects added are not confirmed; the baseline (`study.fits[0]`) can be fitted so "
            f"that its errors 0.5 to 5 s ahead are below {_matters(study)}"
        )
    seen = study.omnibus.rejects or study.diagnoses[-1].significant or structured(study)
    if seen or elsewhere(study) or slow(study):
        if disturbance(study):
            return "the remaining error is disturbance: no function of the driving predicts it"
        helps = study.predicting is not None and study.predicting.helps
        how = " with parameters fitted to predictions (`study.predicting.final`)" if helps else ""
        return f"an error remains, but 0.5 to 5 s ahead it is below {_matters(study)}{how}"
    told = undetermined(study)
    if told:
        return f"{_COMPLETE}; {told}; add such driving to them"
    error = study.test[-1].error
    if study.foretold is None or not share_beyond_noise(error) > study.rules.explainable:
        return _COMPLETE
    return (
        f"{_COMPLETE}; the validation error is {error:.3g} noise floors, from disturbances like "
        "those of the training data"
    )


def _named(study: Study) -> str:
    """The names that stand, in words; rivals of one group are told once."""
    told = {v.effect.id for v in study.verdicts.all if v.finding in ("missing", "one of a group")}
    names: dict[frozenset[str], str] = {}
    for a in study.added:
        if a.id in told:
            names.setdefault(frozenset((a.id, *a.confounded_with)), a.name)
    return f"named: {', '.join(names.values())}; " if names else ""


def _matters(study: Study) -> str:
    return "the noise of the sensors" if study.matters is None else "the errors that matter"
