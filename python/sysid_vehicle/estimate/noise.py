"""The noise model: how noisy the sensors are, and how strongly the motion is disturbed."""

from __future__ import annotations

import math
from collections.abc import Container, Sequence
from dataclasses import dataclass, replace

import numpy as np

from .._common.arrays import FloatArray, as_float64
from .._common.text import html_text
from .._common.typed import typed_fields
from ..log import MEASURED
from ..vehicle import GRAVITY_MPS2, Vehicle
from .driving import UNITS, Driving
from .inputs import white_noise_std

_SENSORS = slice(0, 5)
_MOTION = slice(5, 8)
DISTURBANCE = slice(8, 11)
"""Places of the sizes of disturbances in the core's order (`NoiseModel.vector`)."""
TIMES = slice(11, 14)
"""The same of their correlation times."""
_ROAD = slice(14, 16)
_ROAD_TIME = 16
_COLOUR = slice(17, 20)
_COLOUR_TIMES = slice(20, 23)
COLOURED = ("yaw_rate_radps", "ax_mps2", "ay_mps2")
"""Channels whose sensors may have noise with a correlation time beside the white one."""


_LEAST_TRIED = ", the least that is tried: what the model leaves unexplained stands for the rest"


@dataclass(frozen=True)
class NoiseModel:
    """Standard deviations of sensor noise and of what disturbs the motion.

    Attributes
    ----------
    sensor : tuple of 5 floats
        vx, vy [m/s], yaw rate [rad/s], ax, ay [m/s2]; white.
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
    colour : tuple of 3 floats
        Noise of the yaw rate [rad/s], ax, ay [m/s2] with a correlation time, beside the white one
        (Ornstein-Uhlenbeck): filters, vibration and wind in the sensors. Zeros cost nothing.
    colour_time_s : tuple of 3 floats
        Correlation times of these.
    """

    sensor: tuple[float, ...]
    motion: tuple[float, ...]
    disturbance: tuple[float, ...]
    correlation_time_s: tuple[float, ...]
    road: tuple[float, ...] = (0.0, 0.0)
    road_time_s: float = 5.0
    colour: tuple[float, ...] = (0.0, 0.0, 0.0)
    colour_time_s: tuple[float, ...] = (0.05, 0.05, 0.05)

    @typed_fields
    def __post_init__(self) -> None:
        given: object = self.correlation_time_s
        if isinstance(given, int | float):  # as in files of earlier versions
            object.__setattr__(self, "correlation_time_s", (float(given),) * 3)

    @property
    def sloping(self) -> bool:
        """Whether the slope of the road varies."""
        return any(self.road)

    @property
    def coloured(self) -> bool:
        """Whether noise of sensors is correlated in time."""
        return any(self.colour)

    @property
    def reading(self) -> tuple[float, ...]:
        """Standard deviations of all noise of the sensors, white and coloured, as `sensor`."""
        coloured = dict(zip(COLOURED, self.colour, strict=True))
        return tuple(
            math.hypot(s, coloured.get(c, 0.0)) for c, s in zip(MEASURED, self.sensor, strict=True)
        )

    def vector(self) -> FloatArray:
        """In the core's order."""
        times = (*self.correlation_time_s, *self.road, self.road_time_s)
        colours = (*self.colour, *self.colour_time_s)
        return as_float64([*self.sensor, *self.motion, *self.disturbance, *times, *colours])

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
            tuple(map(float, v[_COLOUR])),
            tuple(map(float, v[_COLOUR_TIMES])),
        )

    def floor(self) -> NoiseModel:
        """The same noise without the disturbances: what remains if the model explains everything.

        A slope that varies stays: no model of a car knows it. So does all noise of sensors.

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
            f"  {c:15s} {s:10.3g} {UNITS[c]}{_LEAST_TRIED if s <= 1.001 * least else ''}"
            for c, s, least in zip(MEASURED, self.sensor, _SMALLEST.tolist(), strict=True)
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
        for c, std, time_s in zip(COLOURED, self.colour, self.colour_time_s, strict=True):
            if std > 0.0 and c in measured:
                name = f"{c}, coloured"
                lines.append(f"  {name} {std:.3g} {UNITS[c]}, correlation time {time_s:.2g} s")
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
_COLOUR_TIMES_S = (0.01, 0.1)  # what is slower moves as the driving does, and may be a fault
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
            _SMALLEST[2:],
            np.full(3, _COLOUR_TIMES_S[0]),
        ]
    )
    high = np.concatenate(
        [
            [5.0, 5.0, 1.0, 20.0, 20.0],
            [2.0, 2.0, 1.0],
            np.array([along * weight, 0.6 * weight, 0.6 * arm]),
            np.full(3, _TIMES_S[1]),
            [2.0, 2.0, _ROAD_TIMES_S[1]],
            [1.0, 20.0, 20.0],
            np.full(3, _COLOUR_TIMES_S[1]),
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
