"""The extended-state observer: motion and unexplained forces from a log, filtered or smoothed.

The model is a single-track car with linear tyres; what it does not explain is a force ahead, a
force sideways and a yaw moment that are random walks: a virtual force sensor.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeVar

import numpy as np
import numpy.typing as npt

from ... import _core
from ..._common.arrays import FloatArray, as_float64
from ..._common.typed import typed, typed_fields
from ...errors import InvalidInput, NumericalError
from ...estimate.inputs import white_noise_std
from ...vehicle import GRAVITY_MPS2
from .observed import READINGS, STATES, StateEstimate
from .record import ObserverCar, ObserverRecord

_T = TypeVar("_T")


@dataclass(frozen=True)
class ObserverForm:
    """Which equations the observer uses; by default all are corrected.

    Attributes
    ----------
    feed_through : bool
        The steering angle acts on the lateral acceleration at once.
    input_before : bool
        The state follows from the inputs of the sample before, not of its own.
    exact_sampling : bool
        Held inputs and dynamics are sampled exactly, not by Euler's rule.
    coupling : bool
        ``v_y r`` in the longitudinal equation, and the full Jacobian.
    speed_predicted : bool
        The reading is predicted with the predicted speed, not with the estimate before it.
    """

    feed_through: bool = True
    input_before: bool = True
    exact_sampling: bool = True
    coupling: bool = True
    speed_predicted: bool = True


@dataclass(frozen=True, eq=False)
class ObserverNoise:
    """Covariances of one sample's disturbances and of the sensors.

    Attributes
    ----------
    process : ndarray of shape (6, 6)
        Of speeds [m/s], yaw rate [rad/s], forces [N] and moment [N m] in one step.
    sensors : ndarray of shape (4, 4)
        Of the readings.

    Raises
    ------
    InvalidInput
        Wrong shapes, a negative variance, a sensor without noise, or correlations beyond one.
    """

    process: FloatArray
    sensors: FloatArray

    @typed_fields
    def __post_init__(self) -> None:
        object.__setattr__(self, "process", as_float64(self.process))
        object.__setattr__(self, "sensors", as_float64(self.sensors))
        _refuse_no_covariance(self.process, STATES, "process noise", zero=True)
        _refuse_no_covariance(self.sensors, READINGS, "sensor noise", zero=False)

    @classmethod
    @typed
    def from_variances(cls, process: npt.ArrayLike, sensors: npt.ArrayLike) -> ObserverNoise:
        """Uncorrelated noise of six and four variances."""
        return cls(np.diag(as_float64(process)), np.diag(as_float64(sensors)))

    @classmethod
    @typed
    def first_guess(cls, record: ObserverRecord, car: ObserverCar) -> ObserverNoise:
        """Guess from the fast scatter of the readings and weight alone: a start for learning."""
        smallest = np.array([1e-3, 1e-4, 1e-4, 1e-3])
        scatter = np.array([white_noise_std(y) for y in record.readings.T])
        sensors = np.maximum(scatter, smallest) ** 2
        dt = 1.0 / record.rate_hz
        force = 0.02 * car.mass_kg * GRAVITY_MPS2
        disturbance = np.array([force, force, 0.5 * force * (car.lf_m + car.lr_m)])
        motion = np.array([0.05, 0.05, 0.05])
        return cls.from_variances(dt * np.concatenate([motion, disturbance]) ** 2, sensors)


def _refuse_no_covariance(C: FloatArray, names: tuple[str, ...], what: str, *, zero: bool) -> None:
    n = len(names)
    if C.shape != (n, n):
        raise InvalidInput(f"{what} has shape {C.shape}; give {n} x {n}: {', '.join(names)}")
    for i, name in enumerate(names):
        good = C[i, i] >= 0.0 if zero else C[i, i] > 0.0
        if not (good and np.isfinite(C[i]).all()):
            above = "zero or more" if zero else "above zero"
            raise InvalidInput(
                f"{what}: the variance of {name} is {C[i, i]:g}, its row {C[i]}; give a finite row "
                f"and a variance {above}"
            )
        if not np.allclose(C[i], C[:, i], rtol=1e-9, atol=0.0):
            raise InvalidInput(f"{what}: row and column of {name} differ; a covariance has none")
    std = np.sqrt(np.diag(C)).clip(1e-150)
    correlation = C / np.outer(std, std)
    np.fill_diagonal(correlation, 1.0)
    if np.linalg.eigvalsh(correlation)[0] < (-1e-9 if zero else 1e-12):
        worst = names[int(np.abs(correlation - np.eye(n)).max(axis=1).argmax())]
        raise InvalidInput(
            f"{what} is not positive definite; lower the correlations, those of {worst} first"
        )


@dataclass(frozen=True)
class Observer:
    """Extended Kalman filter and Rauch-Tung-Striebel smoother of the extended-state model.

    Parameters
    ----------
    car : ObserverCar
        Mass, inertia, geometry. The stiffness comes with each record.
    noise : ObserverNoise
        Covariances; `learn_observer_noise` finds them.
    form : ObserverForm
        The equations; corrected by default.
    certain_start_mps : float or None
        Speed one sample before the first, taken as certain; None begins with the first reading.
    """

    car: ObserverCar
    noise: ObserverNoise
    form: ObserverForm = ObserverForm()
    certain_start_mps: float | None = None

    @typed
    def with_noise(self, noise: ObserverNoise) -> Observer:
        """Give the same observer with other covariances."""
        return dataclasses.replace(self, noise=noise)

    @typed
    def filtered(self, record: ObserverRecord) -> StateEstimate:
        """Estimates from the readings up to each sample.

        Raises
        ------
        NumericalError
            A covariance that is not positive definite.
        """
        return self._trace(record, smoothed=False)

    @typed
    def smoothed(self, record: ObserverRecord) -> StateEstimate:
        """Estimates from all readings; raises as `filtered` does."""
        return self._trace(record, smoothed=True)

    @typed
    def log_likelihood(self, record: ObserverRecord) -> float:
        """Of the readings, by one pass of the filter."""
        return max(self._log_likelihood(one) for one in record.kinds())

    def _log_likelihood(self, record: ObserverRecord) -> float:
        log, noise = self.core_log(record), self.noise
        return _numerical(record.name, lambda: log.log_likelihood(noise.process, noise.sensors))

    @typed
    def told(self, record: ObserverRecord) -> ObserverRecord:
        """The record with `inputs_held` said: as it was, or what is likelier under this noise."""
        kinds = record.kinds()
        return kinds[0] if len(kinds) == 1 else max(kinds, key=self._log_likelihood)

    @typed
    def core_log(self, record: ObserverRecord) -> _core.ObserverLog:
        """Put the record into the core, with the state it starts from.

        Inputs of which it is not said count as held.
        """
        speed = self.certain_start_mps
        if speed is not None:
            mean = as_float64([speed, 0.0, 0.0, 0.0, 0.0, 0.0])
            covariance = np.zeros((len(STATES), len(STATES)))
        else:
            first = record.readings[0].copy()
            if np.isnan(first[0]):  # where the speed is first known is better than nothing
                first[0] = record.readings[np.isfinite(record.readings[:, 0]), 0][0]
            car = self.car.vector()
            mean, covariance = _core.observer_start(car, first, as_float64(self.noise.sensors))
        return _core.ObserverLog(
            self.car.vector(),
            dataclasses.astuple(self.form),
            1.0 / record.rate_hz,
            as_float64(record.inputs()),
            record.readings,
            mean,
            covariance,
            speed is not None,
            record.inputs_held is not False,
        )

    def _trace(self, record: ObserverRecord, *, smoothed: bool) -> StateEstimate:
        record = self.told(record)
        log, noise = self.core_log(record), self.noise
        found = _numerical(record.name, lambda: log.trace(noise.process, noise.sensors, smoothed))
        return StateEstimate(
            name=record.name,
            time_s=record.time_s,
            state=found["state"],
            covariance=found["covariance"].reshape(-1, len(STATES), len(STATES)),
            reading=found["reading"],
            reading_std=found["reading_std"],
            measured=record.readings,
            innovation=found["innovation"],
            innovation_std=found["innovation_std"],
            log_likelihood=found["log_likelihood"],
            smoothed=smoothed,
        )


def _numerical(name: str, run: Callable[[], _T]) -> _T:
    try:
        return run()
    except NumericalError as failure:
        raise NumericalError(
            f"{name}: {failure}; check units and stiffness, or start from larger covariances"
        ) from failure
