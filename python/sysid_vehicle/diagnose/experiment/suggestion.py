"""A drive as something that can be driven: speeds, amplitudes, frequencies, ground, a table."""

from __future__ import annotations

import io
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..._common.arrays import FloatArray, as_float64
from ..._common.files import write_text
from ..._common.style import AFTER, MEASURED, axes_or_new, new_figure, tidy
from ..._common.text import brief, html_text
from ...manoeuvres import Manoeuvre
from ...simulate import Drive

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_BAND = (0.05, 0.95)  # parts of the steering's power below the frequencies that are told
_SLOWEST_HZ = 0.05  # below, steering is the shape of the road


def path_m(drive: Drive) -> FloatArray:
    """Place of the centre of gravity, shape (n, 2) [m]: from the origin, ahead along x."""
    dt = 1.0 / drive.log.rate_hz
    vx, vy, r = drive.states.T
    heading = np.cumsum(r) * dt
    ahead = np.cumsum(vx * np.cos(heading) - vy * np.sin(heading)) * dt
    left = np.cumsum(vx * np.sin(heading) + vy * np.cos(heading)) * dt
    return as_float64(np.column_stack([ahead, left]))


def ground_m(drive: Drive) -> tuple[float, float]:
    """Length and width of the ground that a drive takes, along its main directions."""
    path = path_m(drive)
    turned = path @ np.linalg.svd(path - path.mean(axis=0), full_matrices=False)[2].T
    width, length = sorted(map(float, np.ptp(turned, axis=0)))
    return length, width


