"""What effects along the car do to lateral errors ahead.

A drag changes the speed ahead, and leaves less noise along the car, under which the tyres are
fitted anew. Where the lateral model is not the car, a speed that is wrong may serve its errors, and
other tyres are another compromise: single channels and horizons grow by chance.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ...estimate import Driving
from ...identify import Fit
from ...rules import ErrorChange
from .horizons import LATERAL, changes


def along_alone(one: Fit, other: Fit) -> bool:
    """Whether effects that only one of two models has move the car along it and no other way."""
    parts = {part.id: part for fit in (one, other) for part in fit.model.parts}
    which = set(one.model.effects) ^ set(other.model.effects)
    return bool(which) and all(parts[e].along_alone for e in which)


def changes_of(
    before: Fit, after: Fit, driving: Driving, horizons_s: Sequence[float]
) -> tuple[ErrorChange, ...]:
    """How errors some seconds ahead change from one model to another, by what effects do.

    As `changes`. Where nothing but effects along the car tells the models apart, lateral errors
    are one figure, the mean over channels and horizons, with the parameters of the model before
    where these predict better.

    Parameters
    ----------
    before, after : Fit
        The noise floor of the latter starts the predictions of both.
    driving : Driving
    horizons_s : sequence of float
    """
    found = changes(before, after, driving, horizons_s)
    lateral = _lateral(found)
    if lateral is None or not along_alone(before, after):
        return found
    if lateral.log_ratio > 0.0:
        shared = set(before.model.free_names) & set(after.model.free_names)
        held = after.model.with_values({name: before.model.value(name) for name in shared})
        beside = _lateral(changes(before, replace(after, model=held), driving, horizons_s))
        if beside is not None:
            lateral = min(lateral, beside, key=lambda c: c.log_ratio)
    return (*(c for c in found if c.channel not in LATERAL), lateral)


def _lateral(found: Sequence[ErrorChange]) -> ErrorChange | None:
    """The mean change of lateral errors; their standard errors are nearly of the same samples."""
    some = [c for c in found if c.channel in LATERAL]
    if not some:
        return None
    return ErrorChange(
        "lateral motion",
        max(c.horizon_s for c in some),
        float(np.mean([c.log_ratio for c in some])),
        float(np.mean([c.error for c in some])),
    )
