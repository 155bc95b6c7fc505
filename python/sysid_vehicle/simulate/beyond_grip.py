"""Whether a drive asks its wheels for more force along the car than the tyres hold.

Wheels of a single-track model do not lock or spin: it brakes on ice as hard as it is told to.
"""

from __future__ import annotations

import numpy as np

from .._common.arrays import FloatArray
from ..model import Model
from ..vehicle import AXLES, GRAVITY_MPS2


def beyond_grip(
    model: Model, time_s: FloatArray, force_n: FloatArray, accelerations_mps2: FloatArray
) -> str:
    """Say where, and how far, wheel forces go beyond D times the load of an axle.

    The load is that of a rigid car on a level road, with the transfer by the longitudinal
    acceleration as far as tyres can bring it about (Gillespie, Fundamentals of Vehicle Dynamics,
    ch. 1), whatever the model has of it. Downforce, and grip that changes, are not counted.

    Parameters
    ----------
    model : Model
    time_s, force_n, accelerations_mps2 : array, shape (n,)
        Time of the samples, total wheel force, and longitudinal acceleration.

    Returns
    -------
    str
        Empty where no axle is asked for more.
    """
    car = model.vehicle
    front = np.where(force_n < 0.0, car.brake_front_share, car.drive_front_share)
    forces = np.abs([front * force_n, (1.0 - front) * force_n])
    peaks = np.array([[model.value(f"D_{axle}")] for axle in AXLES])
    most_mps2 = GRAVITY_MPS2 * float(peaks.max())
    transfer = car.cg_height_m * np.clip(accelerations_mps2, -most_mps2, most_mps2)
    arms = [GRAVITY_MPS2 * car.lr_m - transfer, GRAVITY_MPS2 * car.lf_m + transfer]
    held = peaks * car.mass_kg * np.maximum(arms, 0.0) / car.wheelbase_m
    excess = forces / np.maximum(held, 1.0)
    if not np.any(excess > 1.0):
        return ""
    row, k = np.unravel_index(int(np.argmax(excess)), excess.shape)
    axle, force, most = AXLES[row], forces[row, k], held[row, k]
    does, would = ("brake", "lock") if force_n[k] < 0.0 else ("drive", "spin")
    return (
        f"at t = {time_s[k]:.5g} s the {axle} wheels {does} with {force:.4g} N, and their tyres "
        f"hold {most:.4g} N (D_{axle} = {peaks[row, 0]:.3g}): those of a car would {would}, in the "
        "single-track model they do not; ask for less speed, or for changes of it that take longer"
    )
