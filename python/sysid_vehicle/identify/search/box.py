"""The free parameters of a model: bounds, what is known beforehand, their likelihood."""

from __future__ import annotations

import numpy as np

from ... import _core
from ...estimate import Driving, noise_range
from ...estimate.pieces import DrivingProblem
from ...model import Model
from .objective import LinearRows, Objective, gaussian_prior
from .search import Box

# Of the typical size of a lag, its smallest. What the likelihood loses by it goes with its size:
# precise sensors tell a hundredth from none, and a model is not to end below the one without the
# lag. Lags have their exact solution however short they are.
_NEXT_TO_NONE = 1e-4
NO_LAG = 0.01
"""Of its typical size, what few samples leave of a lag that is not there."""


def free_box(model: Model, least: float = _NEXT_TO_NONE) -> Box:
    """The model's free parameters, in the order of their names.

    Parameters
    ----------
    model : Model
    least : float
        The smallest lag, of its typical size.
    """
    names = list(model.free_names)
    known = model.parameters
    bounds = np.array([model.bounds(n) for n in names])
    lower = bounds[:, 0].copy()
    for i, n in enumerate(names):
        # A lag of exactly zero has no derivative. What may have either sign passes through zero.
        part = next((e for e in model.parts if n.startswith(f"{e.id}.")), None)
        null = known[n].null_value
        if part is not None and part.scored_at_typical and known[n].lower == null:
            lower[i] = max(lower[i], null + least * (known[n].typical - null))
    return Box([known[n].column for n in names], lower, bounds[:, 1])


def free_prior(model: Model) -> tuple[LinearRows, ...]:
    """The priors of the model's free parameters."""
    known = model.parameters
    return gaussian_prior(_core.PARAMETERS, {known[n].column: p for n, p in model.priors.items()})


def objective_of(model: Model, problem: DrivingProblem, driving: Driving) -> Objective:
    """The likelihood of a problem with the priors of a model's free parameters."""
    return Objective(problem, free_prior(model), *noise_range(model.vehicle, driving))
