"""Twins: the built-in car as one, and any pair of functions."""

from __future__ import annotations

import copy
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from .._common.arrays import FloatArray, as_float64
from .._common.typed import typed
from ..errors import InvalidInput, near_names
from .car import LOAD_NAMES, Load, TwinCar
from .checks import check_apart
from .drives import INPUTS, OUTPUTS
from .observer import STATES

if TYPE_CHECKING:
    from typing_extensions import Self

_WRENCH = INPUTS.index("force_x_n")


class _Standing(ABC):
    """What a twin with states and parameters can do with where it stands."""

    _state: FloatArray

    @abstractmethod
    def get_parameters(self) -> dict[str, float]:
        """Its parameters by name."""

    @abstractmethod
    def set_parameters(self, values: Mapping[str, float]) -> None:
        """Change some of them."""

    def get_state(self) -> FloatArray:
        """Its states."""
        return self._state.copy()

    def set_state(self, state: FloatArray) -> None:
        """Set its states."""
        self._state = as_float64(state).copy()

    def snapshot(self) -> tuple[FloatArray, dict[str, float]]:
        """Remember states and parameters."""
        return self._state.copy(), self.get_parameters()

    def restore(self, snapshot: tuple[FloatArray, dict[str, float]]) -> None:
        """Go back there."""
        self.set_state(snapshot[0])
        self.set_parameters(snapshot[1])

    def clone(self) -> Self:
        """Make another that stands here."""
        other = copy.copy(self)
        other._state = self._state.copy()
        return other


class NativeTwin(_Standing):
    """The built-in car as a twin; `observe` runs the same loop faster, without Python in it.

    Parameters
    ----------
    car : TwinCar
        The car.
    load : Load
        Its load.
    speed_mps : float
        It starts at rest on its springs, at this speed.
    dt_s : float
        Step.
    """

    input_names = INPUTS
    output_names = OUTPUTS
    state_names = STATES
    parameter_names = LOAD_NAMES
    capabilities = frozenset({"parameters", "state", "wrench", "snapshot", "clone"})

    @typed
    def __init__(self, car: TwinCar, load: Load, speed_mps: float, *, dt_s: float = 1e-3) -> None:
        self.car = car
        self.dt_s = dt_s
        self._core = car.core(load)
        self._state = self._core.rest(speed_mps)
        self._wrench = np.zeros(6)

    def __getstate__(self) -> dict[str, Any]:
        """Car, load, states and push, for a copy or another process."""
        return {
            "car": self.car,
            "dt_s": self.dt_s,
            "load": list(self._core.load),
            "state": self._state,
            "wrench": self._wrench,
            "capabilities": self.capabilities,
        }

    def __setstate__(self, kept: dict[str, Any]) -> None:
        self.car, self.dt_s = kept["car"], kept["dt_s"]
        self.capabilities = kept["capabilities"]
        self._core = self.car.core()
        self._core.load = kept["load"]
        self._state, self._wrench = kept["state"].copy(), kept["wrench"].copy()

    def _inputs(self, inputs: FloatArray) -> FloatArray:
        if not self._wrench.any():
            return as_float64(inputs).reshape(1, -1)
        row = np.array(inputs, dtype=np.float64).reshape(1, -1)
        row[0, _WRENCH:] += self._wrench
        return row

    def outputs(self, inputs: FloatArray) -> FloatArray:
        """What it reads now."""
        return self._core.evaluate(self._state, self._inputs(inputs))[1]

    def step(self, inputs: FloatArray) -> None:
        """Advance one step."""
        self._state = self._core.step(self._state, self._inputs(inputs), self.dt_s)

    def get_parameters(self) -> dict[str, float]:
        """Its load by name."""
        return dict(zip(LOAD_NAMES, self._core.load, strict=True))

    def set_parameters(self, values: Mapping[str, float]) -> None:
        """Change its load.

        Raises
        ------
        InvalidInput
            If a name is unknown, or no body has such a load.
        """
        load = self.get_parameters()
        for name in values:
            if name not in load:
                raise InvalidInput(f"there is no parameter '{name}'{near_names(name, load)}")
        try:
            self._core.load = list({**load, **values}.values())
        except ValueError as error:
            raise InvalidInput(f"{self.car.name}: {error}") from error

    def set_wrench(self, force_n: FloatArray, moment_nm: FloatArray) -> None:
        """Push its body."""
        self._wrench = np.concatenate([force_n, moment_nm])


