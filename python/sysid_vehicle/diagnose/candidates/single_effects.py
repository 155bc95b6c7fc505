"""Sum of single effects over the scores of all candidates.

What is missing is a sum of at most a few effects, each of them one candidate, a force unknown to
the catalogue, or nothing. Given the others, the posterior of one of them is a Bayesian regression
on one candidate at a time; going round until nothing changes approximates the posterior of all
(SuSiE: Wang, Sarkar, Carbonetto & Stephens, JRSS B 2020). It needs the scores S and the information
I of the candidates only (Zou, Carbonetto, Wang & Stephens, PLoS Genetics 2022). Rounds begin at the
subset of up to three effects with the largest evidence, as two that hold only together are not
found one at a time.

A candidate's prior is normal with its typical size as standard deviation, cut at nothing where
physics has one sign. That of an unknown force is a unit-information prior (Kass & Wasserman, JASA
1995). Scores count by their long-run variance: S_j and I_jj over the variance ratio of j.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import combinations

import numpy as np
import numpy.typing as npt
import scipy

from ..._common.arrays import FloatArray, as_float64

_ROUNDS, _SETTLED = 200, 1e-4
_EXTENDED = 12  # of the best subsets, to which one effect more is added


@dataclass(frozen=True, eq=False)
class Hypothesis:
    """One effect in one form.

    Attributes
    ----------
    name : str
        Of the effect; one with a scanned parameter, or with some parameters of one sign, has
        several forms.
    columns : tuple of int
        Of its parameters.
    sides : tuple of float
        By parameter: the sign that it must have, 0 for either.
    weight : float
        Prior probability beside other forms of the effect.
    """

    name: str
    columns: tuple[int, ...]
    sides: tuple[float, ...]
    weight: float


@dataclass(frozen=True)
class Subset:
    """Effects that may be missing together.

    Attributes
    ----------
    effects : tuple of str
    log_odds : float
        Logarithm of its posterior odds against nothing being missing, by the linearised model.
    columns : tuple of int
        Whose parameters are not at their null values.
    """

    effects: tuple[str, ...]
    log_odds: float
    columns: tuple[int, ...] = ()


@dataclass(frozen=True, eq=False)
class Posterior:
    """The posterior of a sum of single effects.

    Attributes
    ----------
    weights : array, shape (effects of the sum, hypotheses)
        Probability that an effect of the sum is this hypothesis; what is left of 1 is nothing.
    means, stds : array, shape (effects of the sum, columns)
        Of the parameters, were each of its own hypothesis, in prior standard deviations.
    """

    weights: FloatArray
    means: FloatArray
    stds: FloatArray


@dataclass(frozen=True, eq=False)
class _Regression:
    """Single-effect regressions of hypotheses with equally many parameters."""

    which: npt.NDArray[np.intp]  # hypotheses (k,)
    columns: npt.NDArray[np.intp]  # (k, d)
    sides: FloatArray
    inverse: FloatArray  # posterior covariance (k, d, d)
    log_determinant: FloatArray

    @cached_property
    def _std(self) -> FloatArray:
        return as_float64(np.sqrt(np.einsum("kii->ki", self.inverse)))

    def __call__(self, score: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Log Bayes factors against nothing, posterior means and standard deviations."""
        s = score[self.columns]
        mean = np.einsum("kij,kj->ki", self.inverse, s)
        log_bf = 0.5 * (np.einsum("ki,ki->k", s, mean) + self.log_determinant)
        log_share, cut, narrow = _on_side(mean, self._std, self.sides)
        return log_bf + log_share.sum(axis=1), cut, narrow


