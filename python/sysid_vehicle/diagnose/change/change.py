"""What changed between a reference and later driving: the result of `changed`."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from ..._common.printed import Part, Printed, Table
from ..._common.tables import frame
from ..._common.text import brief, few, number
from ...identify import Fit
from ...rules import Rules
from ..candidates.causes import UNKNOWN, Causes, CredibleSet
from .both_axles import FRICTION, STIFFNESS
from .effect_change import EffectChange, LoadChange
from .pieces import Alike


@dataclass(frozen=True, eq=False)
class Change(Printed):
    """What changed since the reference.

    Attributes
    ----------
    before : Fit
        The reference.
    after : Fit
        Its model with the changes that were found, on the later driving, under the noise of the
        reference. Where no effect explains a change, disturbances along what that acts on are as
        large as the later driving asks for. Nothing else was fitted to it alone.
    causes : Causes
        Posterior of a sum of single changes: inclusion probabilities, credible sets. Of each set
        what was fitted together with those of the others stands first. What begins with `unknown`
        is a change that no effect of the catalogue explains.
    effects : tuple of EffectChange
        What is named first, then by probability.
    nothing : float
        Probability that nothing changed, by what was fitted; in other driving likelihoods count as
        much less as intervals are wider.
    alike : Alike
        How like the reference the later driving is; where it is not, intervals are as much wider
        as estimates differ between pieces of the reference.
    rules : Rules
    lacks : tuple of str
        Effects that the reference lacked, and that were put into its model: it shows them alone,
        or in both drivings the same they explain more than what seemed to have changed.
    late_facts : tuple of str
        What a time limit left out.
    """

    before: Fit
    after: Fit
    causes: Causes
    effects: tuple[EffectChange, ...]
    nothing: float
    alike: Alike
    rules: Rules
    lacks: tuple[str, ...] = ()
    late_facts: tuple[str, ...] = ()

    __iter__ = None  # numbers are no names

    def __getitem__(self, effect: str) -> EffectChange:
        for e in self.effects:
            if e.id == effect:
                return e
        raise KeyError(f"'{effect}'; there are {', '.join(e.id for e in self.effects)}")

    @property
    def named(self) -> tuple[EffectChange, ...]:
        """What may be called changed, each followed by its rivals."""
        return tuple(e for e in self.effects if e.named)

    @property
    def unknown(self) -> tuple[CredibleSet, ...]:
        """Changes that are there and that no effect of the catalogue explains."""
        return tuple(s for s in self.causes.sets if s.effects[0].startswith(UNKNOWN))

    @property
    def calm(self) -> bool:
        """Whether no change is shown, none is likely, and no time limit left anything out."""
        told = bool(self.named or self.unknown or self.late_facts)
        return not told and not any(e.said in ("likely", "implausible") for e in self.effects)

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
        named = {e.id: e for e in self.named}
        # Another one may be a rival of two of them.
        first = [next((e for e in s.effects if e in named), "") for s in self.causes.sets]
        leading = [named[e] for e in dict.fromkeys(first) if e]
        told = [
            f"{e} ({'; confounded with '.join(filter(None, (e.sure, ', '.join(e.group))))})"
            for e in leading
        ]
        what = f"changed: {'; '.join(told)}" if told else ""
        if self.unknown:
            several = [[e.removeprefix(UNKNOWN) for e in s.effects] for s in self.unknown]
            kinds = ", ".join(" or ".join(few) for few in several)
            more = f"something changed that no effect explains, in {kinds}"
            return f"{what}; beside it {more}" if what else more
        if what:
            return what
        likely = [f"{e.id} ({e.sure})" for e in self.effects if e.said == "likely"]
        if likely:
            return (
                f"no single change is significant; something changed, likeliest {', '.join(likely)}"
            )
        beyond = [f"{e} ({e.sure})" for e in self.effects if e.said == "implausible"]
        if beyond:
            return (
                f"something changed, and what explains it is not shown: {'; '.join(beyond)} "
                "fits best, and is larger than on any car"
            )
        little = any(e.said == "negligible" for e in self.effects)
        if self.nothing < 1.0 - self.rules.credible and not little:
            return (
                "something changed, and no effect is sure enough to be named: that nothing did has "
                f"a probability of {number(self.nothing, 2)}"
            )
        tried = " by what was tried in time" if self.late_facts else ""
        return f"no change is shown{tried}"

    _HEAD = ("what", "by how much", "how sure", "")

    def _rows(self, most: int = 8) -> list[list[str]]:
        first = self.effects[: max(most, len(self.named))]
        return [[e.id, e.size, e.sure.removesuffix(" sure") or "-", e.sentence] for e in first]

    __repr__ = brief

    def _parts(self) -> list[Part]:
        other = (
            f"{self.alike}: intervals hold what estimates differ by between pieces of the "
            "reference, and what the model lacks beyond them may look like a change; drive the "
            "same again to be sure"
        )
        told = [other] if self.alike.beyond > self.rules.taken else []
        if self.lacks:
            told.insert(
                0,
                f"the reference lacks {', '.join(self.lacks)}, in both drivings the same: compared "
                "with it in the model",
            )
        if self.late_facts:
            told.insert(0, f"the time limit ended the comparison: {'; '.join(self.late_facts)}")
        if self.load is not None:
            told.insert(0, f"mass and centre of gravity: as {self.load} would change them")
        return [self._headline(), *told, self._power(), Table(self._HEAD, self._rows())]

    def _power(self) -> str:
        """Which changes of the tyres, and of usual size, this driving would not show."""
        known = {e.id: e for e in self.effects}
        sizes = {
            "cornering stiffness of the front axle": ("tyre_front", "least_stiffness"),
            "of the rear axle": ("tyre_rear", "least_stiffness"),
            "of both": (STIFFNESS, "least"),
            "friction of both": (FRICTION, "least"),
        }
        told = []
        for what, (effect, of) in sizes.items():
            if effect in known:
                least = np.atleast_1d(getattr(known[effect], of))[0]
                below = f"below {number(100.0 * least, 2 if least < 1.0 else 3)} %"
                told.append(f"{what} {below if np.isfinite(least) else 'of any size'}")
        if weak := [e.id for e in self.effects if e.weak and not e.named]:
            told.append(f"of a usual size {few(weak)}")
        return f"changes that would not be seen: {', '.join(told)}" if told else ""

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
            "nothing": self.nothing,
            "lacks": list(self.lacks),
            "late_facts": list(self.late_facts),
            "effects": {e.id: e.to_dict() for e in self.effects},
        }
