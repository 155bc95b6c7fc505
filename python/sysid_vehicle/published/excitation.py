"""The published identification trajectory and the published oval."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from .._common.arguments import check_positive_fields
from .._common.arrays import FloatArray, as_float64
from ..lab.excitation import Excitation


@dataclass(frozen=True)
class Identification(Excitation):
    """Slowly swinging speed and a chirped heading; the defaults are the published ones.

    ``v = mean + swing sin(2 pi t / period - pi/2)``, and
    ``psi = amplitude heading_speed / v sin(2 pi (f0 t + (f1 - f0) t^2 / (2 chirp_s)))``.

    Parameters
    ----------
    amplitude_rad : float
        Heading amplitude at `heading_speed_mps`; it falls with the speed. 0.35 leaves the tyres
        near their linear range, 0.60 reaches their peak at half load.
    from_hz, to_hz, chirp_s : float
        First frequency, and the one reached after `chirp_s`. The published chirp was meant to
        reach 0.8 Hz; a stray factor left a fifth of the rise.
    duration_s : float
        Length.
    mean_mps, swing_mps, period_s, lowest_mps, highest_mps : float
        The speed and its bounds.
    heading_speed_mps : float
        See `amplitude_rad`.
    """

    amplitude_rad: float = 0.35
    duration_s: float = 145.0
    from_hz: float = 0.001
    to_hz: float = 0.001 + 0.2 * 0.799
    chirp_s: float = 150.0
    mean_mps: float = 45.0
    swing_mps: float = 35.0
    period_s: float = 100.0
    lowest_mps: float = 10.0
    highest_mps: float = 80.0
    heading_speed_mps: float = 10.0

    def __post_init__(self) -> None:
        check_positive_fields(
            self, "duration_s", "chirp_s", "period_s", "lowest_mps", "heading_speed_mps"
        )

    def speed_mps(self, time_s: FloatArray) -> FloatArray:
        """Wanted speed at these times [m/s]."""
        swing = self.swing_mps * np.sin(2.0 * np.pi * time_s / self.period_s - np.pi / 2.0)
        return as_float64(np.clip(swing + self.mean_mps, self.lowest_mps, self.highest_mps))

    def heading_rad(self, time_s: FloatArray) -> FloatArray:
        """Wanted heading at these times [rad]."""
        rise = (self.to_hz - self.from_hz) / self.chirp_s
        turns = self.from_hz * time_s + 0.5 * rise * time_s**2
        size = self.amplitude_rad * self.heading_speed_mps / self.speed_mps(time_s)
        return as_float64(size * np.sin(2.0 * np.pi * turns))


@dataclass(frozen=True)
class Oval(Excitation):
    """Laps of a rounded rectangle, clockwise, with a driver who looks ahead on it.

    Parameters
    ----------
    duration_s : float
        Length.
    length_m, width_m, radius_m : float
        Its straights, and the radius of its corners.
    steps : tuple of (float, float)
        Time [s] until which a speed [m/s] is wanted, one after the other; the last speed stays.
    first_rise_s : float
        The speed rises to the first step in this time.
    lowest_mps : float
        Lowest wanted speed.
    look_ahead : tuple of (float, float)
        Distance to the point the driver steers at: metres, and seconds of wanted speed.
    beside_m : float
        How far to the left of the track the drive begins.
    """

    steer_by: ClassVar[str] = "track"

    duration_s: float = 350.0
    length_m: float = 2500.0
    width_m: float = 1000.0
    radius_m: float = 600.0
    steps: tuple[tuple[float, float], ...] = (
        (60.0, 15.0),
        (120.0, 25.0),
        (180.0, 35.0),
        (240.0, 45.0),
        (350.0, 55.0),
        (float("inf"), 60.0),
    )
    first_rise_s: float = 10.0
    lowest_mps: float = 1.0
    look_ahead: tuple[float, float] = (15.0, 0.4)
    beside_m: float = 2.0

    def __post_init__(self) -> None:
        check_positive_fields(self, "duration_s", "length_m", "width_m", "radius_m", "lowest_mps")

    @property
    def start(self) -> tuple[float, float]:
        """In the middle of the upper straight, beside the track."""
        return 0.0, 0.5 * self.width_m + self.radius_m + self.beside_m

    def track(self) -> FloatArray:
        """Points of the centre line about a metre apart [m], shape (n, 2)."""
        half, up, r = 0.5 * self.length_m, 0.5 * self.width_m, self.radius_m
        parts = []
        line = (np.array([0.0, up + r]), np.array([half, up + r]))
        parts.append(_straight(*line))
        corners = ((half, up, 0.5), (half, -up, 0.0), (-half, -up, -0.5), (-half, up, -1.0))
        for x, y, turn in corners:
            count = int(np.ceil(0.5 * np.pi * r))
            angle = np.pi * (turn - 0.5 * np.arange(count) / count)
            arc = np.array([x, y]) + r * np.column_stack([np.cos(angle), np.sin(angle)])
            parts.append(arc)
            last = angle[-1] - 0.5 * np.pi / count
            begin = np.array([x, y]) + r * np.array([np.cos(last), np.sin(last)])
            along = {0.5: (0.0, -2.0 * up), 0.0: (-2.0 * half, 0.0), -0.5: (0.0, 2.0 * up)}
            parts.append(_straight(begin, begin + np.array(along.get(turn, (half, 0.0)))))
        return as_float64(np.vstack(parts))

    def speed_mps(self, time_s: FloatArray) -> FloatArray:
        """Wanted speed at these times [m/s]."""
        ends = np.array([end for end, _ in self.steps[:-1]])
        speeds = np.array([speed for _, speed in self.steps])
        speed = speeds[np.searchsorted(ends, time_s, side="right")]
        rising = speeds[0] * time_s / self.first_rise_s
        speed = np.where(time_s < self.first_rise_s, rising, speed)
        return as_float64(np.maximum(speed, self.lowest_mps))


def excitations() -> dict[str, Excitation]:
    """Make both with their default parameters, by name."""
    return {e.name: e for e in (Identification(), Oval())}


def _straight(begin: FloatArray, end: FloatArray) -> FloatArray:
    """Points from `begin` on, `end` left out."""
    count = max(1, int(np.ceil(np.hypot(*(end - begin)))))
    return begin + np.outer(np.arange(count) / count, end - begin)
