"""What effects do to errors ahead of the motion that they do not move: nothing but by other tyres.

A drag that is added leaves the forces along the car alone with less noise, and the tyres are
fitted anew under it. Where the lateral model is not the car these are another compromise, which
serves the corners of validation data better or worse by chance.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ..estimate import Driving
from ..identify import Fit
from ..rules import ErrorChange
from .horizons import PREDICTED, changes, moving_with


def moved_between(one: Fit, other: Fit) -> frozenset[str]:
    """Predicted channels of the motions that effects move which only one of two models has."""
    parts = {part.id: part.moved for fit in (one, other) for part in fit.model.parts}
    which = set(one.model.effects) ^ set(other.model.effects)
    return frozenset(c for e in which for c in moving_with(parts[e]))


def changes_of(
    before: Fit, after: Fit, driving: Driving, horizons_s: Sequence[float]
) -> tuple[ErrorChange, ...]:
    """How errors some seconds ahead change from one model to another, by what effects do.

    As `changes`; but errors of a motion that no effect moves which one of the models lacks are
    those with the parameters of the model before, where these predict that motion better.

    Parameters
    ----------
    before, after : Fit
        The noise floor of the latter starts the predictions of both.
    driving : Driving
    horizons_s : sequence of float
    """
    found = changes(before, after, driving, horizons_s)
    others = set(PREDICTED) - moved_between(before, after)
    if set(before.model.effects) == set(after.model.effects) or not any(
        c.channel in others and c.log_ratio > 0.0 for c in found
    ):
        return found
    shared = set(before.model.free_names) & set(after.model.free_names)
    held = after.model.with_values({name: before.model.value(name) for name in shared})
    beside = changes(before, replace(after, model=held), driving, horizons_s)

    def grows(told: Sequence[ErrorChange]) -> float:
        return float(np.sum([c.log_ratio for c in told if c.channel in others]))

    if grows(beside) >= grows(found):
        return found
    return (
        *(c for c in found if c.channel not in others),
        *(c for c in beside if c.channel in others),
    )
