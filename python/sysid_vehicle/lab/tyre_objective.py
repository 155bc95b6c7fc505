"""What is asked of the data: which parameters are free, and the likelihood with its priors.

Equations of the likelihood: `cpp/include/sysid/lab/tyre_likelihood.hpp`.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..identify.objective import Objective, gaussian_prior
from .tyre_data import GreyBoxVehicle, TyreLog, tyre_problem
from .tyre_fit import PARAMETERS

# Of the disturbances: what steps of 10 ms and axles without a width leave out. Beside the true
# tyres a step is 3e-7 m/s, 3e-6 m/s and 3e-6 rad/s off in a slide: ten times that per root second
# where each step errs anew, as of v_y and yaw rate, and a hundred times where all of a second err
# alike, as of v_x. Without that floor a minute of sliding is taken as one calculation, and its
# coefficients as known to the sixth figure.
_SMALLEST = np.array([1e-4, 1e-4, 1e-5, 1e-4, 3e-5, 3e-5, 3e-5])
_LARGEST = np.array([10.0, 10.0, 2.0, 20.0, 5.0, 5.0, 5.0])


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
) -> Objective:
    """Likelihood of logs thinned to `most_samples`, with priors where the vehicle is unsure."""
    problem = tyre_problem(vehicle, logs, most_samples=most_samples)
    unsure = {PARAMETERS.index(n): (1.0, std) for n, std in _tolerances(vehicle).items()}
    return Objective(problem, gaussian_prior(len(PARAMETERS), unsure), _SMALLEST, _LARGEST)
