"""Which effects a car may have, and of which size: beyond it they stand for something else."""

from __future__ import annotations

from collections.abc import Container, Iterable, Sequence
from dataclasses import replace
from typing import Protocol

import numpy as np

from ...effects import Effect, Parameter, catalogue
from ...identify import Estimate, Fit
from ...model import Model
from ...rules import USUAL, Rules


class Sized(Protocol):
    """What has parameters: an effect, or a change of one."""

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """In their order."""


Size = tuple[tuple[float, ...], tuple[float, ...]]
"""Parameters of an effect, and their standard errors."""

_AT_BOUND = 1e-5  # of the width between the bounds
OF_A_FACTOR = "_error"
"""Names of relative errors end so: what is multiplied by 1 + e."""


def considered(model: Model, candidates: Sequence[str | Effect] | None) -> tuple[Effect, ...]:
    """What may be added to a model: all that it lacks, or what is wanted of that.

    What refines another effect is among it only beside that, or where it is wanted, what is there
    on request only where it is. An effect that is given itself keeps the bounds that it has.
    """
    if candidates is None:
        return model.candidates
    wanted = {e.id: e for e in map(model.effect, candidates)}
    return tuple(_between(e, wanted[e.id]) for e in lacking(model, wanted))


def lacking(model: Model, names: Container[str]) -> tuple[Effect, ...]:
    """What a model lacks of these effects, those that are no candidates by themselves too."""
    others = (e for e in catalogue() if e.refines or e.on_request)
    asked = [model.effect(e) for e in others if e.id not in model.effects]
    known = {e.id: e for e in (*model.candidates, *model.seated(asked))}
    return tuple(sorted((e for e in known.values() if e.id in names), key=lambda e: e.index))


def beside_what_they_refine(finer: Iterable[Effect], model: Model) -> tuple[Effect, ...]:
    """Those of which a model has what they refine, or that have taken its place."""
    return tuple(e for e in finer if not {e.id, *e.refines}.isdisjoint(model.effects))


def refining() -> tuple[Effect, ...]:
    """Effects of the catalogue that refine others."""
    return tuple(e for e in catalogue() if e.refines)


def _between(e: Effect, given: Effect) -> Effect:
    """An effect at its place, within the bounds of the one that was given."""
    if e.parameters == given.parameters:
        return e
    both = zip(e.parameters, given.parameters, strict=True)
    return replace(e, parameters=tuple(replace(p, lower=g.lower, upper=g.upper) for p, g in both))


def refused(given: Effect, value: Sequence[float], model: Model) -> bool:
    """Whether a search ended at a bound that is narrower than the one of the catalogue.

    What was told beforehand refuses the value that was wanted: the effect stands for something
    else, of whatever size. `model` has the bounds of its car.
    """
    own = next((model.effect(e) for e in catalogue() if e.id == given.id), given)
    return any(
        (g.lower > p.lower and v < g.lower + _AT_BOUND * (g.upper - g.lower))
        or (g.upper < p.upper and v > g.upper - _AT_BOUND * (g.upper - g.lower))
        for p, g, v in zip(own.parameters, given.parameters, value, strict=True)
    )


def possible(
    effect: Sized, value: Sequence[float], std: Sequence[float], rules: Rules = USUAL
) -> bool:
    """Whether the 95 % intervals of an effect's parameters hold values that a car can have.

    A search that ends at a bound other than nothing wanted more than any car has. A factor can be
    as many times smaller as it can be larger: no car turns with a quarter of its yaw inertia.

    Parameters
    ----------
    effect : Effect, or another thing with parameters
    value, std : sequence of float
        Of its parameters, in their order.
    rules : Rules

    Returns
    -------
    bool
    """
    return not any(_impossible(p, d, s, rules) for p, d, s in sizes(effect, value, std, rules))


def possible_in(fit: Fit, effect: Effect, rules: Rules = USUAL) -> bool:
    """As `possible`, of the parameters of an effect of a fit.

    Where a bound holds a value that a car can have, it is asked of what the data lead to beyond it:
    a car whose value is that of the bound leads there by noise alone, half of the time.
    """
    asked = [_wanted(fit[n], p, rules) for n, p in effect.named.items()]
    return possible(effect, [v for v, _ in asked], [s for _, s in asked], rules)


def _wanted(found: Estimate, p: Parameter, rules: Rules) -> tuple[float, float]:
    off = found.value - p.null_value
    at_null = abs(off) < _AT_BOUND * (p.upper - p.lower)
    # At nothing no size was wanted. A bound may be further than any car, and a search that ends
    # there wanted that.
    if found.unbounded is None or at_null or _impossible(p, off, 0.0, rules):
        return found.value, found.std
    return found.unbounded


def sizes(
    effect: Sized, value: Sequence[float], std: Sequence[float], rules: Rules = USUAL
) -> list[tuple[Parameter, float, float]]:
    """Parameters that have a size, how far each is from nothing, and the reach of its interval."""
    return [
        (p, v - p.null_value, rules.interval * s)
        for p, v, s in zip(effect.parameters, value, std, strict=True)
        if not p.scan
    ]


def _impossible(p: Parameter, off: float, reach: float, rules: Rules) -> bool:
    most = rules.implausible * abs(p.typical - p.null_value)
    least = most / (1.0 + most) if p.name.endswith(OF_A_FACTOR) else most
    low, high = max(p.lower - p.null_value, -least), min(p.upper - p.null_value, most)
    if np.isinf(reach):
        at = _AT_BOUND * (p.upper - p.lower)
        return bool((low < 0.0 and off < low + at) or (high > 0.0 and off > high - at))
    return bool(off + reach < low or off - reach > high)
