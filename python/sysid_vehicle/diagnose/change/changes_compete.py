"""What the differences between two drivings say: sizes of changes, and which compete for them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from types import MappingProxyType

import numpy as np
import scipy

from ..._common.arrays import FloatArray, as_float64
from ...rules import USUAL, Rules
from ..candidates.causes import UNKNOWN, Causes
from ..candidates.posterior import causes_in
from ..candidates.single_effects import Hypothesis, ScoreModel
from ..evidence.projection import pseudo_inverse
from ..unexplained.omnibus import LEAST_LEFT
from .beside_reference import Differences
from .imitated import left_by, likeness
from .may_change import May, as_one

_MOST = 6  # effects of the sum
_SINGULAR = 1e-6  # of the eigenvalues of what an unknown force does


class Competition:
    """Scores of changes, with some put in already, as a sum of single effects.

    Parameters
    ----------
    differences : Differences
    may : sequence of May
        What may have changed.
    place : dict of str to int
        Columns of its parameters; the others are unknown forces and readings.
    targets : sequence of str
        Of all columns, what the unknown ones act on.
    before : array, shape (n,)
        Information about each column where nothing is shared.
    samples : int
        Of the later driving.
    put : sequence of str
        Changes that the model of the later driving has already.
    rules : Rules
    moves : mapping of str to mapping
        What a parameter that has no column of its own does to those that have one.

    Attributes
    ----------
    put : tuple of str
    sizes, stds : dict of str to float
        By parameter: the change beside what was put in, in place of what acts like it.
    stds_beside : dict of str to float
        The same beside all that was put in.
    scores : ScoreModel
    causes : Causes
    alone : tuple of str
        What may have changed by itself, the likeliest first.
    beside_put : dict of str to float
        Log-odds of what may have changed together with what was put in, against that alone.
    """

    def __init__(
        self,
        differences: Differences,
        may: Sequence[May],
        place: dict[str, int],
        targets: Sequence[str],
        before: FloatArray,
        samples: int,
        put: Sequence[str],
        rules: Rules = USUAL,
        moves: Mapping[str, Mapping[str, float]] = MappingProxyType({}),
    ) -> None:
        self._differences, self._may, self._place = differences, may, place
        self._moves = moves
        self.put, self._rules = tuple(put), rules
        self._hypotheses: list[Hypothesis] = []
        self._turns, self._scale = self._competing(targets, before, float(np.sqrt(samples)))
        self._information = self._turns.T @ differences.information @ self._turns
        self._score = self._turns.T @ differences.score
        # One hypothesis of each name: the form with all parameters comes last.
        self._whole = {h.name: h for h in self._hypotheses}
        self._alike = likeness(self._information, self._whole)
        self.sizes: dict[str, float] = {}
        self.stds: dict[str, float] = {}
        self.stds_beside: dict[str, float] = {}
        self._ratio = self._measured()
        self.causes, self.alone = self._posterior()

    def _competing(
        self, targets: Sequence[str], before: FloatArray, vague: float
    ) -> tuple[FloatArray, FloatArray]:
        """The directions that compete, as sums of columns, and their prior standard deviations."""
        information = self._differences.information
        every = np.eye(len(information))
        columns: list[FloatArray] = []
        scale: list[float] = []
        for m in self._may:
            at = len(columns)
            for n in m.names:
                moved = self._moves.get(n, {n: 1.0})
                columns.append(
                    as_float64(sum(x * every[:, self._place[c]] for c, x in moved.items()))
                )
            scale += m.scale
            self._hypotheses += [
                Hypothesis(
                    m.id, tuple(at + i for i in form), (0.0,) * len(form), 1.0 / len(m.forms)
                )
                for form in m.forms
            ]
        unknown = sorted(set(range(len(information))) - set(self._place.values()))
        for target in dict.fromkeys(targets[i] for i in unknown):
            own = np.array([i for i in unknown if targets[i] == target])
            own = own[np.diag(information)[own] > LEAST_LEFT**2 * before[own]]
            if not len(own):
                continue
            size = np.sqrt(np.diag(information)[own])
            values, vectors = np.linalg.eigh(information[np.ix_(own, own)] / np.outer(size, size))
            few = values > _SINGULAR * values[-1]
            turns = np.zeros((len(information), int(few.sum())))
            turns[own] = vectors[:, few] / np.sqrt(values[few]) / size[:, None]
            at, width = len(columns), turns.shape[1]
            of = tuple(range(at, at + width))
            self._hypotheses.append(Hypothesis(UNKNOWN + target, of, (0.0,) * width, 1.0))
            columns += list(turns.T)
            scale += [vague] * width
        return as_float64(np.column_stack(columns)), as_float64(scale)

    def acts_like(self, effect: str) -> str:
        """What was put in that the effect is, or acts like; empty where there is none."""
        if effect in self.put:
            return effect
        near = {p: self._alike[effect, p] for p in self.put if effect in self._whole}
        best = max(near, key=lambda p: near[p], default="")
        return best if best and near[best] >= self._rules.near else ""

    def hidden(self, effect: str, size: Sequence[float]) -> tuple[bool, tuple[str, ...]]:
        """Whether a change gains too little to be named, and what by itself explains it as well."""
        others = (h for n, h in self._whole.items() if n != effect and not n.startswith(UNKNOWN))
        left = left_by(self._information, self._whole[effect], as_float64(size), others)
        named = dict(zip(self._of(effect).names, size, strict=True))
        price = self.price((effect,), named)
        told = {n: x / self.width_of((effect,)) for n, x in left.items()}
        weak = told.pop(effect) < price + self._rules.told
        few = sorted((n for n, x in told.items() if x < self._rules.told), key=lambda n: told[n])
        return weak, () if weak else tuple(few)

    def _measured(self) -> FloatArray:
        """Sizes, and the variance ratio of each direction.

        The colour of residuals is asked for without what the changes explain: those that were put
        in and the one in question together.
        """
        n = len(self._score)
        along, sizes, mine = np.zeros((n, n)), np.zeros((n, n)), np.zeros((n, 3))
        told = np.eye(n)
        for name, h in self._whole.items():
            own = list(h.columns)
            beside = [p for p in self.put if p != name and self._alike[name, p] < self._rules.near]
            both, inverse = self._solved([*beside, name])
            size = inverse @ self._score[both]
            for c in own:
                i = both.index(c)
                along[both, c] = inverse[:, i]
                mine[c, :2] = size[i], np.sqrt(max(inverse[i, i], 0.0))
            every, inverse = self._solved([*self.put, name])
            sizes[np.ix_(every, own)] = (inverse @ self._score[every])[:, None]
            for c in own:
                i = every.index(c)
                mine[c, 2] = np.sqrt(max(inverse[i, i], mine[c, 1] ** 2))
            if name.startswith(UNKNOWN):
                # One score: along all that it explains.
                along[:, own] = 0.0
                along[np.ix_(own, own)] = sizes[own, own[0]][:, None]
                told[np.ix_(own, own)] = along[np.ix_(own, own)]
        turned = self._turns @ np.hstack([along, np.eye(n)])
        off = self._turns @ np.hstack([sizes, sizes])
        ratios, wide = self._differences.ratios(turned, off, self._turns @ told)
        self._wide = wide
        for m in self._may:
            own = list(self._whole[m.id].columns)
            for name, c in zip(m.names, own, strict=True):
                self.sizes[name] = float(mine[c, 0])
                # What no driving tells of it, as nothing that it acts on is measured.
                known = mine[c, 1] > 0.0
                own_std, beside_std = mine[c, 1:] * np.sqrt(wide[c]) if known else (np.inf, np.inf)
                self.stds[name], self.stds_beside[name] = float(own_std), float(beside_std)
        ratio = ratios[n:]
        for name, h in self._whole.items():
            own = list(h.columns)
            ratio[own] = (ratios[:n] if name.startswith(UNKNOWN) else ratio)[own].max()
        return self._shared(ratio) if self.put else ratio

    def std_along(
        self, effect: str, slopes: tuple[FloatArray, FloatArray], changes: Mapping[str, float]
    ) -> float:
        """Standard error of what follows from an effect's changes, beside what was put in.

        What the drivings tell of parameters that neither tells one by one is along other lines in
        the later one, where the change is large.

        Parameters
        ----------
        effect : str
        slopes : tuple of array, shape (k,)
            Derivatives by its parameters as they are in the later driving, and in the reference.
        changes : mapping of str to float
            What is taken off before the colour of residuals is asked for.
        """
        both, inverse = self._usual(effect)
        later, shared = self._slopes(effect, slopes)
        by_changes, rest = self._differences.of_both(later, shared)
        slope = (self._turns.T @ by_changes)[both]
        variance = float(slope @ inverse @ slope)
        if variance <= 0.0:
            return np.inf
        along, of, off = np.zeros((3, len(self._score), 1))
        along[both, 0] = of[both, 0] = inverse @ slope
        of /= variance
        for name in {*self.put, effect}:
            columns = self._whole[name].columns
            off[list(columns), 0] = [changes.get(n, 0.0) for n in self._of(name).names]
        turned = (self._turns @ x for x in (along, off, of))
        return float(np.sqrt((variance + rest) * self._differences.ratios(*turned)[1][0]))

    def beside(self, effect: str) -> dict[str, float]:
        """Sizes of an effect that was not put in, as `std_along` takes it, and of what was."""
        both, inverse = self._usual(effect)
        found = dict(zip(both, inverse @ self._score[both], strict=True))
        return {
            n: float(found[c])
            for name in self._beside(effect)
            for n, c in zip(self._of(name).names, self._whole[name].columns, strict=True)
        }

    def _usual(self, effect: str) -> tuple[list[int], FloatArray]:
        """As `_solved`; an effect that was not put in is about as large as usual, or nothing.

        Directions that no driving tells would lead further than lines hold.
        """
        both, inverse = self._solved(self._beside(effect))
        if effect in self.put:
            return both, inverse
        own = [both.index(c) for c in self._whole[effect].columns]
        known = self._information[np.ix_(both, both)].copy()
        known[own, own] += self._scale[[both[i] for i in own]] ** -2.0
        return both, pseudo_inverse(known)[0]

    def _beside(self, effect: str) -> list[str]:
        """The effect, after what was put in; beside what acts like it if that alone was put in."""
        own = effect in self.put
        near = [p for p in self.put if own and self._alike[effect, p] >= self._rules.near]
        return [*(p for p in self.put if p != effect and p not in near), effect]

    def _slopes(
        self, effect: str, slopes: tuple[FloatArray, FloatArray]
    ) -> tuple[FloatArray, FloatArray]:
        """Derivatives by all changes, and by all that both drivings share."""
        later, shared = np.zeros((2, len(self._turns)))
        at = [self._place[n] for n in self._of(effect).names]
        later[at], shared[at] = slopes[0], slopes[0] + slopes[1]
        return later, shared

    def off_nothing(self, effects: Sequence[str], changes: Mapping[str, float]) -> float:
        """Of what was put in as one change, the p-value of nothing by lines, beside the others.

        Lines know unknown forces that both drivings share, which no likelihood of named effects
        does: that gains from what the model lacks by whatever is fitted.
        """
        beside = [
            p
            for p in self.put
            if p not in effects and all(self._alike[e, p] < self._rules.near for e in effects)
        ]
        both, inverse = self._solved([*beside, *effects])
        columns = [c for e in effects for c in self._whole[e].columns]
        own = [both.index(c) for c in columns]
        size = np.array([changes[n] for e in effects for n in self._of(e).names])
        known, rank = pseudo_inverse(inverse[np.ix_(own, own)])
        wald = float(size @ known @ size) / float(self._ratio[columns].max())
        return float(scipy.stats.chi2.sf(wald, rank))

    def _of(self, effect: str) -> May:
        return next(m for m in self._may if m.id == effect)

    def _solved(self, names: Sequence[str]) -> tuple[list[int], FloatArray]:
        """Columns of some hypotheses, and the inverse of the information about them."""
        columns = list(dict.fromkeys(c for n in names for c in self._whole[n].columns))
        return columns, pseudo_inverse(self._information[np.ix_(columns, columns)])[0]

    def _shared(self, ratio: FloatArray) -> FloatArray:
        """Variance ratios with which rivals compete: as large as those of what they act like.

        Two that explain the same by directions that are nearly one must not be told apart by how
        the noise happens to look along either.
        """
        told = {}
        for name in self._whole:
            columns, inverse = self._solved([name])
            told[name] = float(self._score[columns] @ inverse @ self._score[columns])
        most = max(told.values())
        rivals = [n for n, T in told.items() if self._rules.near * most <= T]
        shared = ratio.copy()
        for name, h in self._whole.items():
            least = [
                np.sqrt(self._alike[name, r]) * ratio[self._whole[r].columns[0]] for r in rivals
            ]
            shared[list(h.columns)] = np.maximum(shared[list(h.columns)], max(least))
        return shared

    def _posterior(self) -> tuple[Causes, tuple[str, ...]]:
        scale = self._scale
        model = ScoreModel(
            tuple(self._hypotheses),
            as_float64(self._score * scale),
            as_float64(self._information * np.outer(scale, scale)),
            self._ratio,
            self._rules.nothing,
        )
        named = (h for h in self._hypotheses if not h.name.startswith(UNKNOWN))
        known = replace(model, hypotheses=tuple(named))
        self.scores = model
        self.beside_put = model.beside(self.put) if self.put else {}
        alone = tuple(e for s in known.subsets(1) for e in s.effects)
        parameters = {m.id: m.parameters for m in self._may}
        return causes_in(model, known, scale, parameters, self._rules, most=_MOST), alone

    def ratio_of(self, put: Sequence[str]) -> float:
        """Long-run over naive variance of the scores of some changes, the largest."""
        columns = [c for name in put for c in self._whole[name].columns]
        return float(self._ratio[columns].max(initial=1.0))

    def width_of(self, put: Sequence[str]) -> float:
        """As `ratio_of`, with what pieces of both drivings differ by, as in standard errors."""
        columns = [c for name in put for c in self._whole[name].columns]
        return max(self.ratio_of(put), float(self._wide[columns].max(initial=1.0)))

    def price(self, put: Sequence[str], changed_by: Mapping[str, float]) -> float:
        """Of some changes, by how much they are told better than their priors do [nats].

        With the priors of their sizes, and that of each being the one of all that changed.

        Parameters
        ----------
        put : sequence of str
        changed_by : mapping of str to float
            Differences of their parameters.
        """
        columns = [c for name in put for c in self._whole[name].columns]
        scale = self._scale[columns]
        block = self._information[np.ix_(columns, columns)] * np.outer(scale, scale)
        block = block / self.ratio_of(put)
        known = np.eye(len(columns)) + block
        sizes = np.array([changed_by[n] for e in put for n in self._of(e).names]) / scale
        # Of what no driving tells the likeliest size is any, and the prior's loses nothing.
        far = float(sizes @ block @ np.linalg.solve(known, sizes))
        occam = 0.5 * float(np.linalg.slogdet(known)[1]) + 0.5 * far
        return occam + len(as_one(put)) * self._of_one

    @property
    def _of_one(self) -> float:
        """Price of a change, whatever its size: any of all may be it [nats]."""
        odds = self._rules.nothing / (1.0 - self._rules.nothing) * len(self._whole)
        return float(np.log(odds))

    def least(self, std: float, usual: float, price: float | None = None) -> float:
        """The smallest change of one parameter that is named with probability `Rules.credible`.

        Where its evidence, less what `price` takes off, is as large as a name asks for; and by as
        many standard errors more as chance may take off that.

        Parameters
        ----------
        std, usual : float
            Standard error, and standard deviation of the prior.
        price : float, optional
            What the change costs [nats], where that is not of one parameter.
        """
        if std >= usual:
            return np.inf
        share, rules = (std / usual) ** 2, self._rules
        if price is None:
            price = self._of_one + 0.5 * float(np.log1p(1.0 / share))
        nats = price + rules.told
        return std * (float(np.sqrt(2.0 * nats / (1.0 - share))) + rules.bound)

    def wald(self, effect: str, beside: str, changes: Mapping[str, float]) -> float:
        """Squared standard errors by which an effect is off nothing, with another one free."""
        own, other = list(self._whole[effect].columns), list(self._whole[beside].columns)
        known = self._information
        copy = known[np.ix_(own, other)] @ pseudo_inverse(known[np.ix_(other, other)])[0]
        left = known[np.ix_(own, own)] - copy @ known[np.ix_(other, own)]
        size = np.array([changes[n] for n in self._of(effect).names])
        return float(size @ left @ size)