class CallableTwin(_Standing):
    """A twin made of two functions of state, inputs and parameters, and of nothing else.

    What they keep to themselves, clones of the twin would share: `observe_with` refuses functions
    that give something else when they are asked again. They may write into the state they are
    given, which is a copy. It pickles if its functions do: functions of a module do, those made in
    place do not.

    Parameters
    ----------
    step : callable
        ``step(state, inputs, parameters)`` gives the state one step later.
    outputs : callable
        ``outputs(state, inputs, parameters)`` gives the readings.
    state : ndarray
        First state.
    dt_s : float
        Step.
    input_names, output_names, state_names : sequence of str
        Names.
    parameters : mapping of str to float
        Numbers that may be estimated, at most seven.

    Raises
    ------
    InvalidInput
        If the state does not fit its names, a name comes twice, or `step` or `outputs` is no
        function.
    """

    capabilities = frozenset({"parameters", "state", "snapshot", "clone"})

    @typed
    def __init__(
        self,
        step: Callable[[FloatArray, FloatArray, dict[str, float]], FloatArray],
        outputs: Callable[[FloatArray, FloatArray, dict[str, float]], FloatArray],
        state: FloatArray,
        *,
        dt_s: float,
        input_names: Sequence[str],
        output_names: Sequence[str],
        state_names: Sequence[str],
        parameters: Mapping[str, float],
    ) -> None:
        for what, function in (("step", step), ("outputs", outputs)):
            if not callable(function):
                raise InvalidInput(f"{what} = {function!r}; give a function")
        self._step, self._outputs = step, outputs
        self.dt_s = dt_s
        self.input_names = tuple(input_names)
        self.output_names = tuple(output_names)
        self.state_names = tuple(state_names)
        self.parameter_names = tuple(parameters)
        for names in (self.input_names, self.output_names, self.state_names):
            if names:
                check_apart("names of the twin", names)
        self._parameters = {name: float(value) for name, value in parameters.items()}
        self._state = as_float64(state).copy()
        if self._state.shape != (len(self.state_names),):
            raise InvalidInput(
                f"the state has shape {self._state.shape} but {len(self.state_names)} names"
            )

    def outputs(self, inputs: FloatArray) -> FloatArray:
        """What it reads now.

        Raises
        ------
        InvalidInput
            If the function gives anything but a number for each name.
        """
        found = self._outputs(self._state.copy(), inputs, dict(self._parameters))
        return _numbers(found, self.output_names, "outputs")

    def step(self, inputs: FloatArray) -> None:
        """Advance one step.

        Raises
        ------
        InvalidInput
            If the function gives anything but a number for each name.
        """
        found = self._step(self._state.copy(), inputs, dict(self._parameters))
        self._state = _numbers(found, self.state_names, "step")

    def get_parameters(self) -> dict[str, float]:
        """Its parameters."""
        return dict(self._parameters)

    def set_parameters(self, values: Mapping[str, float]) -> None:
        """Change some of them."""
        self._parameters = {**self._parameters, **values}

    def set_wrench(self, force_n: FloatArray, moment_nm: FloatArray) -> None:
        """Refuse: functions of states take no push."""
        raise InvalidInput("a twin of functions takes no push; its states can be set")


def _numbers(found: Any, names: Sequence[str], what: str) -> FloatArray:
    """What a function of the user's gave, with a number for each name."""
    asked = f"give an array of {len(names)}: {', '.join(names)}"
    if found is None:
        raise InvalidInput(f"{what} of the twin gave None; {asked}")
    if np.iscomplexobj(found):
        raise InvalidInput(f"{what} of the twin gave complex numbers; {asked}")
    try:
        numbers = as_float64(found)
    except (TypeError, ValueError) as error:
        raise InvalidInput(f"{what} of the twin gave no numbers ({error}); {asked}") from error
    if numbers.shape != (len(names),):
        raise InvalidInput(f"{what} of the twin gave an array of shape {numbers.shape}; {asked}")
    return numbers
