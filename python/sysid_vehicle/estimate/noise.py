"""The noise model: how noisy the sensors are, and how strongly the motion is disturbed."""

from __future__ import annotations

from collections.abc import Callable, Container, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import NamedTuple, Protocol

import numpy as np
import numpy.typing as npt
import scipy

from .._common.arrays import FloatArray, as_float64
from .._common.text import html_text
from .._common.threads import check_time
from .._common.typed import typed_fields
from ..errors import NumericalError
from ..log import MEASURED
from ..vehicle import GRAVITY_MPS2, Vehicle
from .driving import UNITS, Driving
from .inputs import white_noise_std
from .pieces import DrivingProblem

_FAR, _TINY = 1.5, 1e-12  # of a logarithm, in one step
_LITTLE = 0.05  # nats for which no other step is tried
# Of a step, nats that it promises and its largest logarithm: what scoring leaves of so little is
# next to nothing.
_NEARLY, _SHORT = 1.0, 0.3

_SENSORS = slice(0, 5)
_MOTION = slice(5, 8)
DISTURBANCE = slice(8, 11)
"""Places of the sizes of disturbances in the core's order (`NoiseModel.vector`)."""
TIMES = slice(11, 14)
"""The same of their correlation times."""
_ROAD = slice(14, 16)
_ROAD_TIME = 16


@dataclass(frozen=True)
class NoiseModel:
    """Standard deviations of white sensor noise and of what disturbs the motion.

    Attributes
    ----------
    sensor : tuple of 5 floats
        vx, vy [m/s], yaw rate [rad/s], ax, ay [m/s2].
    motion : tuple of 3 floats
        White disturbance of vx, vy [m/s per root second], yaw rate [rad/s per root second].
    disturbance : tuple of 3 floats
        Disturbance force x, y [N] and yaw moment [N m] (Ornstein-Uhlenbeck). Takes up what
        the model does not explain.
    correlation_time_s : tuple of 3 floats
        Correlation times of the disturbances; one number stands for all three.
    road : tuple of 2 floats
        Gravity along and across, where the slope varies [m/s2] (Ornstein-Uhlenbeck): it moves the
        car and no accelerometer feels it. Zeros: a level road, which costs nothing.
    road_time_s : float
        Correlation time of both.
    """

    sensor: tuple[float, ...]
    motion: tuple[float, ...]
    disturbance: tuple[float, ...]
    correlation_time_s: tuple[float, ...]
    road: tuple[float, ...] = (0.0, 0.0)
    road_time_s: float = 5.0

    @typed_fields
    def __post_init__(self) -> None:
        given: object = self.correlation_time_s
        if isinstance(given, int | float):  # as in files of earlier versions
            object.__setattr__(self, "correlation_time_s", (float(given),) * 3)

    @property
    def sloping(self) -> bool:
        """Whether the slope of the road varies."""
        return any(self.road)

    def vector(self) -> FloatArray:
        """In the core's order."""
        times = (*self.correlation_time_s, *self.road, self.road_time_s)
        return as_float64([*self.sensor, *self.motion, *self.disturbance, *times])

    @classmethod
    def from_vector(cls, v: FloatArray) -> NoiseModel:
        """From the core's order."""
        return cls(
            tuple(map(float, v[_SENSORS])),
            tuple(map(float, v[_MOTION])),
            tuple(map(float, v[DISTURBANCE])),
            tuple(map(float, v[TIMES])),
            tuple(map(float, v[_ROAD])),
            float(v[_ROAD_TIME]),
        )

    def floor(self) -> NoiseModel:
        """The same noise without the disturbances: what remains if the model explains everything.

        A slope that varies stays: no model of a car knows it.

        The motion keeps a least noise of its own. No log can tell how far below that it lies, yet
        the less there is, the longer the filter trusts its model, and the larger the same fault of
        the model would appear.
        """
        x, y, yaw = (max(m, least) for m, least in zip(self.motion, _LEAST_MOTION, strict=True))
        return replace(self, motion=(x, y, yaw), disturbance=(0.0, 0.0, 0.0))

    def elsewhere(self, vehicle: Vehicle) -> NoiseModel:
        """The same noise on other driving: nowhere sure to less than a thousandth of the weight.

        A manoeuvre that happens to show no unexplained force would otherwise have the filter sure
        of its model wherever it is taken.
        """
        force, moment = _weight_and_moment(vehicle)
        least = _LEAST_DISTURBANCE * np.array([force, force, moment])
        return replace(self, disturbance=tuple(map(float, np.maximum(self.disturbance, least))))

    def text(self, measured: Container[str] = MEASURED) -> str:
        """In words; of sensors that there are not it has a number that means nothing."""
        lines = [
            f"  {c:15s} {s:10.3g} {UNITS[c]}"
            for c, s in zip(MEASURED, self.sensor, strict=True)
            if c in measured
        ]
        force_x, force_y, moment = self.disturbance
        lines.append(
            f"  unexplained force {force_x:.3g} N forward, {force_y:.3g} N sideways, yaw moment "
            f"{moment:.3g} N m, correlation times {self.times}"
        )
        if self.sloping:
            along, across = (np.degrees(g / GRAVITY_MPS2) for g in self.road)
            lines.append(
                f"  road of {along:.2g} deg along and {across:.2g} deg across (standard "
                f"deviations), correlation time {self.road_time_s:.2g} s"
            )
        return "\n".join(lines)

    def __str__(self) -> str:
        return self.text()

    @property
    def times(self) -> str:
        """The correlation times of the disturbances, in words."""
        x, y, moment = (f"{t:.2g}" for t in self.correlation_time_s)
        return f"{x}, {y} and {moment} s"

    _repr_html_ = html_text