@dataclass(frozen=True, eq=False)
class Suggestion:
    """One manoeuvre, how to drive it, and what it would tell.

    Attributes
    ----------
    manoeuvre : Manoeuvre
    duration_s : float
        Of one drive.
    sigmas : float
        Standard errors between the rivals after it, together with the driving at hand.
    drive : Drive
        The manoeuvre as the model with the first rival drives it.
    times : int
        How often it is driven for that.
    needed : int or None
        How often it has to be driven to be enough; None: more often than anybody would.
    if_acts : mapping of str to float
        The same by which of the rivals acts; for the first one, from the nearest of the others.
    """

    manoeuvre: Manoeuvre
    duration_s: float
    sigmas: float
    drive: Drive
    times: int = 1
    needed: int | None = None
    if_acts: Mapping[str, float] = field(default_factory=dict)

    @property
    def whole_s(self) -> float:
        """Duration of all that is driven."""
        return self.times * self.duration_s

    @property
    def speed_mps(self) -> tuple[float, float]:
        """Lowest and highest speed."""
        speed = self.drive.states[:, 0]
        return float(speed.min()), float(speed.max())

    @property
    def lateral_mps2(self) -> float:
        """Largest lateral acceleration, either side."""
        return float(np.abs(self.drive.outputs[:, 4]).max())

    @property
    def steer_rad(self) -> float:
        """Largest angle of the road wheels, either side."""
        return float(np.abs(self.drive.inputs[:, 0]).max())

    @cached_property
    def steer_hz(self) -> tuple[float, float] | None:
        """Between which frequencies nine tenths of the steering's power lie; None on a steady bend.

        Power above 0.05 Hz, from the periodogram with a Hann window.
        """
        steer = self.drive.inputs[:, 0]
        spectrum = np.abs(np.fft.rfft((steer - steer.mean()) * np.hanning(steer.size))) ** 2
        hz = np.fft.rfftfreq(steer.size, 1.0 / self.drive.log.rate_hz)
        fast = hz >= _SLOWEST_HZ
        power = np.cumsum(spectrum[fast])
        if not power.size or power[-1] <= 0.0 or power[-1] < 0.1 * float(spectrum.sum()):
            return None
        low, high = (float(hz[fast][np.searchsorted(power, b * power[-1])]) for b in _BAND)
        return low, high

    @cached_property
    def ground_m(self) -> tuple[float, float]:
        """Length and width of the ground that it takes."""
        return ground_m(self.drive)

    def columns(self) -> dict[str, FloatArray]:
        """Return the drive over time: what to steer and how fast, and where the car then is.

        Returns
        -------
        dict of str to array, shape (n,)
            ``time_s``, ``speed_mps``, ``steer_rad`` (road wheels), ``lateral_mps2``, ``x_m``,
            ``y_m``.
        """
        path = path_m(self.drive)
        return {
            "time_s": self.drive.log["time_s"],
            "speed_mps": as_float64(self.drive.states[:, 0]),
            "steer_rad": as_float64(self.drive.inputs[:, 0]),
            "lateral_mps2": as_float64(self.drive.outputs[:, 4]),
            "x_m": as_float64(path[:, 0]),
            "y_m": as_float64(path[:, 1]),
        }

    def to_csv(self, path: str | Path) -> None:
        """Write :meth:`columns` for a steering robot or a driver's display.

        Raises
        ------
        InvalidInput
            If the file cannot be written.
        """
        columns = self.columns()
        text = io.StringIO()
        np.savetxt(
            text,
            np.column_stack(list(columns.values())),
            fmt="%.6g",
            delimiter=",",
            header=",".join(columns),
            comments="",
        )
        write_text(path, text.getvalue())

    def plot(self, ax: Axes | None = None) -> Axes:
        """Draw the ground track, with the speed as colour.

        Parameters
        ----------
        ax : Axes, optional
            A new figure if left out.

        Returns
        -------
        Axes
        """
        ax = axes_or_new(ax, 5.0, 4.0)
        told = self.columns()
        dots = ax.scatter(told["x_m"], told["y_m"], c=told["speed_mps"], s=4.0, cmap="viridis")
        ax.plot(told["x_m"][:1], told["y_m"][:1], "o", color=MEASURED, label="start")
        ax.figure.colorbar(dots, ax=ax, label="speed [m/s]")
        ax.set_aspect("equal", adjustable="datalim")
        ax.legend(loc="best")
        return tidy(ax, xlabel="x [m]", ylabel="y [m]", title=self.manoeuvre.name)

    def picture(self) -> Figure:
        """Draw the ground track beside speed and steering over time, on a figure of its own."""
        figure = new_figure(9.0, 4.0)
        track, series = figure.subplots(1, 2, width_ratios=(1.2, 1.0))
        self.plot(track)
        told = self.columns()
        series.plot(told["time_s"], np.degrees(told["steer_rad"]), color=AFTER)
        tidy(series, xlabel="time [s]", ylabel="road wheels [deg]", title="steering")
        return figure

    def instructions(self) -> str:
        """Say in one line how it is driven."""
        low, high = self.speed_mps
        speed = f"{low:.0f}" if high - low < 1.0 else f"{low:.0f} to {high:.0f}"
        often = f"{self.times} times " if self.times > 1 else ""
        parts = [
            f"{often}{self.duration_s:.0f} s at {speed} m/s",
            f"lateral acceleration up to {self.lateral_mps2:.1f} m/s2",
            f"road wheels up to {np.degrees(self.steer_rad):.1f} deg",
        ]
        if self.steer_hz is not None:
            parts[-1] += f", {self.steer_hz[0]:.2g} to {self.steer_hz[1]:.2g} Hz"
        length, width = self.ground_m
        parts.append(f"ground of {length:.0f} m x {width:.0f} m")
        return "; ".join(parts)

    def to_dict(self) -> dict[str, Any]:
        """How it is driven, for a JSON file."""
        return {
            "manoeuvre": self.manoeuvre.name,
            "standard_errors": self.sigmas,
            "standard_errors_if": dict(self.if_acts),
            "times": self.times,
            "times_needed": self.needed,
            "duration_s": self.duration_s,
            "speed_mps": list(self.speed_mps),
            "lateral_mps2": self.lateral_mps2,
            "steer_rad": self.steer_rad,
            "steer_hz": None if self.steer_hz is None else list(self.steer_hz),
            "ground_m": list(self.ground_m),
        }

    __repr__ = brief
    _repr_html_ = html_text

    def __str__(self) -> str:
        return (
            f"{self.manoeuvre.name}: {self.sigmas:.1f} standard errors\n  {self.instructions()}\n"
            f"  {self.manoeuvre.purpose}"
        )
