"""A model driven through a manoeuvre: what the car did, and the log its sensors would write."""

from __future__ import annotations

from dataclasses import dataclass, fields
from html import escape
from typing import TYPE_CHECKING

import numpy as np

from .. import _core
from .._arguments import generator
from .._arrays import FloatArray
from .._text import brief
from ..errors import NumericalError
from ..log import Log
from ..manoeuvres import Manoeuvre
from ..model import Model
from ._noise import RoadDisturbance, SensorNoise

if TYPE_CHECKING:
    from matplotlib.axes import Axes

__all__ = ["Drive", "drive", "drive_truth"]

_OUTPUTS = ("vx_mps", "vy_mps", "yaw_rate_radps", "ax_mps2", "ay_mps2")
_STOPPED_MPS = 1.0  # where the core's simulator gives up


@dataclass(frozen=True, eq=False)
class Drive:
    """A finished drive.

    Attributes
    ----------
    log : Log
        What the sensors wrote.
    model : Model
        The car that was driven.
    manoeuvre : Manoeuvre
        What the driver was asked to do.
    references : ndarray, shape (n, 3)
        Wanted speed [m/s] and path curvature [1/m], and open-loop steering [rad].
    inputs : ndarray, shape (n, 2)
        Steering angle [rad] and total wheel force [N] as commanded.
    states : ndarray, shape (n, 3)
        True v_x [m/s], v_y [m/s] and yaw rate [rad/s].
    outputs : ndarray, shape (n, 5)
        Sensor readings free of noise: v_x, v_y, yaw rate, a_x, a_y.
    disturbance : ndarray, shape (n, 3)
        F_x [N], F_y [N] and M_z [N m] that acted on the car.
    """

    log: Log
    model: Model
    manoeuvre: Manoeuvre
    references: FloatArray
    inputs: FloatArray
    states: FloatArray
    outputs: FloatArray
    disturbance: FloatArray

    __repr__ = brief

    def __str__(self) -> str:
        steer, force = np.abs(self.inputs).max(axis=0)
        what = ", ".join(self.model.effects) or "no effect"
        return (
            f"{self.manoeuvre.name} with {self.model.vehicle.name} ({what}): "
            f"{self.log.duration_s:g} s at {self.log.rate_hz:g} Hz\n"
            f"  speed {self.states[:, 0].min():.1f} to {self.states[:, 0].max():.1f} m/s, "
            f"lateral acceleration up to {np.abs(self.outputs[:, 4]).max():.1f} m/s2, "
            f"steering up to {steer:.3f} rad, wheel force up to {force:.0f} N"
        )

    def _repr_html_(self) -> str:
        return f"<pre>{escape(str(self))}</pre>"

    def plot(self, ax: Axes | None = None) -> Axes:
        """Draw driven and wanted speed, and the lateral acceleration on a second axis.

        Parameters
        ----------
        ax : matplotlib Axes, optional
            Where to draw; a new figure is made without it.

        Returns
        -------
        matplotlib Axes
        """
        ax = self.manoeuvre.plot(ax)
        time_s = self.log["time_s"]
        ax.plot(time_s, self.states[:, 0], "C0--")
        ax.figure.axes[-1].plot(time_s, self.outputs[:, 4], "C1--", linewidth=0.8)
        return ax


def drive_truth(
    model: Model,
    manoeuvre: Manoeuvre,
    *,
    seed: int | np.random.Generator,
    noise: SensorNoise | None = None,
    disturbance: RoadDisturbance | None = None,
    rate_hz: float = 100.0,
    name: str | None = None,
) -> Drive:
    """Drive a model through a manoeuvre and keep what no sensor sees; parameters as :func:`drive`.

    Returns
    -------
    Drive
    """
    rng = generator(seed)
    references = manoeuvre.references(model.vehicle, rate_hz)
    n = len(references)
    external = (disturbance or RoadDisturbance()).sample(n, rate_hz, rng)
    inputs, states, outputs, lost_at = _core.simulate(
        model.core(),
        model.vector(),
        1.0 / rate_hz,
        references,
        manoeuvre.driver(model.vehicle),
        external,
        float(references[0, 0]),
    )
    if lost_at < n:
        raise NumericalError(_how_it_was_lost(manoeuvre, states[-1], lost_at / rate_hz))
    if not np.isfinite(outputs).all():
        k = int(np.flatnonzero(~np.isfinite(outputs).all(axis=1))[0])
        raise NumericalError(
            f"{manoeuvre.name}: the simulated sensors show no number at t = {k / rate_hz:.6g} s; "
            f"check the model's values"
        )
    columns = {
        "time_s": np.arange(n) / rate_hz,
        **{channel: outputs[:, i] for i, channel in enumerate(_OUTPUTS)},
        "steer_rad": inputs[:, 0],
        "fx_n": inputs[:, 1].copy(),
    }
    sensors = noise if noise is not None else SensorNoise()
    for field in fields(sensors):
        deviation = getattr(sensors, field.name)
        columns[field.name] = columns[field.name] + deviation * rng.standard_normal(n)
    log = Log.from_arrays(columns, name=name or manoeuvre.name, check=False)
    return Drive(log, model, manoeuvre, references, inputs, states[:, :3], outputs, external)


def drive(
    model: Model,
    manoeuvre: Manoeuvre,
    *,
    seed: int | np.random.Generator,
    noise: SensorNoise | None = None,
    disturbance: RoadDisturbance | None = None,
    rate_hz: float = 100.0,
    name: str | None = None,
) -> Log:
    """Drive a model through a manoeuvre and return the log that the sensors would write.

    Parameters
    ----------
    model : Model
        The true car, with whatever effects act.
    manoeuvre : Manoeuvre
        What the driver is asked to do; he knows the car by its vehicle data, not by its effects.
    seed : int or numpy.random.Generator
        Source of the randomness; the same seed gives the same log.
    noise : SensorNoise, optional
        Noise of the sensors; `SensorNoise()` if left out.
    disturbance : RoadDisturbance, optional
        Random forces on the car; none if left out.
    rate_hz : float
        Sample rate.
    name : str, optional
        Name of the log; the manoeuvre's if left out.

    Returns
    -------
    Log
        All canonical channels.

    Raises
    ------
    InvalidInput
        If the manoeuvre asks for more than the vehicle's tyres can give, or `seed` is neither a
        whole number from zero up nor a generator.
    NumericalError
        If the car spun or stopped; the message names the time.
    """
    return drive_truth(
        model,
        manoeuvre,
        seed=seed,
        noise=noise,
        disturbance=disturbance,
        rate_hz=rate_hz,
        name=name,
    ).log


def _how_it_was_lost(manoeuvre: Manoeuvre, state: FloatArray, time_s: float) -> str:
    vx, vy = float(state[0]), float(state[1])
    what = "stopped" if 0.0 <= vx < _STOPPED_MPS and abs(vy) < _STOPPED_MPS else "spun"
    return (
        f"{manoeuvre.name}: the car {what} at t = {time_s:.6g} s (v_x {vx:.3g} m/s, v_y {vy:.3g} "
        f"m/s); ask the manoeuvre for less lateral acceleration or less speed"
    )
