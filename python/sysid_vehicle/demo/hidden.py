"""The car of the demonstration, and the effect that acts on it."""

from __future__ import annotations

import numpy as np

from ..effects import effect
from ..log import Log
from ..manoeuvres import handling_course, lap
from ..model import Model
from ..simulate import drive, example_vehicle
from ..vehicle import Vehicle

RANDOM = "random"


def hide(hidden: str, rng: np.random.Generator) -> Model:
    """Make the true car: the example vehicle with one effect at its typical size.

    Parameters
    ----------
    hidden : str
        Id of the effect, or `random` to draw one.
    rng : numpy.random.Generator
        Source of the draw.

    Raises
    ------
    InvalidInput
        If no effect has this id.
    """
    baseline = Model(example_vehicle())
    if hidden == RANDOM:
        e = baseline.candidates[int(rng.integers(len(baseline.candidates)))]
    else:
        e = effect(hidden)
    values = {name: p.null_value + p.typical for name, p in e.named.items()}
    return baseline.add(e).with_values(values)


def vehicle_file(true: Vehicle) -> Vehicle:
    """Tell what the user knows of the car: all but the tyres, of which he has a fair guess."""
    front, rear = true.tyre_front, true.tyre_rear
    return true.replace(
        tyre_front=front.replace(B=0.85 * front.B, D=0.96 * front.D),
        tyre_rear=rear.replace(B=0.88 * rear.B, C=0.95 * rear.C),
    )


def drive_both(truth: Model, rng: np.random.Generator) -> tuple[Log, Log]:
    """Drive a lap to fit to, and another course to judge on; their names tell nothing."""
    return (
        drive(truth, lap(), seed=rng, name="lap"),
        drive(truth, handling_course(), seed=rng, name="other course"),
    )
