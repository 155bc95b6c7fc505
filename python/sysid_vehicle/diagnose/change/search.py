"""The search for what changed: scores lead, exact likelihoods of both drivings decide."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import cached_property, partial

import numpy as np
import scipy

from ...effects import Effect
from ...errors import NumericalError
from ...identify import Fit
from ...rules import Rules
from ...vehicle import AXLES, GRAVITY_MPS2
from ..candidates.clocks import CLOCKS
from ..candidates.possible import considered
from .both_axles import SCALINGS, by_other_names, seated
from .changes_compete import Competition
from .in_time import InTime
from .may_change import (
    PAYLOAD,
    YAW_INERTIA,
    as_one,
    forces_of_tyre,
    of_clock,
    of_effect,
    of_inertia,
    of_tyre,
)
from .pieces import Pieces
from .reference import Exact, Reference
from .rivals import beside, idle, in_place, instead, lacking, leading
from .telling import Telling

_TRIED = 5  # of the best single changes, exactly
_BESIDE = 2  # of what goes best with each of these
_ROUNDS = 4  # times that scores are taken anew
_CLOSE = 4.0  # nats of evidence, that a search may end below the maximum


class Search:
    """The reference once, the later driving wherever leading changes have been put in.

    Parameters
    ----------
    before : Fit
        The reference.
    start : Fit
        The same on the later driving.
    candidates : sequence of str, optional
        Effects beside those of the model that may have changed.
    rules : Rules
    in_time : InTime, optional
        When searches end; what was not fitted by then is noted.

    Attributes
    ----------
    may : list of May
        What may have changed.
    tyres : tuple of May
        Those of it that are the tyres of an axle.
    can : dict of str to May
        What of it can be fitted.
    reference : Reference
    visited : dict of frozenset to Exact
        What was fitted, by what was put in.
    failed : set of frozenset
        What cannot be fitted.
    alike : Alike
        How like the reference the later driving is.
    """

    in_time = InTime()

    def __init__(
        self,
        before: Fit,
        start: Fit,
        candidates: Sequence[str | Effect] | None,
        rules: Rules,
        in_time: InTime | None = None,
    ) -> None:
        self.before, self.start, self.rules = before, start, rules
        self.in_time = in_time or InTime()
        known = Pieces(before.driving)
        pieces, self.alike = (known, Pieces(start.driving, known)), known.alike(start.driving)
        model, both = start.model, (before.driving, start.driving)
        free, lacked = set(model.free_names), {e.id for e in before.model.candidates}
        effects = tuple(
            e
            for e in considered(model, candidates)
            if e.scanned is None and e.id in lacked and all(d.shows(e) for d in both)
        )
        self.tyres = tuple(of_tyre(model, a) for a in AXLES)
        own = (e for e in model.parts if e.scanned is None and free.issuperset(e.named))
        several = [*map(of_effect, (*own, *effects)), *self.tyres]
        if YAW_INERTIA in free:
            several.append(of_inertia(model))
        clocks = [c for c in CLOCKS if c.channel != "fx_n" or start.driving.force_known]
        fitted = [m for m in several if m.id in {e.id for e in effects} or free.issuperset(m.names)]
        self.reference = Reference(before, fitted, effects, rules)
        self._scalings = seated(model, self.tyres, free, [e for e in effects if e.acts])
        fitted += map(of_effect, self._scalings)
        self.can = {m.id: m for m in fitted}
        self.may = [*fitted, *map(of_clock, clocks)]
        self._telling = Telling(
            self.reference, start, self.may, self._scalings, pieces, self.alike.unlike
        )
        self.visited: dict[frozenset[str], Exact] = {}
        self.failed: set[frozenset[str]] = set()

    @cached_property
    def singles(self) -> Competition:
        """What competes beside nothing, where what may have changed alone has been fitted."""
        nothing = self.in_time.of(lambda: self.reference.fitted(self.start, (), {}, {}), None)
        begin = self.visited[frozenset()] = nothing or self.reference.as_it_is(self.start)
        # Lines are drawn from the reference: where nothing may change it goes far from any car.
        told = self.told(replace(begin, fit=self.start, shift=np.zeros_like(begin.shift)))
        alone = [(e,) for e in told.alone if e in self.can][:_TRIED]
        # A load, and another set of tyres, change several at once, of which none may lead.
        at_once = [s for s in (PAYLOAD, tuple(e.id for e in SCALINGS)) if self.can.keys() >= set(s)]
        for few in (self._leading(told, begin), *alone, *at_once):
            self._visit(few, told)
        return told

    def found(self) -> tuple[Competition, Exact]:
        """What competes where the changes that explain most have been put in, and these."""
        told = self.singles
        state = max(self.visited.values(), key=lambda s: self.evidence(s, told, 1.0))
        left = self.told(state).causes.sets if state.put else ()
        if any({*state.put}.isdisjoint(s.effects) for s in left):
            self._in_twos()
            state = max(self.visited.values(), key=lambda s: self.evidence(s, told, 1.0))
        seen: set[tuple[str, ...]] = set()
        for _ in range(_ROUNDS):
            told = self.told(state)
            seen.add(state.put)
            self._visit(self._leading(told, state), told)
            self._visit_in_place(state, told)
            best, state = self._best(told, state), self.visited[frozenset(state.put)]
            best = self._better(state, told) if best is state else best
            if best.put in seen:
                break
            state = best
            if self.in_time.over:
                told = self.told(state)
                break
        return self._settled(told, state)

    def _visit_in_place(self, state: Exact, told: Competition) -> None:
        """What may be there in place of each effect that was put in, and is not idle there."""
        least = self.rules.told * told.ratio_of(state.put)
        asked = [e for e in state.put if not idle(e, state, self.visited, least)]
        for few in [instead(state.put, e, r) for e in asked for r in in_place(e, told, self.can)]:
            self._visit(few, told)

    def _in_twos(self) -> None:
        """Of each change that was fitted alone, that together with what lines name beside it."""
        for state in [s for s in self.visited.values() if s.put]:
            if self.in_time.over:
                self.in_time.twos = True
                break
            told = self.told(state)
            for more in beside(told, self.can, self.rules)[:_BESIDE]:
                start = dict.fromkeys(self.can[more].names, 0.0) | state.changes
                self._visit((*state.put, more), told, (start,))

    def _settled(self, told: Competition, state: Exact) -> tuple[Competition, Exact]:
        """What will be named has been put in, and not a rival of it: sizes are told beside it."""
        seen: set[tuple[str, ...]] = set()
        while state.put not in seen and len(seen) < _ROUNDS:
            seen.add(state.put)
            self._visit_in_place(state, told)
            best = self._better(state, told)
            if best is not state:
                state, told = best, self.told(best)
            told, state = self._shown(told, state)
        best = self._at_maximum(state)
        return (told, state) if best is state else (self.told(best), best)

    def worth_their_price(self, told: Competition, state: Exact) -> tuple[Competition, Exact]:
        """Of a state what is worth its price at the variance ratio that all together end with.

        That of fewer changes may be smaller, and by it more was put in.
        """
        while True:
            put, ratio = frozenset(state.put), told.ratio_of(state.put)
            parts = (s for key, s in self.visited.items() if key < put)
            part = max((state, *parts), key=lambda s: self.evidence(s, told, ratio))
            if part is state:
                return told, state
            state = self._at_maximum(part)
            told = self.told(state)

    def _at_maximum(self, state: Exact) -> Exact:
        """The state where its likelihood is highest, as that of nothing is."""
        with suppress(NumericalError, np.linalg.LinAlgError):
            there = self.in_time.of(lambda: self.reference.climbed(self.start, state), None)
            self.in_time.maxima |= there is None
            self.visited[frozenset(state.put)] = there or state
            self.visited[frozenset()] = self.reference.nothing
        return self.visited[frozenset(state.put)]

    def _shown(self, told: Competition, state: Exact) -> tuple[Competition, Exact]:
        """With what lines and likelihoods both tell, and nothing else.

        A likelihood gains by what the model lacks, whatever is fitted; and no line holds far away.
        """
        gone: set[frozenset[str]] = set()
        for _ in range(_ROUNDS):
            while state.put:
                weak = [
                    e
                    for e in as_one(state.put)
                    if self._off_nothing(e, state, told) > 1.0 - self.rules.credible
                ]
                rests = [tuple(e for e in state.put if e not in several) for several in weak]
                for rest in rests:
                    self._visit(rest, told)
                ratio = told.ratio_of(state.put)
                fitted = [self.visited[k] for k in map(frozenset, rests) if k in self.visited]
                if not fitted:
                    break
                # Of several that no line tells beside each other, what is missed least goes.
                gone.add(frozenset(state.put))
                state = max(fitted, key=lambda s: self.evidence(s, told, ratio))
                told = self.told(state)
            for e in self._leading(told, state):
                if e not in state.put:
                    self._visit((*state.put, e), told)
            # What was fitted beside its rival may belong there, whatever lines lead to.
            few = frozenset(state.put)
            more = {k for k in self.visited if few < k and len(k - few) == 1} - gone
            found = [s for k, s in self.visited.items() if k in more]
            if not found:
                break
            ratio = told.ratio_of(state.put)
            best = max((state, *found), key=lambda s: self.evidence(s, told, ratio))
            if best is state:
                break
            state, told = best, self.told(best)
        return told, state

    def _off_nothing(self, effects: tuple[str, ...], state: Exact, told: Competition) -> float:
        """Of what was put in as one change, the p-value of nothing.

        Four coefficients of a tyre lie in a bent valley, where no line tells how far they are from
        nothing: its forces do, the most of them as all sums of four (Scheffe, Biometrika 1953).
        """
        if len(effects) == 1 and self.can[effects[0]] in self.tyres:
            most = max((share / std) ** 2 for share, std in self.forces(effects[0], state, told))
            return float(scipy.stats.chi2.sf(most, len(self.can[effects[0]].names)))
        return told.off_nothing(effects, state.changes)

    def forces(self, axle: str, state: Exact, told: Competition) -> Iterator[tuple[float, float]]:
        """By which shares the side forces of an axle's tyres differ, and their standard errors."""
        m = self.can[axle]
        before = [self.before.model.value(n) for n in m.names]
        sizes = [state.changes[n] for n in m.names]
        ay = np.abs(self.start.driving.channel("ay_mps2"))
        most = float(np.nanpercentile(ay, 99.0)) / GRAVITY_MPS2
        for share, slopes in forces_of_tyre(before, sizes, most):
            yield share, told.std_along(axle, slopes, state.changes)

    def _better(self, state: Exact, told: Competition) -> Exact:
        """The same with a rival in place of an effect, where both together say it is the rival."""
        for effect in state.put:
            odds = self.odds(effect, state, told)
            best = max(odds, key=lambda e: odds[e])
            if best != effect:
                return self.visited[frozenset(instead(state.put, effect, best))]
        return state

    def odds(self, effect: str, state: Exact, told: Competition) -> dict[str, float]:
        """Log-odds of what was fitted in place of an effect that was put in.

        A rival is fitted together with it too, in the reference and in the later driving: which of
        the two differs tells more than which of them alone is likelier, as what the reference left
        may speak for one of them. Of tyres no line tells it (`_off_nothing`); and what changes them
        by other names, no less likely, is no less likely for its more coefficients.
        """
        ratio, odds = told.ratio_of(state.put), {effect: 0.0}
        here, nothing = self.evidence(state, told, ratio), self.visited[frozenset()]
        least = self.rules.near * (state.reached - nothing.reached)
        for rival in self.can:
            other = self.visited.get(frozenset(instead(state.put, effect, rival)))
            if rival in state.put or other is None:
                continue
            odds[rival] = self.evidence(other, told, ratio) - here
            if rival in by_other_names(effect, state.put):
                gain = (other.log_likelihood - state.log_likelihood) / ratio
                odds[rival] = max(odds[rival], min(gain, 0.0))
            if other.reached - nothing.reached < least:
                continue
            both = (*state.put, rival)
            begin = dict.fromkeys((*state.changes, *other.changes), 0.0)
            self._visit(both, told, (begin | state.changes, begin | other.changes))
            pair = self.visited.get(frozenset(both))
            if pair is not None and not {effect, rival} & {m.id for m in self.tyres}:
                # No line tells more of one than the likelihood loses without it.
                w, v = (
                    min(
                        told.wald(a, b, pair.changes),
                        2.0 * max(pair.log_likelihood - alone.log_likelihood, 0.0),
                    )
                    for a, b, alone in ((rival, effect, state), (effect, rival, other))
                )
                prices = (told.price(s.put, s.changes) for s in (state, other))
                odds[rival] = 0.5 * (w - v) / ratio + next(prices) - next(prices)
        return odds

    def told(self, state: Exact, *, at_one_point: bool = False) -> Competition:
        """What competes beside what was put in: lines are then drawn at one point of both."""
        return self._telling.of(state, at_one_point=at_one_point)

    def _leading(self, told: Competition, state: Exact) -> tuple[str, ...]:
        return leading(told, state.put, self.can)

    def _visit(
        self, put: tuple[str, ...], told: Competition, also: Sequence[Mapping[str, float]] = ()
    ) -> None:
        key, usual = frozenset(put), {n: u for e in put for n, u in self.can[e].usual.items()}
        if key in self.visited or key in self.failed:
            return
        self.failed.add(key)
        with suppress(NumericalError, np.linalg.LinAlgError):
            lines = {n: told.sizes[n] for n in usual}
            exact = self.in_time.of(
                lambda: self.reference.fitted(self.start, put, lines, usual, also), None
            )
            self.failed.remove(key)
            if exact is None:
                self.in_time.late[key] = put
            else:
                self.visited |= {key: exact, frozenset(): self.reference.nothing}

    def again(self, other: Exact) -> None:
        """What a search under other noise ended with, under this one."""
        self._visit(other.put, self.singles, (other.changes,))

    def lacking(self, effect: str, state: Exact, group: Sequence[str]) -> list[Exact]:
        """What was fitted, to its maximum, without an effect and all of its group.

        Nothing at all is among it, and what was put in without this change; what has another effect
        in its place is not, as `odds` knows that, nor what holds it by other names.
        """
        return lacking(effect, state.put, group, self.visited)

    def evidence(self, state: Exact, told: Competition, ratio: float) -> float:
        """Log-likelihood over the variance ratio, less the price of the changes [nats].

        Among what is likelier than nothing, and adds changes to each part of it, that by which
        these compare: what is added and only gains as a lack of the reference does is no change.
        """
        some = self.over_nothing(state, told, ratio) > 0.0
        more = some and not self._lacking_in_both(state, ratio)
        likelihood = state.among if more else state.reached
        return likelihood / ratio - told.price(state.put, state.changes)

    def _lacking_in_both(self, state: Exact, ratio: float) -> bool:
        """Whether some of what was put in does as well where it is in both drivings the same."""
        put = frozenset(state.put)
        return any(
            state.among <= part.among
            or state.log_likelihood - self._sharing(state, put - key) < self.rules.told * ratio
            for key, part in self.visited.items()
            if key < put and part.reached > state.reached
        )

    def _sharing(self, state: Exact, few: frozenset[str]) -> float:
        """Log-likelihood with some changes in both drivings; as good where nobody asked in time."""
        work = partial(self.reference.sharing, self.start, state, few)
        return self.in_time.of(work, state.log_likelihood)

    def over_nothing(self, state: Exact, told: Competition, ratio: float) -> float:
        """By how much a state is likelier than that nothing changed [nats]."""
        nothing = self.visited[frozenset()].reached
        return (state.reached - nothing) / ratio - told.price(state.put, state.changes)

    def nothing(self, told: Competition) -> float:
        """Probability that nothing changed, beside all that was fitted.

        Likelihoods count as much less as intervals are wider by what a model lacks elsewhere.
        """
        several = (s for s in self.visited.values() if s.put)
        odds = [self.over_nothing(s, told, told.width_of(s.put)) for s in several]
        return float(scipy.special.expit(-scipy.special.logsumexp(odds))) if odds else 1.0

    def _best(self, told: Competition, state: Exact) -> Exact:
        """The state with most evidence, all that come close to it at their maxima."""
        ratio = told.ratio_of(state.put)
        least = max(self.evidence(s, told, ratio) for s in self.visited.values()) - _CLOSE
        for s in tuple(self.visited.values()):
            if self.evidence(s, told, ratio) > least:
                self._at_maximum(s)
        return max(self.visited.values(), key=lambda s: self.evidence(s, told, ratio))
