"""A verdict for every effect: missing, one of a group, negligible, a proxy, absent, not testable.

After Saris, Satorra & van der Veld (Structural Equation Modeling 2009): evidence, power and size
together, never a p-value alone. Every effect is judged beside those that are known to be missing,
so that what merely acted like one of them is told from what is missing too.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass, replace
from typing import Literal

from ..._common.text import brief, html_table, number, unit_after, with_error
from ...effects import Effect, Parameter

Finding = Literal[
    "missing", "one of a group", "open", "proxy", "negligible", "not testable", "absent"
]

NAMED: tuple[Finding, ...] = ("missing", "one of a group")
ORDER: tuple[Finding, ...] = (
    "missing",
    "one of a group",
    "open",
    "proxy",
    "negligible",
    "not testable",
    "absent",
)


@dataclass(frozen=True)
class EffectVerdict:
    """What the driving says of one effect.

    Attributes
    ----------
    effect : Effect
    finding : str
        `missing`; `one of a group` of rivals that explain this driving as well; `open`, for which
        there is evidence, perhaps beside a missing one, but no refit yet; `proxy`, which acts like
        something else; `negligible`; `absent`; or `not testable` with this data.
    value, std : tuple of float
        Parameters, predicted or refitted; empty where nothing is known of them.
    bound : tuple of float
        How far from nothing each parameter may be, at 95 %, and within its bounds.
    group : tuple of str
        The rivals, what the proxy acted like, or beside what there is evidence.
    because : str
        Of a proxy: what tells that it is not the effect itself.
    """

    effect: Effect
    finding: Finding
    value: tuple[float, ...] = ()
    std: tuple[float, ...] = ()
    bound: tuple[float, ...] = ()
    group: tuple[str, ...] = ()
    because: str = ""

    @property
    def sentence(self) -> str:
        """The verdict in words."""
        size = sizes_in_words(self.effect, self.value, self.std)
        below = _listed(self.effect, _below(self.effect, self.bound))
        matters = _listed(self.effect, [number(p.matters, 2) for p in self.effect.parameters])
        rivals = ", ".join(self.group)
        if self.finding == "missing":
            return f"missing; {size}"
        if self.finding == "one of a group":
            told = f"; {size}" if size else ""
            return f"missing; confounded with {rivals} in this driving{told}"
        if self.finding == "open" and not rivals:
            return f"significant, not tried yet; {size}"
        if self.finding == "open":
            return f"significant beside {rivals}; {size}; add {rivals} and diagnose again"
        if self.finding == "proxy" and rivals:
            return f"its evidence is explained by {rivals}"
        if self.finding == "proxy":
            return f"significant, but {self.because}"
        if self.finding == "negligible":
            return f"present but negligible; {size}; it would matter from {matters}"
        if self.finding == "absent":
            return f"absent; {below} at 95 %"
        takes = f"excited by {self.effect.excited_by}"
        if not self.bound:
            why = "the fitted parameters reproduce it, or a channel is missing"
            return f"not testable: {why}; {takes}"
        return f"not testable; {below} at 95 %, and it would matter from {matters}; {takes}"

    def __str__(self) -> str:
        return f"{self.effect.id}: {self.sentence}"


@dataclass(frozen=True, eq=False)
class Verdicts:
    """The verdicts of all effects.

    Attributes
    ----------
    all : tuple of EffectVerdict
        What is missing first.
    """

    all: tuple[EffectVerdict, ...]

    __iter__ = None  # numbers are no names

    def __getitem__(self, effect: str) -> EffectVerdict:
        for v in self.all:
            if v.effect.id == effect:
                return v
        raise KeyError(f"'{effect}'; there are {', '.join(v.effect.id for v in self.all)}")

    def with_reservation(
        self, effects: Iterable[str], because: str, *, added: Iterable[str] = ()
    ) -> Verdicts:
        """The same, but these effects, and rivals of nothing else, are called proxies.

        What was `added` is no mere rival: it stands or falls by itself.
        """
        reserved, model = set(effects), set(added)

        def falls(v: EffectVerdict) -> bool:
            if v.effect.id in model:
                return v.effect.id in reserved and v.finding in NAMED
            return v.finding == "one of a group" and set(v.group) <= reserved

        told = [
            replace(v, finding="proxy", group=(), because=because) if falls(v) else v
            for v in self.all
        ]
        return Verdicts(tuple(sorted(told, key=lambda v: ORDER.index(v.finding))))

    def with_groups(self, groups: Mapping[str, Collection[str]]) -> Verdicts:
        """The same, but these effects are one of a group with others of the model."""
        told = [
            replace(v, finding="one of a group", group=(*sorted(groups[v.effect.id]), *v.group))
            if v.effect.id in groups
            else v
            for v in self.all
        ]
        return Verdicts(tuple(sorted(told, key=lambda v: ORDER.index(v.finding))))

    def of(self, finding: Finding) -> tuple[EffectVerdict, ...]:
        """All of one kind."""
        return tuple(v for v in self.all if v.finding == finding)

    __repr__ = brief

    def __str__(self) -> str:
        width = max((len(v.effect.id) for v in self.all), default=0)
        return "\n".join(f"{v.effect.id:<{width}}  {v.sentence}" for v in self.all)

    def _repr_html_(self) -> str:
        return html_table(("effect", "verdict"), [[v.effect.id, v.sentence] for v in self.all])

    def to_dict(self) -> dict[str, dict[str, object]]:
        """All figures, ready for JSON."""
        return {
            v.effect.id: {
                "finding": v.finding,
                "sentence": v.sentence,
                "value": list(v.value),
                "std": list(v.std),
                "bound": list(v.bound),
                "group": list(v.group),
                "because": v.because,
            }
            for v in self.all
        }


def farthest(p: Parameter) -> float:
    """How far from nothing a parameter can be."""
    return max(p.upper - p.null_value, p.null_value - p.lower)


def _below(effect: Effect, bound: tuple[float, ...]) -> list[str]:
    """Bounds in words, which say where nothing narrower is known than that of the parameter."""
    told = zip(effect.parameters, bound, strict=False)
    return [f"below {number(b, 2)}" + (" (bound)" if b >= farthest(p) else "") for p, b in told]


def sizes_in_words(effect: Effect, value: tuple[float, ...], std: tuple[float, ...]) -> str:
    """Parameters with their standard errors, as they stand in sentences."""
    told = zip(effect.parameters, value, std, strict=False)
    return _listed(effect, [with_error(v, s, (p.lower, p.upper)) for p, v, s in told])


def _listed(effect: Effect, figures: list[str]) -> str:
    return ", ".join(
        f"{p.name} {x}{unit_after(p.unit)}"
        for p, x in zip(effect.parameters, figures, strict=False)
        if not p.scan
    )