# Per square root of a second: over one, 5 mm/s and 1 mrad/s.
_LEAST_MOTION = (5e-3, 5e-3, 1e-3)
_LEAST_DISTURBANCE = 1e-3  # of the weight
# Slower forces are what effects are: drag, wind, slopes. A varying road slope has its own states.
_TIMES_S = (0.01, 1.0)
_ROAD_TIMES_S = (1.0, 20.0)
_SMALLEST = np.array([1e-3, 1e-3, 1e-4, 5e-3, 5e-3])


def _weight_and_moment(vehicle: Vehicle) -> tuple[float, float]:
    """The weight [N], and the yaw moment of half of it at half the wheelbase [N m]."""
    weight = vehicle.mass_kg * GRAVITY_MPS2
    return weight, weight * vehicle.wheelbase_m / 4.0


def noise_range(vehicle: Vehicle, driving: Driving | None = None) -> tuple[FloatArray, FloatArray]:
    """Smallest and largest noise that is learned, in the core's order.

    No sensor is better than the quanta in which it counts. Where the wheel force is not known the
    measured acceleration takes its place, and no force along the car is left to learn: it would
    act through the steering angle alone, as something that it is not.
    """
    weight, arm = _weight_and_moment(vehicle)
    sensor, along = _SMALLEST, 0.6
    if driving is not None:
        sensor = np.maximum(sensor, driving.rounding)
        along = 0.6 if driving.force_known else 1e-4
    low = np.concatenate(
        [
            sensor,
            [1e-4, 1e-4, 1e-5],
            1e-4 * np.array([weight, weight, arm]),
            np.full(3, _TIMES_S[0]),
            [1e-3, 1e-3, _ROAD_TIMES_S[0]],
        ]
    )
    high = np.concatenate(
        [
            [5.0, 5.0, 1.0, 20.0, 20.0],
            [2.0, 2.0, 1.0],
            np.array([along * weight, 0.6 * weight, 0.6 * arm]),
            np.full(3, _TIMES_S[1]),
            [2.0, 2.0, _ROAD_TIMES_S[1]],
        ]
    )
    return as_float64(low), as_float64(high)


def first_guess(driving: Driving, vehicle: Vehicle) -> NoiseModel:
    """A generous start: sensors from their fast scatter, the motion free to follow them."""
    sensors = [
        max(white_noise_std(y), s)
        for y, s in zip(driving.measured.T, noise_range(vehicle, driving)[0], strict=False)
    ]
    return generous(sensors, vehicle)


def generous(sensor: Sequence[float], vehicle: Vehicle) -> NoiseModel:
    """These sensors, and a motion that is disturbed so much that it follows whatever they say."""
    weight = vehicle.mass_kg * GRAVITY_MPS2
    disturbance = (0.02 * weight, 0.04 * weight, 0.02 * weight * vehicle.wheelbase_m / 2.0)
    return NoiseModel(tuple(map(float, sensor)), (0.02, 0.02, 0.01), disturbance, (0.3, 0.3, 0.3))


def learn_noise(
    problem: DrivingProblem, p: FloatArray, start: NoiseModel, vehicle: Vehicle, *, rounds: int = 8
) -> tuple[NoiseModel, float]:
    """Noise of maximum likelihood at fixed model parameters, and the log-likelihood."""
    found = maximise_noise(problem, p, start.vector(), *noise_range(vehicle), rounds=rounds)
    return NoiseModel.from_vector(found.noise), found.log_likelihood


class Learned(NamedTuple):
    """Noise of maximum likelihood, or what was found on the way there.

    Attributes
    ----------
    noise : array, shape (noises,)
    log_likelihood : float
    stands : bool
        Whether another step promises next to nothing; steps had not merely run out.
    """

    noise: FloatArray
    log_likelihood: float
    stands: bool


