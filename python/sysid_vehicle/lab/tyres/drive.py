"""Drives of the grey-box car itself, to try an experiment or an estimator on."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from ..._common.arguments import generator
from ..._common.arrays import FloatArray, as_float64
from ..._common.typed import typed
from ...errors import InvalidInput
from ..observer.observed import READINGS
from .data import GreyBoxVehicle, TyreLog
from .problem import TyreProblem, first_point

_SENSORS = (0.1, 3.16e-3, 3.16e-3, 3.16e-3)  # v_x, v_y [m/s], yaw rate [rad/s], a_y [m/s2]


@typed
def drive_tyres(
    vehicle: GreyBoxVehicle,
    tyres: Mapping[str, float],
    inputs: FloatArray,
    *,
    step_s: float = 0.01,
    begin: tuple[float, float, float] = (25.0, 0.0, 0.0),
    sensors: tuple[float, float, float, float] = _SENSORS,
    seed: int | np.random.Generator = 0,
    name: str = "simulated drive",
) -> TyreLog:
    """Drive the grey-box car open loop and read its sensors.

    Parameters
    ----------
    vehicle : GreyBoxVehicle
    tyres : mapping
        Values of some of `lab.tyre_fit.PARAMETERS`.
    inputs : array, shape (n, 4)
        As in `TyreLog`.
    step_s : float
    begin : tuple of 3 floats
        v_x, v_y [m/s], yaw rate [rad/s] at the first sample.
    sensors : tuple of 4 floats
        Standard deviations of the sensors' white noise.
    seed : int or numpy.random.Generator
    name : str

    Raises
    ------
    InvalidInput
        The car spins or stops: the motion leaves what the model is made for.
    """
    u = as_float64(inputs)
    told = np.full((len(u), 4), np.nan)
    told[0, :3] = begin
    problem = TyreProblem.of(vehicle, residual_terms=True)
    problem.add_run(step_s, u, told)
    y = problem.free_run(first_point(tyres))
    lost = ~np.isfinite(y).all(axis=1) | (y[:, 0] < 1.0) | (np.abs(y[:, 1]) > y[:, 0])
    if lost.any():
        k = int(np.argmax(lost))
        raise InvalidInput(
            f"{name}: the car spins or stops at sample {k} ({k * step_s:.2f} s; "
            f"{READINGS[0]} {y[k, 0]:.3g}, {READINGS[1]} {y[k, 1]:.3g}); steer or brake less"
        )
    noise = generator(seed).normal(size=y.shape) * np.asarray(sensors)
    return TyreLog(step_s, as_float64(y + noise), u, name, inputs_held=True)
