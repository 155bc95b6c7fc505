"""What effects do to errors ahead of channels that they do not move.

A drag changes the speed ahead, and leaves less noise along the car, under which the tyres are
fitted anew. A body that rolls turns the car differently, and beside it a factor on the wheel force
is fitted anew. A body that leans changes what the accelerometer reads, and tyres that had answered
for that are fitted anew. Where the model is not the car, other tyres or another factor are another
compromise: single channels and horizons grow by chance.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import replace

import numpy as np

from ...effects import Effect
from ...estimate import Driving
from ...identify import Fit
from ...rules import ErrorChange
from .horizons import ALONG, LATERAL, PREDICTED, changes

LATERAL_MOTION, ALONG_THE_CAR, MOTION = "lateral motion", "motion along the car", "motion"


def along_alone(one: Fit, other: Fit) -> bool:
    """Whether effects that only one of two models has move the car along it and no other way."""
    between = _between(one, other)
    return bool(between) and all(e.along_alone for e in between)


def changes_of(
    before: Fit, after: Fit, driving: Driving, horizons_s: Sequence[float]
) -> tuple[ErrorChange, ...]:
    """How errors some seconds ahead change from one model to another, by what effects do.

    As `changes`. Where nothing but effects along the car tells the models apart, lateral errors
    are one figure, the mean over channels and horizons, with the parameters of the model before
    where these predict better. So are errors along the car where nothing but lateral effects tells
    them apart, and the errors of speeds and yaw rate where nothing but what the accelerometer feels
    does, and the wheel force drives the car instead of it.

    Parameters
    ----------
    before, after : Fit
        The noise floor of the latter starts the predictions of both.
    driving : Driving
    horizons_s : sequence of float
    """
    found = changes(before, after, driving, horizons_s)
    what, unmoved = _unmoved(before, after, driving)
    mean = _mean(found, what, unmoved)
    if mean is None:
        return found
    if mean.log_ratio > 0.0:
        shared = set(before.model.free_names) & set(after.model.free_names)
        held = after.model.with_values({name: before.model.value(name) for name in shared})
        told = changes(before, replace(after, model=held), driving, horizons_s)
        beside = _mean(told, what, unmoved)
        if beside is not None:
            mean = min(mean, beside, key=lambda c: c.log_ratio)
    return (*(c for c in found if c.channel not in unmoved), mean)


def _between(one: Fit, other: Fit) -> list[Effect]:
    """Effects that only one of two models has."""
    parts = {part.id: part for fit in (one, other) for part in fit.model.parts}
    return [parts[e] for e in set(one.model.effects) ^ set(other.model.effects)]


def _unmoved(before: Fit, after: Fit, driving: Driving) -> tuple[str, Collection[str]]:
    """Channels that nothing which tells two models apart moves, by one name."""
    if along_alone(before, after):
        return LATERAL_MOTION, LATERAL
    between = _between(before, after)
    if between and all(e.lateral_alone for e in between):
        return ALONG_THE_CAR, ALONG
    if driving.force_known and between and all(e.felt_alone for e in between):
        return MOTION, [c for c in PREDICTED if c not in ("ax_mps2", "ay_mps2")]
    return "", ()


def _mean(found: Sequence[ErrorChange], what: str, channels: Collection[str]) -> ErrorChange | None:
    """The mean change of some errors; their standard errors are nearly of the same samples."""
    some = [c for c in found if c.channel in channels]
    if not some:
        return None
    return ErrorChange(
        what,
        max(c.horizon_s for c in some),
        float(np.mean([c.log_ratio for c in some])),
        float(np.mean([c.error for c in some])),
    )
