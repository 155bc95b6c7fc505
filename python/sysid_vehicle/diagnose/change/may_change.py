"""What of a car may have changed: effects, tyres of an axle, its inertia, clocks of inputs."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

from ...effects import Effect, Parameter
from ...model import Model
from ..candidates.clocks import Clock, clock_parameter
from ..candidates.possible import OF_A_FACTOR
from ..candidates.posterior import forms

YAW_INERTIA = "yaw_inertia_kgm2"
# Priors of changed tyres, as shares of their values; E is itself a share.
_TYRES = {"B": 0.2, "C": 0.1, "D": 0.15, "E": 0.5}
# A load changes these together, and counts as one change.
PAYLOAD = ("mass", "cg_position", "yaw_inertia")
_INERTIA = 0.25  # the same of a yaw inertia that nobody knows


@dataclass(frozen=True)
class May:
    """What may have changed: an effect, the tyres of an axle, the clock of an input.

    Attributes
    ----------
    names : tuple of str
        Columns of `Side`.
    parameters : tuple of Parameter
        The differences: nothing at zero, of either sign, typically as large as the effect itself.
    forms : tuple of tuple of int
        Which of them may change together.
    rivals : tuple of str
        What acts like it in most driving.
    """

    id: str
    names: tuple[str, ...]
    parameters: tuple[Parameter, ...]
    forms: tuple[tuple[int, ...], ...]
    rivals: tuple[str, ...] = ()

    @property
    def scale(self) -> tuple[float, ...]:
        """Prior standard deviations."""
        return tuple(p.typical for p in self.parameters)


def as_one(put: Iterable[str]) -> list[tuple[str, ...]]:
    """What was put in, one by one; with a payload as one change."""
    several = tuple(put)
    if not set(PAYLOAD) <= set(several):
        return [(e,) for e in several]
    return [PAYLOAD, *((e,) for e in several if e not in PAYLOAD)]


def difference(p: Parameter, usual: float) -> Parameter:
    """A change of a parameter, usually so large, as a parameter."""
    width = p.upper - p.lower
    return replace(p, null_value=0.0, typical=usual, lower=-width, upper=width)


def change(name: str, before: float, after: float) -> float:
    """By how much a parameter changed; relative errors multiply."""
    if name.endswith(OF_A_FACTOR):
        return (1.0 + after) / (1.0 + before) - 1.0
    return after - before


def of_effect(e: Effect) -> May:
    """An effect of the catalogue or of a user."""
    several = tuple(difference(p, abs(p.typical - p.null_value)) for p in e.parameters)
    return May(e.id, tuple(e.named), several, tuple(forms(e)), e.confounded_with)


def of_tyre(model: Model, axle: str) -> May:
    """The fitted tyres of an axle."""
    known = model.parameters
    names = tuple(f"{letter}_{axle}" for letter in _TYRES)
    usual = (
        share * (1.0 if letter == "E" else abs(model.value(f"{letter}_{axle}")))
        for letter, share in _TYRES.items()
    )
    several = tuple(difference(known[n], u) for n, u in zip(names, usual, strict=True))
    return May(f"tyre_{axle}", names, several, ((0, 1, 2, 3),))


def of_inertia(model: Model) -> May:
    """A yaw inertia that is fitted."""
    usual = _INERTIA * model.value(YAW_INERTIA)
    changed_by = difference(model.parameters[YAW_INERTIA], usual)
    return May(YAW_INERTIA, (YAW_INERTIA,), (changed_by,), ((0,),))


def of_clock(clock: Clock) -> May:
    """The clock of an input."""
    return May(clock.name, (clock.name,), (clock_parameter(clock),), ((0,),))
