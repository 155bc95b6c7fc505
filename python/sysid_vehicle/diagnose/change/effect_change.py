"""What is said of one thing that may have changed, and of a load."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from ..._common.text import few, number, unit_after, with_error

Said = Literal[
    "changed",
    "one of a group",
    "implausible",
    "negligible",
    "likely",
    "unchanged",
    "not testable",
    "not tried",
]

_NAMED: tuple[Said, ...] = ("changed", "one of a group")


def _signed(value: float, std: float, unit: str) -> str:
    if not np.isfinite(std):
        return "not shown by this driving"
    told = with_error(value, std) + unit
    return told if told.startswith("-") else f"+{told}"


def _finite(value: float | None) -> float | None:
    return value if value is not None and np.isfinite(value) else None


@dataclass(frozen=True)
class EffectChange:
    """By how much an effect, or the tyres of an axle, differ from the reference.

    Attributes
    ----------
    id : str
        Of the effect; `tyre_front`, `tyre_rear` of the tyres that are fitted.
    names, units : tuple of str
        Of its parameters.
    value, std : tuple of float
        Differences of its parameters and their standard errors, beside what else changed; of one of
        a group that another one leads, in the place of that one. Infinite errors are larger than
        all that a parameter may be: this driving does not show it.
    bound : tuple of float
        How far from nothing each difference may be, at 95 %.
    least : tuple of float
        Of each parameter, were it alone, the smallest difference that this driving would have named
        with a probability of 95 %; infinite where it would have named none.
    probability : float, optional
        Of being among what changed; None where this driving does not tell it, and where it tells
        that it is unchanged.
    said : str
        `changed`; `one of a group` that explain the driving as well; `implausible`: it acts like
        what changed, with a size that no car has; `negligible`; `likely`, as something changed and
        no effect is shown by itself; `unchanged`, with a bound below what matters; `not testable`
        with this driving; or `not tried`, as the time limit left it out.
    group : tuple of str
        The others of the group.
    stiffness : tuple of float, optional
        Of tyres, by which share of the reference their cornering stiffness at the same load
        differs, and its standard error: driving tells it long before B, C, D and E one by one.
    least_stiffness : float, optional
        Of tyres, what `least` is of parameters: the smallest such share that would be named.
    weak : bool
        Whether this driving tells too little of a change of usual size to name it, though nothing
        else were known to do the same.
    imitated_by : tuple of str
        What explains a change of usual size as well in this driving, the best first; none of one
        that is weak.
    excited_by : str
        Driving that shows it; empty where the catalogue tells none.
    """

    id: str
    names: tuple[str, ...]
    units: tuple[str, ...]
    value: tuple[float, ...]
    std: tuple[float, ...]
    bound: tuple[float, ...]
    probability: float | None
    said: Said
    group: tuple[str, ...] = ()
    least: tuple[float, ...] = ()
    stiffness: tuple[float, float] | None = None
    least_stiffness: float | None = None
    weak: bool = False
    imitated_by: tuple[str, ...] = ()
    excited_by: str = ""

    @property
    def named(self) -> bool:
        """Whether it is named, perhaps as one of a group."""
        return self.said in _NAMED

    @property
    def size(self) -> str:
        """The differences with standard errors, in words.

        Of tyres the stiffness, and those of B, C, D and E that are off nothing one by one: together
        they may be known where none of them is.
        """
        figures = zip(self.value, self.std, map(unit_after, self.units), strict=True)
        told = [f"{n} {_signed(*f)}" for n, f in zip(self.names, figures, strict=True)]
        if self.stiffness is None:
            return ", ".join(told)
        value, std = (100.0 * x for x in self.stiffness)
        off = (b < 2.0 * abs(v) for v, b in zip(self.value, self.bound, strict=True))
        seen = (t for t, shown in zip(told, off, strict=True) if shown)
        return ", ".join((f"cornering stiffness {_signed(value, std, ' %')}", *seen))

    @property
    def sure(self) -> str:
        """Its probability in words: of a change that is beyond doubt no more than 99 %."""
        if self.probability is None:
            return ""
        return f"{min(int(100.0 * self.probability), 99)} % sure"

    @property
    def sentence(self) -> str:
        """What is said of it, in words."""
        if self.said == "one of a group":
            return f"changed; confounded with {', '.join(self.group)}"
        if self.said == "implausible":
            return "significant, but the change is physically implausible"
        if self.said in ("likely", "unchanged", "not testable", "not tried"):
            words = {"likely": "likely, but not shown", "not tried": "not tried in time"}
            what = words.get(self.said, self.said)
            if self.stiffness is not None:
                return f"{what}; {self.power}"
            bounds = zip(self.names, self.bound, self.units, strict=True)
            below = ", ".join(f"{n} below {number(b, 2)}{unit_after(u)}" for n, b, u in bounds)
            hidden = self.hidden if self.said == "not testable" else ""
            return "; ".join(filter(None, (f"{what}: {below} at 95 %", self.power, hidden)))
        return self.said

    @property
    def power(self) -> str:
        """Which size of change this driving would show, in words."""
        if self.least_stiffness is not None:
            if not np.isfinite(self.least_stiffness):
                return "no cornering stiffness would be seen to change"
            least = number(100.0 * self.least_stiffness, 2 if self.least_stiffness < 1.0 else 3)
            return f"its cornering stiffness is seen to change from {least} % on"
        seen = [
            f"{n} {number(least, 2)}{unit_after(u)}"
            for n, least, u in zip(self.names, self.least, self.units, strict=True)
            if np.isfinite(least)
        ]
        if not seen:
            return "no change of it would be seen"
        told = f"seen from {', '.join(seen)} on"
        large = zip(self.value, self.least, strict=True)
        if self.named or all(abs(value) < least for value, least in large):
            return told
        return f"{told} by itself; it is larger, and not shown beside what else may have changed"

    @property
    def hidden(self) -> str:
        """Why this driving does not name a change of usual size, and which would, in words."""
        told = ""
        if self.imitated_by:
            told = f"a usual change is confounded with {few(self.imitated_by)}"
        asked = f"excited by {self.excited_by}" if self.excited_by and (told or self.weak) else ""
        return "; ".join(filter(None, (told, asked)))

    def to_dict(self) -> dict[str, Any]:
        """All figures, ready for JSON."""
        figures = (self.value, self.std, self.bound, self.least, self.units)
        return {
            "said": self.said,
            "probability": self.probability,
            "group": list(self.group),
            "stiffness": None if self.stiffness is None else [*map(_finite, self.stiffness)],
            "least_stiffness": _finite(self.least_stiffness),
            "weak": self.weak,
            "imitated_by": list(self.imitated_by),
            "excited_by": self.excited_by,
            "change": {
                n: {
                    "value": v,
                    "std": _finite(s),
                    "bound": _finite(b),
                    "least": _finite(m),
                    "unit": u,
                }
                for n, v, s, b, m, u in zip(self.names, *figures, strict=True)
            },
        }

    def __str__(self) -> str:
        return f"{self.id}: {self.size}"


@dataclass(frozen=True)
class LoadChange:
    """A load that was put into the car, or taken out of it.

    Attributes
    ----------
    mass_kg, mass_std_kg : float
        Negative where it was taken out.
    rearward_m, rearward_std_m : float
        How far behind the centre of gravity of the car without the change, and standard error.
    """

    mass_kg: float
    mass_std_kg: float
    rearward_m: float
    rearward_std_m: float

    def __str__(self) -> str:
        what = "a load of" if self.mass_kg > 0.0 else "taking out"
        where = "behind" if self.rearward_m > 0.0 else "ahead of"
        mass = with_error(abs(self.mass_kg), self.mass_std_kg)
        place = with_error(abs(self.rearward_m), self.rearward_std_m)
        return f"{what} {mass} kg, {place} m {where} the centre of gravity,"
