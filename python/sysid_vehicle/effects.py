"""The catalogue of physical effects, as the compiled core declares it.

Each effect's equation, parameters and null values have their home in `cpp/include/sysid/effects/`;
nothing is repeated here.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from html import escape
from typing import Any

from . import _core
from .errors import InvalidInput, near_names

__all__ = ["Effect", "Parameter", "base_parameters", "catalogue", "effect"]


@dataclass(frozen=True)
class Parameter:
    """One parameter: its unit, its box, the value that changes nothing, and telling sizes.

    Attributes
    ----------
    null_value : float
        Value at which the model is exactly the one without the effect.
    typical, matters : float
        A size met in practice, and the smallest one worth acting on.
    lower, upper : float
        Bounds of the search.
    column : int
        Place in the core's parameter vector.
    """

    name: str
    unit: str
    null_value: float
    typical: float
    matters: float
    lower: float
    upper: float
    column: int

    @property
    def one_sided(self) -> bool:
        """Whether the null value lies on a bound, so that only one sign is possible."""
        return self.null_value in (self.lower, self.upper)


@dataclass(frozen=True)
class Effect:
    """A physical effect that a model may lack.

    Attributes
    ----------
    index : int
        Place in the catalogue.
    moves : str
        Measured channels it moves first.
    excited_by : str
        Driving that shows it.
    scored_at_typical : bool
        The derivative at the null value does not exist; scored at the typical size.
    needs_force : bool
        Visible only where the total wheel force was logged.
    """

    id: str
    title: str
    equation: str
    source: str
    excited_by: str
    moves: str
    parameters: tuple[Parameter, ...]
    index: int
    scored_at_typical: bool
    needs_force: bool

    @property
    def bit(self) -> int:
        """The effect's bit in the core's mask."""
        return 1 << self.index

    @property
    def columns(self) -> list[int]:
        """Places of its parameters in the core's parameter vector."""
        return [p.column for p in self.parameters]

    def __str__(self) -> str:
        lines = [
            f"{self.id}: {self.title}",
            f"  equation    {self.equation}",
            f"  source      {self.source}",
        ]
        lines += [
            f"  parameter   {p.name} [{p.unit}], typically {p.typical:g}, "
            f"searched from {p.lower:g} to {p.upper:g}"
            for p in self.parameters
        ]
        lines += [f"  excited by  {self.excited_by}", f"  moves first {self.moves}"]
        return "\n".join(lines)

    def _repr_html_(self) -> str:
        return f"<pre>{escape(str(self))}</pre>"


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


def catalogue() -> tuple[Effect, ...]:
    """Every effect the software knows, in the core's order."""
    return tuple(_by_id().values())


def effect(name: str | Effect) -> Effect:
    """The effect with this id.

    Raises
    ------
    InvalidInput
        No effect has this id; the message names the nearest ones.
    """
    if isinstance(name, Effect):
        return name
    known = _by_id()
    if name not in known:
        raise InvalidInput(
            f"no effect is called '{name}'{near_names(name, known)}; "
            "`sysid-vehicle effects` lists them"
        )
    return known[name]
