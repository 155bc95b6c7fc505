"""Slip angles that a driving reached: beyond, the curves of fitted tyres are extrapolated."""

from __future__ import annotations

import numpy as np

from .._common.arrays import FloatArray, as_float64
from ..estimate import Driving, NoiseModel
from ..estimate.pieces import traces
from ..model import Model
from ..vehicle import slip_angles

RARE = 99.5
"""Percentile of slip angles up to which tyres count as fitted: larger ones may be outliers."""


def slips(model: Model, noise: NoiseModel, driving: Driving) -> FloatArray:
    """Size of the slip angles by the filtered motion and the logged steering, (2, samples).

    What effects do to the steering angle they do in all driving.

    Raises
    ------
    NumericalError
        If the model cannot follow the driving.
    """
    # By pieces: all that a filter tells of a long log is much more than its motion.
    filtered = traces(driving.problem(model), model.vector(), noise.vector())
    motion = np.concatenate([told["state"][:, :3] for _, told in filtered])
    least = min(log.least_speed_mps for log in driving.logs)
    vehicle, steer = model.vehicle, driving.channel("steer_rad")
    v_x, v_y, yaw_rate = np.maximum(motion[:, 0], least), motion[:, 1], motion[:, 2]
    return as_float64(np.abs(slip_angles(vehicle.lf_m, vehicle.lr_m, steer, v_x, v_y, yaw_rate)))


def reached(model: Model, noise: NoiseModel, driving: Driving) -> tuple[float, float]:
    """Slip angles [rad], front and rear, up to which tyres fitted to this driving are known.

    Raises
    ------
    NumericalError
        If the model cannot follow the driving.
    """
    front, rear = np.percentile(slips(model, noise, driving), RARE, axis=1)
    return float(front), float(rear)
