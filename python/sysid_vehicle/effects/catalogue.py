"""The catalogue of physical effects, as the compiled core declares it.

Each effect's equation, parameters and null values have their home in `cpp/include/sysid/effects/`;
nothing is repeated here. Effects that users define stand beside them.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, fields, replace
from functools import cache
from typing import Any

import numpy as np

from .. import _core
from .._common.arguments import expect
from .._common.text import html_text
from .._common.typed import typed, typed_fields
from ..errors import InvalidInput, near_names
from ..vehicle import Vehicle, vehicle_data
from . import plugins
from .parts import OwnState, Parameter


@dataclass(frozen=True)
class Effect:
    """A physical effect that a model may lack.

    Attributes
    ----------
    index : int
        Place in the catalogue, or among the effects of users; no part of what the effect is.
    moves : str
        Measured channels it moves first.
    excited_by : str
        Driving that shows it.
    scored_at_typical : bool
        The derivative at the null value does not exist; scored at the typical size.
    needs_force : bool
        Visible only where the total wheel force was logged.
    needs : tuple of str
        Channels without which a log cannot show it.
    confounded_with : tuple of str
        Effects that act alike in most driving; each names the other.
    through : str
        Effect through which it chiefly acts, if any: weak in a model without that.
    breaks : str
        Law of motion that readings seem to break where it acts, through no fault of theirs:
        `readings late`, `readings elsewhere`, `answers late`, `on a slope`, or empty.
    same_in_all_logs : bool
        As a nuisance it is the same in all logs of a car, where others differ from log to log.
    refines : tuple of str
        Effects that it refines: a candidate only beside one of them, or where a user names it.
        Where both are in a model neither takes a share of the errors that is its own.
    on_request : bool
        A candidate only where a user names it.
    states : int
        How many states of its own it adds to the model.
    changes_car : bool
        It changes numbers that a vehicle file holds: `car_with` has them.
    acts : tuple
        Of an effect that a user defined: what its formulas add to, and their steps.
    channels : tuple of str
        Of such an effect: columns of the log that its formulas read.
    own_states : tuple of OwnState
        Of such an effect.
    """

    id: str
    title: str
    equation: str
    source: str
    excited_by: str
    moves: str
    parameters: tuple[Parameter, ...]
    index: int = field(compare=False)
    scored_at_typical: bool
    needs_force: bool
    needs: tuple[str, ...]
    confounded_with: tuple[str, ...]
    through: str
    states: int
    breaks: str = ""
    same_in_all_logs: bool = False
    refines: tuple[str, ...] = ()
    on_request: bool = False
    acts: tuple[tuple[int, Any], ...] = ()
    channels: tuple[str, ...] = ()
    own_states: tuple[OwnState, ...] = ()
    changes_car: bool = False

    @typed_fields
    def __post_init__(self) -> None:
        # Before any problem is made for it: its runs hold the channels by number.
        for name in self.channels:
            _channel_number(name)

    def __reduce__(self) -> tuple[Any, tuple[Any, ...]]:
        """An effect of the catalogue by its name, whose places may differ; others by value."""
        if _by_id().get(self.id) == self:
            return effect, (self.id,)
        return Effect, tuple(getattr(self, f.name) for f in fields(self))

    def seated(self, taken: set[int]) -> Effect:
        """The same effect, if a user's at a place that is not taken; that is taken then.

        Raises
        ------
        InvalidInput
            All places are taken.
        """
        if not self.acts:
            return self
        free = (i for i in (self.index, *range(_core.USER_EFFECTS)) if i >= 0 and i not in taken)
        place = next(free, None)
        if place is None:
            raise InvalidInput(
                f"effect '{self.id}': there is room for {_core.USER_EFFECTS} effects of your own; "
                "forget one with forget_effect"
            )
        taken.add(place)
        first = _core.USER_OFFSET + place * _core.USER_PARAMETERS
        parameters = tuple(replace(p, column=first + i) for i, p in enumerate(self.parameters))
        return replace(self, index=place, parameters=parameters)

    @property
    def bit(self) -> int:
        """The effect's bit in the core's mask; a user's effect has none."""
        return 0 if self.acts else 1 << self.index

    def core(self) -> tuple[Any, ...]:
        """What the core takes of a user's effect."""
        states = [(s.rate, s.decay, s.initial) for s in self.own_states]
        return self.index, [_channel_number(c) for c in self.channels], self.acts, states

    def car_with(self, vehicle: Vehicle, values: Mapping[str, float]) -> Vehicle:
        """Return what the effect makes of a vehicle, by its own equation.

        Parameters
        ----------
        vehicle : Vehicle
        values : mapping of str to float
            Of its parameters, by the names that they have in a model.

        Raises
        ------
        InvalidInput
            If no vehicle may have such numbers.
        """
        p = np.zeros(_core.PARAMETERS)
        inertia = vehicle.yaw_inertia_kgm2
        at = [b.name for b in base_parameters()].index("yaw_inertia_kgm2")
        p[at] = vehicle.usual_inertia_kgm2 if inertia is None else inertia
        for name, parameter in self.named.items():
            p[parameter.column] = values[name]
        core = _core.SingleTrack(vehicle_data(vehicle), self.bit, True)
        return vehicle.replace(**core.car(p))

    @property
    def columns(self) -> list[int]:
        """Places of its parameters in the core's parameter vector."""
        return [p.column for p in self.parameters]

    @property
    def named(self) -> dict[str, Parameter]:
        """Its parameters by the names that they have in a model."""
        return {f"{self.id}.{p.name}": p for p in self.parameters}

    @property
    def moved(self) -> frozenset[str]:
        """The measured channels that it moves first, one by one."""
        return frozenset(self.moves.split(", "))

    def is_like(self, other: Effect) -> bool:
        """Whether the catalogue says of either that it acts like the other."""
        return other.id in self.confounded_with or self.id in other.confounded_with

    @property
    def along_alone(self) -> bool:
        """Whether it moves the car along it and no other way, as a drag does."""
        return self.moved <= {"vx_mps", "ax_mps2"}

    @property
    def lateral_alone(self) -> bool:
        """Whether it moves the car sideways or turns it, and does nothing to its speed first."""
        return self.moved <= {"vy_mps", "yaw_rate_radps", "ay_mps2"}

    @property
    def felt_alone(self) -> bool:
        """Whether it changes what the accelerometer reads and nothing else, as its bias does.

        A force that both accelerations feel moves the speed or the yaw rate too.
        """
        return self.moved <= {"ax_mps2", "ay_mps2"}

    @property
    def scanned(self) -> Parameter | None:
        """Its parameter that means nothing while the effect is null, if there is one."""
        return next((p for p in self.parameters if p.scan), None)

    @property
    def form(self) -> str:
        """How it is scored without a refit; a refit always has the equation as it stands."""
        if self.scored_at_typical:
            return "scored by a step to the typical size: no derivative at the null value"
        if self.scanned is not None:
            return f"scored by its derivative at the null value, over a grid of {self.scanned.name}"
        return "scored by its derivative at the null value"

    def __str__(self) -> str:
        lines = [
            f"{self.id}: {self.title}",
            f"  equation    {self.equation}",
            f"  source      {self.source}",
        ]
        lines += [
            f"  parameter   {p.name} [{p.unit}], typically {p.typical:g} "
            f"({p.typical_low:g} to {p.typical_high:g}), matters from {p.matters:g}, "
            f"searched from {p.lower:g} to {p.upper:g}, none at {p.null_value:g}"
            for p in self.parameters
        ]
        lines += [
            f"  form        {self.form}",
            f"  excited by  {self.excited_by}",
            f"  moves first {self.moves}",
            f"  needs       {', '.join(self.needs)}",
        ]
        if self.confounded_with:
            lines.append(f"  acts like   {', '.join(self.confounded_with)}")
        if self.through:
            lines.append(f"  through     {self.through}")
        if self.breaks:
            lines.append(f"  breaks      laws of motion: {self.breaks}")
        if self.refines or self.on_request:
            beside = [f"beside {' or '.join(self.refines)}"] if self.refines else []
            named = ", or ".join([*beside, "where it is named among the candidates"])
            lines.append(f"  considered  {named}")
        if self.same_in_all_logs:
            lines.append("  nuisance    the same in all logs of a car")
        return "\n".join(lines)

    _repr_html_ = html_text


