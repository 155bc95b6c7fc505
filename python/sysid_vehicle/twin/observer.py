"""The observer: the twin beside the car, its states and its load corrected by what the car reads.

Dettu et al. (2023), eqs. (1) to (5). On the built-in twin the whole loop runs in C++.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Literal

import numpy as np

from .. import _core
from .._common.arguments import check_positive
from .._common.arrays import FloatArray, as_float64
from .._common.printed import Told
from .._common.style import AFTER, TRUTH, axes_or_new, tidy
from .._common.typed import check_types, typed
from ..errors import InvalidInput, NumericalError, warn
from .car import LOAD_NAMES, Load, TwinCar
from .checks import checked_rows, checked_step, checked_stride
from .drives import INPUTS, OUTPUTS, WHEELS
from .failing import check_start
from .kept import kept_state
from .laws import INPUT_SCALE, ParameterLaw, Schedule, SideBySide, place_of
from .readings import READINGS, Readings
from .residuals import ChannelResidual, Shown, contradictions, residual_of

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_FASTEST_MPS = 150.0
STATES = (
    *("x_m", "y_m", "z_m", "roll_rad", "pitch_rad", "yaw_rad"),
    *("vx_mps", "vy_mps", "vz_mps", "roll_rate_radps", "pitch_rate_radps", "yaw_rate_radps"),
    *(f"wheel_height_{w}_m" for w in WHEELS),
    *(f"wheel_height_rate_{w}_mps" for w in WHEELS),
    *(f"wheel_angle_{w}_rad" for w in WHEELS),
    *(f"wheel_speed_{w}_radps" for w in WHEELS),
    *(f"slip_{w}" for w in WHEELS),
    *(f"slip_angle_{w}" for w in WHEELS),
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

    def __post_init__(self) -> None:
        check_types(self)

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

    def __post_init__(self) -> None:
        check_types(self)

    @property
    def limits(self) -> list[tuple[str, float, float]]:
        """Parameters that are looked for, with their lower and upper limits."""
        batch = () if self.batch is None else self.batch.unknowns
        found = [(u.parameter, u.lower, u.upper) for u in batch]
        return found + [(law.parameter, law.lower, law.upper) for law in self.laws]

    @property
    def compared(self) -> list[str]:
        """Channels of which the readings of car and twin are compared."""
        channels = [g.channel for g in self.gains] + [law.channel for law in self.laws]
        return channels + ([] if self.batch is None else list(self.batch.channels))

    @property
    def corrected(self) -> list[str]:
        """States that gains correct by readings of themselves."""
        return [g.state for g in self.gains if g.gain and g.state == kept_state(g.channel)]

    def starts(self, states: Sequence[str]) -> dict[str, float]:
        """States of a twin whose start the batch looks for, with the steps between the twins."""
        return {} if self.batch is None else self.batch.starts(states, self.corrected)

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


@dataclass(frozen=True, eq=False, repr=False)
class Observation(Told):
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
        Standard deviation of what was looked for side by side at the end: that of least squares,
        wider where residuals are not white, and no less than that of the first guess where they
        contradict the result.
    residuals : tuple of ChannelResidual
        Of the channels that taught something, over the second half.
    contradictions : tuple of str
        What speaks against the estimates, with the remedy; a warning said so too.
    """

    time_s: FloatArray
    parameters: dict[str, FloatArray]
    outputs: dict[str, FloatArray]
    stages: FloatArray
    spread: dict[str, float]
    residuals: tuple[ChannelResidual, ...] = ()
    contradictions: tuple[str, ...] = ()

    def last(self, name: str, window_s: float = 1.0) -> float:
        """Mean of a parameter over the last seconds."""
        return float(np.mean(self._of(name)[self._end(window_s)]))

    def error_percent(self, name: str, truth: float, change: float, window_s: float = 1.0) -> float:
        """Root mean square error over the last seconds in % of the true change.

        Eqs. (11) and (12) of Dettu et al. (2023), with the root that (11) lacks.
        """
        check_positive("error_percent", change=abs(change))
        error = self._of(name)[self._end(window_s)] - truth
        return float(100.0 * np.sqrt(np.mean(error**2)) / abs(change))

    def _of(self, name: str) -> FloatArray:
        place_of(name, list(self.parameters), "parameter")
        return self.parameters[name]

    def _end(self, window_s: float) -> np.ndarray:
        found: np.ndarray = self.time_s > self.time_s[-1] - window_s
        return found

    def moved(self) -> list[str]:
        """Parameters that were corrected."""
        return [n for n, v in self.parameters.items() if float(np.ptp(v)) > 0.0]

    def plot(self, name: str, *, truth: float | None = None, ax: Axes | None = None) -> Axes:
        """Draw a parameter over time."""
        ax = axes_or_new(ax, 6.0, 3.0)
        ax.plot(self.time_s, self._of(name), color=AFTER, label="estimate")
        if truth is not None:
            ax.axhline(truth, color=TRUTH, linestyle="--", label="true")
        ax.legend(frameon=False)
        return tidy(ax, xlabel="time [s]", ylabel=name)

    def __str__(self) -> str:
        lines = [f"Observer over {self.time_s[-1]:.0f} s; parameters from first to last:"]
        # What was looked for and did not move is as unknown as at first, which is to be seen.
        for name in [n for n, v in self.parameters.items() if n in self.spread or np.ptp(v) > 0.0]:
            spread = f" +- {self.spread[name]:.3g}" if name in self.spread else ""
            first = self.parameters[name][0]
            lines.append(f"  {name:12s} {first:10.5g} -> {self.last(name):.5g}{spread}")
        lines += [f"  {residual}" for residual in self.residuals]
        lines += [f"  NOT TO BE BELIEVED: {text}" for text in self.contradictions]
        return "\n".join(lines)


