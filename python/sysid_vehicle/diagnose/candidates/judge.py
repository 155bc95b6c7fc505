"""How the verdict on every effect is reached, beside those of the final model."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType

import numpy as np

from ..._common.arguments import expect
from ..._common.progress import doing
from ..._common.typed import typed
from ...effects import Effect
from ...identify import Fit
from ...rules import USUAL, Rules
from .constancy import constancy
from .diagnosis import Diagnosis
from .possible import Size, lacking, possible, possible_in, sizes
from .score import Score, score_board
from .verdicts import NAMED, ORDER, EffectVerdict, Finding, Verdicts, farthest, sizes_in_words

Scored = tuple[tuple[Score, ...], Mapping[str, float], Mapping[str, Size]]


@typed
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
    named = {v.effect.id for v in told.all if v.finding in NAMED}
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
        Of rivals, their parameters and standard errors in place of what they cannot be told from;
        a rival that is not among them has no size.
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
    found = _all_added(final, lacked, groups, away, rules)
    beside = _Beside(
        tuple(e for e in final.model.effects if e in lacked),
        tuple(v.effect.id for v in found if v.finding in NAMED),
        groups,
        {} if refitted is None else refitted,
        rules,
    )
    for effect in lacking(final.model, lacked):
        evidence = family.get(effect.id, 1.0) < rules.alpha
        verdict = _of_scored(effect, scores.get(effect.id), tried.get(effect.id), evidence, rules)
        if verdict.finding == "missing":
            verdict = beside.of_evidence(verdict, settled, effect.id in untried)
        elif effect.id in acted:
            verdict = beside.of_explained(verdict)
        found.append(verdict)
    found.sort(key=lambda v: (ORDER.index(v.finding), family.get(v.effect.id, 0.0)))
    return Verdicts(tuple(found))


@dataclass(frozen=True)
class _Beside:
    """What an effect that the final model lacks is judged beside.

    Attributes
    ----------
    names : tuple of str
        Effects of the final model that are judged.
    missing : tuple of str
        Those of them that are named.
    groups : mapping
        By effect of the final model, the rivals that driving cannot tell from it.
    refitted : mapping
        Of rivals, their parameters and standard errors in place of what they cannot be told from.
    rules : Rules
    """

    names: tuple[str, ...]
    missing: tuple[str, ...]
    groups: Mapping[str, tuple[str, ...]]
    refitted: Mapping[str, Size]
    rules: Rules

    def of_evidence(self, verdict: EffectVerdict, settled: bool, untried: bool) -> EffectVerdict:
        """One for which there is evidence, and which was not added."""
        if untried:
            return replace(verdict, finding="open")
        if settled:
            because = "it does not improve the prediction of validation data"
            return replace(verdict, finding="proxy", because=because)
        # Several may act like the same one that is missing too: only a refit tells.
        return replace(verdict, finding="open", group=self.names) if self.names else verdict

    def of_explained(self, verdict: EffectVerdict) -> EffectVerdict:
        """One for which there was evidence before what the final model has was added.

        A rival of what is itself a proxy, or negligible, is no better than that.
        """
        if not self.names or verdict.finding not in ("absent", "not testable"):
            return verdict
        effect = verdict.effect
        instead = tuple(e for e in self.missing if effect.id in self.groups.get(e, ()))
        if not instead:
            return replace(verdict, finding="proxy", group=self.names)
        # Beside its rival it explains nothing: its size is that of the model without it.
        value, std = self.refitted.get(effect.id, ((), ()))
        bound = bound_of(effect, value, std, self.rules) if value else ()
        return EffectVerdict(effect, "one of a group", value, std, bound, instead)


def _all_added(
    final: Fit,
    lacked: set[str],
    groups: Mapping[str, tuple[str, ...]],
    away: Mapping[str, str],
    rules: Rules,
) -> list[EffectVerdict]:
    """Verdicts on the effects of the final model: names fall that nothing holds up."""
    kept = constancy(final, rules)
    found = []
    for e in final.model.sought:
        if e.id not in lacked:
            continue
        verdict, because = _of_added(e, final, groups.get(e.id, ()), rules), ""
        if e.id in kept and not kept[e.id].holds:
            because = f"its value is not constant ({kept[e.id].span})"
        elif e.id in away and verdict.finding in NAMED:
            because = f"an unknown {away[e.id]} explains the same and more"
        if because:
            verdict = replace(verdict, finding="proxy", group=(), because=because)
        found.append(verdict)
    return found


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
        size = sizes_in_words(effect, value, std)
        because = f"the value is physically implausible ({size})"
    elif all(abs(d) + s < p.matters for p, d, s in sizes(effect, value, std, rules)):
        finding, group = "negligible", ()
    bound = bound_of(effect, value, std, rules)
    return EffectVerdict(effect, finding, value, std, bound, group, because)


def bound_of(
    effect: Effect, value: tuple[float, ...], std: tuple[float, ...], rules: Rules
) -> tuple[float, ...]:
    """How far from nothing each parameter may be, at 95 %, and within its bounds."""
    return _within(effect, _reach(effect, value, std, rules))


def _reach(
    effect: Effect, value: tuple[float, ...], std: tuple[float, ...], rules: Rules
) -> tuple[float, ...]:
    return tuple(
        float(np.abs(v - p.null_value) + rules.bound * s)
        for p, v, s in zip(effect.parameters, value, std, strict=True)
    )


def _within(effect: Effect, reach: tuple[float, ...]) -> tuple[float, ...]:
    return tuple(min(r, farthest(p)) for p, r in zip(effect.parameters, reach, strict=True))
