"""A model driven through a manoeuvre: what the car did, and the log its sensors would write."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from .. import _core
from .._common.arguments import expect, generator
from .._common.arrays import FloatArray, as_float64
from .._common.printed import Told
from .._common.typed import typed
from ..effects import channels_in_use, effect
from ..errors import InvalidInput, NumericalError, warn
from ..log import CHANNELS, MEASURED, Log
from ..manoeuvres import Manoeuvre
from ..model import Model
from .beyond_grip import beyond_grip
from .noise import RoadDisturbance, SensorNoise

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Channel = float | FloatArray | Callable[[FloatArray], FloatArray]
"""A column of the log: a constant, its samples, or a function of the time of all samples [s]."""

_STOPPED_MPS = 1.0  # where the core's simulator gives up
(_LATE,) = effect("steer_delay").named


@dataclass(frozen=True, eq=False, repr=False)
class Drive(Told):
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
    disturbance : ndarray, shape (n, 3) or (n, 5)
        F_x [N], F_y [N] and M_z [N m] that acted on the car; gravity on a sloping road [m/s2].
    own_states : mapping of str to ndarray, shape (n,)
        States of effects that users defined, by `effect.state`.
    """

    log: Log
    model: Model
    manoeuvre: Manoeuvre
    references: FloatArray
    inputs: FloatArray
    states: FloatArray
    outputs: FloatArray
    disturbance: FloatArray
    own_states: Mapping[str, FloatArray] = field(default_factory=dict)

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

    def plot(self, ax: Axes | None = None) -> Axes:
        """Draw driven and wanted speed, and the lateral acceleration on a second axis."""
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
    channels: Mapping[str, Channel] | None = None,
    farthest_m: float = np.inf,
) -> Drive:
    """Drive as :func:`drive` does, and keep what no sensor sees.

    A drive that leads farther than `farthest_m` from where it began is lost too.
    """
    expect(model, Model, "drive")
    expect(manoeuvre, Manoeuvre, "drive")
    rng = generator(seed)
    references = manoeuvre.references(model.vehicle, rate_hz)
    n = len(references)
    logged = _channels(model, channels or {}, np.arange(n) / rate_hz)
    external = (disturbance or RoadDisturbance()).sample(n, rate_hz, rng)
    lead = _lead(model, rate_hz)
    *driven, lost_at = _core.simulate(
        model.core(),
        model.vector(),
        1.0 / rate_hz,
        _from_before(references, lead),
        manoeuvre.driver(model.vehicle),
        np.vstack([np.zeros_like(external[:lead]), external]),
        float(references[0, 0]),
        start=-lead / rate_hz,
        channels=_from_before(_by_number(logged, n), lead),
        farthest_m=farthest_m,
    )
    if lost_at < lead + n:
        lost_s = max(lost_at - lead, 0) / rate_hz
        raise NumericalError(_how_it_was_lost(manoeuvre, driven[1][-1], lost_s, farthest_m))
    inputs, states, outputs = (as_float64(x[lead:]) for x in driven)
    if not np.isfinite(outputs).all():
        k = int(np.flatnonzero(~np.isfinite(outputs).all(axis=1))[0])
        raise NumericalError(
            f"{manoeuvre.name}: the simulated sensors show no number at t = {k / rate_hz:.6g} s; "
            f"check the model's values"
        )
    columns = {
        "time_s": np.arange(n) / rate_hz,
        **{channel: outputs[:, i] for i, channel in enumerate(MEASURED)},
        "steer_rad": inputs[:, 0],
        "fx_n": inputs[:, 1].copy(),
        **logged,
    }
    (noise or SensorNoise()).add_to(columns, rng)
    log = Log.from_arrays(columns, name=name or manoeuvre.name, check=False)
    names = [f"{e.id}.{s.name}" for e in model.parts for s in e.own_states]
    own = {name: states[:, _core.USER_STATES_FROM + i] for i, name in enumerate(names)}
    return Drive(log, model, manoeuvre, references, inputs, states[:, :3], outputs, external, own)