class _Scored(Protocol):
    def noise_score(
        self, p: FloatArray, noise: FloatArray, /
    ) -> tuple[float, FloatArray, FloatArray]: ...


def maximise_noise(
    problem: _Scored,
    p: FloatArray,
    start: FloatArray,
    lowest: FloatArray,
    highest: FloatArray,
    *,
    rounds: int,
    enough: float = 0.01,
    likelihood: Callable[[FloatArray], float] | None = None,
    along: bool = False,
) -> Learned:
    """Noise of maximum likelihood at fixed parameters of any model.

    Fisher scoring on the logarithms of the noise parameters, each step the best one within a box
    that shrinks where the likelihood would fall; it never does.

    Parameters
    ----------
    problem : object with `noise_score`
        Such as `_core.Problem`.
    p : array, shape (parameters,)
    start, lowest, highest : array, shape (noises,)
        Where to begin, and the range that is searched.
    rounds : int
        Most steps.
    enough : float
        What a step has to promise [nats].
    likelihood : callable, optional
        The log-likelihood alone, from noise, where that costs less than its score: after the last
        step nobody asks for more.
    along : bool
        Whether a score costs little more where the likelihood is known: then steps that lower it
        are not scored either.

    Notes
    -----
    What is zero at the start is not there, and stays so.
    """
    low, high = np.log(lowest), np.log(highest)
    there_is = start > 0.0
    eta = np.clip(np.log(np.maximum(start, 1e-12)), low, high)

    def noise_of(logarithms: FloatArray) -> FloatArray:
        return as_float64(np.where(there_is, np.exp(logarithms), 0.0))

    value, gradient, information = problem.noise_score(p, noise_of(eta))
    reach = _FAR
    stands = False
    for left in reversed(range(rounds)):
        check_time()
        whole, promised = _step(gradient, information, low - eta, high - eta, there_is)
        if promised < enough:
            stands = True
            break
        gained = 0.0
        stands = promised < _NEARLY and float(np.abs(whole).max()) < _SHORT
        last = likelihood is not None and (left == 0 or stands)
        for _ in range(6):
            step, _ = _step(gradient, information, low - eta, high - eta, there_is, reach)
            trial = np.clip(eta + step, low, high)
            there = (-np.inf, gradient, information)
            with suppress(NumericalError):
                if likelihood is not None and (last or along):
                    there = (likelihood(noise_of(trial)), gradient, information)
                if not last and (there[0] > value or not along):
                    there = problem.noise_score(p, noise_of(trial))
            if there[0] > value:
                gained = there[0] - value
                eta, (value, gradient, information) = trial, there
                reach = min(2.0 * reach, _FAR)
                break
            reach *= 0.25
            if promised < _LITTLE:
                break
        if last or gained < max(_LITTLE, enough):
            break
    return Learned(noise_of(eta), float(value), stands)


def promised_by_noise(
    problem: _Scored,
    p: FloatArray,
    noise: FloatArray,
    lowest: FloatArray,
    highest: FloatArray,
) -> float:
    """What a step of Fisher scoring within the range promises to gain [nats].

    Parameters
    ----------
    problem : object with `noise_score`
    p : array, shape (parameters,)
    noise, lowest, highest : array, shape (noises,)
        Noise, of which what is zero is not there, and its range.
    """
    _, gradient, information = problem.noise_score(p, noise)
    there_is = noise > 0.0
    eta = np.log(np.where(there_is, noise, lowest))
    within = (np.log(lowest) - eta, np.log(highest) - eta)
    return _step(gradient, information, *within, there_is)[1]


def _step(
    gradient: FloatArray,
    information: FloatArray,
    low: FloatArray,
    high: FloatArray,
    there_is: npt.NDArray[np.bool_],
    reach: float = _FAR,
) -> tuple[FloatArray, float]:
    """The best step within the range and `reach`, and what it promises to gain.

    Cut at the box, the best step without one may lead downhill: what is next to nothing acts like
    its neighbours.
    """
    step = np.zeros_like(gradient)
    free = (np.diag(information) > 1e-9) & there_is
    if not free.any():
        return step, 0.0
    size = np.sqrt(np.diag(information)[free])
    slope = gradient[free] / size
    scaled = information[np.ix_(free, free)] / np.outer(size, size)
    root = np.linalg.cholesky(scaled + 1e-3 * np.eye(len(size))).T
    bounds = (np.clip(low[free], -reach, -_TINY) * size, np.clip(high[free], _TINY, reach) * size)
    aim = np.linalg.solve(root.T, slope)
    best = np.linalg.solve(root, aim)
    if not np.all((bounds[0] <= best) & (best <= bounds[1])):
        best = scipy.optimize.lsq_linear(root, aim, bounds=bounds, method="bvls").x
    step[free] = best / size
    return as_float64(step), float(slope @ best - 0.5 * best @ scaled @ best)
