"""What a reference fit knows of later driving: its scores, priors, and what it lets go."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np

from ..._common.arrays import FloatArray, as_float64
from ...effects import Effect
from ...errors import NumericalError
from ...identify import Fit, lost_to_input_noise
from ...identify.search.box import free_box
from ...identify.search.climb import climb as to_the_maximum
from ...identify.search.objective import Objective
from ...model import Model
from ...rules import USUAL, Rules
from ..candidates.possible import OF_A_FACTOR
from .beside_reference import Shared, Side
from .both_axles import SCALINGS, as_tyres, moves, without
from .maximum import along, highest, highest_of
from .may_change import May, change
from .together import cost, starts_of, together

_DELAY = "delay_s"  # how names of delays end
_FOLLOWED = 2  # of the likeliest starts
_LOOSE = 2.0  # times the usual change, by which fitted parameters may be off
_VAGUE = 0.1  # of the information: of the prior of unknown forces that both drivings share


@dataclass(frozen=True, eq=False)
class Exact:
    """Later driving with some changes put in.

    Attributes
    ----------
    put : tuple of str
        Ids of what changed.
    fit : Fit
        With tyres that are multiplied by what was put in (`both_axles.py`).
    searched : Model
        The same model where these are not.
    shift : array, shape (n,)
        By which its parameters differ from those of the reference as it was; as much as lines say
        that what multiplies tyres makes of them.
    changes : dict of str to float
        By which parameters of what changed differ from the reference fitted in the same way.
    log_likelihood : float
        Of both drivings, with exact inputs of the later one: of a lag and a delay by the same time
        the lag is likelier otherwise, as it filters their noise.
    reached : float
        The same, less what the changes gain where they are in both the same: what the reference
        left is no evidence. By this it is likelier than nothing.
    among : float
        The same, less what of that the reference allows: where it knows better, half of a large
        change in both drivings is no more than a compromise. By this it is likelier than others.
    climbed : bool
        Whether that is the maximum of the likelihood itself, and not where a search stands still.
    """

    put: tuple[str, ...]
    fit: Fit
    searched: Model
    shift: FloatArray
    changes: dict[str, float]
    log_likelihood: float
    reached: float
    among: float
    climbed: bool = False


class Reference:
    """The reference: its scores, and what is known of what both drivings share.

    Parameters
    ----------
    before : Fit
    may : sequence of May
        What may have changed, clocks of inputs apart.
    effects : sequence of Effect
        Those of them that the model lacks.
    rules : Rules

    Attributes
    ----------
    side : Side
    names : tuple of str
        Full names of parameters.
    place : dict of str to int
        Their columns, and those of clocks.
    shared : Shared
        Effects that the model lacks are about as large as usual, or nothing.
    rules : Rules
    nothing : Exact
        Both drivings without a change, at the highest maximum that any search came to.
    """

    nothing: Exact

    def __init__(
        self,
        before: Fit,
        may: Sequence[May],
        effects: Sequence[Effect],
        rules: Rules = USUAL,
    ) -> None:
        self.before, self.effects, self.rules = before, tuple(effects), rules
        model = before.model
        names = dict.fromkeys([*(n for m in may for n in m.names), *model.free_names])
        self.names = tuple(names)
        self.side = Side(before, self.names, effects)
        columns, targets = self.side.names, set(self.side.unknown.names)
        self.place = {n: i for i, n in enumerate(columns) if n not in targets}
        free = set(model.free_names)
        precision = _VAGUE * np.maximum(np.diag(self.side.information), 1e-300)
        centre = np.zeros(len(columns))
        for m in may:
            for name, usual in zip(m.names, m.scale, strict=True):
                loose = _LOOSE if name in free else 1.0
                precision[self.place[name]] = (loose * usual) ** -2
        for name in free:
            i = self.place[name]
            if name in model.priors:
                mean, std = model.priors[name]
                precision[i], centre[i] = std**-2, mean - model.value(name)
        self.shared = Shared(as_float64(precision), centre)
        self._of = {n: m.id for m in may for n in m.names}
        self._of |= {n: e.id for e in SCALINGS for n in e.named}
        self._fitted: dict[frozenset[str], tuple[Model, float]] = {}
        self._sharing: dict[tuple[frozenset[str], frozenset[str], bool], float] = {}
        self._nothing, self._unchanged = -np.inf, model
        self._likeliest = self._best = -np.inf  # of later driving, and less what both share
        self._alone = self._fit(before, (), {}, {})[1]

    def value(self, name: str) -> float:
        """Of a parameter in the reference."""
        model = self.before.model
        if name in model.parameters:
            return model.value(name)
        several = (*self.effects, *SCALINGS)
        return next(e.named[name].null_value for e in several if name in e.named)

    def own(self, state: Exact, name: str) -> float:
        """The same in the reference, fitted as some state is."""
        model = self._fitted[frozenset(state.put)][0]
        return model.value(name) if name in model.parameters else self.value(name)

    def factors(self, state: Exact) -> dict[str, float]:
        """What relative errors multiply by in the reference, fitted as some state is."""
        names = (n for n in self.names if n.endswith(OF_A_FACTOR))
        return {n: 1.0 + self.own(state, n) for n in names}

    def fitted(
        self,
        start: Fit,
        put: Sequence[str],
        sizes: Mapping[str, float],
        usual: Mapping[str, float],
        also: Sequence[Mapping[str, float]] = (),
    ) -> Exact:
        """Both drivings with some changes in the later one, all else the same.

        Parameters that change have the values in the reference that they have in a fit to it alone.

        Parameters
        ----------
        start : Fit
            The reference as it is, on the later driving.
        put : sequence of str
            Ids of what changed.
        sizes : mapping of str to float
            Of their parameters, as lines from the reference tell them.
        usual : mapping of str to float
            Usual sizes of these.
        also : sequence of mapping
            Other sizes to begin with.

        Returns
        -------
        Exact
        """
        key = frozenset(put)
        if key not in self._fitted:
            self._fitted[key] = self._own(put, sizes, usual)
        own = self._fitted[key][0]
        if not put:
            model, value = self._fit(start, put, sizes, usual, own)
            model, value = self._climbed(start, model, own, [])
            return self._without(start, model, value)
        model, value = self._fit(start, put, sizes, usual, own, also)
        return self._exact(start, put, sizes, model, value, climbed=False)

    def as_it_is(self, start: Fit) -> Exact:
        """Nothing changed, and nothing was fitted to the later driving: where no time is left."""
        model = start.model
        objective = together(self.before, start, model, self.before.model, ())
        value = objective.log_likelihood(model.vector(), self.before.noise.vector())
        self._fitted[frozenset()] = self.before.model, self._alone
        return self._without(start, model, value)

    def _without(self, start: Fit, model: Model, value: float) -> Exact:
        """Nothing changed."""
        self._nothing, self._unchanged = value, model
        self.nothing = self._exact(start, (), (), model, value, climbed=True)
        return self.nothing

    def climbed(self, start: Fit, state: Exact) -> Exact:
        """The same at the maximum of the likelihood, as is what nothing changed.

        Searches hold gains: they end some nats below it, as much as a change may gain.
        """
        if state.climbed:
            return state
        own, names = self._fitted[frozenset(state.put)][0], list(state.changes)
        model, value = self._climbed(start, state.searched, own, names)
        return self._exact(start, state.put, names, model, value, climbed=True)

    def sharing(self, start: Fit, state: Exact, few: Collection[str]) -> float:
        """Log-likelihood of a state in which some of what was put in is in both drivings the same.

        The rest changes as in the state: what the reference refuses of that says nothing of these.
        """
        key = (frozenset(state.put), frozenset(few), state.climbed)
        if key not in self._sharing:
            own, later = self._fitted[key[0]][0], state.searched
            alike = {n for n in state.changes if self._of[n] in few}
            changed = [n for n in state.changes if n not in alike]
            objective = together(self.before, start, later, own, changed)
            ends = [{n: m.value(n) for n in alike} for m in (own, later)]
            ends.append({n: 0.5 * (ends[0][n] + ends[1][n]) for n in alike})
            best, reached = self._followed(objective, later, ends, climb=state.climbed)
            fit = replace(start, model=as_tyres(best))
            self._sharing[key] = reached + lost_to_input_noise(fit, fit.driving)
        return self._sharing[key]

    def _exact(
        self,
        start: Fit,
        put: Sequence[str],
        names: Iterable[str],
        model: Model,
        value: float,
        *,
        climbed: bool,
    ) -> Exact:
        """What was fitted, less what the changes gain where they are in both the same."""
        own, reached, among = self._fitted[frozenset(put)][0], value, value
        self._likeliest = max(self._likeliest, value)
        # What gains too little to be named, or to replace the best: what it shares is not asked.
        leads = max(self._best - self._nothing, 0.0)
        if put and value - self._nothing > max(self.rules.told, self.rules.near * leads):
            seconds = [d.usable_s for d in (self.before.driving, start.driving)]
            wanted = self._fitted[frozenset(put)][1] - self._alone
            wanted *= sum(seconds) / seconds[0]  # as much in each second of both
            same, allowed, both = self._same(start, own, model, wanted, climb=climbed)
            if {*both.effects} == {*start.model.effects} and same > self._nothing:
                # Tyres that are in both the same are no change: searches end in several valleys.
                self._without(start, both, same)
            reached -= max(same - self._nothing, 0.0)
            among -= max(allowed - self._nothing, 0.0)
        self._best = max(self._best, reached)
        shift = np.zeros(len(self.side.names))
        for n in without(model).free_names:
            shift[self.place[n]] = model.value(n) - self.value(n)
        changes = {n: change(n, own.value(n), model.value(n)) for n in names}
        for e in (e for e in SCALINGS if e.id in put):
            for n, moved in moves(e.id, model).items():
                shift[self.place[n]] += moved * sum(changes[factor] for factor in e.named)
        fit = replace(start, model=as_tyres(model))
        lost = lost_to_input_noise(fit, fit.driving)
        told = (value + lost, reached + lost, among + lost)
        return Exact(tuple(put), fit, model, shift, changes, *told, climbed)

    def _climbed(
        self, start: Fit, model: Model, own: Model, changed: Sequence[str]
    ) -> tuple[Model, float]:
        """From where a search stands still to the maximum of the likelihood itself."""
        objective = together(self.before, start, model, own, changed)
        noise, box = self.before.noise.vector(), free_box(model)
        p, _, reached = to_the_maximum(objective, model.vector(), noise, box)
        values = {n: float(p[model.parameters[n].column]) for n in model.free_names}
        return model.with_values(values), reached

    def _same(
        self, start: Fit, own: Model, apart: Model, wanted: float, *, climb: bool
    ) -> tuple[float, float, Model]:
        """Log-likelihoods of both drivings where what was put in is in both the same, and where.

        The second one gains no more than the reference alone wants (`wanted`, of both drivings),
        where it refuses the compromise of both. Tyres that are multiplied in both are other tyres
        of both.
        """
        own, apart = without(own), as_tyres(apart)
        changed = [n for n in apart.free_names if n not in self.before.model.free_names]
        objective = together(self.before, start, apart, own, [])
        ends = [{n: m.value(n) for n in apart.free_names} for m in (own, apart)]
        ends.append({n: 0.5 * (ends[0][n] + ends[1][n]) for n in apart.free_names})
        ends.append(ends[0] | {n: self._unchanged.value(n) for n in self._unchanged.free_names})
        both, value = self._followed(objective, apart, ends, climb=climb)
        loss = 0.5 * self._squared({n: both.value(n) - own.value(n) for n in changed})
        allowed = value if loss <= self.rules.told else min(value, self._nothing + wanted)
        return value, allowed, both

    def _followed(
        self,
        objective: Objective,
        model: Model,
        ends: Sequence[Mapping[str, float]],
        *,
        climb: bool,
    ) -> tuple[Model, float]:
        """Where a search from the best of some starts ends, and its log-likelihood."""
        noise, box = self.before.noise.vector(), free_box(model)
        starts = [box.inside(model.with_values(e).vector()) for e in ends]
        gains = objective.freeze(starts[0], noise)
        begin = min(starts, key=lambda p: cost(objective, p, gains))
        p, value = highest(objective, begin, noise, box)
        if climb:
            p, _, value = to_the_maximum(objective, p, noise, box)
        values = {n: float(p[model.parameters[n].column]) for n in model.free_names}
        return model.with_values(values), value

    def _squared(self, off: Mapping[str, float]) -> float:
        """Squared standard errors of the reference by which parameters are off, all else free."""
        own = [self.place[n] for n in off]
        rest = [self.place[n] for n in self.before.model.free_names if n not in off]
        known = self.side.information + np.diag(self.shared.precision)
        inverse = np.linalg.pinv(known[np.ix_(rest, rest)], hermitian=True)
        alone = self.side.information[np.ix_(own, own)]
        cross = self.side.information[np.ix_(own, rest)]
        size = np.array(list(off.values()))
        return max(float(size @ (alone - cross @ inverse @ cross.T) @ size), 0.0)

    def _own(
        self, put: Sequence[str], sizes: Mapping[str, float], usual: Mapping[str, float]
    ) -> tuple[Model, float]:
        """The same of the reference."""
        scalings = [e for e in SCALINGS if e.id in put]
        if scalings:  # one driving knows its tyres as they are
            rest = [e for e in put if e not in {s.id for s in scalings}]
            few = {n: v for n, v in sizes.items() if not any(n in s.named for s in scalings)}
            key = frozenset(rest)
            if key not in self._fitted:
                self._fitted[key] = self._own(rest, few, {n: usual[n] for n in few})
            model, reached = self._fitted[key]
            return model.add(*scalings), reached
        if not put:
            return self.before.model, self._alone
        model, reached = self._fit(self.before, put, dict.fromkeys(sizes, 0.0), usual)
        if reached > self._alone:
            return model, reached
        more = (e for e in self.effects if e.id in put)
        return self.before.model.add(*more), self._alone  # a lag is never quite nothing

    def _fit(
        self,
        start: Fit,
        put: Sequence[str],
        sizes: Mapping[str, float],
        usual: Mapping[str, float],
        own: Model | None = None,
        also: Sequence[Mapping[str, float]] = (),
    ) -> tuple[Model, float]:
        """A model with some changes, and its log-likelihood; beside the reference where given."""
        model = start.model.add(*(e for e in (*self.effects, *SCALINGS) if e.id in put))
        if own is not None:  # changes begin where the reference ends
            model = model.with_values({n: own.value(n) for n in model.free_names})
        noise, box = self.before.noise.vector(), free_box(model)
        objective = together(self.before, start, model, own, sizes)
        p, best = box.inside(model.vector()), -np.inf
        unchanged = self._unchanged if own is not None else None
        starts = starts_of(model, objective, noise, sizes, usual, also, unchanged)
        bar = -np.inf if own is None else self._likeliest
        delays = [n for n in usual if n.endswith(_DELAY)]
        several = starts[:_FOLLOWED]
        for there, value in highest_of(
            objective, several, noise, box, best=bar, every=bool(delays)
        ):
            with suppress(NumericalError, np.linalg.LinAlgError):
                for name in delays:
                    at = model.parameters[name].column
                    there, value = along(objective, there, value, at, usual[name], noise, box)
                if value > best:
                    p, best = there, value
        if best == -np.inf:
            raise NumericalError(f"the model with {', '.join(put)} cannot be evaluated")
        values = {n: float(p[model.parameters[n].column]) for n in model.free_names}
        return model.with_values(values), best
