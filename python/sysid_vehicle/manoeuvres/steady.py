"""The steering a car needs in steady cornering, from its own numbers."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from .._common.arrays import FloatArray
from .._common.typed import typed
from ..errors import InvalidInput
from ..tyre import Tyre
from ..vehicle import GRAVITY_MPS2, Vehicle

# Beyond this share of its peak a tyre's curve is too flat to tell a slip angle from a force.
_USABLE_PEAK = 0.97
_LARGEST_SLIP_RAD = 0.6


def _curve(tyre: Tyre) -> tuple[FloatArray, FloatArray]:
    """Slip angle and force per load of the rising branch of :class:`Tyre`'s curve."""
    alpha = np.linspace(0.0, _LARGEST_SLIP_RAD, 3001)
    mu = tyre.friction(alpha)
    top = int(np.argmax(mu)) + 1
    return alpha[:top], mu[:top]


def _slip_for(tyre: Tyre, mu: FloatArray) -> FloatArray:
    alpha, rising = _curve(tyre)
    within = np.minimum(np.abs(mu), _USABLE_PEAK * rising[-1])
    return np.asarray(np.sign(mu) * np.interp(within, rising, alpha), dtype=float)


@typed
def peak_lateral_mps2(vehicle: Vehicle) -> float:
    """Lateral acceleration at which the weaker axle has reached its peak [m/s2]."""
    tyres = (vehicle.tyre_front, vehicle.tyre_rear)
    return GRAVITY_MPS2 * min(float(_curve(tyre)[1][-1]) for tyre in tyres)


@typed
def understeer_gradient(vehicle: Vehicle) -> float:
    """Steering angle per lateral acceleration for small ones [rad s2/m].

    ``K = (1/BCD_front - 1/BCD_rear) / g``: Rajamani, *Vehicle Dynamics and Control* (2nd ed.),
    ch. 3, with cornering stiffnesses proportional to the axle loads.
    """
    front = vehicle.tyre_front.cornering_stiffness_per_load
    rear = vehicle.tyre_rear.cornering_stiffness_per_load
    return (1.0 / front - 1.0 / rear) / GRAVITY_MPS2


def slip_difference(vehicle: Vehicle, lateral_mps2: npt.ArrayLike) -> FloatArray:
    """Front minus rear slip angle in steady cornering [rad], on the tyres' full curves."""
    mu = np.asarray(lateral_mps2, dtype=float) / GRAVITY_MPS2
    return _slip_for(vehicle.tyre_front, mu) - _slip_for(vehicle.tyre_rear, mu)


@typed
def steady_steer(
    vehicle: Vehicle, speed_mps: npt.ArrayLike, lateral_mps2: npt.ArrayLike
) -> FloatArray:
    """Steering angle [rad] that holds a lateral acceleration: ``L a_y / v^2 + alpha_f - alpha_r``.

    Parameters
    ----------
    vehicle : Vehicle
        The car, with its tyres.
    speed_mps, lateral_mps2 : array_like, shape (n,) or ()
        Speed and lateral acceleration.

    Returns
    -------
    ndarray, shape as the broadcast arguments

    Raises
    ------
    InvalidInput
        If a lateral acceleration is beyond the peak of the vehicle's tyres.

    Notes
    -----
    Rajamani, *Vehicle Dynamics and Control* (2nd ed.), ch. 3, on the tyres' full curves.
    """
    speed, lateral = (np.asarray(a, dtype=float) for a in (speed_mps, lateral_mps2))
    most, peak = float(np.max(np.abs(lateral))), peak_lateral_mps2(vehicle)
    if most > peak:
        raise InvalidInput(
            f"lateral_mps2: {most:.3g} m/s2 is more than the {peak:.3g} m/s2 that the tyres of "
            f"'{vehicle.name}' can give; ask the manoeuvre for less"
        )
    path = vehicle.wheelbase_m * lateral / speed**2
    return np.asarray(path + slip_difference(vehicle, lateral), dtype=float)