@dataclass(frozen=True, eq=False)
class ScoreModel:
    """Scores of all candidates, in units of their prior standard deviations.

    Attributes
    ----------
    hypotheses : tuple of Hypothesis
    score : array, shape (n,)
    information : array, shape (n, n)
    ratio : array, shape (n,)
        Long-run over naive variance of each score, at least 1.
    absent : float
        Prior probability that an effect of the sum is nothing.
    """

    hypotheses: tuple[Hypothesis, ...]
    score: FloatArray
    information: FloatArray
    ratio: FloatArray
    absent: float

    @cached_property
    def effects(self) -> tuple[str, ...]:
        """Names of the effects."""
        return tuple(dict.fromkeys(h.name for h in self.hypotheses))

    @cached_property
    def _log_prior(self) -> FloatArray:
        """Of each hypothesis, against nothing."""
        odds = (1.0 - self.absent) / self.absent / len(self.effects)
        return np.log([odds * h.weight for h in self.hypotheses])

    @cached_property
    def _regressions(self) -> tuple[_Regression, ...]:
        made = []
        for d in sorted({len(h.columns) for h in self.hypotheses}):
            which = [i for i, h in enumerate(self.hypotheses) if len(h.columns) == d]
            columns = np.array([self.hypotheses[i].columns for i in which], dtype=np.intp)
            sides = np.array([self.hypotheses[i].sides for i in which])
            block = self.information[columns[:, :, None], columns[:, None, :]]
            block = block / self.ratio[columns].max(axis=1)[:, None, None] + np.eye(d)
            inverse = np.linalg.inv(block)
            made.append(
                _Regression(
                    np.array(which, dtype=np.intp),
                    columns,
                    sides,
                    as_float64(inverse),
                    -np.linalg.slogdet(block)[1],
                )
            )
        return tuple(made)

    @cached_property
    def _ratios(self) -> FloatArray:
        """Of each column beside the others of its hypothesis."""
        found = self.ratio.copy()
        for h in self.hypotheses:
            if len(h.columns) > 1:
                found[list(h.columns)] = self.ratio[list(h.columns)].max()
        return found

    def _single(self, score: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        """Weights of the hypotheses, mean of their mixture, their own means and deviations."""
        log_odds = self._log_prior.copy()
        n = len(self.score)
        means, stds, mixture = np.zeros(n), np.zeros(n), np.zeros(n)
        found = []
        over = score / self._ratios
        for regression in self._regressions:
            log_bf, mean, std = regression(over)
            log_odds[regression.which] += log_bf
            # The form with most parameters speaks last: it is the one that is printed.
            means[regression.columns], stds[regression.columns] = mean, std
            found.append((regression, mean))
        # Many times for each posterior: scipy's own sum takes as long as all the rest.
        top = max(float(log_odds.max()), 0.0)
        weights = np.exp(log_odds - top)
        weights /= weights.sum() + np.exp(-top)
        for regression, mean in found:
            np.add.at(mixture, regression.columns, weights[regression.which][:, None] * mean)
        return weights, mixture, means, stds

    def posterior(self, most: int, begin: Subset | None = None) -> Posterior:
        """The sum of at most so many single effects.

        Parameters
        ----------
        most : int
        begin : Subset, optional
            Where the rounds begin; else with nothing.
        """
        n = len(self.score)
        mixtures, weights = np.zeros((most, n)), np.zeros((most, len(self.hypotheses)))
        means, stds = np.zeros((most, n)), np.zeros((most, n))
        if begin is not None:
            few = [h for h in self.hypotheses if set(h.columns) <= set(begin.columns)]
            few = [h for h in few if not any(set(h.columns) < set(o.columns) for o in few)][:most]
            size = iter(self._joint([few])[1][0])
            for row, h in zip(mixtures, few, strict=False):
                row[list(h.columns)] = [next(size) for _ in h.columns]
        for _ in range(_ROUNDS):
            before = weights.copy()
            for i in range(most):
                others = mixtures.sum(axis=0) - mixtures[i]
                score = self.score - self.information @ others
                weights[i], mixtures[i], means[i], stds[i] = self._single(score)
            if np.abs(weights - before).max() < _SETTLED:
                break
        return Posterior(weights, means, stds)

    def subsets(self, most: int = 3) -> tuple[Subset, ...]:
        """Leading subsets of up to so many effects, the one with most evidence first.

        All of one and two effects; larger ones extend the best of those with one effect less.
        """
        prior = dict(zip(self.hypotheses, self._log_prior, strict=True))
        best: dict[frozenset[str], tuple[float, float, tuple[int, ...]]] = {}

        def noted(tried: list[tuple[Hypothesis, ...]]) -> list[float]:
            found = []
            for few, log_bf in zip(tried, self._log_factors(tried), strict=True):
                log_odds = float(log_bf) + sum(prior[h] for h in few)
                names = frozenset(h.name for h in few)
                # Forms of the same effects: their odds add up.
                sum_, top, columns = best.get(names, (-np.inf, -np.inf, ()))
                if log_odds > top:
                    top, columns = log_odds, tuple(c for h in few for c in h.columns)
                best[names] = float(np.logaddexp(sum_, log_odds)), top, columns
                found.append(log_odds)
            return found

        alone = noted([(h,) for h in self.hypotheses])
        ranked = sorted(zip(self.hypotheses, alone, strict=True), key=lambda k: -k[1])
        place = {h: i for i, (h, _) in enumerate(ranked)}
        tried: list[tuple[Hypothesis, ...]] = [
            pair for pair in combinations(place, 2) if pair[0].name != pair[1].name
        ]
        for size in range(2, most + 1):
            leading = sorted(zip(noted(tried), tried, strict=True), key=lambda k: -k[0])
            if size < most:
                more = (
                    tuple(sorted((*few, h), key=place.__getitem__))
                    for _, few in leading[:_EXTENDED]
                    for h in self.hypotheses
                    if all(h.name != one.name for one in few)
                )
                tried = list(dict.fromkeys(more))
        order = sorted(best.items(), key=lambda k: -k[1][0])
        return tuple(Subset(tuple(sorted(n)), odds, columns) for n, (odds, _, columns) in order)

    def beside(self, effects: Sequence[str]) -> dict[str, float]:
        """Log-odds of each other effect together with some, against these alone.

        All of their parameters are told together: those of the few are no longer what made up for
        the other one.
        """
        whole = {h.name: h for h in self.hypotheses}  # the form with all parameters comes last
        few = tuple(whole[e] for e in effects)
        more = [(h, prior) for h, prior in zip(self.hypotheses, self._log_prior, strict=True)
                if h.name not in effects]  # fmt: skip
        together = self._log_factors([(*few, h) for h, _ in more])
        alone = self._log_factors([few])[0] if few else 0.0
        found: dict[str, float] = {}
        for (h, prior), log_bf in zip(more, together, strict=True):
            log_odds = float(prior + log_bf - alone)
            found[h.name] = float(np.logaddexp(found.get(h.name, -np.inf), log_odds))
        return found

    def _log_factors(self, sets: Sequence[Sequence[Hypothesis]]) -> FloatArray:
        """Log Bayes factor of each set of hypotheses against nothing."""
        out = np.empty(len(sets))
        by_width: dict[int, list[int]] = {}
        for i, few in enumerate(sets):
            by_width.setdefault(sum(len(h.columns) for h in few), []).append(i)
        for alike in by_width.values():
            out[alike] = self._joint([sets[i] for i in alike])[0]
        return out

    def _joint(self, sets: Sequence[Sequence[Hypothesis]]) -> tuple[FloatArray, FloatArray]:
        """Log Bayes factors of sets of hypotheses against nothing, and the means of their columns.

        Each hypothesis adds what the ones before it leave, over its own variance ratio. The sets
        have as many columns.
        """
        where = np.array([[c for h in few for c in h.columns] for few in sets], dtype=np.intp)
        sides = np.array([[s for h in few for s in h.sides] for few in sets])
        ratio = self._ratios[where]
        block = self.information[where[:, :, None], where[:, None, :]]
        block = block + ratio[:, :, None] * np.eye(where.shape[1])
        root = np.linalg.inv(np.linalg.cholesky(block))
        added = np.einsum("nij,nj->ni", root, self.score[where])
        mean = np.einsum("nij,ni->nj", root, added)
        own = np.diagonal(root, axis1=1, axis2=2)
        log_bf = 0.5 * np.sum(added**2 / ratio + np.log(ratio * own**2), axis=1)
        std = np.sqrt(ratio * np.sum(root**2, axis=1))
        log_bf += _on_side(mean, std, sides)[0].sum(axis=1)
        return as_float64(log_bf), as_float64(mean)


def _on_side(
    mean: FloatArray, std: FloatArray, sides: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Normal distributions cut at nothing: log of 2 x the share that stays, means, deviations.

    Prior and posterior lose their other half: what stays is twice as dense.
    """
    cut = sides != 0.0
    z = sides * mean / std
    log_kept = scipy.special.log_ndtr(z)
    log_share = np.where(cut, np.log(2.0) + log_kept, 0.0)
    mills = np.exp(-0.5 * z**2 - 0.5 * np.log(2.0 * np.pi) - log_kept)
    mills = np.where(cut, mills, 0.0)
    narrow = std * np.sqrt(np.clip(1.0 - mills * (mills + z), 0.0, 1.0))
    return log_share, mean + sides * std * mills, narrow
