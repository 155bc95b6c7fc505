"""What changed between a reference and later driving of the same car.

Everything that the reference left stays where it was: effects of the model and of the catalogue,
tyres, unknown forces, shifted clocks compete for what is new (`beside_reference.py`), as a sum of
single effects (`changes_compete.py`). A large change bends every line that is drawn from the
reference: so the leading ones are fitted exactly, the scores taken anew from there, and the exact
likelihoods decide between what was fitted.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import replace

import numpy as np
import scipy

from ...effects import Effect
from ...errors import InvalidInput, NumericalError
from ...estimate import Driving
from ...identify import Fit, explaining
from ...identify.offsets import centred
from ...log import Log
from ...model import Model
from ...rules import USUAL, Rules
from ...vehicle import AXLES, Vehicle
from ..candidates.causes import Causes, CredibleSet
from ..candidates.clocks import CLOCKS
from ..candidates.possible import considered, possible
from .beside_reference import Differences, Side
from .change import Change, EffectChange, Said
from .changes_compete import Competition
from .may_change import YAW_INERTIA, May, of_clock, of_effect, of_inertia, of_tyre
from .reference import Exact, Reference

_TRIED = 5  # of the best single changes, exactly
_ROUNDS = 4  # times that scores are taken anew
_CLOSE = 4.0  # nats of evidence, that a search may end below the maximum


@explaining
def changed(
    before: Fit,
    after: Log | Sequence[Log] | Driving | Fit,
    *,
    vehicle: Vehicle | None = None,
    candidates: Sequence[str | Effect] | None = None,
    rules: Rules = USUAL,
) -> Change:
    """Tell what of a car changed since a reference: yesterday's log fits the model, today's not.

    What the reference left unexplained counts only as far as the later driving leaves more. Both
    are taken as independent; noise is that of the reference.

    Parameters
    ----------
    before : Fit
        The reference: a model fitted to earlier driving.
    after : Log, sequence of Log, Driving, or Fit
        Later driving; of a fit, its driving and vehicle.
    vehicle : Vehicle, optional
        The vehicle file of the later driving, where it is another one.
    candidates : sequence of str, optional
        Effects beside those of the model that may have changed; by default all of the catalogue.
        Those with a moment of their own, as a drop of grip, belong to one driving and are left out.
    rules : Rules
        By which changes are claimed.

    Returns
    -------
    Change

    Raises
    ------
    InvalidInput
        The wheel force is known in one of the drivings only, or the fit is one to predictions.
    NumericalError
        The model of the reference cannot be evaluated on the later driving.
    """
    if before.horizon_s:
        raise InvalidInput(
            f"the reference is a fit to predictions {before.horizon_s:g} s ahead, and evidence is "
            "of the likelihood; identify without horizon_s"
        )
    if isinstance(after, Fit):
        vehicle = after.model.vehicle if vehicle is None else vehicle
        after = replace(after.driving, offsets=())
    driving = Driving.of(after)
    if driving.force_known != before.driving.force_known:
        raise InvalidInput(
            "the wheel force fx_n is known in one of the drivings only; log it in both, or leave "
            "it out of both"
        )
    start = replace(
        before,
        model=before.model if vehicle is None else _of_vehicle(before.model, vehicle),
        driving=driving,
        estimates=(),
        covariance=np.zeros((0, 0)),
        profiles=(),
    )
    if len(driving.logs) > 1 and start.model.offset_names:
        start = replace(start, driving=centred(start)[1])
    return _Search(before, start, candidates, rules).found()


def _of_vehicle(model: Model, vehicle: Vehicle) -> Model:
    """The same model of another vehicle file; its tyres stay."""
    stays = (n for n in model.names if n != YAW_INERTIA or n in model.values)
    values = {n: model.value(n) for n in stays}
    return replace(model, vehicle=vehicle, values=values)


def _instead(put: tuple[str, ...], effect: str, rival: str) -> tuple[str, ...]:
    return tuple(rival if e == effect else e for e in put)


class _Search:
    """The reference once, the later driving wherever leading changes have been put in."""

    def __init__(
        self, before: Fit, start: Fit, candidates: Sequence[str | Effect] | None, rules: Rules
    ) -> None:
        self.before, self.start, self.rules = before, start, rules
        model, both = start.model, (before.driving, start.driving)
        free, lacked = set(model.free_names), {e.id for e in before.model.candidates}
        effects = tuple(
            e
            for e in considered(model, candidates)
            if e.scanned is None and e.id in lacked and all(d.shows(e) for d in both)
        )
        own = (e for e in model.parts if e.scanned is None and free.issuperset(e.named))
        several = [*map(of_effect, (*own, *effects)), *(of_tyre(model, a) for a in AXLES)]
        if YAW_INERTIA in free:
            several.append(of_inertia(model))
        clocks = [c for c in CLOCKS if c.channel != "fx_n" or start.driving.force_known]
        fitted = [m for m in several if m.id in {e.id for e in effects} or free.issuperset(m.names)]
        self.can = {m.id: m for m in fitted}
        self.may = [*fitted, *map(of_clock, clocks)]
        self.reference = Reference(before, fitted, effects)
        self.visited: dict[frozenset[str], Exact] = {}

    def found(self) -> Change:
        """The changes, linearised where those that explain most have been put in exactly."""
        begin = self.reference.fitted(self.start, (), {}, {})
        self.visited[frozenset()] = begin
        # Lines are drawn from the reference: where nothing may change it goes far from any car.
        told = self._told(replace(begin, fit=self.start, shift=np.zeros_like(begin.shift)))
        alone = [(e,) for e in told.alone if e in self.can][:_TRIED]
        for few in (self._leading(told, begin), *alone):
            self._visit(few, told)
        state = max(self.visited.values(), key=lambda s: self._evidence(s, told, 1.0))
        seen: set[tuple[str, ...]] = set()
        for _ in range(_ROUNDS):
            told = self._told(state)
            seen.add(state.put)
            self._visit(self._leading(told, state), told)
            for effect in state.put:
                for rival in self._rivals(effect, told):
                    self._visit(_instead(state.put, effect, rival), told)
            best, state = self._best(told, state), self.visited[frozenset(state.put)]
            if best is state:
                best = self._better(state, told)
            if best.put in seen:
                break
            state = best
        return self._change(told, state)

    def _better(self, state: Exact, told: Competition) -> Exact:
        """The same with a rival in place of an effect, where both together say it is the rival."""
        for effect in state.put:
            odds = self._odds(effect, state, told)
            best = max(odds, key=lambda e: odds[e])
            if best != effect:
                return self.visited[frozenset(_instead(state.put, effect, best))]
        return state

    def _odds(self, effect: str, state: Exact, told: Competition) -> dict[str, float]:
        """Log-odds of what was fitted in place of an effect that was put in.

        A rival is fitted together with it too, in the reference and in the later driving: which of
        the two differs tells more than which of them alone is likelier, as what the reference left
        may speak for one of them.
        """
        ratio, odds = told.ratio_of(state.put), {effect: 0.0}
        here, nothing = self._evidence(state, told, ratio), self.visited[frozenset()]
        least = self.rules.near * (state.reached - nothing.reached)
        for rival in self.can:
            other = self.visited.get(frozenset(_instead(state.put, effect, rival)))
            if rival in state.put or other is None:
                continue
            odds[rival] = self._evidence(other, told, ratio) - here
            if other.reached - nothing.reached < least:
                continue
            both = (*state.put, rival)
            begin = dict.fromkeys((*state.changes, *other.changes), 0.0)
            self._visit(both, told, (begin | state.changes, begin | other.changes))
            pair = self.visited.get(frozenset(both))
            if pair is not None:
                # No line tells more of one than the likelihood loses without it.
                w, v = (
                    min(
                        told.wald(a, b, pair.changes),
                        2.0 * max(pair.log_likelihood - alone.log_likelihood, 0.0),
                    )
                    for a, b, alone in ((rival, effect, state), (effect, rival, other))
                )
                prices = (told.price(s.put, s.shift) for s in (state, other))
                odds[rival] = 0.5 * (w - v) / ratio + next(prices) - next(prices)
        return odds

    def _rivals(self, effect: str, told: Competition) -> list[str]:
        """What may have changed in its place."""
        own = told.causes.of(effect)
        several = (*self.can[effect].rivals, *(() if own is None else own.effects))
        return [e for e in dict.fromkeys(several) if e in self.can and e != effect]

    def _told(self, state: Exact) -> Competition:
        reference, side = self.reference, self.reference.side
        later = Side(state.fit, reference.names, reference.effects, like=side)
        if self.start.model.vehicle != self.before.model.vehicle:
            # What both share is told in terms of the vehicle file of the later driving.
            same = replace(self.before, model=state.fit.model)
            side = Side(same, reference.names, reference.effects, like=side, residuals_of=side)
        differences = Differences(side, later, state.shift, reference.shared)
        return Competition(
            differences,
            self.may,
            reference.place,
            side.names,
            np.diag(side.information),
            self.start.driving.samples,
            state.put,
            self.rules,
        )

    def _leading(self, told: Competition, state: Exact) -> tuple[str, ...]:
        """Of each credible set the likeliest that can be fitted, or what was, if it is like it."""
        found = []
        for s in told.causes.sets:
            known = next((e for e in s.effects if e in state.put), "")
            known = known or told.acts_like(s.effects[0])
            found.append(known or next((e for e in s.effects if e in self.can), ""))
        return tuple(dict.fromkeys(e for e in (*state.put, *found) if e))

    def _visit(
        self,
        put: tuple[str, ...],
        told: Competition,
        also: Sequence[Mapping[str, float]] = (),
    ) -> None:
        if frozenset(put) in self.visited:
            return
        usual = {
            n: u for e in put for n, u in zip(self.can[e].names, self.can[e].scale, strict=True)
        }
        with suppress(NumericalError, np.linalg.LinAlgError):
            told_by_lines = {n: told.sizes[n] for n in usual}
            exact = self.reference.fitted(self.start, put, told_by_lines, usual, also)
            self.visited[frozenset(put)] = exact

    def _evidence(self, state: Exact, told: Competition, ratio: float) -> float:
        """Log-likelihood over the variance ratio, less the price of the changes [nats]."""
        return state.reached / ratio - told.price(state.put, state.shift)

    def _best(self, told: Competition, state: Exact) -> Exact:
        """The state with most evidence, all that come close to it at their maxima."""
        ratio = told.ratio_of(state.put)
        least = max(self._evidence(s, told, ratio) for s in self.visited.values()) - _CLOSE
        for key, s in tuple(self.visited.items()):
            if not s.climbed and self._evidence(s, told, ratio) > least:
                with suppress(NumericalError, np.linalg.LinAlgError):
                    self.visited[key] = self.reference.climbed(self.start, s)
        return max(self.visited.values(), key=lambda s: self._evidence(s, told, ratio))

    def _change(self, told: Competition, state: Exact) -> Change:
        """The result: exact likelihoods decide on what was put in, scores on all else."""
        ratio = told.ratio_of(state.put)
        exact = {e: self._exact(e, state, told, ratio) for e in state.put}
        rest = [
            s
            for s in told.causes.sets
            if not any(e in state.put for e in s.effects)
            and not told.acts_like(s.effects[0])
            and frozenset({*state.put, s.effects[0]}) not in self.visited  # refused by a refit
        ]
        causes = told.causes.only([*(s for s in exact.values() if s is not None), *rest], {})
        sizes, stds = (self._of_the_car(told_by, state) for told_by in (told.sizes, told.stds))
        # Of what was put in the exact size: no line is drawn from the reference to there.
        for e in state.put:
            sizes |= self._sizes_in(state, e)
        for e, m in self.can.items():
            without, put = frozenset(state.put) - {e}, frozenset({*state.put, e})
            one, other = self.visited.get(without), self.visited.get(put)
            if len(m.names) > 1 or one is None or other is None:
                continue
            # As many standard errors from nothing as the likelihood ratio says, at most.
            ((name, size),) = self._sizes_in(other, e).items()
            rises = 2.0 * (other.reached - one.reached) / told.ratio_of((e,))
            sizes[name] = size if rises > 0.0 else sizes[name]
            stds[name] = max(stds[name], abs(sizes[name]) / float(np.sqrt(max(rises, 1.0))))
        for s in (s for s in exact.values() if s is not None):
            for e in s.effects:
                other = self._in_place(e, s, state)
                if other is not None and e not in state.put:
                    beside = self._told(other)
                    sizes |= self._sizes_in(other, e)
                    lines = self._of_the_car(beside.stds, other)
                    stds |= {n: max(lines[n], stds[n]) for n in self.can[e].names}
        found = [self._of(m, causes, sizes, stds, told) for m in self.may]
        order = [e for s in causes.sets for e in s.effects]
        found.sort(
            key=lambda e: (order.index(e.id) if e.id in order else len(order), -e.probability)
        )
        return Change(self.before, state.fit, causes, tuple(found), self.rules)

    def _sizes_in(self, state: Exact, effect: str) -> dict[str, float]:
        return {n: state.changes[n] for n in self.can[effect].names}

    def _of_the_car(self, told_by: Mapping[str, float], state: Exact) -> dict[str, float]:
        """Lines tell differences of parameters: of relative errors as shares of what there was."""
        own = self.reference.factors(state)
        return {n: x / own.get(n, 1.0) for n, x in told_by.items()}

    def _in_place(self, effect: str, of: CredibleSet, state: Exact) -> Exact | None:
        """The state with an effect in place of another one of its set, where it was visited."""
        others = frozenset(state.put) - set(of.effects)
        return self.visited.get(others | {effect})

    def _exact(
        self, effect: str, state: Exact, told: Competition, ratio: float
    ) -> CredibleSet | None:
        """What may have changed in place of an effect that was put in; None where nothing need."""
        others = frozenset(state.put) - {effect}
        here = self._evidence(state, told, ratio)
        log_odds = self._odds(effect, state, told)
        linear = told.causes.of(effect)
        if linear is not None:
            own = linear.weights.get(effect, 0.0)
            for e, weight in linear.weights.items():
                if e not in log_odds and min(weight, own) > 0.0:
                    log_odds[e] = float(np.log(weight / own))
        names = sorted(log_odds, key=lambda e: -log_odds[e])
        odds = np.array([log_odds[e] for e in names])
        without = self.visited.get(others)
        if without is not None:
            absent = self._evidence(without, told, ratio) - here
            whole = scipy.special.logsumexp(odds)
            if whole - np.logaddexp(whole, absent) < np.log(self.rules.credible):
                return None
        weights = np.exp(odds - scipy.special.logsumexp(odds))
        few = int(np.argmax(np.cumsum(weights) >= self.rules.credible)) + 1
        listed = dict(zip(names, map(float, weights), strict=True))
        return CredibleSet(tuple(names[:few]), tuple(listed.values())[:few], listed)

    def _of(
        self,
        m: May,
        causes: Causes,
        sizes: dict[str, float],
        stds: dict[str, float],
        told: Competition,
    ) -> EffectChange:
        rules, own = self.rules, causes.of(m.id)
        value, std = (tuple(known[n] for n in m.names) for known in (sizes, stds))
        bound = tuple(abs(v) + rules.bound * s for v, s in zip(value, std, strict=True))
        matters = [p.matters for p in m.parameters]
        least = tuple(
            max(told.least(s, usual), w + (rules.bound - 1.0) * s)
            for s, usual, w in zip(std, m.scale, matters, strict=True)
        )
        group: tuple[str, ...] = ()
        said: Said = "not testable"
        if own is not None:
            group = tuple(e for e in own.effects if e != m.id)
            said = "one of a group" if group else "changed"
            if not possible(m, value, std, rules):
                said = "implausible"
            elif all(abs(v) + s < w for v, s, w in zip(value, std, matters, strict=True)):
                said, group = "negligible", ()
        elif all(b < w for b, w in zip(bound, matters, strict=True)):
            said = "unchanged"
        names, units = zip(*((p.name, p.unit) for p in m.parameters), strict=True)
        probability = causes.inclusion.get(m.id, 0.0)
        return EffectChange(m.id, names, units, value, std, bound, probability, said, group, least)
