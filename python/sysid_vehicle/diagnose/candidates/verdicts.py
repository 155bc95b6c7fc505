"""A verdict for every effect: missing, one of a group, negligible, a proxy, absent, not testable.

After Saris, Satorra & van der Veld (Structural Equation Modeling 2009): evidence, power and size
together, never a p-value alone. Every effect is judged beside those that are known to be missing,
so that what merely acted like one of them is told from what is missing too.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import Literal

import numpy as np

from ..._common.arguments import expect
from ..._common.progress import doing
from ..._common.text import brief, html_table, number, unit_after, with_error
from ...effects import Effect, Parameter
from ...identify import Fit
from ...rules import USUAL, Rules
from .constancy import constancy
from .diagnosis import Diagnosis
from .possible import Size, lacking, possible, possible_in, sizes
from .score import Score, score_board

Finding = Literal[
    "missing", "one of a group", "open", "proxy", "negligible", "not testable", "absent"
]

Scored = tuple[tuple[Score, ...], Mapping[str, float], Mapping[str, Size]]
_NAMED: tuple[Finding, ...] = ("missing", "one of a group")
_ORDER: tuple[Finding, ...] = (
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
        size = _sizes(self.effect, self.value, self.std)
        below = _listed(self.effect, _below(self.effect, self.bound))
        matters = _listed(self.effect, [number(p.matters, 2) for p in self.effect.parameters])
        rivals = ", ".join(self.group)
        if self.finding == "missing":
            return f"missing; {size}"
        if self.finding == "one of a group":
            return f"missing; confounded with {rivals} in this driving; {size}"
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
                return v.effect.id in reserved and v.finding in _NAMED
            return v.finding == "one of a group" and set(v.group) <= reserved

        told = [
            replace(v, finding="proxy", group=(), because=because) if falls(v) else v
            for v in self.all
        ]
        return Verdicts(tuple(sorted(told, key=lambda v: _ORDER.index(v.finding))))

    def with_groups(self, groups: Mapping[str, Collection[str]]) -> Verdicts:
        """The same, but these effects are one of a group with others of the model."""
        told = [
            replace(v, finding="one of a group", group=(*sorted(groups[v.effect.id]), *v.group))
            if v.effect.id in groups
            else v
            for v in self.all
        ]
        return Verdicts(tuple(sorted(told, key=lambda v: _ORDER.index(v.finding))))

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


@doing("verdicts")
def verdicts(dx: Diagnosis, *, seed: int = 0) -> Verdicts:
    """Give a verdict on every effect that a diagnosed model lacks.

    Parameters
    ----------
    dx : Diagnosis
    seed : int
        Of the draws that correct for testing many effects.

    Returns
    -------
    Verdicts
    """
    expect(dx, Diagnosis, "verdicts")
    best = dx.named
    final = dx.fit if best is None or best.fit is None else best.fit
    groups = {} if best is None else {best.id: best.indistinguishable_from}
    if final is dx.fit:
        known = dx.scores, dx.family, dx.sizes
    else:
        known = dx.beside.board.scores, dx.beside.board.family_p_values(seed=seed), {}
    told = judge(
        final,
        scored=known,
        lacked=dx.lacked,
        groups=groups,
        acted={c.id for c in dx.significant},
        rules=dx.rules,
        seed=seed,
        refitted=dx.sizes,
    )
    if not dx.reservation:
        return told
    named = {v.effect.id for v in told.all if v.finding in _NAMED}
    return told.with_reservation(named, dx.reservation, added=named)


def judge(
    final: Fit,
    *,
    lacked: set[str],
    groups: Mapping[str, tuple[str, ...]],
    acted: set[str],
    rules: Rules = USUAL,
    seed: int = 0,
    scored: Scored | None = None,
    refitted: Mapping[str, Size] | None = None,
    settled: bool = False,
    untried: Collection[str] = (),
    away: Mapping[str, str] = MappingProxyType({}),
) -> Verdicts:
    """Judge every effect beside those of the final model.

    Parameters
    ----------
    final : Fit
        With all effects that were found missing.
    lacked : set of str
        What the model lacked to begin with: only that is judged.
    groups : mapping
        By effect of the final model, the rivals that driving cannot tell from it.
    acted : set of str
        Effects for which there was evidence before.
    rules : Rules
        By which effects are claimed.
    seed : int
        Of the draws that correct for testing many effects.
    scored : (scores, p-values, sizes), optional
        Of what the final model lacks, where a diagnosis of it has them already; sizes are those of
        refits, of which the noise that was learned without an effect hides nothing.
    refitted : mapping, optional
        Of rivals, their parameters and standard errors in place of what they cannot be told from.
    settled : bool
        Whether everything worth adding was added. What there is still evidence for is then no
        explanation: with it, driving that no fit saw is not predicted better.
    untried : collection of str
        Effects that time did not suffice for: of these nobody knows whether they hold.
    away : mapping
        By effect of the final model, something unknown that explains it away (`instead`).
    """
    if scored is None:
        board = score_board(final, final.driving, lacking(final.model, lacked), rules)
        scored = board.scores, board.family_p_values(seed=seed), {}
    _, family, tried = scored
    scores = {s.effect.id: s for s in scored[0]}
    names = tuple(e for e in final.model.effects if e in lacked)
    found = [
        _of_added(e, final, groups.get(e.id, ()), rules)
        for e in final.model.parts
        if e.id in lacked
    ]
    kept = constancy(final, rules)
    for i, v in enumerate(found):
        if v.effect.id in kept and not kept[v.effect.id].holds:
            because = f"its value is not constant ({kept[v.effect.id].span})"
            found[i] = replace(v, finding="proxy", group=(), because=because)
        elif v.effect.id in away and v.finding in _NAMED:
            because = f"an unknown {away[v.effect.id]} explains the same and more"
            found[i] = replace(v, finding="proxy", group=(), because=because)
    missing = [v.effect.id for v in found if v.finding in _NAMED]
    for effect in lacking(final.model, lacked):
        score = scores.get(effect.id)
        evidence = family.get(effect.id, 1.0) < rules.alpha
        verdict = _of_scored(effect, score, tried.get(effect.id), evidence, rules)
        if effect.id in acted and names and verdict.finding in ("absent", "not testable"):
            # A rival of what is itself a proxy, or negligible, is no better than that.
            instead = tuple(e for e in missing if effect.id in groups.get(e, ()))
            kind: Finding = "one of a group" if instead else "proxy"
            value, std, bound = verdict.value, verdict.std, verdict.bound
            if instead and refitted is not None and effect.id in refitted:
                # Beside its rival it explains nothing: its size is that of the model without it.
                value, std = refitted[effect.id]
                bound = _within(effect, _reach(effect, value, std, rules))
            verdict = EffectVerdict(effect, kind, value, std, bound, group=instead or names)
        elif effect.id in untried and verdict.finding == "missing":
            verdict = replace(verdict, finding="open")
        elif settled and verdict.finding == "missing":
            because = "it does not improve the prediction of validation data"
            verdict = replace(verdict, finding="proxy", because=because)
        elif names and verdict.finding == "missing":
            # Several may act like the same one that is missing too: only a refit tells.
            verdict = replace(verdict, finding="open", group=names)
        found.append(verdict)
    found.sort(key=lambda v: (_ORDER.index(v.finding), family.get(v.effect.id, 0.0)))
    return Verdicts(tuple(found))


def _of_added(effect: Effect, final: Fit, group: tuple[str, ...], rules: Rules) -> EffectVerdict:
    estimates = [final[name] for name in effect.named]
    value, std = tuple(e.value for e in estimates), tuple(e.std for e in estimates)
    return _of_present(effect, value, std, group, rules, possible_in(final, effect, rules))


def _of_scored(
    effect: Effect, score: Score | None, tried: Size | None, evidence: bool, rules: Rules
) -> EffectVerdict:
    if score is None:
        return EffectVerdict(effect, "not testable")
    if evidence:
        can_be = possible(effect, score.value, score.std, rules)
        return _of_present(effect, score.value, score.std, (), rules, can_be)
    value, std = score.value, score.std
    if tried is not None and np.isfinite(tried[1]).all():  # at a bound a refit has no error
        value, std = tried
    reach = _reach(effect, value, std, rules)
    # The bound says it all: below what matters, the test had the power to find what does.
    small = all(b < p.matters for b, p in zip(reach, effect.parameters, strict=True) if not p.scan)
    return EffectVerdict(
        effect,
        "absent" if small else "not testable",
        value,
        std,
        _within(effect, reach),
    )


def _of_present(
    effect: Effect,
    value: tuple[float, ...],
    std: tuple[float, ...],
    group: tuple[str, ...],
    rules: Rules,
    can_be: bool,
) -> EffectVerdict:
    finding: Finding = "one of a group" if group else "missing"
    because = ""
    if not can_be:
        finding, group = "proxy", ()
        size = _sizes(effect, value, std)
        because = f"the value is physically implausible ({size})"
    elif all(abs(d) + s < p.matters for p, d, s in sizes(effect, value, std, rules)):
        finding, group = "negligible", ()
    bound = _within(effect, _reach(effect, value, std, rules))
    return EffectVerdict(effect, finding, value, std, bound, group, because)


def _reach(
    effect: Effect, value: tuple[float, ...], std: tuple[float, ...], rules: Rules
) -> tuple[float, ...]:
    return tuple(
        float(np.abs(v - p.null_value) + rules.bound * s)
        for p, v, s in zip(effect.parameters, value, std, strict=True)
    )


def _most(p: Parameter) -> float:
    """How far from nothing a parameter can be."""
    return max(p.upper - p.null_value, p.null_value - p.lower)


def _within(effect: Effect, reach: tuple[float, ...]) -> tuple[float, ...]:
    return tuple(min(r, _most(p)) for p, r in zip(effect.parameters, reach, strict=True))


def _below(effect: Effect, bound: tuple[float, ...]) -> list[str]:
    """Bounds in words, which say where nothing narrower is known than that of the parameter."""
    told = zip(effect.parameters, bound, strict=False)
    return [f"below {number(b, 2)}" + (" (bound)" if b >= _most(p) else "") for p, b in told]


def _sizes(effect: Effect, value: tuple[float, ...], std: tuple[float, ...]) -> str:
    told = zip(effect.parameters, value, std, strict=False)
    return _listed(effect, [with_error(v, s, (p.lower, p.upper)) for p, v, s in told])


def _listed(effect: Effect, figures: list[str]) -> str:
    return ", ".join(
        f"{p.name} {x}{unit_after(p.unit)}"
        for p, x in zip(effect.parameters, figures, strict=False)
        if not p.scan
    )
