"""Excitations made of a speed and a lateral acceleration, and those of a manoeuvre."""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ..._common.arguments import check_positive
from ..._common.arrays import FloatArray, as_float64
from ..._common.typed import typed, typed_fields
from ...manoeuvres import Knots, Manoeuvre
from ...manoeuvres.curves import Curve
from ...vehicle import Vehicle
from .excitation import Excitation
from .multisine import MultiSine

_FINE_HZ = 200.0


class _ByLateral(Excitation):
    """The heading follows from speed and lateral acceleration: ``psi = integral of a_y / v``."""

    @abstractmethod
    def lateral_mps2(self, time_s: FloatArray) -> FloatArray:
        """Wanted lateral acceleration at these times [m/s2]."""

    @cached_property
    def _heading(self) -> tuple[FloatArray, FloatArray]:
        fine = np.arange(round(self.duration_s * _FINE_HZ) + 1) / _FINE_HZ
        rate = self.lateral_mps2(fine) / self.speed_mps(fine)
        steps = 0.5 * (rate[1:] + rate[:-1]) / _FINE_HZ
        return fine, np.concatenate([[0.0], np.cumsum(steps)])

    def heading_rad(self, time_s: FloatArray) -> FloatArray:
        """Wanted heading at these times [rad]."""
        return as_float64(np.interp(time_s, *self._heading))


@dataclass(frozen=True)
class Driven(_ByLateral):
    """Speed and lateral acceleration wanted over time.

    Parameters
    ----------
    label : str
        Name.
    duration_s : float
        Length.
    speed, lateral : callable
        Wanted speed [m/s] and lateral acceleration [m/s2] at an array of times [s].
    """

    label: str
    duration_s: float
    speed: Curve
    lateral: Curve

    @typed_fields
    def __post_init__(self) -> None:
        check_positive(self.label, duration_s=self.duration_s)

    @property
    def name(self) -> str:
        """Name, also of the log that comes out."""
        return self.label

    @typed
    def speed_mps(self, time_s: FloatArray) -> FloatArray:
        """Wanted speed at these times [m/s]."""
        return as_float64(self.speed(time_s))

    @typed
    def lateral_mps2(self, time_s: FloatArray) -> FloatArray:
        """Wanted lateral acceleration at these times [m/s2]."""
        return as_float64(self.lateral(time_s))


@dataclass(frozen=True)
class OnManoeuvre(_ByLateral):
    """A manoeuvre in the hands of the closed loop.

    On a path its lateral acceleration becomes a heading to follow; open-loop steering stays as it
    is, and only the speed is controlled.

    Parameters
    ----------
    manoeuvre : Manoeuvre
        For instance ``manoeuvres.slalom()`` or ``manoeuvres.sine_with_dwell()``.
    """

    manoeuvre: Manoeuvre

    @property
    def name(self) -> str:
        """Name, also of the log that comes out."""
        return self.manoeuvre.name

    @property
    def duration_s(self) -> float:  # type: ignore[override]
        """Length."""
        return self.manoeuvre.duration_s

    @property
    def steer_by(self) -> str:  # type: ignore[override]
        """The heading, or the steering angle where the manoeuvre is open loop."""
        return "heading" if self.manoeuvre.tracks_path else "angle"

    @typed
    def speed_mps(self, time_s: FloatArray) -> FloatArray:
        """Wanted speed at these times [m/s]."""
        return as_float64(self.manoeuvre.speed_mps(time_s))

    @typed
    def lateral_mps2(self, time_s: FloatArray) -> FloatArray:
        """Wanted lateral acceleration at these times [m/s2]."""
        return as_float64(self.manoeuvre.lateral_mps2(time_s))

    @typed
    def steer_rad(self, vehicle: Vehicle, time_s: FloatArray) -> FloatArray:
        """Steering angle at these times [rad]."""
        if self.manoeuvre.tracks_path:
            return np.zeros_like(time_s)
        rate_hz = (time_s.size - 1) / float(time_s[-1] - time_s[0])
        return as_float64(self.manoeuvre.references(vehicle, rate_hz)[:, 2])


@typed
def speed_ramp(
    from_mps: float = 15.0,
    to_mps: float = 80.0,
    duration_s: float = 130.0,
    lateral: Curve | None = None,
) -> Driven:
    """Rise steadily in speed while the car is steered to both sides.

    Parameters
    ----------
    from_mps, to_mps : float
        First and last speed.
    duration_s : float
        Length.
    lateral : callable, optional
        Lateral acceleration over time [m/s2]; a multi-sine up to 5 m/s2 and 0.6 Hz if left out.
    """
    check_positive("speed_ramp", from_mps=from_mps, to_mps=to_mps, duration_s=duration_s)
    speed = Knots((0.0, duration_s), (from_mps, to_mps))
    wanted = lateral or MultiSine(5.0, min(30.0, duration_s), 0.05, 0.6)
    return Driven("speed_ramp", duration_s, speed, wanted)


@typed
def multi_sine(
    lateral_mps2: float = 6.0,
    speed_mps: float = 30.0,
    duration_s: float = 60.0,
    from_hz: float = 0.1,
    to_hz: float = 1.0,
    period_s: float = 20.0,
) -> Driven:
    """Many frequencies of lateral acceleration at once, at held speed; see :class:`MultiSine`.

    Parameters
    ----------
    lateral_mps2 : float
        Highest lateral acceleration.
    speed_mps, duration_s : float
        Speed and length.
    from_hz, to_hz, period_s : float
        First and last frequency, and the period in which all repeats.
    """
    check_positive("multi_sine", speed_mps=speed_mps, duration_s=duration_s)
    speed = Knots((0.0, duration_s), (speed_mps, speed_mps))
    return Driven(
        "multi_sine", duration_s, speed, MultiSine(lateral_mps2, period_s, from_hz, to_hz)
    )
