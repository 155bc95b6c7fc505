"""What a manoeuvre asks for over time: values between knots, and sines."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
import scipy

from .._common.arguments import check_positive, check_positive_fields
from .._common.arrays import FloatArray
from ..errors import InvalidInput


class Curve(Protocol):
    """A quantity over time."""

    def __call__(self, time_s: FloatArray) -> FloatArray:
        """Values at these times."""


@dataclass(frozen=True)
class Knots:
    """A curve through knots.

    Parameters
    ----------
    time_s, value : tuple of float
        Knots, in increasing order of time; the end values hold outside.
    smooth : bool
        False: straight lines between the knots. True: monotone cubics, with a horizontal tangent
        wherever the value turns or rests.
    """

    time_s: tuple[float, ...]
    value: tuple[float, ...]
    smooth: bool = False

    def __post_init__(self) -> None:
        if len(self.time_s) != len(self.value) or len(self.time_s) < 2:
            raise InvalidInput("a curve needs two knots or more, each with a time and a value")
        for index, step in enumerate(np.diff(self.time_s)):
            if not step > 0.0:
                raise InvalidInput(
                    f"time_s: knot {index + 1} ({self.time_s[index + 1]:g} s) does not come after "
                    f"knot {index} ({self.time_s[index]:g} s); order the knots in time"
                )

    def __call__(self, time_s: FloatArray) -> FloatArray:
        """Values at these times."""
        inside = np.clip(time_s, self.time_s[0], self.time_s[-1])
        if self.smooth:
            return np.asarray(
                scipy.interpolate.PchipInterpolator(self.time_s, self.value)(inside), dtype=float
            )
        return np.interp(inside, self.time_s, self.value)


@dataclass(frozen=True)
class Sweep:
    """A sine whose frequency changes exponentially, so that every octave takes the same time.

    ``y = A sin(2 pi f0 T / ln(f1/f0) ((f1/f0)^(t/T) - 1))`` for ``t = time_s - start_s``, then 0.

    Parameters
    ----------
    amplitude : float
        Peak value, in the unit of the curve.
    start_s, duration_s : float
        When the sweep begins and how long it takes.
    from_hz, to_hz : float
        First and last frequency; equal ones make a plain sine.
    """

    amplitude: float
    start_s: float
    duration_s: float
    from_hz: float
    to_hz: float

    def __post_init__(self) -> None:
        check_positive_fields(self, "duration_s", "from_hz", "to_hz")

    @classmethod
    def of_whole_periods(
        cls, amplitude: float, start_s: float, longest_s: float, from_hz: float, to_hz: float
    ) -> Sweep:
        """Make the longest sweep within `longest_s` that ends where it began, at zero.

        Raises
        ------
        InvalidInput
            If there is no room for one period, or a frequency is not positive.
        """
        check_positive("Sweep", from_hz=from_hz, to_hz=to_hz)
        mean = _mean_frequency(from_hz, to_hz)
        periods = np.floor(longest_s * mean + 1e-9)
        if not periods >= 1.0:
            raise InvalidInput(
                f"a sine from {from_hz:g} to {to_hz:g} Hz needs {1.0 / mean:.3g} s for one period, "
                f"there are {longest_s:.3g} s; make the manoeuvre longer"
            )
        return cls(amplitude, start_s, float(periods / mean), from_hz, to_hz)

    def __call__(self, time_s: FloatArray) -> FloatArray:
        """Values at these times."""
        t = time_s - self.start_s
        part = np.clip(t / self.duration_s, 0.0, 1.0)
        rise = float(np.log(self.to_hz / self.from_hz))
        turns = part if abs(rise) < 1e-9 else np.expm1(rise * part) / rise
        value = self.amplitude * np.sin(2.0 * np.pi * self.from_hz * self.duration_s * turns)
        return np.where((t >= 0.0) & (t <= self.duration_s), value, 0.0)


def _mean_frequency(from_hz: float, to_hz: float) -> float:
    rise = float(np.log(to_hz / from_hz))
    return from_hz if abs(rise) < 1e-9 else (to_hz - from_hz) / rise


@dataclass(frozen=True)
class Pulse:
    """One full sine that may rest at its second peak.

    Parameters
    ----------
    start_s : float
        When it begins.
    amplitude : float
        First peak, in the unit of the curve; its sign is the first direction.
    frequency_hz : float
        Frequency of the sine.
    dwell_s : float
        How long the second peak is held.
    """

    start_s: float
    amplitude: float
    frequency_hz: float
    dwell_s: float = 0.0

    @property
    def end_s(self) -> float:
        """When the value is back at zero."""
        return self.start_s + 1.0 / self.frequency_hz + self.dwell_s


@dataclass(frozen=True)
class Pulses:
    """Pulses one after the other, zero in between."""

    pulses: tuple[Pulse, ...]

    def __call__(self, time_s: FloatArray) -> FloatArray:
        """Values at these times."""
        total = np.zeros_like(time_s)
        for p in self.pulses:
            t = time_s - p.start_s
            peak = 0.75 / p.frequency_hz
            running = np.where(t < peak, t, np.maximum(peak, t - p.dwell_s))
            sine = p.amplitude * np.sin(2.0 * np.pi * p.frequency_hz * running)
            total += np.where((t > 0.0) & (time_s < p.end_s), sine, 0.0)
        return total


@dataclass(frozen=True)
class Curvature:
    """The lateral acceleration ``v^2 kappa`` on a path of given curvature [1/m]."""

    speed_mps: Curve
    curvature_radpm: Curve

    def __call__(self, time_s: FloatArray) -> FloatArray:
        """Values at these times [m/s2]."""
        return self.speed_mps(time_s) ** 2 * self.curvature_radpm(time_s)


def constant(value: float, duration_s: float) -> Knots:
    """Hold a value."""
    return Knots((0.0, duration_s), (value, value))
