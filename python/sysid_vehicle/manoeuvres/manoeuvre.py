"""A manoeuvre: speed and lateral acceleration wanted over time, turned into what a driver does."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from .. import _core
from .._common.arrays import FloatArray, as_float64
from .._common.style import axes_or_new
from .._common.text import html_text
from ..errors import InvalidInput
from ..vehicle import Vehicle
from .curves import Curve
from .steady import peak_lateral_mps2, slip_difference, steady_steer, understeer_gradient

if TYPE_CHECKING:
    from matplotlib.axes import Axes

# A driver on a path may come this near to the peak before the manoeuvre is refused.
_LARGEST_SHARE = 0.95
_SLOWEST_MPS = 1.2  # a car that is simulated has stopped at 1 m/s


@dataclass(frozen=True)
class Manoeuvre:
    """What the driver is asked to do.

    Parameters
    ----------
    name : str
        Name, also of the log that comes out.
    purpose : str
        What it shows, in a few words.
    duration_s : float
        Length.
    speed_mps : callable
        Wanted speed over time: an array of times in s gives an array in m/s.
    lateral_mps2 : callable
        Wanted lateral acceleration over time, positive to the left [m/s2].
    tracks_path : bool
        True: a driver steers, with feedback from the yaw rate, along the path that speed and
        lateral acceleration make. False: the steering angle goes open loop, in proportion to
        `lateral_mps2`, so high that its peak would hold the peak of `lateral_mps2` for ever.

    Raises
    ------
    InvalidInput
        If the duration or a wanted speed is not positive.
    """

    name: str
    purpose: str
    duration_s: float
    speed_mps: Curve
    lateral_mps2: Curve
    tracks_path: bool = True

    def __post_init__(self) -> None:
        if not 0.0 < self.duration_s < 1e5:
            raise InvalidInput(
                f"{self.name}: duration_s = {self.duration_s!r}; give a positive number of seconds"
            )
        time_s = self._times(10.0)
        speed = self.speed_mps(time_s)
        slow = np.flatnonzero(~(speed >= _SLOWEST_MPS))
        if slow.size:
            k = int(slow[0])
            raise InvalidInput(
                f"{self.name}: the wanted speed is {speed[k]:.3g} m/s at {time_s[k]:.6g} s; the "
                f"single track needs {_SLOWEST_MPS:g} m/s or more, ask for a higher speed"
            )

    def _times(self, rate_hz: float) -> FloatArray:
        return np.arange(round(self.duration_s * rate_hz) + 1) / rate_hz

    def references(self, vehicle: Vehicle, rate_hz: float) -> FloatArray:
        """Speed [m/s], path curvature [1/m] and open-loop steering angle [rad] at a rate.

        Parameters
        ----------
        vehicle : Vehicle
            The car as the driver knows it; its tyres tell how much steering a corner needs.
        rate_hz : float
            Samples per second.

        Returns
        -------
        ndarray, shape (n, 3)
            On a path the third column is only what the bent tyre curves need beyond the linear
            understeer, which the driver adds by himself.

        Raises
        ------
        InvalidInput
            If the lateral acceleration is more than the vehicle's tyres can give.
        """
        if not 1.0 <= rate_hz <= 1e4:
            raise InvalidInput(f"rate_hz = {rate_hz!r}; give a sample rate from 1 to 10000 Hz")
        time_s = self._times(rate_hz)
        speed, lateral = self.speed_mps(time_s), self.lateral_mps2(time_s)
        most = float(np.max(np.abs(lateral)))
        limit = _LARGEST_SHARE * peak_lateral_mps2(vehicle)
        if most > limit:
            at = float(time_s[int(np.argmax(np.abs(lateral)))])
            raise InvalidInput(
                f"{self.name}: asks for {most:.3g} m/s2 of lateral acceleration at {at:.6g} s, "
                f"but '{vehicle.name}' can follow up to {limit:.3g} m/s2; ask for less"
            )
        if self.tracks_path:
            curvature = lateral / speed**2
            extra = slip_difference(vehicle, lateral) - understeer_gradient(vehicle) * lateral
            return as_float64(np.column_stack([speed, curvature, extra]))
        share = lateral / most if most > 0.0 else lateral
        steer = share * steady_steer(vehicle, speed, np.full_like(speed, most))
        return as_float64(np.column_stack([speed, np.zeros_like(speed), steer]))

    def driver(self, vehicle: Vehicle) -> _core.Driver:
        """Make the driver who does it with this vehicle."""
        driver = _core.Driver()
        driver.tracks_path = self.tracks_path
        driver.understeer_radps2pm = understeer_gradient(vehicle)
        return driver

    def __str__(self) -> str:
        time_s = self._times(20.0)
        speed, lateral = self.speed_mps(time_s), self.lateral_mps2(time_s)
        how = "a driver follows the path" if self.tracks_path else "open-loop steering, speed held"
        return (
            f"{self.name}: {self.purpose}\n"
            f"  {self.duration_s:g} s, {speed.min():.1f} to {speed.max():.1f} m/s, lateral "
            f"{lateral.min():+.1f} to {lateral.max():+.1f} m/s2 wanted; {how}"
        )

    _repr_html_ = html_text

    def plot(self, ax: Axes | None = None) -> Axes:
        """Draw the wanted speed, and the wanted lateral acceleration on a second axis."""
        ax = axes_or_new(ax, 8.0, 3.0)
        time_s = self._times(50.0)
        ax.plot(time_s, self.speed_mps(time_s), color="C0")
        ax.set_xlabel("time_s")
        ax.set_ylabel("vx_mps", color="C0")
        ax.set_title(self.name)
        right = ax.twinx()
        right.plot(time_s, self.lateral_mps2(time_s), color="C1")
        right.set_ylabel("ay_mps2", color="C1")
        return ax
