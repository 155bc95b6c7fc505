"""What of a car may have changed: effects, tyres of an axle, its inertia, clocks of inputs."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..._common.arrays import FloatArray, as_float64
from ...effects import Effect, Parameter
from ...model import Model
from ...tyre import magic_formula
from ..candidates.clocks import Clock, clock_parameter
from ..candidates.possible import OF_A_FACTOR
from ..candidates.posterior import forms

YAW_INERTIA = "yaw_inertia_kgm2"
# Priors of changed tyres, as shares of their values; E is itself a share.
_TYRES = {"B": 0.2, "C": 0.1, "D": 0.15, "E": 0.5}
# A load changes these together, and counts as one change.
PAYLOAD = ("mass", "cg_position", "yaw_inertia")
# Of the largest slip that was driven, where side forces of tyres are compared.
_PARTS = (0.01, 0.25, 0.5, 0.75, 1.0)
_LARGEST_SLIP_RAD = 0.6
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
    usually : tuple of float
        A usual change, with the signs that its parameters have together.
    excited_by : str
        Driving that shows it; empty where the catalogue tells none.
    """

    id: str
    names: tuple[str, ...]
    parameters: tuple[Parameter, ...]
    forms: tuple[tuple[int, ...], ...]
    rivals: tuple[str, ...] = ()
    usually: tuple[float, ...] = ()
    excited_by: str = ""

    @property
    def scale(self) -> tuple[float, ...]:
        """Prior standard deviations."""
        return tuple(p.typical for p in self.parameters)

    @property
    def usual(self) -> dict[str, float]:
        """The same by name."""
        return dict(zip(self.names, self.scale, strict=True))


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
    usually = tuple(p.typical - p.null_value for p in e.parameters)
    several = tuple(difference(p, abs(u)) for p, u in zip(e.parameters, usually, strict=True))
    known = e.confounded_with, usually, e.excited_by
    return May(e.id, tuple(e.named), several, tuple(forms(e)), *known)


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


def room(m: May, model: Model) -> list[tuple[float, float]]:
    """Lowest and highest difference that leaves each parameter of a reference within its bounds.

    Where the model has none of them, the reference may have any value.
    """
    found = []
    for name, own in zip(m.names, m.parameters, strict=True):
        p = model.parameters.get(name)
        ends = (own.lower, own.upper)
        if p is not None:
            before = model.value(name)
            ends = change(name, before, p.lower), change(name, before, p.upper)
        found.append(ends)
    return found


def beyond(
    sizes: Sequence[float], reach: Sequence[float], ends: Sequence[tuple[float, float]]
) -> float:
    """Share of the differences of an effect that leads further than their ends and errors."""
    kept = 1.0
    for size, r, (low, high) in zip(sizes, reach, ends, strict=True):
        end = high + r if size > 0.0 else low - r
        if not low - r <= size <= high + r:
            kept = min(kept, max(end / size, 0.0))
    return 1.0 - kept


def within(least: float, most: float) -> float:
    """A change that is larger than any is none."""
    return least if least <= most else np.inf


def finite_std(std: float, ends: tuple[float, float]) -> float:
    """A standard error; infinite where it is larger than all that its parameter may be."""
    return std if std < ends[1] - ends[0] else np.inf


def forces_of_tyre(
    before: Sequence[float], change: Sequence[float], friction: float
) -> Iterator[tuple[float, tuple[FloatArray, FloatArray]]]:
    """By which share the side force of a tyre differs, from no slip to the largest one driven.

    Parameters
    ----------
    before, change : sequence of float, shape (4,)
        B, C, D, E of the reference, and their differences.
    friction : float
        The largest side force over the load that was driven.

    Yields
    ------
    share : float
    slopes : tuple of array, shape (4,)
        Its derivatives by the tyre as it is later, and by that of the reference.
    """
    known = as_float64(before)
    after = known + as_float64(change)
    slips = np.linspace(0.0, _LARGEST_SLIP_RAD, 500)[1:]
    forces = magic_formula(slips, *known)
    driven = float(slips[int(np.argmax(forces >= min(friction, float(forces.max()))))])
    for part in _PARTS:
        at = part * driven
        ratio = float(magic_formula(at, *after) / magic_formula(at, *known))
        yield ratio - 1.0, (ratio * _relative(at, after), -ratio * _relative(at, known))


def _relative(slip: float, tyre: FloatArray) -> FloatArray:
    """Derivatives of the logarithm of a side force by the coefficients of its tyre."""
    step = 1e-6 * np.maximum(np.abs(tyre), 0.1)
    sides = [(magic_formula(slip, *(tyre + d)), magic_formula(slip, *(tyre - d)))
             for d in np.diag(step)]  # fmt: skip
    return as_float64([(high - low) / (high + low) for high, low in sides] / step)
