"""What is asked of the data: which parameters are free, and the likelihood with its priors."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from .likelihood import Likelihood
from .tyre_data import GreyBoxVehicle, TyreLog, tyre_problem
from .tyre_fit import PARAMETERS

__all__ = ["free_parameters", "objective_of"]


def _tolerances(vehicle: GreyBoxVehicle) -> dict[str, float]:
    """Factors that are not known exactly, and their standard deviations."""
    stated = {
        "mass_factor": vehicle.mass_tolerance,
        "yaw_inertia_factor": vehicle.yaw_inertia_tolerance,
    }
    return {name: tolerance for name, tolerance in stated.items() if tolerance > 0.0}


def free_parameters(vehicle: GreyBoxVehicle, *, residual_terms: bool = False) -> tuple[str, ...]:
    """Names of what is identified: both tyres, what the vehicle is not sure of, the drag."""
    terms = ("P1", "P2", "P3") if residual_terms else ()
    return (*PARAMETERS[:8], *terms, *_tolerances(vehicle), "drag_area_m2")


def objective_of(
    vehicle: GreyBoxVehicle, logs: Sequence[TyreLog], most_samples: int | None = None
) -> Likelihood:
    """Likelihood of logs thinned to `most_samples`, with priors where the vehicle is unsure."""
    per_std = np.zeros(len(PARAMETERS))
    for name, tolerance in _tolerances(vehicle).items():
        per_std[PARAMETERS.index(name)] = 1.0 / tolerance
    centre = np.ones(len(PARAMETERS))  # only factors have priors
    return Likelihood(tyre_problem(vehicle, logs, most_samples=most_samples), centre, per_std)
