"""The extended-state observer: motion and unexplained forces from a log, filtered or smoothed.

The model is a single-track car with linear tyres; what it does not explain is a force ahead, a
force sideways and a yaw moment that wander freely: a virtual force sensor.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeVar

import numpy as np
import numpy.typing as npt

from .. import _core
from .._arrays import FloatArray, as_float64
from ..errors import InvalidInput, NumericalError
from ..estimate.inputs import white_noise_std
from ..vehicle import Vehicle
from .observed import READINGS, STATES, StateEstimate

__all__ = ["Observer", "ObserverCar", "ObserverForm", "ObserverNoise", "ObserverRecord"]

_GRAVITY = 9.81
_T = TypeVar("_T")


@dataclass(frozen=True)
class ObserverForm:
    """Which equations the observer uses; by default all are mended.

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

    @classmethod
    def published(cls) -> ObserverForm:
        """Give the observer as published, with its defects, to reproduce its numbers."""
        return cls(False, False, False, False, False)


@dataclass(frozen=True)
class ObserverCar:
    """What the observer believes of the car.

    Attributes
    ----------
    mass_kg, yaw_inertia_kgm2, lf_m, lr_m : float
        Mass, yaw inertia, distances from the centre of gravity to the axles.
    drag_nspm : float
        Drag force per speed [N s/m].
    """

    mass_kg: float
    yaw_inertia_kgm2: float
    lf_m: float
    lr_m: float
    drag_nspm: float = 0.0

    def __post_init__(self) -> None:
        for name in ("mass_kg", "yaw_inertia_kgm2", "lf_m", "lr_m"):
            if not getattr(self, name) > 0.0:
                raise InvalidInput(f"{name} = {getattr(self, name)} must be a number above zero")

    @classmethod
    def of(cls, vehicle: Vehicle, *, drag_nspm: float = 0.0) -> ObserverCar:
        """Take the numbers of a vehicle.

        Raises
        ------
        InvalidInput
            The vehicle's yaw inertia is not known.
        """
        inertia = vehicle.yaw_inertia_kgm2
        if inertia is None:
            raise InvalidInput("yaw_inertia_kgm2 is not known; set it in the vehicle first")
        return cls(vehicle.mass_kg, inertia, vehicle.lf_m, vehicle.lr_m, drag_nspm)

    def vector(self) -> FloatArray:
        """In the core's order."""
        return as_float64(dataclasses.astuple(self))

    def static_loads_n(self) -> tuple[float, float]:
        """Axle loads at rest, front and rear [N]."""
        per_metre = self.mass_kg * _GRAVITY / (self.lf_m + self.lr_m)
        return per_metre * self.lr_m, per_metre * self.lf_m


@dataclass(frozen=True, eq=False)
class ObserverRecord:
    """One log made ready for the observer.

    Attributes
    ----------
    rate_hz : float
        Sample rate.
    force_x_n, steer_rad : ndarray of shape (n,)
        Longitudinal force and road-wheel steering angle, held over each sample.
    stiffness_front_nprad, stiffness_rear_nprad : ndarray of shape (n,)
        Nominal cornering stiffness of the axles; a stiffness per load times the load.
    readings : ndarray of shape (n, 4)
        Speed ahead and sideways [m/s], yaw rate [rad/s], lateral acceleration [m/s2]; NaN where
        missing.
    name : str
        Name in messages.
    """

    rate_hz: float
    force_x_n: FloatArray
    steer_rad: FloatArray
    stiffness_front_nprad: FloatArray
    stiffness_rear_nprad: FloatArray
    readings: FloatArray
    name: str = "log"

    @classmethod
    def from_arrays(
        cls,
        *,
        rate_hz: float,
        force_x_n: npt.ArrayLike,
        steer_rad: npt.ArrayLike,
        stiffness_front_nprad: npt.ArrayLike,
        stiffness_rear_nprad: npt.ArrayLike,
        readings: npt.ArrayLike,
        name: str = "log",
    ) -> ObserverRecord:
        """Check and convert; a single number stands for a constant input.

        Raises
        ------
        InvalidInput
            Shapes that do not fit, an input that is not finite, a stiffness not above zero, an
            infinite reading, or no reading of the speed.
        """
        y = as_float64(readings)
        if y.ndim != 2 or y.shape[1] != len(READINGS) or len(y) < 2:
            raise InvalidInput(
                f"{name}: readings have shape {y.shape}; give samples x 4: {', '.join(READINGS)}"
            )
        if not (np.isfinite(rate_hz) and rate_hz > 0.0):
            raise InvalidInput(f"{name}: rate_hz = {rate_hz} must be a number above zero")
        given = {
            "force_x_n": force_x_n,
            "steer_rad": steer_rad,
            "stiffness_front_nprad": stiffness_front_nprad,
            "stiffness_rear_nprad": stiffness_rear_nprad,
        }
        inputs = {}
        for key, values in given.items():
            u = np.asarray(values, dtype=np.float64)
            if u.shape not in ((), (len(y),)):
                raise InvalidInput(f"{name}: {key} has shape {u.shape}; give {len(y)} values")
            inputs[key] = u = as_float64(np.broadcast_to(u, len(y)))
            bad = ~np.isfinite(u)
            if key.startswith("stiffness"):
                bad |= ~(u > 0.0)
            _refuse(bad, u, key, name, rate_hz, "fill or cut it: the observer needs every input")
        for i, key in enumerate(READINGS):
            remedy = "mark a missing reading by NaN"
            _refuse(np.isinf(y[:, i]), y[:, i], key, name, rate_hz, remedy)
        if not np.isfinite(y[:, 0]).any():
            raise InvalidInput(f"{name}: no reading of vx_mps; the observer needs the speed")
        return cls(rate_hz=float(rate_hz), readings=y, name=name, **inputs)

    @property
    def time_s(self) -> FloatArray:
        """Time of each sample [s]."""
        return np.arange(len(self.readings), dtype=np.float64) / self.rate_hz

    def inputs(self) -> FloatArray:
        """In the core's order, samples x 4."""
        return np.column_stack(
            [
                self.force_x_n,
                self.steer_rad,
                self.stiffness_front_nprad,
                self.stiffness_rear_nprad,
            ]
        )

    def without(self, *channels: str) -> ObserverRecord:
        """Give the same record with the readings of some channels missing."""
        y = self.readings.copy()
        for channel in channels:
            if channel not in READINGS:
                raise InvalidInput(f"no reading {channel!r}; there are {', '.join(READINGS)}")
            y[:, READINGS.index(channel)] = np.nan
        return dataclasses.replace(self, readings=y)


