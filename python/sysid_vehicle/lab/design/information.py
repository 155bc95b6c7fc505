"""What a drive tells of the tyres: the Fisher information of its readings.

The drive is computed with the car as it is believed to be, and an extended Kalman filter predicts
each reading from those before it. With `S` the covariances of the prediction errors and `G` their
derivatives by the coefficients, the information is ``sum G' S^-1 G``, and its inverse the least
covariance that any unbiased estimate can have (Ljung, System Identification, 2nd ed., sec. 7.4 and
14.2). Derivatives come from the core's dual numbers.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ... import _core
from ..._common.arrays import FloatArray, as_float64
from ..._common.typed import typed
from ...errors import InvalidInput
from ...estimate import MEASURED, NoiseModel
from ...model import Model
from ...vehicle import AXLES
from ..drive.loop import ClosedLoop
from ..observer.observed import READINGS

TYRES = tuple(f"{letter}_{axle}" for axle in AXLES for letter in "BCDE")
"""The eight tyre coefficients."""

MOTION = (5e-3, 5e-3, 1e-3)
"""White disturbance of v_x, v_y [m/s per root second] and yaw rate [rad/s per root second] that is
allowed for: no real car obeys its model better."""

_LEAST_STD = 1e-4
_LOAD_COEFFICIENTS = ("D_front", "D_rear")


def problem_of(
    drive: ClosedLoop, model: Model, readings: Sequence[str] = READINGS
) -> _core.Problem:
    """Prediction problem of a model on what the sensors of a drive wrote.

    Parameters
    ----------
    drive : ClosedLoop
        Best with `Simulator.inputs_linear`: the problem takes inputs as linear between samples.
    model : Model
    readings : sequence of str
        Readings to predict; others are left out.

    Raises
    ------
    InvalidInput
        An unknown reading, or no reading of wheel force or steering angle at some sample.
    """
    for name in readings:
        if name not in MEASURED:
            raise InvalidInput(f"readings: '{name}' is not one of {', '.join(MEASURED)}")
    inputs = as_float64(np.column_stack([drive.sensed["steer_rad"], drive.sensed["fx_n"]]))
    if not np.isfinite(inputs).all():
        k = int(np.flatnonzero(~np.isfinite(inputs).all(axis=1))[0])
        raise InvalidInput(
            f"{drive.excitation.name}: steer_rad or fx_n has no reading at sample {k} "
            f"({drive.time_s[k]:.6g} s); give these sensors no rate of their own"
        )
    y = np.full((len(inputs), len(MEASURED)), np.nan)
    for i, name in enumerate(MEASURED):
        if name in readings:
            y[:, i] = drive.sensed[name]
    model.refuse_channels("the laboratory")
    problem = _core.Problem(model.core())
    problem.add_run(1.0 / drive.setup.rate_hz, inputs, as_float64(y))
    return problem


def sensor_noise(drive: ClosedLoop, motion: tuple[float, float, float]) -> NoiseModel:
    """The noise that the sensors of a drive are known to have, and no disturbance force."""
    sensors = drive.setup.sensors
    std = [max(float(getattr(sensors, name).noise_std), _LEAST_STD) for name in MEASURED]
    return NoiseModel(tuple(std), motion, (0.0, 0.0, 0.0), (0.3, 0.3, 0.3))


def parameters_of(drive: ClosedLoop, model: Model) -> FloatArray:
    """A model's values in the core's order, with the grip that the simulator leaves of it."""
    p = model.vector()
    for name in _LOAD_COEFFICIENTS:
        p[model.parameters[name].column] *= drive.setup.simulator.load_share
    return p


@typed
def information(
    drive: ClosedLoop,
    model: Model,
    names: Sequence[str],
    *,
    readings: Sequence[str] = READINGS,
    motion: tuple[float, float, float] = MOTION,
) -> FloatArray:
    """Fisher information of a drive about parameters of a model.

    Parameters
    ----------
    drive : ClosedLoop
        The drive, computed with this model.
    model : Model
    names : sequence of str
        Parameters that are not known, by full name.
    readings : sequence of str
        Readings that are used.
    motion : tuple of 3 floats
        White disturbance that is allowed for, in the units of `MOTION`.

    Returns
    -------
    array, shape (n, n)

    Raises
    ------
    InvalidInput
        An unknown parameter or reading.
    """
    known = model.parameters
    for name in names:
        if name not in known:
            raise InvalidInput(f"the model has no parameter '{name}'; it has {', '.join(known)}")
    p = parameters_of(drive, model)
    columns = [known[name].column for name in names]
    problem = problem_of(drive, model, readings)
    frozen = problem.freeze(p, sensor_noise(drive, motion).vector())
    _, _, found = problem.normal_equations(p, frozen, columns)
    share = drive.setup.simulator.load_share
    scale = np.array([share if name in _LOAD_COEFFICIENTS else 1.0 for name in names])
    return as_float64(found * np.outer(scale, scale))
