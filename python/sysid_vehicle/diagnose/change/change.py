"""What changed between a reference and later driving: the result of `changed`."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from ..._common.printed import Part, Printed, Table
from ..._common.tables import frame
from ..._common.text import brief, number, unit_after, with_error
from ...identify import Fit
from ...rules import Rules
from ..candidates.causes import UNKNOWN, Causes, CredibleSet
from .pieces import Alike

Said = Literal[
    "changed",
    "one of a group",
    "implausible",
    "negligible",
    "unchanged",
    "not testable",
]

_NAMED: tuple[Said, ...] = ("changed", "one of a group")


def _signed(value: float, std: float) -> str:
    told = with_error(value, std)
    return told if told.startswith("-") else f"+{told}"


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
        Differences of its parameters and their standard errors, beside what else changed.
    bound : tuple of float
        How far from nothing each difference may be, at 95 %.
    least : tuple of float
        Of each parameter, were it alone, the smallest difference that this driving would have named
        with a probability of 95 %; infinite where it would have named none.
    probability : float
        Of being among what changed.
    said : str
        `changed`; `one of a group` that explain the driving as well; `implausible`: it acts like
        what changed, with a size that no car has; `negligible`; `unchanged`, with a bound below
        what matters; or `not testable` with this driving.
    group : tuple of str
        The others of the group.
    stiffness : tuple of float, optional
        Of tyres, by which share of the reference their cornering stiffness at the same load
        differs, and its standard error: driving tells it long before B, C, D and E one by one.
    """

    id: str
    names: tuple[str, ...]
    units: tuple[str, ...]
    value: tuple[float, ...]
    std: tuple[float, ...]
    bound: tuple[float, ...]
    probability: float
    said: Said
    group: tuple[str, ...] = ()
    least: tuple[float, ...] = ()
    stiffness: tuple[float, float] | None = None

    @property
    def named(self) -> bool:
        """Whether it is named, perhaps as one of a group."""
        return self.said in _NAMED

    @property
    def size(self) -> str:
        """The differences with standard errors, in words."""
        told = [_signed(v, s) for v, s in zip(self.value, self.std, strict=True)]
        if self.stiffness is None:
            return self._listed(told)
        value, std = (100.0 * x for x in self.stiffness)
        return f"cornering stiffness {_signed(value, std)} %, {self._listed(told)}"

    @property
    def sure(self) -> str:
        """Its probability in words: of a change that is beyond doubt no more than 99 %."""
        return f"{min(int(100.0 * self.probability), 99)} % sure"

    @property
    def sentence(self) -> str:
        """What is said of it, in words."""
        if self.said == "one of a group":
            return f"changed; confounded with {', '.join(self.group)}"
        if self.said == "implausible":
            return "significant, but the change is physically implausible"
        if self.said in ("unchanged", "not testable"):
            below = self._listed([f"below {number(b, 2)}" for b in self.bound])
            return f"{self.said}: {below} at 95 %"
        return self.said

    def _listed(self, figures: list[str]) -> str:
        told = zip(self.names, figures, self.units, strict=True)
        return ", ".join(f"{n} {x}{unit_after(u)}" for n, x, u in told)

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