def _refuse(
    bad: npt.NDArray[np.bool_], u: FloatArray, key: str, name: str, rate_hz: float, remedy: str
) -> None:
    if bad.any():
        k = int(np.argmax(bad))
        raise InvalidInput(
            f"{name}: {key} = {u[k]} at sample {k} ({k / rate_hz:.2f} s) and {bad.sum() - 1} "
            f"others; {remedy}"
        )


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

    def __post_init__(self) -> None:
        object.__setattr__(self, "process", as_float64(self.process))
        object.__setattr__(self, "sensors", as_float64(self.sensors))
        _refuse_no_covariance(self.process, STATES, "process noise", zero=True)
        _refuse_no_covariance(self.sensors, READINGS, "sensor noise", zero=False)

    @classmethod
    def from_variances(cls, process: npt.ArrayLike, sensors: npt.ArrayLike) -> ObserverNoise:
        """Uncorrelated noise of six and four variances."""
        return cls(np.diag(as_float64(process)), np.diag(as_float64(sensors)))

    @classmethod
    def published(cls) -> ObserverNoise:
        """Give the noise the publication ships."""
        return cls.from_variances(
            [4.9439e-4, 5.8044e-4, 5.55501e-6, 17.535, 1321.6, 28.569],
            [0.0093, 5.8534e-5, 6.1532e-6, 0.0026],
        )

    @classmethod
    def first_guess(cls, record: ObserverRecord, car: ObserverCar) -> ObserverNoise:
        """Guess from the fast scatter of the readings and weight alone: a start for learning."""
        smallest = np.array([1e-3, 1e-4, 1e-4, 1e-3])
        scatter = np.array([white_noise_std(y) for y in record.readings.T])
        sensors = np.maximum(scatter, smallest) ** 2
        dt = 1.0 / record.rate_hz
        force = 0.02 * car.mass_kg * _GRAVITY
        wander = np.array([force, force, 0.5 * force * (car.lf_m + car.lr_m)])
        motion = np.array([0.05, 0.05, 0.05])
        return cls.from_variances(dt * np.concatenate([motion, wander]) ** 2, sensors)


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
        The equations; mended by default.
    """

    car: ObserverCar
    noise: ObserverNoise
    form: ObserverForm = ObserverForm()

    def with_noise(self, noise: ObserverNoise) -> Observer:
        """Give the same observer with other covariances."""
        return dataclasses.replace(self, noise=noise)

    def filtered(self, record: ObserverRecord) -> StateEstimate:
        """Estimates from the readings up to each sample.

        Raises
        ------
        NumericalError
            A covariance that is not positive definite.
        """
        return self._trace(record, smoothed=False)

    def smoothed(self, record: ObserverRecord) -> StateEstimate:
        """Estimates from all readings; raises as `filtered` does."""
        return self._trace(record, smoothed=True)

    def log_likelihood(self, record: ObserverRecord) -> float:
        """Of the readings, by one pass of the filter."""
        log = self.core_log(record)
        return _numerical(
            record.name, lambda: log.log_likelihood(self.noise.process, self.noise.sensors)
        )

    def core_log(self, record: ObserverRecord) -> _core.ObserverLog:
        """Put the record into the core, with the state it starts from."""
        if self.form == ObserverForm.published():
            mean, covariance, one_before = np.array([5.0, 0, 0, 0, 0, 0]), np.zeros((6, 6)), True
        else:
            first = record.readings[0].copy()
            if np.isnan(first[0]):  # where the speed is first known is better than nothing
                first[0] = record.readings[np.isfinite(record.readings[:, 0]), 0][0]
            car = self.car.vector()
            mean, covariance = _core.observer_start(car, first, as_float64(self.noise.sensors))
            one_before = False
        return _core.ObserverLog(
            self.car.vector(),
            dataclasses.astuple(self.form),
            1.0 / record.rate_hz,
            as_float64(record.inputs()),
            record.readings,
            mean,
            covariance,
            one_before,
        )

    def _trace(self, record: ObserverRecord, *, smoothed: bool) -> StateEstimate:
        log = self.core_log(record)
        noise = self.noise
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
    except _core.NumericalFailure as failure:
        raise NumericalError(
            f"{name}: {failure}; check units and stiffness, or start from larger covariances"
        ) from failure
