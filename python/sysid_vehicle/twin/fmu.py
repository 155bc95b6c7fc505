"""A Functional Mock-up Unit as a twin: FMI 2 and 3, model exchange and co-simulation, by FMPy.

What an FMU can do depends on how it was exported. For model exchange its continuous states can be
set; for co-simulation only inputs and tunable parameters can, so that states are corrected only
where it takes a push as an input. Twins side by side need copies of it: for model exchange a
second instance with the same states, for co-simulation one that can be serialised.

An FMU is a library of native code: it runs with all the rights of this process and is not checked
in any way. Load those only whose maker you trust.
"""

from __future__ import annotations

import contextlib
import ctypes
import math
import platform
import shutil
import weakref
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NoReturn

import numpy as np

from .._common.arrays import FloatArray, as_float64
from .._common.typed import typed
from ..errors import InvalidInput, NumericalError, near_names
from .checks import checked_step
from .fmu_file import Kind, fmpy_module, kind_of, read_description

_AXES = 3


@dataclass(frozen=True)
class FMUVariables:
    """Which variable of the FMU is what; names of this package to names of the FMU.

    Parameters
    ----------
    inputs, outputs : mapping of str to str
        What it takes and gives.
    parameters : mapping of str to str
        What may be corrected, such as ``{"mass_kg": "body.m"}``; must be tunable.
    start : mapping of str to float
        Values, by the FMU's own names, to set before it starts.
    force_n, moment_nm : sequence of str
        Three inputs of the FMU each that push its body; where there are none, none.
    states : sequence of str
        Names for its continuous states, in its order. If left out, one that is among `outputs` has
        its name there, others that of the FMU.
    """

    inputs: Mapping[str, str]
    outputs: Mapping[str, str]
    parameters: Mapping[str, str] = field(default_factory=dict)
    start: Mapping[str, float] = field(default_factory=dict)
    force_n: Sequence[str] = ()
    moment_nm: Sequence[str] = ()
    states: Sequence[str] = ()


class _Alive:
    """An FMU's instance and the folder it is unpacked in; ended together, and once."""

    def __init__(self, folder: str) -> None:
        self.folder = folder
        self.fmu: Any = None

    def end(self) -> None:
        fmu, self.fmu = self.fmu, None
        try:
            if fmu is not None:
                # An instance that is still being set up may refuse to be terminated.
                with contextlib.suppress(Exception):
                    fmu.terminate()
                fmu.freeInstance()
        finally:
            shutil.rmtree(self.folder, ignore_errors=True)