@typed
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

    Raises
    ------
    InvalidInput
        If inputs or readings have another shape, hold a number that is not finite or beyond what
        its unit can mean, differ in length, or the first speed is unknown; the message names
        channel, sample and remedy.
    NumericalError
        If the twin overturned or left the range of numbers; the message names the time.

    Warns
    -----
    SysidWarning
        If residuals contradict the estimates, an estimate stands at its limit, or nothing sets a
        speed that is compared.
    """
    dt = checked_step(readings.dt_s)
    rows = checked_rows(inputs, INPUTS, "inputs", dt)
    values = checked_rows(readings.values, READINGS, "readings", dt, missing=True)
    if len(rows) != len(values):
        raise InvalidInput(
            f"{len(rows)} rows of inputs but {len(values)} of readings; give equally many"
        )
    stride = checked_stride(stride, len(rows))
    check_start(observer.limits, vars(load))
    twin = car.core(load)
    speed = _first_speed(car, readings) if speed_mps is None else float(speed_mps)
    if not abs(speed) <= _FASTEST_MPS:
        raise InvalidInput(f"speed_mps = {speed!r}; give a speed up to {_FASTEST_MPS:g} m/s")
    batch = observer.batch
    starts = observer.starts(STATES)
    try:
        start = twin.rest(speed)
        loads, outputs, stages, spread = _core.observe14(
            twin,
            start,
            rows,
            values,
            dt,
            [g.row(READINGS, STATES) for g in observer.gains],
            observer.core_laws(LOAD_NAMES, READINGS, dt),
            None if batch is None else batch.core(LOAD_NAMES, READINGS, dt, INPUTS, starts),
            stride,
            [] if batch is None else batch.scaled(INPUTS),
            [] if batch is None else batch.start_steps(INPUTS, STATES, starts),
        )
    except NumericalError as error:
        raise NumericalError(f"{error}; take smaller gains or a nearer first load") from error
    except InvalidInput:
        raise
    except ValueError as error:
        raise InvalidInput(f"{car.name}: {error}") from error
    if not (np.isfinite(loads).all() and np.isfinite(outputs).all()):
        sample = int(np.argmin(np.isfinite(outputs).all(axis=1))) * stride
        raise NumericalError(
            f"the twin left the range of numbers by sample {sample}, t = {sample * dt:.6g} s; take "
            f"smaller gains or a nearer first load"
        )
    return judged(
        observer,
        INPUTS,
        as_float64(np.arange(len(loads)) * (stride * dt)),
        {name: loads[:, i] for i, name in enumerate(LOAD_NAMES)},
        {name: outputs[:, i] for i, name in enumerate(OUTPUTS)},
        np.asarray(stages, dtype=np.float64),
        spread,
        Shown(
            {name: values[::stride, i] for i, name in enumerate(READINGS)},
            {name: outputs[:, i] for i, name in enumerate(OUTPUTS)},
            stride * dt,
        ),
    )


def judged(
    observer: Observer,
    inputs: Sequence[str],
    time_s: FloatArray,
    parameters: dict[str, FloatArray],
    outputs: dict[str, FloatArray],
    stages: FloatArray,
    spread: Sequence[float],
    shown: Shown,
    doubts: Sequence[str] = (),
) -> Observation:
    """An observation with what its residuals say of it; a warning where they contradict it.

    Parameters
    ----------
    observer : Observer
        What corrected the twin.
    inputs : sequence of str
        Of the twin.
    time_s, parameters, outputs, stages : ndarray, mappings of them
        As `Observation` has them.
    spread : sequence of float
        Of the batch's unknowns, in parts of their first spread.
    shown : Shown
        What is judged: readings of car and twin, at the recorded times or at more of them.
    doubts : sequence of str
        What speaks against the estimates whatever the residuals say.
    """
    batch = observer.batch
    unknown = () if batch is None else batch.looked_for(inputs)
    estimated = [u for u in unknown if u.parameter != INPUT_SCALE]
    laws = [law for law in observer.laws if float(np.ptp(parameters[law.parameter])) > 0.0]
    noise = {law.channel: float("nan") for law in laws}
    filtered: set[str] = set()
    if batch is not None:
        noise.update(batch.channels)
        filtered = {name for name, hz in batch.high_pass_hz.items() if hz > 0.0}
    residuals = tuple(
        found
        for name, told in noise.items()
        if name not in filtered and (found := residual_of(name, shown, told)) is not None
    )
    limits = {law.parameter: (law.lower, law.upper) for law in laws}
    limits.update({u.parameter: (u.lower, u.upper) for u in estimated})
    against = (*doubts, *contradictions(residuals, parameters, limits))
    wide = {}
    for u, s in zip(estimated, spread, strict=False):
        wide[u.parameter] = float(s) * u.spread
        if against:
            wide[u.parameter] = max(wide[u.parameter], u.spread)
        if not u.lower < parameters[u.parameter][-1] < u.upper:
            wide[u.parameter] = max(wide[u.parameter], 0.5 * (u.upper - u.lower))
    if against:
        warn("what the twin found is not to be believed: " + "; ".join(against))
    return Observation(time_s, parameters, outputs, stages, wide, residuals, against)


def _first_speed(car: TwinCar, readings: Readings) -> float:
    speed = float(readings["vx_mps"][0])
    if np.isfinite(speed):
        return speed
    wheels = [float(readings[f"wheel_speed_{w}_radps"][0]) for w in ("fl", "fr")]
    if not np.all(np.isfinite(wheels)):
        raise InvalidInput("the first speed is not measured; give speed_mps")
    return float(np.mean(wheels)) * car.numbers()["front.radius_m"]