@dataclass(frozen=True, eq=False)
class Change(Printed):
    """What changed since the reference.

    Attributes
    ----------
    before : Fit
        The reference.
    after : Fit
        Its model with the changes that were found, on the later driving, under the noise of the
        reference; nothing else was fitted to the later driving alone.
    causes : Causes
        Posterior of a sum of single changes: inclusion probabilities, credible sets. What begins
        with `unknown` is a change that no effect of the catalogue explains.
    effects : tuple of EffectChange
        What is named first, then by probability.
    alike : Alike
        How like the reference the later driving is; where it is not, intervals are as much wider
        as estimates differ between pieces of the reference.
    rules : Rules
    """

    before: Fit
    after: Fit
    causes: Causes
    effects: tuple[EffectChange, ...]
    alike: Alike
    rules: Rules

    __iter__ = None  # numbers are no names

    def __getitem__(self, effect: str) -> EffectChange:
        for e in self.effects:
            if e.id == effect:
                return e
        raise KeyError(f"'{effect}'; there are {', '.join(e.id for e in self.effects)}")

    @property
    def named(self) -> tuple[EffectChange, ...]:
        """What may be called changed, the likeliest first; rivals follow each other."""
        return tuple(e for e in self.effects if e.named)

    @property
    def unknown(self) -> tuple[CredibleSet, ...]:
        """Changes that are there and that no effect of the catalogue explains."""
        return tuple(s for s in self.causes.sets if s.effects[0].startswith(UNKNOWN))

    @property
    def load(self) -> LoadChange | None:
        """The load that changes mass and centre of gravity as they are named; None without both."""
        named = {e.id: e for e in self.named}
        if not {"mass", "cg_position"} <= set(named):
            return None
        before = self.before.model
        own = "mass.relative_error"
        mass = before.vehicle.mass_kg
        mass *= 1.0 + (before.value(own) if own in before.parameters else 0.0)
        (more,), (more_std,) = named["mass"].value, named["mass"].std
        (back,), (back_std,) = named["cg_position"].value, named["cg_position"].std
        # The whole is in balance: (m + load) shift = load place.
        place = back * (1.0 + more) / more
        std = np.hypot(back_std * (1.0 + more) / more, back * more_std / more**2)
        return LoadChange(mass * more, mass * more_std, place, float(std))

    def _headline(self) -> str:
        leading = [e for e in self.named if not any(self._before(g, e) for g in e.group)]
        told = [
            f"{e} ({'; confounded with '.join(filter(None, (e.sure, ', '.join(e.group))))})"
            for e in leading
        ]
        what = f"changed: {'; '.join(told)}" if told else ""
        if self.unknown:
            kinds = ", ".join(s.effects[0].removeprefix(UNKNOWN) for s in self.unknown)
            more = f"something changed that no effect explains, in {kinds}"
            return f"{what}; beside it {more}" if what else more
        if what:
            return what
        likely = [f"{e.id} ({e.sure})" for e in self.effects if e.probability > 0.5]
        if likely:
            return (
                f"no single change is significant; something changed, likeliest {', '.join(likely)}"
            )
        return "no change is shown"

    def _before(self, effect: str, e: EffectChange) -> bool:
        order = [one.id for one in self.named]
        return effect in order and order.index(effect) < order.index(e.id)

    _HEAD = ("what", "by how much", "how sure", "")

    def _rows(self, most: int = 8) -> list[list[str]]:
        few = self.effects[: max(most, len(self.named))]
        return [[e.id, e.size, e.sure.removesuffix(" sure"), e.sentence] for e in few]

    __repr__ = brief

    def _parts(self) -> list[Part]:
        other = (
            f"{self.alike}: intervals hold what estimates differ by between pieces of the "
            "reference, and what the model lacks beyond them may look like a change; drive the "
            "same again to be sure"
        )
        told = [other] if self.alike.beyond > self.rules.taken else []
        if self.load is not None:
            told.insert(0, f"mass and centre of gravity: as {self.load} would change them")
        return [self._headline(), *told, Table(self._HEAD, self._rows())]

    def to_pandas(self) -> Any:
        """A DataFrame of all parameters, by effect and parameter."""
        rows = [
            (f"{e.id}.{n}", v, s, b, m, u, e.probability, e.said)
            for e in self.effects
            for n, v, s, b, m, u in zip(
                e.names, e.value, e.std, e.bound, e.least, e.units, strict=True
            )
        ]
        head = ("parameter", "change", "std", "bound", "least", "unit", "probability", "said")
        columns = {h: [row[i] for row in rows] for i, h in enumerate(head)}
        return frame(columns, "parameter")

    def to_dict(self) -> dict[str, Any]:
        """All figures, ready for JSON."""
        return {
            "headline": self._headline(),
            "beyond": self.alike.beyond,
            "causes": self.causes.to_dict(),
            "effects": {
                e.id: {
                    "said": e.said,
                    "probability": e.probability,
                    "group": list(e.group),
                    "stiffness": None if e.stiffness is None else list(e.stiffness),
                    "change": {
                        n: {
                            "value": v,
                            "std": s,
                            "bound": b,
                            "least": m if np.isfinite(m) else None,
                            "unit": u,
                        }
                        for n, v, s, b, m, u in zip(
                            e.names, e.value, e.std, e.bound, e.least, e.units, strict=True
                        )
                    },
                }
                for e in self.effects
            },
        }