def _parameter(info: dict[str, Any], column: int) -> Parameter:
    return Parameter(**info, column=column)


@cache
def base_parameters() -> tuple[Parameter, ...]:
    """The baseline's parameters: eight tyre coefficients and the yaw inertia."""
    return tuple(_parameter(info, i) for i, info in enumerate(_core.base_parameters()))


@cache
def _by_id() -> dict[str, Effect]:
    found: dict[str, Effect] = {}
    for index, info in enumerate(_core.effects()):
        offset = info.pop("offset")
        parameters = tuple(_parameter(p, offset + i) for i, p in enumerate(info.pop("parameters")))
        found[info["id"]] = Effect(**info, parameters=parameters, index=index)
    return found


_users: dict[str, Effect] = {}
_channels: list[str] = []  # by their number in the core, for as long as the process lives


def channels_in_use() -> tuple[str, ...]:
    """Columns of logs that users' effects read, by their number in the core."""
    return tuple(_channels)


def _channel_number(name: str) -> int:
    if name not in _channels:
        if len(_channels) == _core.USER_CHANNELS:
            raise InvalidInput(
                f"channel '{name}': there is room for {_core.USER_CHANNELS} channels in one "
                f"process, taken by {', '.join(_channels)}; start another one"
            )
        _channels.append(name)
    return _channels.index(name)


def catalogue() -> tuple[Effect, ...]:
    """Every effect the software knows, in the core's order; those of users last."""
    return (*_by_id().values(), *_users.values())


def register(made: Effect) -> Effect:
    """Give a user's effect its place in the core's parameter vector.

    Raises
    ------
    InvalidInput
        All places are taken.
    """
    _users[made.id] = made.seated({e.index for e in _users.values() if e.id != made.id})
    return _users[made.id]


def of_users() -> tuple[Effect, ...]:
    """The effects that users have defined in this process."""
    return tuple(_users.values())


def know(others: Iterable[Effect]) -> None:
    """Take over effects that were defined in another process; those known here stay."""
    for other in others:
        if _users.get(other.id) != other:
            register(other)


def forget(name: str) -> None:
    """Remove a user's effect."""
    if name not in _users:
        raise InvalidInput(f"no effect of yours is called '{name}'{near_names(name, _users)}")
    del _users[name]


@typed
def effect(name: str | Effect) -> Effect:
    """The effect with this id.

    Raises
    ------
    InvalidInput
        No effect has this id; the message names the nearest ones.
    """
    if isinstance(name, Effect):
        return name
    expect(name, str, "effect")
    known = {**_by_id(), **_users}
    if name in known:
        return known[name]
    if plugins.run(name):
        if name in _users:
            return _users[name]
        raise InvalidInput(
            f"effect '{name}': a package names it in its entry points and does not define it"
        )
    found = [p.id for p in plugins.installed_effects()]
    raise InvalidInput(
        f"no effect is called '{name}'{near_names(name, [*known, *found])}; "
        "`sysid-vehicle effects` lists them"
    )
