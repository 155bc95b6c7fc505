"""What is said of everything that may have changed: exact likelihoods first, lines of all else."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cached_property

import numpy as np
import scipy

from ..._common.arrays import as_float64
from ...effects import Effect
from ..candidates.causes import UNKNOWN, Causes, CredibleSet
from ..candidates.possible import possible
from .beside_unknown import unknown_beside
from .change import Change
from .changes_compete import Competition
from .effect_change import EffectChange, Said
from .may_change import May, beyond, finite_std, room, within
from .reference import Exact
from .search import Search


def _unknown(several: CredibleSet) -> bool:
    return several.effects[0].startswith(UNKNOWN)


class Saying:
    """What is said of everything that may have changed."""

    def __init__(self, search: Search) -> None:
        self.search = search
        self.told, self.state = search.found()
        self._places: dict[str, tuple[Exact, Competition]] = {}

    @cached_property
    def at_one_point(self) -> Competition:
        """Of tyres that did not change: their coefficients lie in a bent valley."""
        if self.state.put:
            return self.told
        return self.search.told(self.state, at_one_point=True)

    @cached_property
    def priced(self) -> tuple[Competition, Exact]:
        """What is worth its price of what was put in, and what competes beside it."""
        return self.search.worth_their_price(self.told, self.state)

    @cached_property
    def unknown(self) -> tuple[CredibleSet, ...]:
        """What changed beside it that no effect explains, under the noise of the reference."""
        told, few = self.priced
        noise = self.search.before.noise
        if few.fit.noise is not noise:
            few = replace(few, fit=replace(few.fit, noise=noise))
            told = self.search.told(few)
        # A sum of many shapes is like any effect: lines tell whether it is there beside that.
        apart = (s for s in told.causes.sets if {*few.put}.isdisjoint(s.effects))
        if not any(map(_unknown, apart)):
            return ()
        return unknown_beside(told.scores, few.put, self.search.rules)

    def change(self) -> Change:
        """Exact likelihoods decide on what was put in, scores on all else.

        Names are given of what is worth its price; sizes are told beside all that was put in,
        which would be taken for a part of them otherwise.
        """
        search, told, state = self.search, self.told, self.state
        priced, few = self.priced
        ratio = priced.ratio_of(few.put)
        exact = {e: self._exact(e, few, priced, ratio) for e in few.put}
        shown = [s for s in exact.values() if s is not None]
        named = [s for s in self._not_refused(priced, few) if not _unknown(s)]
        causes = priced.causes.only([*shown, *named, *self.unknown], {})
        sizes, stds = self._told_sizes(shown, few)
        nothing = search.nothing(told)
        late = search.in_time.effects(state.put)
        scored = any(e in late for s in told.causes.sets for e in s.effects)
        calm = nothing > 1.0 - search.rules.credible and not scored
        found = [self._of(m, causes, sizes, stds, told, calm=calm) for m in self.search.may]
        order = [e for s in causes.sets for e in s.effects]
        sure = causes.inclusion
        found.sort(
            key=lambda e: (order.index(e.id) if e.id in order else len(order), -sure.get(e.id, 0.0))
        )
        return Change(
            search.before,
            state.fit,
            causes,
            tuple(found),
            nothing,
            search.alike,
            search.rules,
            late_facts=search.in_time.facts(state.put),
        )

    def _not_refused(self, told: Competition, state: Exact) -> list[CredibleSet]:
        """Sets by scores whose likeliest is not what was put in, and no refit has refused it.

        An unknown has no refit: it has to be likely beside what was put in. Where scores vary more
        than white ones, several that vary less may take the place of that.
        """
        put, tried = state.put, self.search.visited.keys() | self.search.failed
        late = self.search.in_time.effects(put)
        least = scipy.special.logit(self.search.rules.credible)
        return [
            s
            for s in told.causes.sets
            if not any(e in put for e in s.effects)
            and not told.acts_like(s.effects[0])
            and frozenset({*put, s.effects[0]}) not in tried
            and s.effects[0] not in late
            and told.beside_put.get(s.effects[0], np.inf) > least
        ]

    def _told_sizes(
        self, shown: Sequence[CredibleSet], named: Exact
    ) -> tuple[dict[str, float], dict[str, float]]:
        """Sizes and standard errors by parameter: exact ones where there are, lines elsewhere."""
        told, state = self.told, self.state
        lines = (told.sizes, told.stds, told.stds_beside)
        sizes, stds, beside = (self._of_the_car(told_by, state) for told_by in lines)
        # Of what was put in the exact size: no line is drawn from the reference to there. It was
        # fitted together with all else that was put in, what acts like it too.
        for e in state.put:
            sizes |= self._sizes_in(state, e)
            stds |= {n: beside[n] for n in self.search.can[e].names}
        for e in self.search.can:
            self._by_ratio(e, sizes, stds)
        for s in shown:
            for e in (e for e in s.effects if e not in {*state.put, *self._places}):
                other = self._in_place(e, s, state) or self._in_place(e, s, named)
                if other is not None:
                    self._places[e] = other, self.search.told(other)
                    sizes |= self._sizes_in(other, e)
                    own = self._of_the_car(self._places[e][1].stds_beside, other)
                    stds |= {n: max(own[n], stds[n]) for n in self.search.can[e].names}
        return sizes, stds

    def _by_ratio(self, effect: str, sizes: dict[str, float], stds: dict[str, float]) -> None:
        """As many standard errors from nothing as the likelihood ratio says, at most.

        Of a parameter that was fitted with the change and without it.
        """
        put = frozenset(self.state.put)
        without, beside = put - {effect}, put | {effect}
        one, other = self.search.visited.get(without), self.search.visited.get(beside)
        if len(self.search.can[effect].names) > 1 or one is None or other is None:
            return
        ((name, size),) = self._sizes_in(other, effect).items()
        gain = other.among - one.among if without else other.reached - one.reached
        rises = 2.0 * gain / self.told.ratio_of((effect,))
        if rises > 0.0:
            sizes[name] = size
        stds[name] = max(stds[name], abs(sizes[name]) / float(np.sqrt(max(rises, 1.0))))

    def lack(self) -> Effect | None:
        """What the reference lacks: in both drivings the same it explains more than any change."""
        search, told = self.search, self.told
        nothing = search.visited[frozenset()].reached
        found = None
        most = self.state.among - nothing
        for e in search.reference.effects:
            s = search.visited.get(frozenset({e.id}))
            left = 0.0 if s is None else s.log_likelihood - s.reached
            shown = left / told.ratio_of((e.id,)) > told.price((e.id,), dict.fromkeys(e.named, 0.0))
            if left > most and shown:
                found, most = e, left
        return found

    def _likely(self, effect: str, probability: float) -> bool:
        """Whether an effect that is not named is likelier than not, and no refit speaks against."""
        other = self.search.visited.get(frozenset({*self.state.put, effect}))
        ratio = self.told.ratio_of(self.state.put)
        states = [s for s in (other, self.state) if s is not None]
        best = max(states, key=lambda s: self.search.evidence(s, self.told, ratio))
        return probability > 0.5 and (other is None or best is other)

    def _sizes_in(self, state: Exact, effect: str) -> dict[str, float]:
        return {n: state.changes[n] for n in self.search.can[effect].names}

    def _of_the_car(self, told_by: Mapping[str, float], state: Exact) -> dict[str, float]:
        """Lines tell differences of parameters: of relative errors as shares of what there was."""
        own = self.search.reference.factors(state)
        return {n: x / own.get(n, 1.0) for n, x in told_by.items()}

    def _off_nothing(self, effect: str, state: Exact, told: Competition) -> bool:
        """Whether a size is beyond what pieces of the drivings differ by, as far as a name asks.

        What stands in for a lack of the model gains likelihood as a change does. Of tyres the
        interval of their force has to exclude nothing, at some slip that was driven: likelihoods
        of four coefficients that no driving tells apart gain by what the model lacks. A size may be
        known badly though it is not nothing, as a drag is in a wind: of a change alone lines from
        nothing are asked as well. Beside others that stand in for it they tell too much.
        """
        m, rules = self.search.can[effect], self.search.rules
        if m in self.search.tyres:
            forces = self.search.forces(effect, state, told)
            return any(abs(share) > rules.interval * std for share, std in forces)

        def off(told: Competition, sizes: Mapping[str, float]) -> bool:
            known = ((sizes[n], told.stds[n], usual) for n, usual in m.usual.items())
            return any(abs(x) > told.least(s, usual) - rules.bound * s for x, s, usual in known)

        singles = self.search.singles
        return off(told, state.changes) or (state.put == (effect,) and off(singles, singles.sizes))

    def _in_place(self, effect: str, of: CredibleSet, state: Exact) -> Exact | None:
        """The state with an effect in place of another one of its set, where it was visited."""
        others = frozenset(state.put) - set(of.effects)
        return self.search.visited.get(others | {effect})

    def _exact(
        self, effect: str, state: Exact, told: Competition, ratio: float
    ) -> CredibleSet | None:
        """What may have changed in place of an effect that was put in; None where nothing need."""
        here = self.search.evidence(state, told, ratio)
        log_odds = self.search.odds(effect, state, told)
        linear = told.causes.of(effect)
        if linear is not None:
            own = linear.weights.get(effect, 0.0)
            for e, weight in linear.weights.items():
                if e not in log_odds and min(weight, own) > 0.0:
                    log_odds[e] = float(np.log(weight / own))
        found = self._told_apart(effect, log_odds, state, ratio)
        if not self._some_off_nothing(effect, found, state, told):
            return None
        absent = [
            self.search.evidence(s, told, ratio) - here
            if s.put
            else -self.search.over_nothing(state, told, ratio)
            for s in self.search.lacking(effect, state, found.effects)
        ]
        whole = scipy.special.logsumexp(list(log_odds.values()))
        least = np.log(self.search.rules.credible)
        if whole - scipy.special.logsumexp([whole, *absent]) < least:
            return None
        # What was not tried in its place in time speaks against the name.
        late = self.search.in_time.in_place_of(effect, state.put)
        more = {e: log_odds[effect] for e in late if e not in found.effects}
        if more:
            found = CredibleSet.of({e: log_odds[e] for e in found.effects} | more, 1.0)
        return found.led_by(effect)  # sizes of what leads are told together

    def _some_off_nothing(
        self, effect: str, of: CredibleSet, state: Exact, told: Competition
    ) -> bool:
        """Whether an effect that was put in, or one of its set in its place, is off nothing.

        Whichever of them changed, it is not nothing: the likeliest need not be the closest known.
        """
        if self._off_nothing(effect, state, told):
            return True
        others = ((e, self._in_place(e, of, state)) for e in of.effects if e != effect)
        return any(
            self._off_nothing(e, other, self.search.told(other))
            for e, other in others
            if other is not None
        )

    def _told_apart(
        self, effect: str, log_odds: dict[str, float], state: Exact, ratio: float
    ) -> CredibleSet:
        """The credible set of an effect and its rivals, but for those that are nothing beside it.

        What the reference lacks gains likelihood as a change of it does: beside each other lines
        tell which of the two differs, where the likelihood does not do as well without it.
        """
        while True:
            found = CredibleSet.of(log_odds, self.search.rules.credible)
            for e in found.effects:
                both = self.search.visited.get(frozenset({*state.put, e}))
                if e == effect or both is None:
                    continue
                alone = self.search.visited.get(frozenset({*state.put, e}) - {effect})
                if alone is not None:
                    gain = (both.log_likelihood - alone.log_likelihood) / ratio
                    if gain < self.search.rules.told:
                        continue
                beside = self.search.told(both)
                if not self._off_nothing(e, both, beside) and self._off_nothing(
                    effect, both, beside
                ):
                    del log_odds[e]
                    break
            else:
                return found

    def _of(
        self,
        m: May,
        causes: Causes,
        sizes: dict[str, float],
        stds: dict[str, float],
        told: Competition,
        *,
        calm: bool,
    ) -> EffectChange:
        rules = self.search.rules
        ends = room(m, self.search.before.model)
        raw = [sizes[n] for n in m.names], [stds[n] for n in m.names]
        # A line that leads further beyond what a parameter can be than its error is followed to
        # there, all of its effect; what is cut off is no less uncertain than it is large.
        cut = beyond(raw[0], [rules.bound * s for s in raw[1]], ends)
        told_by = [(1.0 - cut) * v for v in raw[0]]
        value = tuple(float(np.clip(v, *both)) for v, both in zip(told_by, ends, strict=True))
        std = tuple(
            finite_std(max(s, cut * abs(v)), both) for v, s, both in zip(*raw, ends, strict=True)
        )
        bound = tuple(
            min(abs(v) + rules.bound * s, max(-low, high))
            for v, s, (low, high) in zip(value, std, ends, strict=True)
        )
        matters = [p.matters for p in m.parameters]
        least = tuple(
            within(max(told.least(s, usual), w + (rules.bound - 1.0) * s), max(-low, high))
            for s, usual, w, (low, high) in zip(std, m.scale, matters, ends, strict=True)
        )
        small = all(abs(v) + s < w for v, s, w in zip(value, std, matters, strict=True))
        stiffness = self._stiffness(m, told_by, cut)
        can_be = possible(m, *raw, rules) if stiffness is None else self._can_be(m, stiffness)
        said, group = self._verdict(m, causes, can_be=can_be, small=small)
        if said == "not testable":
            if m.id in self.search.in_time.effects(self.state.put):
                likely = not calm and self._likely(m.id, causes.inclusion.get(m.id, 0.0))
                said = "likely" if likely else "not tried"
            elif all(b < w for b, w in zip(bound, matters, strict=True)):
                said = "unchanged"
            elif not calm and self._likely(m.id, causes.inclusion.get(m.id, 0.0)):
                said = "likely"
        names, units = zip(*((p.name, p.unit) for p in m.parameters), strict=True)
        # Of what driving does not tell, its line has a probability that says nothing.
        silent = said in ("unchanged", "not testable", "not tried")
        sure = None if silent else causes.inclusion.get(m.id, 0.0)
        least_stiffness = None if stiffness is None else self._least_stiffness(m, stiffness[1])
        figures = (value, std, bound, sure, said, group, least, stiffness, least_stiffness)
        hidden = told.hidden(m.id, m.usually) if m.usually else (False, ())
        return EffectChange(m.id, names, units, *figures, *hidden, m.excited_by)

    @staticmethod
    def _verdict(
        m: May, causes: Causes, *, can_be: bool, small: bool
    ) -> tuple[Said, tuple[str, ...]]:
        """What is said of what is in a credible set, and what else it may be."""
        own = causes.of(m.id)
        if own is None:
            return "not testable", ()
        group = tuple(e for e in own.effects if e != m.id)
        if not can_be:
            return "implausible", group
        if small:
            return "negligible", ()
        return ("one of a group" if group else "changed"), group

    def _usual_share(self, m: May) -> float:
        """Of tyres, by which share their cornering stiffness usually changes."""
        before = [self.search.before.model.value(n) for n in m.names[:3]]  # B, C, D
        return float(np.linalg.norm(np.array(m.scale[:3]) / before))

    def _can_be(self, m: May, stiffness: tuple[float, float]) -> bool:
        """Whether tyres can change so: one by one their coefficients, in their valley, tell not."""
        share, std = stiffness
        rules = self.search.rules
        return abs(share) - rules.interval * std <= rules.implausible * self._usual_share(m)

    def _least_stiffness(self, m: May, std: float) -> float:
        """Of tyres, the smallest share of their cornering stiffness that would be named."""
        price = self.told.price([m.id], dict.fromkeys(m.names, 0.0))
        return self.told.least(std, self._usual_share(m), price)

    def _stiffness(self, m: May, sizes: Sequence[float], cut: float) -> tuple[float, float] | None:
        """By which share the cornering stiffness of an axle's tyres differs, per load, +- what.

        `cut` is the share of the sizes that leads beyond any tyre.
        """
        if m not in self.search.tyres:
            return None
        put = m.id in self.state.put
        fitted = (self.state, self.told) if put else self._places.get(m.id)
        model = self.search.before.model if fitted else self.state.searched
        before = np.array([model.value(n) for n in m.names[:3]])  # B, C, D
        after = before + np.array(sizes[:3]) if fitted else before
        ratio = float(np.prod(after) / np.prod(before))
        later = as_float64([*(ratio / after), 0.0])
        earlier = as_float64([*(-ratio / before), 0.0])
        if fitted:
            state, told = fitted
            known = {**dict(zip(m.names, sizes, strict=True)), **state.changes}
            value = ratio - 1.0
        else:
            told = self.at_one_point
            known = told.beside(m.id)
            value = (1.0 - cut) * float(later @ [known[n] for n in m.names])
        std = told.std_along(m.id, (later, earlier), known)
        std = max(std, abs(value) * cut / (1.0 - cut) if cut < 1.0 else np.inf)
        return value, finite_std(std, (0.0, 1.0))  # an error of all of it tells nothing
