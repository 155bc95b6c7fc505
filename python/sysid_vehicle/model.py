"""A car model: the single track with Magic Formula tyres, and the effects added to it.

Equations: `cpp/include/sysid/dynamics/single_track.hpp`.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from . import _core
from ._common.arguments import pair, real
from ._common.arrays import FloatArray
from ._common.text import html_text
from ._common.typed import typed, typed_fields
from .effects import Effect, Parameter, base_parameters, catalogue, effect, in_car
from .errors import InvalidInput
from .saved import save
from .tyre import TYRE_RANGES, Tyre
from .vehicle import Vehicle, vehicle_data

NUISANCES = (
    "steer_offset",
    "speed_sensor_misalignment",
    "accelerometer_bias",
    "gyro_bias",
    "road_bank",
)
"""Offsets that measured logs have, crossfall of the road among them."""

_YAW_INERTIA = "yaw_inertia_kgm2"


@dataclass(frozen=True)
class Setting:
    """What a user says of one parameter; None leaves it as the model has it.

    Attributes
    ----------
    free : bool, optional
        Whether driving has to tell it.
    bounds : tuple of 2 floats, optional
        Lower and upper bound, within those that the parameter has of itself.
    prior : tuple of 2 floats, optional
        Mean and standard deviation of what is known beforehand.
    """

    free: bool | None = None
    bounds: tuple[float, float] | None = None
    prior: tuple[float, float] | None = None


@dataclass(frozen=True)
class Model:
    """The baseline of a vehicle, with effects.

    Parameters
    ----------
    vehicle : Vehicle
        What is known beforehand; its tyres are starting values.
    effects : tuple of str
        Ids of the effects that act.
    parts : tuple of Effect
        The effects themselves, as they were defined when the model was made: a model keeps its
        own, whatever is defined or forgotten later. Those of `effects` that are not given here are
        looked up.
    settings : mapping of str to Setting
        Which parameters are fixed or free, bounded, or have a prior, by full name; most easily
        said by `with_fixed`, `with_free`, `with_bounds` and `with_priors`.
    values : mapping of str to float
        Values of parameters by full name (`B_front`, `steer_lag.time_constant_s`), where they
        differ from the vehicle's, or from the null values of effects.
    """

    vehicle: Vehicle
    effects: tuple[str, ...] = ()
    values: Mapping[str, float] = field(default_factory=dict)
    parts: tuple[Effect, ...] = field(default=(), repr=False)
    settings: Mapping[str, Setting] = field(default_factory=dict)

    @typed_fields
    def __post_init__(self) -> None:
        vehicle: object = self.vehicle
        if not isinstance(vehicle, Vehicle):
            raise InvalidInput(
                f"a model is made of a Vehicle, not of {type(vehicle).__name__}; "
                "Vehicle.from_toml reads one"
            )
        names: object = self.effects
        if isinstance(names, str):
            raise InvalidInput(f"effects = {names!r}: give a tuple of names")
        own = {e.id: e for e in self.parts}
        found = [self.effect(own.get(e) or e) for e in self.effects]
        ids = tuple(e.id for e in found)
        if len(set(ids)) != len(ids):
            raise InvalidInput(f"an effect is named twice: {', '.join(ids)}")
        taken: set[int] = set()
        object.__setattr__(self, "effects", ids)
        object.__setattr__(self, "parts", tuple(e.seated(taken) for e in found))
        object.__setattr__(self, "values", dict(self.values))
        known = self.names
        object.__setattr__(self, "settings", dict(self.settings))
        for n in (*self.values, *self.settings):
            if n not in known:
                raise InvalidInput(f"the model has no parameter '{n}'; it has {', '.join(known)}")
            if real(self.values.get(n, 0.0)) is None:
                raise InvalidInput(f"{n} = {self.values[n]!r}: give a finite number")
        for name, told in self.settings.items():
            self._check_setting(name, told)

    def add(self, *names: str | Effect) -> Model:
        """The same model with more effects, at their null values."""
        new = [self.effect(n) for n in names]
        return replace(
            self, effects=(*self.effects, *(e.id for e in new)), parts=(*self.parts, *new)
        )

    def effect(self, name: str | Effect) -> Effect:
        """An effect with the sizes that it has in this car.

        Raises
        ------
        InvalidInput
            No effect has this id; the message names the nearest ones.
        """
        car = self.vehicle
        return in_car(effect(name), wheelbase_m=car.wheelbase_m, mass_kg=car.mass_kg)

    def drop(self, *names: str | Effect) -> Model:
        """The same model with fewer effects."""
        gone = {n if n in self.effects else effect(n).id for n in names}
        kept = tuple(e for e in self.effects if e not in gone)
        values = {k: v for k, v in self.values.items() if k.split(".")[0] not in gone}
        settings = {k: v for k, v in self.settings.items() if k.split(".")[0] not in gone}
        return replace(self, effects=kept, values=values, settings=settings)

    @typed
    def with_values(self, values: Mapping[str, float]) -> Model:
        """The same model with some parameters at other values."""
        return replace(self, values={**self.values, **values})

    def with_fixed(self, what: Mapping[str, float] | Iterable[str]) -> Model:
        """The same model with some parameters known: at given values, or where they stand."""
        values = dict(what) if isinstance(what, Mapping) else {}
        names = [what] if isinstance(what, str) else list(what)
        fixed = {n: Setting(free=False) for n in names}
        return replace(self, values={**self.values, **values}, settings={**self.settings, **fixed})

    def with_free(self, names: Iterable[str]) -> Model:
        """The same model with some parameters for driving to tell, a known yaw inertia too."""
        several = [names] if isinstance(names, str) else list(names)
        return self._with_settings({n: {"free": True} for n in several})

    def with_bounds(self, bounds: Mapping[str, tuple[float, float]]) -> Model:
        """The same model with narrower bounds of some parameters, (lower, upper)."""
        return self._with_settings({n: {"bounds": pair} for n, pair in bounds.items()})

    def with_priors(self, priors: Mapping[str, tuple[float, float]]) -> Model:
        """The same model with some parameters roughly known: (mean, standard deviation)."""
        return self._with_settings({n: {"prior": pair} for n, pair in priors.items()})

    def with_nuisances(self, names: Iterable[str] = NUISANCES) -> Model:
        """The same model with effects that are known to be there, about as large as usual.

        They are marginalised: each of their parameters has a normal prior about its null value
        whose standard deviation is the typical size in the catalogue, every fit has them, and a
        study neither names nor drops them.
        """
        several = [names] if isinstance(names, str) else list(dict.fromkeys(names))
        model = self.add(*(n for n in several if n not in self.effects))
        return model.with_priors(
            {
                name: (p.null_value, abs(p.typical - p.null_value))
                for e in model.parts
                if e.id in several
                for name, p in e.named.items()
            }
        )

    @property
    def nuisances(self) -> tuple[str, ...]:
        """Effects of which every parameter has a prior about its null value."""
        priors = self.priors
        about = {n for n, (mean, _) in priors.items() if mean == self.parameters[n].null_value}
        return tuple(e.id for e in self.parts if about.issuperset(e.named))

    @property
    def offset_names(self) -> tuple[str, ...]:
        """Full names of those effects' parameters of which each log has its own."""
        shared = {e.id for e in self.parts if e.same_in_all_logs}
        own = set(self.nuisances) - shared
        return tuple(n for n in self.free_names if n.split(".")[0] in own)

    def _with_settings(self, changes: Mapping[str, Mapping[str, Any]]) -> Model:
        told = dict(self.settings)
        for name, change in changes.items():
            told[name] = replace(told.get(name, Setting()), **change)
        return replace(self, settings=told)

    def _check_known(self, name: str) -> None:
        if not np.isfinite(number := self.value(name)):
            raise InvalidInput(f"{name} = {number!r}: give a finite number")
        of_tyre = TYRE_RANGES.get(name[0]) if name[1:] in ("_front", "_rear") else None
        if of_tyre and (wrong := of_tyre.complaint(name, number)):
            raise InvalidInput(wrong)

    def _check_setting(self, name: str, told: Setting) -> None:
        if (told.bounds or told.prior) and name not in self.free_names:
            raise InvalidInput(
                f"{name} has bounds or a prior but is not free; with_free(['{name}']) frees it"
            )
        if told.free is False:
            self._check_known(name)
        own = self._own_bounds(name)
        if told.bounds is not None:
            low, high = pair(told.bounds, f"bounds of {name}", "(lower, upper)")
            if not own[0] <= low < high <= own[1]:
                raise InvalidInput(
                    f"bounds of {name} are {low:g} .. {high:g}; give (lower, upper) within "
                    f"{own[0]:g} .. {own[1]:g}"
                )
        if told.prior is not None:
            low, high = self.bounds(name)
            mean, std = pair(told.prior, f"prior of {name}", "(mean, standard deviation)")
            if not (low <= mean <= high and 0.0 < std < np.inf):
                raise InvalidInput(
                    f"the prior of {name} is {mean:g} +- {std:g}; give (mean, standard deviation), "
                    f"the mean within {low:g} .. {high:g} and the deviation above zero"
                )

    @property
    def priors(self) -> dict[str, tuple[float, float]]:
        """Means and standard deviations of the free parameters that have a prior."""
        return {n: told.prior for n, told in self.settings.items() if told.prior is not None}

    def save(self, path: str | Path) -> None:
        """Write the model; :func:`sysid_vehicle.load` reads it.

        Raises
        ------
        InvalidInput
            If the file cannot be written.
        """
        save(self, path)

    @property
    def parameters(self) -> dict[str, Parameter]:
        """Parameters by full name, those of the baseline first."""
        own = {name: p for e in self.parts for name, p in e.named.items()}
        return {p.name: p for p in base_parameters()} | own

    @property
    def names(self) -> tuple[str, ...]:
        """Full names of all parameters."""
        return tuple(self.parameters)

    @property
    def free_names(self) -> tuple[str, ...]:
        """Parameters that driving has to tell.

        Tyres, effects, and a yaw inertia nobody knows, unless `settings` say otherwise.
        """
        known = self.vehicle.yaw_inertia_kgm2 is not None
        told = {n: s.free for n, s in self.settings.items() if s.free is not None}
        return tuple(n for n in self.names if told.get(n, not (known and n == _YAW_INERTIA)))

    @property
    def sought(self) -> tuple[Effect, ...]:
        """Effects that driving has something to tell of, each with its free parameters alone.

        What is known of the car, with values that are fixed, is not among them.
        """
        free = set(self.free_names)
        return tuple(
            e
            if free.issuperset(e.named)
            else replace(e, parameters=tuple(p for n, p in e.named.items() if n in free))
            for e in self.parts
            if not free.isdisjoint(e.named)
        )

    @property
    def channels(self) -> tuple[str, ...]:
        """Columns that a log must have beside the canonical ones: effects of users read them."""
        return tuple(dict.fromkeys(c for e in self.parts for c in e.channels))

    def refuse_channels(self, where: str) -> None:
        """Refuse a model that reads columns of a log where there is none.

        Raises
        ------
        InvalidInput
            An effect reads a column; the message names it.
        """
        for e in self.parts:
            if e.channels:
                raise InvalidInput(
                    f"{where}: there is no log, and the effect {e.id} reads the column "
                    f"{e.channels[0]}; drop the effect"
                )

    @property
    def candidates(self) -> tuple[Effect, ...]:
        """Effects of the catalogue that are considered where no others are named."""
        unknown_inertia = _YAW_INERTIA in self.free_names
        return self.seated(
            self.effect(e)
            for e in catalogue()
            if not (e.on_request or e.id in self.effects)
            and (not e.refines or {*e.refines} & {*self.effects})
            and not (unknown_inertia and e.id == "yaw_inertia")
        )

    def seated(self, others: Iterable[Effect]) -> tuple[Effect, ...]:
        """Other effects at places of the parameter vector that those of the model leave free.

        Raises
        ------
        InvalidInput
            There are more effects of users than places.
        """
        taken = {e.index for e in self.parts if e.acts}
        return tuple(e.seated(taken) for e in others)

    def bounds(self, name: str) -> tuple[float, float]:
        """Lower and upper bound of a parameter."""
        told = self.settings.get(name, Setting()).bounds
        return self._own_bounds(name) if told is None else told

    def _own_bounds(self, name: str) -> tuple[float, float]:
        p = self.parameters[name]
        if name == _YAW_INERTIA:
            guess = self.vehicle.usual_inertia_kgm2
            return 0.2 * guess, 5.0 * guess
        return p.lower, p.upper

    def value(self, name: str) -> float:
        """The value a parameter has in this model."""
        if name in self.values:
            return float(self.values[name])
        if name == _YAW_INERTIA:
            given = self.vehicle.yaw_inertia_kgm2
            return given if given is not None else self.vehicle.usual_inertia_kgm2
        if "." in name:
            return self.parameters[name].null_value
        letter, axle = name.split("_")
        return float(getattr(self.tyre_of_vehicle(axle), letter))

    def tyre_of_vehicle(self, axle: str) -> Tyre:
        """Starting values of the tyre of an axle, `front` or `rear`."""
        return self.vehicle.tyre_front if axle == "front" else self.vehicle.tyre_rear

    def tyre(self, axle: str) -> Tyre:
        """The tyre that an axle, `front` or `rear`, has in this model."""
        return Tyre(*(self.value(f"{letter}_{axle}") for letter in "BCDE"))

    def vector(self, also: Iterable[Effect] = ()) -> FloatArray:
        """The core's parameter vector; effects that do not act stand at their null values."""
        p = np.zeros(_core.PARAMETERS)
        for e in (*catalogue(), *also):
            for parameter in e.parameters:
                p[parameter.column] = parameter.null_value
        for name, parameter in self.parameters.items():
            p[parameter.column] = self.value(name)
        return p

    def from_vector(self, p: FloatArray) -> Model:
        """The model with the free parameters taken from a core vector."""
        columns = self.parameters
        return self.with_values({n: float(p[columns[n].column]) for n in self.free_names})

    def core(self, *, force_known: bool = True, also: Iterable[Effect] = ()) -> _core.SingleTrack:
        """The compiled model, with effects `also` switched on."""
        data = vehicle_data(self.vehicle)
        acting = (*self.parts, *also)
        mask = 0
        for e in acting:
            mask |= e.bit
        users = [e for e in acting if e.acts]
        if sum(e.states for e in users) > _core.USER_STATES:
            raise InvalidInput(
                f"{', '.join(e.id for e in users if e.states)}: together they have more than the "
                f"{_core.USER_STATES} states that effects of your own may have in a model; drop one"
            )
        return _core.SingleTrack(data, mask, force_known, [e.core() for e in users])

    def __str__(self) -> str:
        what = ", ".join(self.effects) if self.effects else "baseline"
        lines = [f"{self.vehicle.name}: single track with Magic Formula tyres, {what}"]
        free = set(self.free_names)
        for name, p in self.parameters.items():
            note = "" if name in free else "  (given)"
            lines.append(f"  {name:34s} {self.value(name):12.6g} {p.unit}{note}")
        return "\n".join(lines)

    _repr_html_ = html_text
