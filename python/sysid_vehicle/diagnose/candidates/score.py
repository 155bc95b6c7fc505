"""Score tests of effects a model may lack, without refitting it.

With e the whitened one-step-ahead residuals of the fitted model, G their sensitivities (minus the
derivatives) to its free parameters and G_j those to the parameters of effect j:

    R_j = (I - P_G) G_j,  I_j = R_j' R_j,  S_j = R_j' e,
    T_j = S_j' I_j^-1 S_j,  predicted parameters I_j^-1 S_j

(Basseville, Automatica 1998; Bera & Bilias, J. Statistical Planning and Inference 2001). Under a
complete model T_j is chi-squared with as many degrees of freedom as effect j has parameters.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy

from ... import _core
from ..._common.arguments import generator
from ..._common.arrays import FloatArray, as_float64
from ...effects import Effect
from ...estimate import Driving
from ...identify import Fit, longest_s
from ...rules import USUAL, Rules
from ..evidence.coordinates import blocks
from ..evidence.directions import Ask, Columns, Directions
from ..evidence.evidence import Evidence
from ..evidence.input_noise import added_by_input_noise
from ..evidence.projection import pseudo_inverse
from ..evidence.sensitivity import Sensitivities, sensitivities

_BLOCK_S, _FEWEST_BLOCKS = 0.5, 24
_DRAWN = 1 << 22  # random numbers at once
_ROUNDED = float(np.sqrt(np.finfo(float).eps))  # of the residuals, all that an effect moves


@dataclass(frozen=True, eq=False)
class Score:
    """The score test of one effect.

    Attributes
    ----------
    statistic : float
        T_j over the variance ratio.
    p_value : float
        For this effect alone.
    value, std : tuple of float
        Predicted parameters and their standard errors.
    retained : float
        Share of the effect's sensitivity left after projection on the fitted parameters.
    variance_ratio : float
        Long-run over naive variance of the score; above 1 the residuals are not white in the
        direction of this effect.
    """

    effect: Effect
    statistic: float
    p_value: float
    value: tuple[float, ...]
    std: tuple[float, ...]
    retained: float
    variance_ratio: float


@dataclass(frozen=True, eq=False)
class ScoreBoard:
    """The scores of all candidates, and what their joint distribution needs.

    Attributes
    ----------
    columns : tuple of int
        Which columns of `sensitivities` are scored.
    places : dict of str to slice
        By effect, where its directions stand among those.
    gradient, information : array, shape (n,), (n, n)
        S and I of all directions together.
    blocks : array, shape (blocks, n)
        What stretches of the driving add to the gradient by chance, over the root of each effect's
        variance ratio.
    """

    scores: tuple[Score, ...]
    columns: tuple[int, ...]
    places: dict[str, slice]
    gradient: FloatArray
    information: FloatArray
    blocks: FloatArray
    sensitivities: Sensitivities
    projected: Directions

    @property
    def directions(self) -> dict[str, FloatArray]:
        """Projected sensitivities R_j by effect id, shape (5 n, parameters)."""
        whole = np.concatenate([R for _, (R,), _ in self.projected.rows(self.sensitivities)])
        return {n: whole[:, self.columns[own]] for n, own in self.places.items()}

    @cached_property
    def _alone(self) -> dict[str, float]:
        return {n: self._joint(n) for n in self.places}

    def joint_statistic(self, *names: str) -> float:
        """T of several effects together."""
        return self._alone[names[0]] if len(names) == 1 else self._joint(*names)

    def _joint(self, *names: str) -> float:
        where = np.concatenate([np.r_[self.places[n]] for n in names])
        S = self.gradient[where]
        return float(S @ pseudo_inverse(self.information[np.ix_(where, where)])[0] @ S)

    def family_p_values(self, draws: int = 4000, seed: int = 0) -> dict[str, float]:
        """P-values corrected for testing all effects at once.

        The smallest p-value of all is drawn under a complete model by turning what blocks of the
        driving add to the scores at random, all effects together (multiplier bootstrap;
        Chernozhukov, Chetverikov & Kato, Annals of Statistics 2013): residuals that are not white,
        or have outliers, scatter as they do.
        """
        if not self.scores:
            return {}
        # In units of their own: rounding at the largest would drown the smallest.
        scale = np.sqrt(np.maximum(np.diag(self.information), 1e-300))
        covariance = self.information / np.outer(scale, scale)
        rng, blocks = generator(seed), self.blocks / scale
        some = max(_DRAWN // max(len(blocks), 1), 1)
        normal = np.vstack(
            [
                rng.standard_normal((min(some, draws - first), len(blocks))) @ blocks
                for first in range(0, draws, some)
            ]
        )
        smallest = _smallest_p_values(
            [(s.effect, self.places[s.effect.id]) for s in self.scores], normal, covariance
        )
        smallest.sort()
        alone = np.array([s.p_value for s in self.scores])
        family = np.searchsorted(smallest, alone, side="right") / draws
        # Below what the draws resolve: as many independent tests as they act like at 1 %.
        tests = max(0.01 / max(float(np.quantile(smallest, 0.01)), 1e-12), 1.0)
        family = np.where(alone < smallest[20], np.minimum(alone * tests, 1.0), family)
        return dict(zip((s.effect.id for s in self.scores), map(float, family), strict=True))


def score_board(
    fit: Fit, driving: Driving, candidates: tuple[Effect, ...], rules: Rules = USUAL
) -> ScoreBoard:
    """Score every candidate at once.

    Parameters
    ----------
    fit : Fit
        A converged fit.
    driving : Driving
        What it was fitted to.
    rules : Rules
    """
    return score_board_of(Evidence(fit, driving), candidates, rules)


def score_board_of(
    evidence: Evidence,
    candidates: tuple[Effect, ...],
    rules: Rules = USUAL,
    *others: Columns,
) -> ScoreBoard:
    """The same of residuals that may be known already.

    `others` are gone through together with the effects, and stand behind them in `projected`.
    """
    found = sensitivities(evidence, tuple(candidates))
    projected = Directions(evidence, found, *others)
    every = projected.place(found)
    after = np.diag(projected.information)[every]
    before = projected.before[every]
    numbers = _core.CHANNELS * evidence.driving.samples
    visible: list[tuple[Effect, float, slice]] = []
    kept: list[int] = []
    for effect in found.candidates:
        own = found.places[effect.id]
        retained = float(np.sqrt(after[own].sum() / max(before[own].sum(), 1e-300)))
        moves = float(np.sqrt(before[own].sum())) * max(p.typical for p in effect.parameters)
        if retained >= rules.retained and moves > _ROUNDED * np.sqrt(numbers):
            visible.append((effect, retained, slice(len(kept), len(kept) + own.stop - own.start)))
            kept += list(range(own.start, own.stop))
    information = projected.information[np.ix_(kept, kept)]
    S = projected.score[kept]
    claimed = {
        effect.id: own
        for effect, _, own in visible
        if _p_value(effect, S[None, own], information[own, own])[0] < rules.alpha
    }
    if claimed:
        some = sensitivities(evidence, [e for e, *_ in visible if e.id in claimed])
        added = added_by_input_noise(
            evidence, some, lambda noisy, _: sensitivities(noisy, some.candidates)
        )
        for name, own in claimed.items():
            S[own] -= added[some.places[name]]
    covariance = np.zeros_like(information)
    for *_, own in visible:
        covariance[own, own] = pseudo_inverse(information[own, own])[0]
    # Each effect's own explanation is taken out before its residuals are asked for their colour.
    sizes = np.zeros_like(projected.information[every, every])
    for *_, own in visible:
        at = slice(kept[own.start], kept[own.stop - 1] + 1)
        sizes[at, at] = np.repeat((covariance[own, own] @ S[own])[:, None], own.stop - own.start, 1)
    seconds = longest_s(evidence.driving)
    block_s = min(_BLOCK_S, evidence.driving.usable_s / _FEWEST_BLOCKS)
    told = projected.answer(found, Ask(None, sizes, blocks(evidence.driving, block_s)))
    ratios, chance = told.ratios[kept], told.blocks[:, kept]
    scores = [
        _score(
            effect,
            S[own],
            information[own, own],
            covariance[own, own],
            retained,
            float(ratios[own].max()),
            seconds,
        )
        for effect, retained, own in visible
    ]
    scores.sort(key=lambda s: (s.p_value, -s.statistic))
    more = np.ones(len(kept))
    for *_, own in visible:
        more[own] = max(float(ratios[own].max()), 1.0)
    return ScoreBoard(
        tuple(scores),
        tuple(kept),
        {effect.id: own for effect, _, own in visible},
        S,
        information,
        chance / np.sqrt(more),
        found,
        projected,
    )


def _score(
    effect: Effect,
    S: FloatArray,
    information: FloatArray,
    covariance: FloatArray,
    retained: float,
    ratio: float,
    duration_s: float,
) -> Score:
    value = covariance @ S
    more = max(ratio, 1.0)
    p = float(_p_value(effect, S[None, :] / np.sqrt(more), information)[0])
    std = np.sqrt(np.maximum(np.diag(covariance) * more, 0.0))
    statistic = float(S @ value) / more
    if effect.scanned is not None:
        # The best of the grid, known as closely as the grid is fine.
        grid = effect.scanned.grid(duration_s)
        squares = np.maximum(np.diag(information), 1e-300)
        best = int(np.argmax(S**2 / squares))
        value = np.array([S[best] / squares[best], grid[best]])
        std = np.array([np.sqrt(more / squares[best]), float(np.gradient(grid)[best])])
    return Score(
        effect, statistic, p, tuple(map(float, value)), tuple(map(float, std)), retained, ratio
    )


def _p_value(effect: Effect, S: FloatArray, information: FloatArray) -> FloatArray:
    """P-values of scores S, one a row, with this information.

    Parameters that have one sign only are tested on that side: for two the null distribution is a
    mixture whose weights follow from the angle between them (Shapiro, Biometrika 1985).
    """
    if _on_one_side(effect, S.shape[1]):
        sides = np.sign([p.typical - p.null_value for p in effect.parameters])
        return _p_value_on_one_side(S * sides, information * np.outer(sides, sides))
    T, degrees = _chi_squared(S, information)
    p: FloatArray = _chi2_tail(degrees, T)
    return p


def _smallest_p_values(
    effects: list[tuple[Effect, slice]], scores: FloatArray, covariance: FloatArray
) -> FloatArray:
    """Of scores of several effects, one draw a row: the smallest p-value of each draw.

    P-values fall with what they are the p-values of. So the largest of it comes first, over all
    effects that are tested alike, and its p-value once.
    """
    draws = len(scores)
    smallest = np.ones(draws)
    one_sided = np.zeros(draws)
    largest: dict[int, FloatArray] = {}
    for effect, own in effects:
        S, block = scores[:, own], covariance[own, own]
        if _on_one_side(effect, S.shape[1]):
            if S.shape[1] > 1:
                smallest = np.minimum(smallest, _p_value(effect, S, block))
                continue
            side = np.sign(effect.parameters[0].typical - effect.parameters[0].null_value)
            np.maximum(one_sided, side * S[:, 0] / np.sqrt(block[0, 0]), out=one_sided)
            continue
        T, degrees = _chi_squared(S, block)
        largest[degrees] = np.maximum(largest.get(degrees, 0.0), T)
    for degrees, T in largest.items():
        np.minimum(smallest, _chi2_tail(degrees, T), out=smallest)
    found = one_sided > 0.0
    smallest[found] = np.minimum(smallest[found], 0.5 * _chi2_tail(1, one_sided[found] ** 2))
    return smallest


def _on_one_side(effect: Effect, directions: int) -> bool:
    one_sided = [p.one_sided for p in effect.parameters]
    return len(one_sided) == directions <= 2 and all(one_sided)


def _chi2_tail(degrees: int, T: FloatArray) -> FloatArray:
    # Far quicker than the general form, and thousands of draws have one or two degrees.
    if degrees == 1:
        return as_float64(scipy.special.erfc(np.sqrt(0.5 * np.maximum(T, 0.0))))
    return as_float64(np.exp(-0.5 * T) if degrees == 2 else scipy.special.chdtrc(degrees, T))


def _chi_squared(S: FloatArray, information: FloatArray) -> tuple[FloatArray, int]:
    """Statistics of scores, one a row, and their degrees of freedom."""
    inverse, rank = pseudo_inverse(information)
    return np.einsum("ij,ij->i", S @ inverse, S), rank


def _p_value_on_one_side(S: FloatArray, information: FloatArray) -> FloatArray:
    scale = np.sqrt(np.maximum(np.diag(information), 1e-300))
    z = S / scale
    T = np.max(np.maximum(z, 0.0), axis=1) ** 2  # on an edge of the cone: one of them alone
    both = 0.0
    if S.shape[1] == 2:
        alike = float(np.clip(information[0, 1] / (scale[0] * scale[1]), -1.0, 1.0))
        left = 1.0 - alike**2
        if left > 1e-6:
            inside = np.all(z - alike * z[:, ::-1] > 0.0, axis=1)
            whole = (z[:, 0] ** 2 - 2.0 * alike * z[:, 0] * z[:, 1] + z[:, 1] ** 2) / left
            T = np.where(inside, whole, T)
            both = float(np.arccos(alike) / (2.0 * np.pi))
    p: FloatArray = np.where(T > 0.0, 0.5 * _chi2_tail(1, T) + both * _chi2_tail(2, T), 1.0)
    return p
