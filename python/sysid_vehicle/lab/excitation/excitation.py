"""What the closed loop is asked to do."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from ..._common.arrays import FloatArray, as_float64
from ..._common.style import axes_or_new, tidy
from ..._common.text import html_text
from ..._common.typed import typed
from ...errors import InvalidInput
from ...vehicle import Vehicle

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from ..design.preview import Preview
    from ..setup import Setup


_MOST_SAMPLES = 5_000_000  # of a drive; all its columns take some GB


def sample_times(duration_s: float, rate_hz: float) -> FloatArray:
    """Sample times from 0 to the end, both included."""
    if not duration_s * rate_hz < _MOST_SAMPLES:
        raise InvalidInput(
            f"duration_s = {duration_s:g}: {duration_s * rate_hz:.3g} samples at {rate_hz:g} Hz do "
            f"not fit; give less than {_MOST_SAMPLES / rate_hz:g} s"
        )
    return np.arange(round(duration_s * rate_hz) + 1) / rate_hz


def derivative(values: FloatArray, rate_hz: float) -> FloatArray:
    """Differentiate a sampled curve, per second."""
    return np.asarray(np.gradient(values) * rate_hz, dtype=float)


class Excitation(ABC):
    """Speed and direction wanted over time, for the closed loop.

    A subclass is a frozen dataclass with SI parameters and a `duration_s`; it says by what the car
    is steered (`steer_by`): the heading, a track on the ground, or the steering angle itself.
    """

    duration_s: float
    steer_by: ClassVar[str] = "heading"
    # The track [m], for steering by it, and the look-ahead: metres, and seconds of wanted speed.
    look_ahead: tuple[float, float] = (15.0, 0.4)

    @property
    def name(self) -> str:
        """Name, also of the log that comes out."""
        return type(self).__name__.lower()

    @property
    def start(self) -> tuple[float, float]:
        """Place at which the drive begins, heading along x [m]."""
        return 0.0, 0.0

    def track(self) -> FloatArray | None:
        """Points of a closed track [m], shape (n, 2), or None."""
        return None

    @abstractmethod
    def speed_mps(self, time_s: FloatArray) -> FloatArray:
        """Wanted speed at these times [m/s]."""

    @typed
    def heading_rad(self, time_s: FloatArray) -> FloatArray:
        """Wanted heading at these times [rad]; zero where something else steers."""
        return np.zeros_like(time_s)

    @typed
    def steer_rad(self, vehicle: Vehicle, time_s: FloatArray) -> FloatArray:
        """Steering angle at these times [rad], where that is what is prescribed."""
        return np.zeros_like(time_s)

    @typed
    def wanted(self, vehicle: Vehicle, rate_hz: float) -> FloatArray:
        """Sample everything that is wanted.

        Parameters
        ----------
        vehicle : Vehicle
            The car as the driver knows it, for open-loop steering.
        rate_hz : float
            Samples per second.

        Returns
        -------
        ndarray, shape (n, 5)
            Speed [m/s] and its derivative, heading [rad] and its derivative, steering angle [rad].

        Raises
        ------
        InvalidInput
            If a wanted speed is not a number above 0.5 m/s.
        """
        time_s = sample_times(self.duration_s, rate_hz)
        speed = as_float64(self.speed_mps(time_s))
        bad = np.flatnonzero(~((speed > 0.5) & (speed < 150.0)))
        if bad.size:
            k = int(bad[0])
            raise InvalidInput(
                f"{self.name}: speed_mps is {speed[k]:.4g} at sample {k} ({time_s[k]:.6g} s); "
                f"ask for 0.5 to 150 m/s"
            )
        heading = as_float64(self.heading_rad(time_s))
        return as_float64(
            np.column_stack(
                [
                    speed,
                    derivative(speed, rate_hz),
                    heading,
                    derivative(heading, rate_hz),
                    self.steer_rad(vehicle, time_s),
                ]
            )
        )

    @typed
    def preview(self, setup: Setup | None = None, **options: Any) -> Preview:
        """What it will teach; see :func:`sysid_vehicle.lab.preview`."""
        from ..design.preview import preview

        return preview(self, setup, **options)

    def __str__(self) -> str:
        time_s = sample_times(self.duration_s, 20.0)
        speed = self.speed_mps(time_s)
        text = (
            f"{self.name}: {self.duration_s:g} s, {speed.min():.1f} to {speed.max():.1f} m/s, "
            f"steered by the {self.steer_by}"
        )
        if self.steer_by != "heading":
            return text
        lateral = speed * derivative(self.heading_rad(time_s), 20.0)
        return text + f", lateral {lateral.min():+.1f} to {lateral.max():+.1f} m/s2 wanted"

    _repr_html_ = html_text

    @typed
    def plot(self, ax: Axes | None = None) -> Axes:
        """Draw the wanted speed, and the heading on a second axis; or the track."""
        ax = axes_or_new(ax, 8.0, 3.0)
        track = self.track()
        if track is not None:
            ax.plot(*np.vstack([track, track[:1]]).T, color="C0")
            ax.set_aspect("equal", adjustable="datalim")
            return tidy(ax, xlabel="x_m", ylabel="y_m", title=self.name)
        time_s = sample_times(self.duration_s, 50.0)
        ax.plot(time_s, self.speed_mps(time_s), color="C0")
        tidy(ax, xlabel="time_s", title=self.name)
        ax.set_ylabel("vx_mps", color="C0")
        if self.steer_by == "heading":
            right = ax.twinx()
            right.plot(time_s, self.heading_rad(time_s), color="C1", linewidth=0.8)
            right.set_ylabel("heading_rad", color="C1")
        return ax
