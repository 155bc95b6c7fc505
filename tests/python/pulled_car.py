"""What tests of twins share: a car that is pulled along, slowed down by 50 N s/m."""

from typing import Any

import numpy as np

from sysid_vehicle.twin import CallableTwin, Unknown

DT = 0.01
MASS = Unknown("mass_kg", spread=300.0, apart=10.0, lower=500.0, upper=2000.0)


def pulled(x: np.ndarray, u: np.ndarray, p: dict[str, float]) -> Any:
    return (u[0] - 50.0 * x[0]) / p["mass_kg"]


def twin(speed: float) -> CallableTwin:
    return CallableTwin(
        lambda x, u, p: x + DT * pulled(x, u, p),
        lambda x, u, p: np.array([x[0], pulled(x, u, p)]),
        np.array([speed]),
        dt_s=DT,
        input_names=("force_n",),
        output_names=("vx_mps", "ax_mps2"),
        state_names=("vx_mps",),
        parameters={"mass_kg": 1000.0},
    )
