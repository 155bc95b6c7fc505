"""What a simulator must be able to do to serve as a twin, and the loop around any that can.

A twin announces its capabilities; the observer uses what there is and says what is missing:

- ``parameters``: numbers that may be changed between steps,
- ``state``: its states can be read and set, so that eq. (4) can correct them,
- ``wrench``: it takes a force and a moment on its body; where states cannot be set, velocities are
  corrected by the push that changes them so much in a step,
- ``snapshot``: it can be put back to where it was,
- ``clone``: a second one can be made that stands where the first does, which twins side by side
  need.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Protocol, runtime_checkable

import numpy as np

from .._common.arrays import FloatArray, as_float64
from .._common.progress import doing
from .._common.typed import typed
from ..errors import InvalidInput, warn
from .car import LOAD_NAMES
from .checks import check_heard, checked_rows, checked_step, checked_stride
from .failing import all_numbers, blamed_on, check_repeats, check_start
from .kept import kept_state, kept_states, shows_speed
from .observer import Observation, Observer, judged
from .residuals import Shown

CAPABILITIES = ("parameters", "state", "wrench", "snapshot", "clone")
_MOST_PARAMETERS = len(LOAD_NAMES)
_ASKED = ("dt_s", "input_names", "output_names", "state_names", "parameter_names", "capabilities")
# Velocity: (force or moment, axis, what resists it). The horizontal axes move the whole mass.
_PUSHES = {
    "vx_mps": (0, 0, "mass_kg"),
    "vy_mps": (0, 1, "mass_kg"),
    "roll_rate_radps": (1, 0, "jxx_kgm2"),
    "pitch_rate_radps": (1, 1, "jyy_kgm2"),
    "yaw_rate_radps": (1, 2, "jzz_kgm2"),
}


@runtime_checkable
class Twin(Protocol):
    """A simulator of a car.

    Attributes
    ----------
    dt_s : float
        Step.
    input_names, output_names, state_names, parameter_names : tuple of str
        What it takes, gives, and may be asked for; states and parameters may be none. The names
        of this package (`INPUTS`, `OUTPUTS`, `STATES`, `LOAD_NAMES`) where they mean the same.
    capabilities : frozenset of str
        Out of `CAPABILITIES`; the methods that belong to one are called only if it is announced.
    """

    dt_s: float
    input_names: tuple[str, ...]
    output_names: tuple[str, ...]
    state_names: tuple[str, ...]
    parameter_names: tuple[str, ...]
    capabilities: frozenset[str]

    def outputs(self, inputs: FloatArray) -> FloatArray:
        """What it reads now; time stands still."""

    def step(self, inputs: FloatArray) -> None:
        """Advance one step with the inputs held."""

    def get_parameters(self) -> dict[str, float]:
        """Numbers by name (``parameters``)."""

    def set_parameters(self, values: Mapping[str, float]) -> None:
        """Change some of them from the next step on (``parameters``)."""

    def get_state(self) -> FloatArray:
        """States in the order of their names (``state``)."""

    def set_state(self, state: FloatArray) -> None:
        """Set all of them (``state``)."""

    def set_wrench(self, force_n: FloatArray, moment_nm: FloatArray) -> None:
        """Push the body in its yaw frame during the coming steps (``wrench``)."""

    def snapshot(self) -> Any:
        """Remember where it stands (``snapshot``)."""

    def restore(self, snapshot: Any) -> None:
        """Go back there (``snapshot``)."""

    def clone(self) -> Twin:
        """Make another that stands where this one does (``clone``)."""


@typed
@doing("observer")
def observe_with(
    twin: Twin,
    inputs: FloatArray,
    measured: Mapping[str, FloatArray],
    observer: Observer,
    *,
    stride: int = 10,
) -> Observation:
    """Run an observer on any twin, step by step; it starts where the twin stands.

    Parameters
    ----------
    twin : Twin
        The simulator. It is used up: it ends where the observer left it.
    inputs : ndarray, shape (n, inputs)
        What the car was given, columns as the twin's `input_names`.
    measured : mapping of str to ndarray, shape (n,)
        What the car read, by the twin's names of outputs; NaN where nothing was read.
    observer : Observer
        What corrects the twin.
    stride : int
        Every so many samples are recorded.

    Raises
    ------
    InvalidInput
        If the observer needs what the twin cannot do, or arrays do not fit; the message says what.
    NumericalError
        If an output of the twin is no number any more, or the simulator failed; the message names
        the time, and the parameters that it had.
    """
    for name in _ASKED:
        if not hasattr(twin, name):
            raise InvalidInput(
                f"observe_with: twin = {twin!r} has no {name}; give a NativeTwin, a CallableTwin, "
                f"an FMUTwin, or what does all that sysid_vehicle.twin.Twin describes"
            )
    dt, names = checked_step(twin.dt_s), twin.parameter_names
    inputs = checked_rows(inputs, twin.input_names, "inputs", dt, any_size=True)
    n = len(inputs)
    stride = checked_stride(stride, n)
    read = _table(twin, measured, n, dt)
    _check(twin, observer)
    check_heard(observer.compared, measured)
    check_repeats(twin, inputs[0])
    _say_if_exact(twin, observer)
    several = _Several(twin, observer, dt)
    check_start(observer.limits, dict(zip(names, several.estimate, strict=False)))
    kept: list[tuple[list[float], FloatArray, int]] = []
    shown = np.empty((n, len(twin.output_names)))
    for k in range(n):
        with blamed_on(several, k, dt):
            outputs = several.outputs(inputs[k])
            shown[k] = outputs[0]
            if k % stride == 0:
                kept.append((list(several.estimate), outputs[0], several.stage))
            several.learn(read[k], outputs)
            several.step()
    history = np.array([row[0] for row in kept])
    seen = np.array([row[1] for row in kept])
    return judged(
        observer,
        twin.input_names,
        as_float64(np.arange(len(kept)) * (stride * dt)),
        {name: history[:, i] for i, name in enumerate(names)},
        {name: seen[:, i] for i, name in enumerate(twin.output_names)},
        np.array([float(row[2]) for row in kept]),
        several.spread,
        Shown(
            {name: read[:, i] for i, name in enumerate(twin.output_names)},
            {name: shown[:, i] for i, name in enumerate(twin.output_names)},
            dt,
        ),
        _left_behind(twin, observer),
    )


class _Several:
    """A twin and, where parameters are looked for, its clones with other values of them."""

    def __init__(self, twin: Twin, observer: Observer, dt: float) -> None:
        self._names, read = twin.parameter_names, twin.output_names
        self._dt = dt
        self._laws = observer.core_laws(self._names, read, dt)
        self._batch, self._scaled, count = None, [], 1
        steps: list[tuple[int, int, float]] = []
        if observer.batch is not None:
            starts = observer.starts(_settable(twin))
            self._batch = observer.batch.core(self._names, read, dt, twin.input_names, starts)
            self._scaled = observer.batch.scaled(twin.input_names)
            count += len(observer.batch.looked_for(twin.input_names)) + len(starts)
            steps = observer.batch.start_steps(twin.input_names, _settable(twin), starts)
        known = twin.get_parameters() if "parameters" in twin.capabilities else {}
        self.estimate = [known.get(name, 0.0) for name in self._names]
        self.estimate += [0.0] * (_MOST_PARAMETERS - len(self.estimate)) + [1.0]
        self._gains = [g.row(read, _correctable(twin)) for g in observer.gains]
        self._twins = [twin, *(twin.clone() for _ in range(count - 1))]
        for which, state, step in steps:
            start = np.array(self._twins[which].get_state(), dtype=np.float64)
            start[state] += step
            self._twins[which].set_state(start)
        self.at_work = twin
        self._has_states = "state" in twin.capabilities
        self._told = np.zeros((count, len(twin.input_names)))
        self._scales = np.ones((count, 1))
        if self._batch is not None:
            self._put()

    @property
    def stage(self) -> int:
        """Of the laws by which the load is found."""
        return self._laws.stage if self._laws is not None else 0

    @property
    def spread(self) -> list[float]:
        """Standard errors of what the batch looks for; none without one."""
        return [] if self._batch is None else list(self._batch.spread.tolist())

    def outputs(self, inputs: FloatArray) -> FloatArray:
        """What each of them reads with these inputs, the twin itself first."""
        self._told[:] = inputs
        self._told[:, self._scaled] *= self._scales
        found = []
        for t, u in zip(self._twins, self._told, strict=True):
            self.at_work = t
            found.append(all_numbers(t, t.outputs(u)))
        return np.array(found, dtype=np.float64)

    def learn(self, read: FloatArray, outputs: FloatArray) -> None:
        """Correct states and estimates by what the car read."""
        if self._gains:
            load = _named(self._names, self.estimate)
            for t, y in zip(self._twins, outputs, strict=True):
                _correct(t, self._gains, read - y, self._dt, load)
        if self._laws is not None:
            self.estimate = self._laws.update(read, outputs[0], self.estimate)
        if self._batch is not None:
            self.estimate, moved = self._batch.update(read, outputs, self.estimate)
            if self._has_states and np.any(moved):
                _follow(self._twins, moved)
        if self._batch is not None or self._laws is not None:
            self._put()

    def step(self) -> None:
        """Advance all of them with the inputs held."""
        for t, u in zip(self._twins, self._told, strict=True):
            self.at_work = t
            t.step(u)

    def _put(self) -> None:
        for j, t in enumerate(self._twins):
            own = self.estimate if self._batch is None else self._batch.of_twin(j, self.estimate)
            t.set_parameters(_named(self._names, own))
            self._scales[j] = own[-1]


def _named(names: Sequence[str], values: Sequence[float]) -> dict[str, float]:
    return dict(zip(names, values, strict=False))


def _table(twin: Twin, measured: Mapping[str, FloatArray], n: int, dt: float) -> FloatArray:
    read = np.full((n, len(twin.output_names)), np.nan)
    for name, values in measured.items():
        if name not in twin.output_names:
            continue  # a sensor that the twin has no counterpart of teaches nothing
        column = as_float64(values)
        if len(column) != n or column.ndim != 1:
            raise InvalidInput(
                f"measured '{name}' has {len(column)} samples, shape {column.shape}; the inputs "
                f"have {n}, give shape ({n},)"
            )
        read[:, twin.output_names.index(name)] = column
    return checked_rows(read, twin.output_names, "measured", dt, missing=True, any_size=True)


def _check(twin: Twin, observer: Observer) -> None:
    def need(capability: str, why: str) -> None:
        if capability not in twin.capabilities:
            able = ", ".join(sorted(twin.capabilities)) or "nothing of it"
            raise InvalidInput(f"{why} needs a twin with '{capability}'; this one has {able}")

    if observer.laws or observer.batch is not None:
        need("parameters", "correcting the load")
    if observer.batch is not None:
        need("clone", "a batch of twins side by side")
    if observer.gains and "state" not in twin.capabilities:
        need("wrench", "correcting states that cannot be set")
    if len(twin.parameter_names) > _MOST_PARAMETERS:
        raise InvalidInput(
            f"the twin has {len(twin.parameter_names)} parameters; give it at most "
            f"{_MOST_PARAMETERS}, those that are looked for"
        )


def _say_if_exact(twin: Twin, observer: Observer) -> None:
    """Warn where the spread of a mass cannot hold what its forces are not known by."""
    batch = observer.batch
    if batch is None or not batch.doubts_inputs or batch.scaled(twin.input_names):
        return
    warn(
        f"mass_kg: no input of the twin ({', '.join(twin.input_names)}) is known as a force or a "
        f"torque, so its spread takes them all as exact; name those that are not, "
        f"uncertain_inputs=(...), or say input_std=0.0"
    )


def _left_behind(twin: Twin, observer: Observer) -> list[str]:
    """Compared channels whose state keeps what earlier guesses did to it, as nothing sets it."""
    batch = observer.batch
    if batch is None or "vx_mps" in observer.corrected:
        return []
    if "state" not in twin.capabilities:
        # Of guesses at inertias little is left in the speed.
        of_mass = any(u.parameter == "mass_kg" for u in batch.unknowns)
        return [
            f"{channel}: the twin's speed cannot be set and keeps what earlier guesses did to it; "
            f"compare ax_mps2 alone, correct vx_mps by a gain, or give the twin 'state'"
            for channel in batch.channels
            if kept_state(channel) == "vx_mps" or (of_mass and shows_speed(channel))
        ]
    asked = batch.start_std > 0.0 and "vx_mps" in kept_states(batch.channels)
    if not asked or "vx_mps" in twin.state_names:
        return []
    text = (
        f"the start of the twin's speed is not looked for, as none of its states "
        f"({', '.join(twin.state_names)}) is named vx_mps; name the one that is the speed so"
    )
    return [text]


def _settable(twin: Twin) -> tuple[str, ...]:
    return twin.state_names if "state" in twin.capabilities else ()


def _correctable(twin: Twin) -> tuple[str, ...]:
    return _settable(twin) if "state" in twin.capabilities else tuple(_PUSHES)


def _correct(
    twin: Twin,
    gains: Sequence[Sequence[float]],
    innovation: FloatArray,
    dt: float,
    load: Mapping[str, float],
) -> None:
    by_state = "state" in twin.capabilities
    names = _correctable(twin)
    change = np.zeros(len(names))
    for channel, state, gain, per_sample in gains:
        error = innovation[int(channel)]
        if np.isfinite(error):
            change[int(state)] += gain * (1.0 if per_sample else dt) * error
    if by_state:
        if np.any(change):
            twin.set_state(twin.get_state() + change)
        return
    push = np.zeros((2, 3))
    for name, moved in zip(names, change, strict=True):
        kind, axis, inertia = _PUSHES[name]
        if moved != 0.0:
            if inertia not in load:
                raise InvalidInput(f"to correct {name} by a push, the twin must give its {inertia}")
            push[kind, axis] = load[inertia] * moved / dt
    twin.set_wrench(push[0], push[1])


def _follow(twins: Sequence[Twin], moved: FloatArray) -> None:
    """Take all twins to where they would be, had the parameters always been the new ones."""
    states = [t.get_state() for t in twins]
    change = np.zeros_like(states[0])
    for part, state in zip(moved, states[1:], strict=True):
        change += part * (state - states[0])
    for t, state in zip(twins, states, strict=True):
        t.set_state(state + change)