class FMUTwin:
    """An FMU as a twin.

    It runs the native code in the file, with all the rights of this process: load no FMU that you
    do not trust. It is unpacked into a folder of its own, which is deleted when the twin is closed,
    by `close` or at the end of a ``with`` block, when it is collected, or when Python ends. The
    instance lives in that code: it can be cloned if the FMU can, but neither pickled nor sent to
    another process.

    Parameters
    ----------
    path : Path or str
        The file.
    variables : FMUVariables
        Which variable is what.
    dt_s : float
        Step; a model for exchange is integrated with one Runge-Kutta step of fourth order.
    kind : {"model_exchange", "co_simulation"}, optional
        Which of what it offers; model exchange if it offers both, as its states can be set.

    Raises
    ------
    InvalidInput
        If FMPy is not installed, the file is no FMU or has no library for this machine, the FMU
        lacks a variable, a parameter is not tunable, a start value is no number, or it does not
        offer `kind`.
    """

    @typed
    def __init__(
        self,
        path: Path | str,
        variables: FMUVariables,
        *,
        dt_s: float = 1e-3,
        kind: Kind | None = None,
    ) -> None:
        fmpy = fmpy_module()
        if not Path(path).is_file():
            raise InvalidInput(f"{path}: there is no such file")
        self._path, self._variables, self.dt_s = path, variables, checked_step(dt_s)
        self._description = read_description(str(path))
        self._version = 3 if self._description.fmiVersion.startswith("3") else 2
        self.kind = kind_of(self._description, kind, str(path))
        self._alive = _Alive(fmpy.extract(str(path)))
        # Whoever lets go of the twin, or stops half-way through its making, leaves nothing behind.
        self._finalizer = weakref.finalize(self, self._alive.end)
        self.input_names = tuple(variables.inputs)
        self.output_names = tuple(variables.outputs)
        self.parameter_names = tuple(variables.parameters)
        self._inputs = self._references(variables.inputs.values())
        self._outputs = self._references(variables.outputs.values())
        self._parameters = self._references(variables.parameters.values(), tunable=True)
        self._push = self._references([*variables.force_n, *variables.moment_nm])
        self._time = 0.0
        self._start()
        count = int(self._description.numberOfContinuousStates or 0)
        names = tuple(variables.states) or self._names_of_states(count)
        if self.kind == "model_exchange" and len(names) != count:
            raise InvalidInput(f"{path} has {count} states but {len(names)} names were given")
        self.state_names = names if self.kind == "model_exchange" else ()
        self.capabilities = self._capabilities()

    def _names_of_states(self, count: int) -> tuple[str, ...]:
        """What the states are called: by what a channel is compared with, its start is found."""
        given = {theirs: ours for ours, theirs in reversed(list(self._variables.outputs.items()))}
        rates = [rate.variable.derivative for rate in self._description.derivatives]
        theirs = [f"state_{i}" if x is None else x.name for i, x in enumerate(rates)]
        names = tuple(given.get(name, name) for name in theirs)
        counted = tuple(f"state_{i}" for i in range(count))
        return names if len(set(names)) == len(names) == count else counted

    @property
    def _fmu(self) -> Any:
        if self._alive.fmu is None:
            raise InvalidInput(f"{self._path}: this twin is closed; make it anew from the file")
        return self._alive.fmu

    def close(self) -> None:
        """End the instance and delete its folder; a second time does nothing."""
        self._finalizer()

    def __enter__(self) -> FMUTwin:
        """Give itself; the end of the block closes it."""
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def __reduce_ex__(self, protocol: object) -> NoReturn:
        raise TypeError(
            f"{self._path}: an FMU's instance lives in native code and cannot be pickled; make it "
            f"anew from the file in the other process, or take clone() for a copy in this one"
        )

    def __copy__(self) -> FMUTwin:
        return self.__deepcopy__({})

    def __deepcopy__(self, _: object) -> FMUTwin:
        if "clone" not in self.capabilities:
            raise TypeError(
                f"{self._path}: this FMU gives no copy of its state; make it anew from the file"
            )
        return self.clone()

    def _capabilities(self) -> frozenset[str]:
        offer = (
            self._description.modelExchange
            if self.kind == "model_exchange"
            else self._description.coSimulation
        )
        able = set()
        if self.parameter_names:
            able.add("parameters")
        if self.state_names:
            able |= {"state", "clone", "snapshot"}
        if len(self._push) == 2 * _AXES:
            able.add("wrench")
        # FMPy gives both versions the spelling of the second.
        if offer.canGetAndSetFMUstate:
            able.add("snapshot")
            if offer.canSerializeFMUstate:
                able.add("clone")
        return frozenset(able)

    def _references(self, names: Any, tunable: bool = False) -> list[int]:
        known = {v.name: v for v in self._description.modelVariables}
        out = []
        for name in names:
            if name not in known:
                raise InvalidInput(
                    f"{self._path}: there is no variable '{name}'{near_names(name, known)}"
                )
            if tunable and known[name].variability != "tunable":
                raise InvalidInput(
                    f"{self._path}: '{name}' is {known[name].variability}, not tunable, and cannot "
                    f"be corrected; export it as tunable"
                )
            out.append(int(known[name].valueReference))
        return out

    def _start(self) -> None:
        from fmpy.simulation import instantiate_fmu

        try:
            self._alive.fmu = instantiate_fmu(
                self._alive.folder,
                self._description,
                "ModelExchange" if self.kind == "model_exchange" else "CoSimulation",
                require_functions=False,
            )
        except Exception as error:
            raise InvalidInput(
                f"{self._path}: the FMU cannot be loaded ({error}); export it with a library for "
                f"{platform.system()} on {platform.machine()}"
            ) from error
        if self._version == 2:
            self._fmu.setupExperiment(startTime=0.0)
        self._fmu.enterInitializationMode()
        names = list(self._variables.start)
        for name in names:
            if not math.isfinite(self._variables.start[name]):
                raise InvalidInput(
                    f"{self._path}: start of '{name}' is {self._variables.start[name]}; give a "
                    f"number"
                )
        self._set(self._references(names), [float(self._variables.start[n]) for n in names])
        self._fmu.exitInitializationMode()
        if self.kind == "model_exchange":
            self._settle()

    def _settle(self) -> None:
        """From event mode, in which parameters may change, back to continuous time."""
        update = (
            self._fmu.newDiscreteStates if self._version == 2 else self._fmu.updateDiscreteStates
        )
        while update()[0]:
            pass
        self._fmu.enterContinuousTimeMode()

    def _set(self, references: list[int], values: Sequence[float]) -> None:
        if references:
            put = self._fmu.setReal if self._version == 2 else self._fmu.setFloat64
            put(references, [float(v) for v in values])

    def _get(self, references: list[int]) -> list[float]:
        if not references:
            return []
        take = self._fmu.getReal if self._version == 2 else self._fmu.getFloat64
        return [float(v) for v in take(references)]

    def outputs(self, inputs: FloatArray) -> FloatArray:
        """What it reads now; for co-simulation some FMUs refresh outputs only when they step."""
        self._set(self._inputs, list(inputs))
        return as_float64(self._get(self._outputs))

    def step(self, inputs: FloatArray) -> None:
        """Advance one step."""
        self._set(self._inputs, list(inputs))
        if self.kind == "co_simulation":
            self._fmu.doStep(self._time, self.dt_s)
        else:
            self._integrate()
        self._time += self.dt_s

    def _rates(self, state: FloatArray, time: float) -> FloatArray:
        self._fmu.setTime(time)
        self.set_state(state)
        rates = (ctypes.c_double * len(state))()
        take = (
            self._fmu.getDerivatives
            if self._version == 2
            else self._fmu.getContinuousStateDerivatives
        )
        take(rates, len(state))
        return as_float64(list(rates))

    def _integrate(self) -> None:
        x, t, h = self.get_state(), self._time, self.dt_s
        k1 = self._rates(x, t)
        k2 = self._rates(x + 0.5 * h * k1, t + 0.5 * h)
        k3 = self._rates(x + 0.5 * h * k2, t + 0.5 * h)
        k4 = self._rates(x + h * k3, t + h)
        new = x + h / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)
        if not np.all(np.isfinite(new)):
            raise NumericalError(f"{self._path}: a state is no number at t = {t:.6g} s")
        self._fmu.setTime(t + h)
        self.set_state(new)
        event, _ = self._fmu.completedIntegratorStep()
        if event:
            self._fmu.enterEventMode()
            self._settle()

    def get_parameters(self) -> dict[str, float]:
        """Its parameters."""
        return dict(zip(self.parameter_names, self._get(self._parameters), strict=True))

    def set_parameters(self, values: Mapping[str, float]) -> None:
        """Change some of them; for model exchange that takes an event."""
        places = [self.parameter_names.index(name) for name in values]
        references = [self._parameters[i] for i in places]
        if self.kind == "model_exchange":
            self._fmu.enterEventMode()
            self._set(references, list(values.values()))
            self._settle()
        else:
            self._set(references, list(values.values()))

    def get_state(self) -> FloatArray:
        """Its continuous states."""
        state = (ctypes.c_double * len(self.state_names))()
        self._fmu.getContinuousStates(state, len(state))
        return as_float64(list(state))

    def set_state(self, state: FloatArray) -> None:
        """Set its continuous states."""
        values = (ctypes.c_double * len(state))(*[float(v) for v in state])
        self._fmu.setContinuousStates(values, len(state))

    def set_wrench(self, force_n: FloatArray, moment_nm: FloatArray) -> None:
        """Push its body."""
        self._set(self._push, [*force_n, *moment_nm])

    def snapshot(self) -> Any:
        """Remember where it stands."""
        if self.state_names:
            return self._time, self.get_state(), self.get_parameters()
        return self._time, self._fmu.getFMUState(), {}

    def restore(self, snapshot: Any) -> None:
        """Go back there."""
        self._time, state, parameters = snapshot
        if self.state_names:
            self.set_parameters(parameters)
            self._fmu.setTime(self._time)
            self.set_state(state)
        else:
            self._fmu.setFMUState(state)

    def clone(self) -> FMUTwin:
        """Make another instance that stands here."""
        other = FMUTwin(self._path, self._variables, dt_s=self.dt_s, kind=self.kind)
        other._time = self._time
        if self.state_names:
            other.restore(self.snapshot())
        else:
            state = self._fmu.getFMUState()
            bytes_ = self._fmu.serializeFMUState(state)
            self._fmu.freeFMUState(state)
            other._fmu.setFMUState(other._fmu.deserializeFMUState(bytes_))
        return other
