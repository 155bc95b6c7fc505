"""The observer: the twin beside the car, its states and its load corrected by what the car reads.

Dettu et al. (2023), eqs. (1) to (5). On the built-in twin the whole loop runs in C++.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from html import escape
from typing import TYPE_CHECKING, Literal

import numpy as np

from .. import _core
from .._arrays import FloatArray, as_float64
from .._style import AFTER, TRUTH, axes_or_new, tidy
from ..errors import InvalidInput, NumericalError
from .car import LOAD_NAMES, Load, TwinCar
from .drives import OUTPUTS
from .laws import ParameterLaw, Schedule, SideBySide, place_of
from .readings import READINGS, Readings

if TYPE_CHECKING:
    from matplotlib.axes import Axes

__all__ = ["STATES", "Observation", "Observer", "StateGain", "observe"]

_WHEELS = ("fl", "fr", "rl", "rr")
STATES = (
    *("x_m", "y_m", "z_m", "roll_rad", "pitch_rad", "yaw_rad"),
    *("vx_mps", "vy_mps", "vz_mps", "roll_rate_radps", "pitch_rate_radps", "yaw_rate_radps"),
    *(f"wheel_height_{w}_m" for w in _WHEELS),
    *(f"wheel_height_rate_{w}_mps" for w in _WHEELS),
    *(f"wheel_angle_{w}_rad" for w in _WHEELS),
    *(f"wheel_speed_{w}_radps" for w in _WHEELS),
    *(f"slip_{w}" for w in _WHEELS),
    *(f"slip_angle_{w}" for w in _WHEELS),
)
"""Names of the states of the built-in twin; the last eight move only with relaxing tyres."""


@dataclass(frozen=True)
class StateGain:
    """One entry of the matrix K of eq. (4).

    Parameters
    ----------
    channel : str
        Reading whose error corrects
    state : str
        this state.
    gain : float
        Per second; or, as in table 8 of the paper, per sample.
    unit : {"per_second", "per_sample"}
        Which of them.
    """

    channel: str
    state: str
    gain: float
    unit: Literal["per_second", "per_sample"] = "per_second"

    def row(self, channels: Sequence[str], states: Sequence[str]) -> list[float]:
        """Positions, gain and unit, as the core takes them."""
        return [
            float(place_of(self.channel, channels, "channel")),
            float(place_of(self.state, states, "state")),
            self.gain,
            1.0 if self.unit == "per_sample" else 0.0,
        ]


@dataclass(frozen=True)
class Observer:
    """What corrects the twin.

    Parameters
    ----------
    gains : sequence of StateGain
        Corrections of states.
    laws : sequence of ParameterLaw
        Corrections of the load by one reading each.
    batch : SideBySide, optional
        Corrections of the load by twins side by side.
    schedule : Schedule
        When the laws' next stage begins.
    derivative_hz : float
        Corner of the filter that differentiates angular rates, of car and twin alike.
    """

    gains: Sequence[StateGain] = ()
    laws: Sequence[ParameterLaw] = ()
    batch: SideBySide | None = None
    schedule: Schedule = field(default_factory=Schedule)
    derivative_hz: float = 20.0

    def core_laws(
        self, parameters: Sequence[str], channels: Sequence[str], dt_s: float
    ) -> _core.ParameterLaws | None:
        """The compiled laws, for a twin with these parameters and outputs."""
        if not self.laws:
            return None
        s = self.schedule
        gated = any(
            law.yaw_rate_below_radps < np.inf or law.yaw_rate_above_radps > 0.0 for law in self.laws
        )
        has_yaw_rate = gated or "yaw_rate_radps" in channels
        return _core.ParameterLaws(
            [law.core(parameters, channels) for law in self.laws],
            dt_s,
            place_of("yaw_rate_radps", channels, "channel") if has_yaw_rate else 0,
            self.derivative_hz,
            [s.excited_s, s.window_s, s.relative_rate_ps],
        )


@dataclass(frozen=True, eq=False)
class Observation:
    """What an observer found.

    Attributes
    ----------
    time_s : ndarray, shape (m,)
        Recorded times.
    parameters : mapping of str to ndarray
        Estimate of each parameter over time, shape (m,).
    outputs : mapping of str to ndarray
        What the twin reads, before its correction.
    stages : ndarray, shape (m,)
        Stage of the schedule.
    spread : mapping of str to float
        Standard deviation of what was looked for side by side, as least squares see it at the end.
    """

    time_s: FloatArray
    parameters: dict[str, FloatArray]
    outputs: dict[str, FloatArray]
    stages: FloatArray
    spread: dict[str, float]

    def last(self, name: str, window_s: float = 1.0) -> float:
        """Mean of a parameter over the last seconds."""
        return float(np.mean(self.parameters[name][self._end(window_s)]))

    def error_percent(self, name: str, truth: float, change: float, window_s: float = 1.0) -> float:
        """Root mean square error over the last seconds in % of the true change.

        Eqs. (11) and (12) of Dettu et al. (2023), with the root that (11) lacks.
        """
        error = self.parameters[name][self._end(window_s)] - truth
        return float(100.0 * np.sqrt(np.mean(error**2)) / abs(change))

    def _end(self, window_s: float) -> np.ndarray:
        found: np.ndarray = self.time_s > self.time_s[-1] - window_s
        return found

    def moved(self) -> list[str]:
        """Parameters that were corrected."""
        return [n for n, v in self.parameters.items() if float(np.ptp(v)) > 0.0]

    def plot(self, name: str, *, truth: float | None = None, ax: Axes | None = None) -> Axes:
        """Draw a parameter over time."""
        ax = axes_or_new(ax, 6.0, 3.0)
        ax.plot(self.time_s, self.parameters[name], color=AFTER, label="estimate")
        if truth is not None:
            ax.axhline(truth, color=TRUTH, linestyle="--", label="true")
        ax.legend(frameon=False)
        return tidy(ax, xlabel="time [s]", ylabel=name)

    def __str__(self) -> str:
        lines = [f"Observer over {self.time_s[-1]:.0f} s; parameters from first to last:"]
        for name in self.moved():
            spread = f" +- {self.spread[name]:.3g}" if name in self.spread else ""
            first = self.parameters[name][0]
            lines.append(f"  {name:12s} {first:10.5g} -> {self.last(name):.5g}{spread}")
        return "\n".join(lines)

    def _repr_html_(self) -> str:
        return f"<pre>{escape(str(self))}</pre>"


def observe(
    car: TwinCar,
    load: Load,
    inputs: FloatArray,
    readings: Readings,
    observer: Observer,
    *,
    speed_mps: float | None = None,
    stride: int = 10,
) -> Observation:
    """Run an observer on the built-in twin.

    Parameters
    ----------
    car : TwinCar
        The twin.
    load : Load
        Its first load.
    inputs : ndarray, shape (n, 24)
        What the car was given, columns as `INPUTS`.
    readings : Readings
        What the car read.
    observer : Observer
        What corrects the twin.
    speed_mps : float, optional
        First speed of the twin; by default the first reading of ``vx_mps``, or the front wheels'.
    stride : int
        Every so many samples are recorded.

    Returns
    -------
    Observation

    Raises
    ------
    InvalidInput
        If inputs and readings differ in length, nothing would be recorded, or the first speed is
        unknown.
    NumericalError
        If the twin overturned or left the range of numbers; the message names the time.
    """
    n, dt = len(readings.values), readings.dt_s
    if len(inputs) != n:
        raise InvalidInput(f"{len(inputs)} rows of inputs but {n} of readings; give equally many")
    if stride < 1:
        raise InvalidInput(f"stride = {stride}; give a whole number from one up")
    twin = car.core(load)
    start = twin.rest(_first_speed(car, readings) if speed_mps is None else speed_mps)
    batch = None if observer.batch is None else observer.batch.core(LOAD_NAMES, READINGS, dt)
    try:
        loads, outputs, stages, spread = _core.observe14(
            twin,
            start,
            as_float64(inputs),
            as_float64(readings.values),
            dt,
            [g.row(READINGS, STATES) for g in observer.gains],
            observer.core_laws(LOAD_NAMES, READINGS, dt),
            batch,
            stride,
        )
    except NumericalError as error:
        raise NumericalError(f"{error}; take smaller gains or a nearer first load") from error
    unknown = [] if observer.batch is None else list(observer.batch.unknowns)
    return Observation(
        as_float64(np.arange(len(loads)) * (stride * dt)),
        {name: loads[:, i] for i, name in enumerate(LOAD_NAMES)},
        {name: outputs[:, i] for i, name in enumerate(OUTPUTS)},
        np.asarray(stages, dtype=np.float64),
        {u.parameter: s * u.spread for u, s in zip(unknown, spread, strict=True)},
    )


def _first_speed(car: TwinCar, readings: Readings) -> float:
    speed = float(readings["vx_mps"][0])
    if np.isfinite(speed):
        return speed
    wheels = [float(readings[f"wheel_speed_{w}_radps"][0]) for w in ("fl", "fr")]
    if not np.all(np.isfinite(wheels)):
        raise InvalidInput("the first speed is not measured; give speed_mps")
    return float(np.mean(wheels)) * car.numbers()["front.radius_m"]