def _lead(model: Model, rate_hz: float) -> int:
    """Samples driven before the log begins.

    Wheels that act late do at its beginning what was asked of them before. A driver begins to steer
    at once: that kink is in no log, and whoever reads it would take it for a lag.
    """
    late_s = model.value(_LATE) if _LATE in model.parameters else 0.0
    return math.ceil(late_s * rate_hz) + 1 if late_s > 0.0 else 0


def _from_before(rows: FloatArray, lead: int) -> FloatArray:
    """The same, which before their beginning were what they are there."""
    return as_float64(np.vstack([np.repeat(rows[:1], lead, axis=0), rows]))


def _by_number(logged: Mapping[str, FloatArray], n: int) -> FloatArray:
    """Channels in the order of their numbers in the core; NaN for those that there are none of."""
    columns = [logged.get(c, np.full(n, np.nan)) for c in channels_in_use()]
    return as_float64(np.array(columns).reshape(len(columns), n).T)


def _channels(
    model: Model, given: Mapping[str, Channel], time_s: FloatArray
) -> dict[str, FloatArray]:
    """Columns that the model reads, and others that the log is to hold."""
    for name in model.channels:
        if name not in given:
            reads = ", ".join(e.id for e in model.parts if name in e.channels)
            raise InvalidInput(
                f"the effect {reads} reads the column {name}; give channels={{'{name}': ...}}, a "
                "number, its samples, or a function of time"
            )
    made = {}
    for name, value in given.items():
        if name in CHANNELS:
            raise InvalidInput(f"channels: {name} is what the drive makes; give other columns")
        values = np.asarray(value(time_s) if callable(value) else value, dtype=float)
        if values.shape not in ((), time_s.shape) or not np.isfinite(values).all():
            raise InvalidInput(
                f"channels: {name} has the shape {values.shape}; give a number, or {time_s.size} "
                "finite samples"
            )
        made[name] = np.broadcast_to(values, time_s.shape).astype(float)
    return made


@typed
def drive(
    model: Model,
    manoeuvre: Manoeuvre,
    *,
    seed: int | np.random.Generator,
    noise: SensorNoise | None = None,
    disturbance: RoadDisturbance | None = None,
    rate_hz: float = 100.0,
    name: str | None = None,
    channels: Mapping[str, Channel] | None = None,
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
    channels : mapping of str to float, array or callable, optional
        Further columns, such as those that effects of users read: a number, an array of samples, or
        a function of the time of all samples [s].

    Returns
    -------
    Log
        All canonical channels, and the further ones.

    Raises
    ------
    InvalidInput
        If the manoeuvre asks for more than the vehicle's tyres can give, or `seed` is neither a
        whole number from zero up nor a generator.
    NumericalError
        If the car spun or stopped; the message names the time.

    Warns
    -----
    SysidWarning
        If the wheels of an axle brake or drive with more than their tyres hold.
    """
    made = drive_truth(
        model,
        manoeuvre,
        seed=seed,
        noise=noise,
        disturbance=disturbance,
        rate_hz=rate_hz,
        name=name,
        channels=channels,
    )
    beyond = beyond_grip(model, made.log["time_s"], made.inputs, made.states)
    if beyond:
        warn(f"{made.log.name}: {beyond}")
    return made.log


def _how_it_was_lost(
    manoeuvre: Manoeuvre, state: FloatArray, time_s: float, farthest_m: float
) -> str:
    vx, vy = float(state[0]), float(state[1])
    what = "stopped" if 0.0 <= vx < _STOPPED_MPS and abs(vy) < _STOPPED_MPS else "spun"
    if np.isfinite(farthest_m):
        what = f"spun, stopped, or was more than {farthest_m:g} m from where it began"
    return (
        f"{manoeuvre.name}: the car {what} at t = {time_s:.6g} s (v_x {vx:.3g} m/s, v_y {vy:.3g} "
        f"m/s); ask the manoeuvre for less lateral acceleration or less speed"
    )
