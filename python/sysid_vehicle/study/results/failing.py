"""Where the models of a study fail, and what else would take off their errors."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ...diagnose import INPUTS, Delay, Evidence, coherence
from ...identify import refine
from .sentences import on_train

if TYPE_CHECKING:
    from ..study import Study


def errors_with(study: Study) -> tuple[dict[str, tuple[float, float]], ...]:
    """Errors with each effect that a diagnosis refitted; see `Study.errors_with`."""
    floor = study.fit.noise
    found = []
    for dx in study.diagnoses:
        train = dx.errors_on(study.fit.driving, floor)
        test = dx.errors_on(study.validation, floor)
        found.append({e: (train[e], test[e]) for e in train})
    return tuple(found)


def late(study: Study) -> dict[str, Delay]:
    """How late the car answers where the final model has lags; see `Study.late`."""
    lags = {e.id for e in study.model.parts if e.scored_at_typical}
    lags &= {a.id for a in study.added}
    if not lags:
        return {}
    model = study.model
    for name in lags:
        model = model.drop(name)
    driving = study.fit.driving
    known = (f for f in study.fits if f.driving is driving and f.model.effects == model.effects)
    # What the study began with, or came through, was searched from more places.
    prompt = next(known, None) or refine(model, driving, study.fit.noise)
    found = coherence(Evidence(prompt, prompt.driving))
    return {c.input: c.delay for c in found if c.delay is not None and c.delay.significant}


def where_lines(study: Study) -> tuple[tuple[str, tuple[str, ...]], ...]:
    """Where the baseline and the final model fail: a title and sentences of each."""
    final = study.where.lines
    if not study.omnibus.rejects:
        # Where something is left all the same, the test alone would say that nothing is.
        final = (on_train(study).removesuffix("."), *final[1:])
    lags = ", ".join(e.id for e in study.model.parts if e.scored_at_typical)
    final += tuple(
        d.answers(f"the model without {lags}", f"the {INPUTS[name]}")
        for name, d in study.late.items()
    )
    told = ((study.where.title, final),)
    if len(study.fits) == 1:
        return told
    return ((study.where_baseline.title, study.where_baseline.lines), *told)
