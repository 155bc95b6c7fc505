"""What a reference fit knows of later driving: its scores, priors, and what it lets go."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np

from ... import _core
from ..._common.arrays import FloatArray, as_float64
from ...effects import Effect
from ...errors import NumericalError
from ...estimate import noise_range
from ...identify import Fit
from ...identify.box import free_box
from ...identify.objective import LinearRows, Objective
from ...identify.search import Box
from ...identify.settle import moved
from ...model import Model
from .beside_reference import Shared, Side
from .may_change import May

_REFREEZES = 4
_ENOUGH = 0.05  # nats that a step gains
_FAR = 3.0  # usual sizes, within which a search begins
_SHARES = (0.25, 0.5, 1.0, 2.0)  # of the usual size, where it may begin too
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
    shift : array, shape (n,)
        By which its parameters differ from those of the reference as it was.
    changes : dict of str to float
        By which parameters of what changed differ from the reference fitted in the same way.
    reached : float
        Log-likelihood, less what the reference knows of what stays, and what the changes gain of
        that which the reference left.
    """

    put: tuple[str, ...]
    fit: Fit
    shift: FloatArray
    changes: dict[str, float]
    reached: float


class Reference:
    """The reference: its scores, and what is known of what both drivings share.

    Parameters
    ----------
    before : Fit
    may : sequence of May
        What may have changed, clocks of inputs apart.
    effects : sequence of Effect
        Those of them that the model lacks.

    Attributes
    ----------
    side : Side
    names : tuple of str
        Full names of parameters.
    place : dict of str to int
        Their columns, and those of clocks.
    shared : Shared
        Effects that the model lacks are about as large as usual, or nothing.
    """

    def __init__(self, before: Fit, may: Sequence[May], effects: Sequence[Effect]) -> None:
        self.before, self.effects = before, tuple(effects)
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
        self._fitted: dict[frozenset[str], tuple[Model, float]] = {}
        self._alone = self._fit(before, (), {}, {})[1]

    def value(self, name: str) -> float:
        """Of a parameter in the reference."""
        model = self.before.model
        if name in model.parameters:
            return model.value(name)
        return next(e.named[name].null_value for e in self.effects if name in e.named)

    def fitted(
        self,
        start: Fit,
        put: Sequence[str],
        sizes: Mapping[str, float],
        usual: Mapping[str, float],
        also: Sequence[Mapping[str, float]] = (),
    ) -> Exact:
        """Later driving with some changes, all else as far as the reference lets it go.

        The reference is fitted in the same way: what the changes do for that is no change, and
        what they gain of it no evidence.

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
        own, own_reached = self._fitted[key]
        model, reached = self._fit(start, put, sizes, usual, own, also)
        shift = np.zeros(len(self.side.names))
        for n in model.free_names:
            shift[self.place[n]] = model.value(n) - self.value(n)
        changes = {n: model.value(n) - own.value(n) for n in sizes}
        share = start.driving.samples / self.before.driving.samples
        left = share * (own_reached - self._alone)
        return Exact(tuple(put), replace(start, model=model), shift, changes, reached - left)

    def _own(
        self, put: Sequence[str], sizes: Mapping[str, float], usual: Mapping[str, float]
    ) -> tuple[Model, float]:
        """The same of the reference."""
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
        """A model with some changes, and its log-likelihood less what is known of all else."""
        model = start.model.add(*(e for e in self.effects if e.id in put))
        if own is not None:  # changes begin where the reference ends
            model = model.with_values({n: own.value(n) for n in model.free_names})
        driving, noise, box = start.driving, self.before.noise.vector(), free_box(model)
        stays = self._knowledge(start.model, [n for n in start.model.free_names if n not in sizes])
        noises = noise_range(model.vehicle, driving)
        objective = Objective(driving.problem(model), (stays,), *noises)
        p, best = box.inside(model.vector()), -np.inf
        for begin in self._starts(model, objective, sizes, usual, also)[:_FOLLOWED]:
            with suppress(NumericalError, np.linalg.LinAlgError):
                there, value = _highest(objective, begin, noise, box)
                if value > best:
                    p, best = there, value
        if best == -np.inf:
            raise NumericalError(f"the model with {', '.join(put)} cannot be evaluated")
        values = {n: float(p[model.parameters[n].column]) for n in model.free_names}
        return model.with_values(values), best

    def _starts(
        self,
        model: Model,
        objective: Objective,
        sizes: Mapping[str, float],
        usual: Mapping[str, float],
        also: Sequence[Mapping[str, float]],
    ) -> list[FloatArray]:
        """Starts, the likeliest first: what lines say leads astray where a change is large."""
        box, noise = free_box(model), self.before.noise.vector()
        far = {n: _FAR * usual.get(n, 0.0) for n in sizes}
        starts = [*also, {n: float(np.clip(v, -far[n], far[n])) for n, v in sizes.items()}]
        if len(usual) == 1:
            ((name, size),) = usual.items()
            starts += [{name: sign * share * size} for share in _SHARES for sign in (-1.0, 1.0)]
        sets = [
            box.inside(
                model.with_values({n: model.value(n) + size for n, size in start.items()}).vector()
            )
            for start in starts
        ]
        values = objective.log_likelihoods(np.array(sets), noise)
        return [sets[i] for i in np.argsort(-values, kind="stable")]

    def _knowledge(self, model: Model, names: Sequence[str]) -> LinearRows:
        """What the reference knows of parameters that stay, as further residuals."""
        at = [self.place[n] for n in names]
        information = self.side.information[np.ix_(at, at)] + np.diag(self.shared.precision[at])
        size = np.sqrt(np.maximum(np.diag(information), 1e-300))
        values, vectors = np.linalg.eigh(information / np.outer(size, size))
        root = np.sqrt(np.maximum(values, 0.0))[:, None] * vectors.T * size
        rows = np.zeros((len(names), _core.PARAMETERS))
        rows[:, [model.parameters[n].column for n in names]] = root
        return LinearRows(rows, as_float64(root @ np.array([self.value(n) for n in names])))


def _highest(
    objective: Objective, p: FloatArray, noise: FloatArray, box: Box
) -> tuple[FloatArray, float]:
    """The end of a search under given noise, and its log-likelihood."""
    best = -np.inf
    for _ in range(_REFREEZES):
        p, gains = moved(objective, p, noise, box, tolerance=_ENOUGH)
        before, best = best, objective.reached(p, gains)
        if best < before + _ENOUGH:
            break
    return p, best
