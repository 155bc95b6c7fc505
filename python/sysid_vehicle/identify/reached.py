"""Slip angles that the driving of a fit reached: beyond, the curves of tyres are extrapolated."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from .._common.arrays import FloatArray, as_float64
from .._common.memo import remembered
from ..estimate import Driving
from ..vehicle import slip_angles

if TYPE_CHECKING:
    from .fit import Fit

RARE = 99.5
"""Percentile of slip angles up to which tyres count as fitted: larger ones may be outliers."""


@remembered(16)
def slips(fit: Fit, driving: Driving) -> FloatArray:
    """Size of the slip angles by the filtered motion and the logged steering, (2, samples).

    What effects do to the steering angle they do in all driving.

    Raises
    ------
    NumericalError
        If the model cannot follow the driving.
    """
    motion = driving.problem(fit.model).trace(fit.model.vector(), fit.noise.vector(), False)
    state = motion["state"]
    least = min(log.least_speed_mps for log in driving.logs)
    vehicle, steer = fit.model.vehicle, driving.channel("steer_rad")
    v_x, v_y, yaw_rate = np.maximum(state[:, 0], least), state[:, 1], state[:, 2]
    return as_float64(np.abs(slip_angles(vehicle.lf_m, vehicle.lr_m, steer, v_x, v_y, yaw_rate)))


def reached(fit: Fit) -> tuple[float, float]:
    """Slip angles [rad], front and rear, up to which the tyres count as fitted.

    Raises
    ------
    NumericalError
        If the model cannot follow the driving.
    """
    front, rear = np.percentile(slips(fit, fit.driving), RARE, axis=1)
    return float(front), float(rear)
