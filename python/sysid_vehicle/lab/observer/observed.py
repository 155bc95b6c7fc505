"""What the extended-state observer found in a log."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from ..._common.arrays import FloatArray
from ..._common.printed import Part, Printed, Table
from ..._common.style import AFTER, BEFORE, MEASURED, TRUTH, axes_or_new, tidy
from ..._common.text import HALF_95, number
from ..._common.typed import typed
from ...errors import InvalidInput, near_names

if TYPE_CHECKING:
    from matplotlib.axes import Axes

STATES = ("vx_mps", "vy_mps", "yaw_rate_radps", "xi_x_n", "xi_y_n", "xi_psi_nm")
"""Motion, then the unexplained force ahead, force sideways and yaw moment."""

READINGS = ("vx_mps", "vy_mps", "yaw_rate_radps", "ay_mps2")
"""Measured channels, in the core's order."""

_LABELS = {
    "vx_mps": "speed ahead [m/s]",
    "vy_mps": "speed sideways [m/s]",
    "yaw_rate_radps": "yaw rate [rad/s]",
    "ay_mps2": "lateral acceleration [m/s²]",
    "xi_x_n": "unexplained force ahead [N]",
    "xi_y_n": "unexplained force sideways [N]",
    "xi_psi_nm": "unexplained yaw moment [N m]",
}
_HEAD = ("state", "rms", "mean std")


def refuse(
    bad: npt.NDArray[np.bool_], values: FloatArray, what: str, step_s: float, remedy: str
) -> None:
    """Raise :class:`InvalidInput` that names the first sample that is bad, if there is one."""
    if bad.any():
        k = int(np.argmax(bad))
        others = f" and {bad.sum() - 1} others" if bad.sum() > 1 else ""
        raise InvalidInput(
            f"{what} is {values[k]} at sample {k} ({k * step_s:.2f} s){others}; {remedy}"
        )


@dataclass(frozen=True, eq=False)
class StateEstimate(Printed):
    """States and readings without their noise, with their uncertainty.

    Attributes
    ----------
    name : str
        Name of the record.
    time_s : ndarray of shape (n,)
        Time.
    state : ndarray of shape (n, 6)
        In the order of ``STATES``.
    covariance : ndarray of shape (n, 6, 6)
        Of the state.
    reading, reading_std : ndarray of shape (n, 4)
        The readings as the state gives them, in the order of ``READINGS``; the last column is the
        reconstructed lateral acceleration [m/s2].
    measured : ndarray of shape (n, 4)
        What the sensors said; NaN where missing.
    innovation, innovation_std : ndarray of shape (n, 4)
        One-step errors of the filter and what it expected of them; NaN where missing.
    log_likelihood : float
        Of all readings.
    smoothed : bool
        Whether later readings were used.
    """

    name: str
    time_s: FloatArray
    state: FloatArray
    covariance: FloatArray
    reading: FloatArray
    reading_std: FloatArray
    measured: FloatArray
    innovation: FloatArray
    innovation_std: FloatArray
    log_likelihood: float
    smoothed: bool

    @property
    def std(self) -> FloatArray:
        """Standard deviation of the state, shape (n, 6)."""
        variances = np.diagonal(self.covariance, axis1=1, axis2=2)
        return np.sqrt(np.maximum(variances, 0.0))

    @property
    def force(self) -> FloatArray:
        """The virtual force sensor: force ahead, sideways [N], yaw moment [N m], shape (n, 3)."""
        return self.state[:, 3:]

    @property
    def force_std(self) -> FloatArray:
        """Standard deviation of the virtual force sensor, shape (n, 3)."""
        return self.std[:, 3:]

    @typed
    def channel(self, name: str) -> tuple[FloatArray, FloatArray]:
        """Give a state or reading and its standard deviation.

        Raises
        ------
        InvalidInput
            No state or reading of that name.
        """
        if name in STATES:
            i = STATES.index(name)
            return self.state[:, i], self.std[:, i]
        if name in READINGS:
            i = READINGS.index(name)
            return self.reading[:, i], self.reading_std[:, i]
        raise InvalidInput(f"no state or reading {name!r}{near_names(name, _LABELS)}")

    @typed
    def plot(self, channel: str = "xi_y_n", *, ax: Axes | None = None) -> Axes:
        """Draw a state or reading with its 95 % band, and the readings behind it."""
        value, std = self.channel(channel)
        ax = axes_or_new(ax, 8.0, 3.0)
        if channel in READINGS:
            measured = self.measured[:, READINGS.index(channel)]
            ax.plot(self.time_s, measured, ".", color=MEASURED, ms=1.5, alpha=0.25, label="sensor")
        low, high = value - HALF_95 * std, value + HALF_95 * std
        ax.fill_between(self.time_s, low, high, color=AFTER, alpha=0.25, lw=0, label="95 %")
        ax.plot(self.time_s, value, color=AFTER, lw=1.0, label=self._kind)
        ax.legend(loc="upper right", frameon=False)
        return tidy(ax, xlabel="time [s]", ylabel=_LABELS[channel])

    @typed
    def plot_forces(self, *, ax: Axes | None = None) -> Axes:
        """Draw the virtual force sensor: both forces, and the moment per metre, with 95 % bands."""
        ax = axes_or_new(ax, 8.0, 3.5)
        for i, (label, color) in enumerate(
            (("ahead", BEFORE), ("sideways", AFTER), ("yaw moment per metre", TRUTH))
        ):
            value, half = self.force[:, i], HALF_95 * self.force_std[:, i]
            ax.fill_between(self.time_s, value - half, value + half, color=color, alpha=0.2, lw=0)
            ax.plot(self.time_s, value, color=color, lw=1.0, label=label)
        ax.legend(frameon=False, ncols=3)
        return tidy(ax, xlabel="time [s]", ylabel=f"unexplained force, {self._kind} [N]")

    @property
    def _kind(self) -> str:
        return "smoothed" if self.smoothed else "filtered"

    @property
    def _title(self) -> str:
        return (
            f"{self.name}: {self._kind} state of {len(self.time_s)} samples, log-likelihood "
            f"{self.log_likelihood:.2f}"
        )

    def _rows(self) -> list[tuple[str, str, str]]:
        values = [*zip(STATES, self.state.T, self.std.T, strict=True)]
        values.append((READINGS[3], self.reading[:, 3], self.reading_std[:, 3]))
        return [
            (n, number(float(np.sqrt(np.mean(x**2)))), number(float(s.mean())))
            for n, x, s in values
        ]

    def _parts(self) -> list[Part]:
        return [self._title, Table(_HEAD, self._rows())]
