"""The equations of a model as text that Python and C++ both understand.

They are those of the compiled model, which writes down its own calculation
(`cpp/include/sysid/dynamics/written_model.hpp`): of a car that is driven, free of what only its
sensors do. What an effect does is written nowhere else than at its home.
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from typing import NamedTuple

from .. import _core
from ..effects import Effect
from ..errors import InvalidInput
from ..model import Model
from .calculation import TAKEN, Calculation, Writer, free_name

_START_SPEED = 20.0  # m/s

# Data of the car, and what is known of them; the parameters of tyres and effects say it themselves.
_CAR = {
    "gravity_mps2": ("gravity", "m/s2"),
    "mass_kg": ("mass", "kg"),
    "lf_m": ("front_arm", "m, centre of gravity to front axle"),
    "lr_m": ("rear_arm", "m, centre of gravity to rear axle"),
    "cg_height_m": ("cg_height", "m"),
    "track_front_m": ("front_track", "m"),
    "track_rear_m": ("rear_track", "m"),
    "drag_area_m2": ("drag_area", "m2, drag coefficient times frontal area"),
    "air_density_kgpm3": ("air_density", "kg/m3"),
    "brake_front_share": ("brake_share", "of the front axle in brake force"),
    "drive_front_share": ("drive_share", "of the front axle in drive force"),
}
_YAW_INERTIA = "yaw_inertia_kgm2"

Constant = tuple[str, float, str]


@dataclass(frozen=True)
class State:
    """A state: the motion, or one of an effect.

    Attributes
    ----------
    start : float
        Where it settles on a car that goes straight on at 20 m/s.
    """

    name: str
    unit: str
    start: float


@dataclass(frozen=True)
class Equations:
    """A model as text.

    Attributes
    ----------
    constants : tuple of (name, value, comment)
    states : tuple of State
        The motion, then those of effects.
    sections : tuple of (title, lines)
        Assignments ``name = expression``, in order; names may be assigned again. Each state has a
        result ``<name>_rate``; others are `a_x` and `a_y`.
    left_out : tuple of str
        Effects of sensors, which are no part of a car that is driven.
    even : bool
        Whether every rate depends on a state, so that it has as many values as states have.
    """

    constants: tuple[Constant, ...]
    states: tuple[State, ...]
    sections: tuple[tuple[str, tuple[str, ...]], ...]
    left_out: tuple[str, ...]
    even: bool

    @property
    def lines(self) -> tuple[str, ...]:
        """The assignments of all sections."""
        return tuple(line for _, lines in self.sections for line in lines)

    @property
    def functions(self) -> set[str]:
        """Functions that they call."""
        return set(re.findall(r"(\w+)\(", "\n".join(self.lines)))


def equations(model: Model) -> Equations:
    """Write the equations of a model with the wheel force as its input.

    Raises
    ------
    InvalidInput
        If the model has an effect that cannot be exported: one that reads the time, a channel of
        the log or the rate of the steering angle.
    """
    written = _Written(model)
    if written.foreign():
        foreign = [e.id for e in model.parts if _Written(_with_only(model, e)).foreign()]
        raise InvalidInput(
            f"{', '.join(foreign)}: cannot be exported; drop it first: model.drop('{foreign[0]}'), "
            f"as it reads the time, a channel of the log or how fast the steering turns, and what "
            f"is exported is told steering angle and force alone"
        )
    return written.equations()


def _with_only(model: Model, e: Effect) -> Model:
    return model.drop(*(other.id for other in model.parts if other.id != e.id))


class _State(NamedTuple):
    name: str
    unit: str
    place: int
    rate: int
    start: float


class _Written:
    """What the compiled core wrote of a model, as far as the car that is driven needs it."""

    def __init__(self, model: Model) -> None:
        self.model = model
        self.core = _core.write_model(model.core(), model.vector(), _START_SPEED)
        # The catalogue names its states, users' effects have theirs in their order.
        own = iter(_own_states(model))
        states = []
        for name, unit, place, rate, start in self.core.states:
            name, unit = (name, unit) if name else next(own)
            states.append(_State(name, unit, place, rate, start))
        # States that the motion depends on, and what those depend on in turn.
        self.states = states[:3]
        while True:
            results = {f"{s.name}_rate": s.rate for s in self.states}
            results |= {"a_x": self.core.a_x, "a_y": self.core.a_y}
            self.calculation = Calculation(self.core.steps, results)
            self.inputs = set(self.calculation.inputs())
            needed = [s for k, s in enumerate(states) if k < 3 or s.place in self.inputs]
            if len(needed) == len(self.states):
                break
            self.states = needed

    def foreign(self) -> bool:
        """Whether it reads what a driven car is not told."""
        return not self.inputs <= {
            self.core.steer,
            self.core.force,
            *(place for _, place in self.core.car),
            *self.core.parameters,
            *(s.place for s in self.states),
        }

    def acts(self, e: Effect) -> bool:
        return any(self.core.parameters[p.column] in self.inputs for p in e.parameters)

    def equations(self) -> Equations:
        core = self.core
        taken = {"steer", "force", *TAKEN, *self.calculation.results}
        names = {core.steer: "steer", core.force: "force"}
        for s in self.states:
            names[s.place] = s.name
            taken.add(s.name)
        constants = []
        for place, (name, value, comment) in (*self._of_car(), *self._of_parameters()):
            if place in self.inputs:
                names[place] = free_name(name, taken)
                taken.add(names[place])
                constants.append((names[place], value, comment))
        moving = {s.place for s in self.states}
        return Equations(
            tuple(constants),
            tuple(State(s.name, s.unit, _finite(s.start)) for s in self.states),
            Writer(self.calculation, names, core.names).sections(core.parts),
            self._left_out(),
            all(self.calculation.depends(s.rate, moving) for s in self.states),
        )

    def _left_out(self) -> tuple[str, ...]:
        """Effects that do nothing whatever their size, unlike a lag of no length."""
        silent = [e for e in self.model.parts if not self.acts(e)]
        sizes = {f"{e.id}.{p.name}": p.typical for e in silent for p in e.parameters}
        typical = _Written(self.model.with_values(sizes)) if silent else self
        return tuple(e.id for e in silent if not typical.acts(e))

    def _of_car(self) -> list[tuple[int, Constant]]:
        told = dict(self.core.car)
        values = {"gravity_mps2": _core.GRAVITY_MPS2}
        return [
            (told[field], (name, values.get(field) or getattr(self.model.vehicle, field), comment))
            for field, (name, comment) in _CAR.items()
        ]

    def _of_parameters(self) -> list[tuple[int, Constant]]:
        titles = {e.id: e.title for e in self.model.parts}
        found = []
        for name, p in self.model.parameters.items():
            effect, _, own = name.partition(".")
            comment = _line(f"{p.unit}, {titles[effect] if own else 'Magic Formula'}")
            constant = (name.replace(".", "_"), self.model.value(name), comment)
            if name == _YAW_INERTIA:
                constant = ("yaw_inertia", self.model.value(name), p.unit)
            found.append((self.core.parameters[p.column], constant))
        return found


def _own_states(model: Model) -> list[tuple[str, str]]:
    """Names and units of the states of users' effects."""
    taken, found = set(TAKEN), []
    for e in model.parts:
        for s in e.own_states:
            name = free_name(f"{e.id}_{s.name}", taken)
            taken |= {name, f"{name}_rate"}
            found.append((name, _line(s.unit)))
    return found


def _line(text: str) -> str:
    """A text of a user as a comment: one line, whatever it holds."""
    return " ".join(text.replace("\\", "").split())


def _finite(value: float) -> float:
    return value + 0.0 if math.isfinite(value) else 0.0
