"""Whether a drive asks its wheels for more force along the car than the tyres hold.

Wheels of a single-track model do not lock or spin: it brakes on ice as hard as it is told to.
"""

from __future__ import annotations

import numpy as np

from .._common.arrays import FloatArray, as_float64
from ..model import Model
from ..vehicle import AXLES, GRAVITY_MPS2

_LOADS = slice(7, 9)  # among what the compiled model evaluates


def beyond_grip(model: Model, time_s: FloatArray, inputs: FloatArray, motion: FloatArray) -> str:
    """Say where, and how far, wheel forces go beyond D times the load of an axle.

    The load is that of the model, downforce included, with the transfer by no more force than all
    tyres hold together. Grip that changes on the way is not counted.

    Parameters
    ----------
    model : Model
    time_s : array, shape (n,)
    inputs : array, shape (n, 2)
        Steering angle and total wheel force.
    motion : array, shape (n, 3)
        v_x, v_y and yaw rate.

    Returns
    -------
    str
        Empty where no axle is asked for more.
    """
    car, force_n = model.vehicle, inputs[:, 1]
    front = np.where(force_n < 0.0, car.brake_front_share, car.drive_front_share)
    forces = np.abs([front * force_n, (1.0 - front) * force_n])
    peaks = np.array([[model.value(f"D_{axle}")] for axle in AXLES])
    # An axle carries half of the car or so: half of that is not worth a closer look.
    weight_n = car.mass_kg * GRAVITY_MPS2
    near = np.flatnonzero(np.any(forces > 0.25 * peaks * weight_n, axis=0))
    if not near.size:
        return ""
    held = peaks * _loads(model, inputs[near], motion[near], float(peaks.max()))
    held[np.isnan(held)] = np.inf  # an effect reads a column that one evaluation has none of
    excess = forces[:, near] / np.maximum(held, 1.0)
    row, k = np.unravel_index(int(np.argmax(excess)), excess.shape)
    if not excess[row, k] > 1.0:
        return ""
    axle, at = AXLES[row], near[k]
    does, would = ("brake", "lock") if force_n[at] < 0.0 else ("drive", "spin")
    return (
        f"at t = {time_s[at]:.5g} s the {axle} wheels {does} with {forces[row, at]:.4g} N, and "
        f"their tyres hold {held[row, k]:.4g} N (D_{axle} = {peaks[row, 0]:.3g}): those of a car "
        f"would {would}, in the single-track model they do not; ask for less speed, or for changes "
        "of it that take longer"
    )


def _loads(model: Model, inputs: FloatArray, motion: FloatArray, peak: float) -> FloatArray:
    """Loads of the front and the rear axle, shape (2, n)."""
    core, p = model.core(), model.vector()
    loads = np.empty((2, len(inputs)))
    for k, ((steer, force), moving) in enumerate(zip(inputs, motion, strict=True)):
        coasting = core.evaluate(p, moving, steer, 0.0)[0, _LOADS]
        most = peak * float(coasting.sum())
        loads[:, k] = core.evaluate(p, moving, steer, float(np.clip(force, -most, most)))[0, _LOADS]
    return as_float64(loads)
