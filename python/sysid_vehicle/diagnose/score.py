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
from itertools import pairwise

import numpy as np
from scipy.special import chdtrc as chi2_tail

from .. import _core
from .._arrays import FloatArray
from ..effects import Effect
from ..estimate import Driving, NoiseModel
from ..identify import Fit
from .sensitivity import duration, sensitivities

__all__ = ["Score", "ScoreBoard", "score_board"]

_INVISIBLE = 1e-3  # share of an effect's sensitivity that the fitted parameters cannot copy


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
    directions : dict of str to array
        Projected sensitivities R_j by effect id.
    residual : array
        Whitened residuals, projected off the fitted parameters.
    gradient, information : array, shape (n,), (n, n)
        S and I of all directions together, in the order of `directions`.
    """

    scores: tuple[Score, ...]
    directions: dict[str, FloatArray]
    residual: FloatArray
    gradient: FloatArray
    information: FloatArray

    @cached_property
    def _places(self) -> dict[str, list[int]]:
        ends = np.cumsum([0, *(R.shape[1] for R in self.directions.values())])
        return {
            n: list(range(a, b)) for n, (a, b) in zip(self.directions, pairwise(ends), strict=True)
        }

    def joint_statistic(self, *names: str) -> float:
        """T of several effects together."""
        where = [i for n in names for i in self._places[n]]
        S = self.gradient[where]
        return float(S @ _pseudo_inverse(self.information[np.ix_(where, where)])[0] @ S)

    def family_p_values(self, draws: int = 4000, seed: int = 0) -> dict[str, float]:
        """P-values corrected for testing all effects at once.

        The smallest p-value of all is simulated under a complete model, with the effects' true
        correlation (Westfall & Young, Resampling-Based Multiple Testing, 1993).
        """
        if not self.scores:
            return {}
        # In units of their own: rounding at the largest would drown the smallest.
        scale = np.sqrt(np.maximum(np.diag(self.information), 1e-300))
        covariance = self.information / np.outer(scale, scale)
        values, vectors = np.linalg.eigh(covariance)
        root = vectors * np.sqrt(np.maximum(values, 0.0))
        normal = np.random.default_rng(seed).standard_normal((draws, len(values))) @ root.T
        smallest = np.ones(draws)
        largest: dict[int, FloatArray] = {}  # of equal degrees the largest has the smallest p-value
        for s in self.scores:
            own = self._places[s.effect.id]
            S, block = normal[:, own], covariance[np.ix_(own, own)]
            if _on_one_side(s.effect, len(own)):
                smallest = np.minimum(smallest, _p_value(s.effect, S, block))
                continue
            T, degrees = _chi_squared(S, block)
            largest[degrees] = np.maximum(largest.get(degrees, 0.0), T)
        for degrees, T in largest.items():
            smallest = np.minimum(smallest, chi2_tail(degrees, T))
        smallest.sort()
        alone = np.array([s.p_value for s in self.scores])
        family = np.searchsorted(smallest, alone, side="right") / draws
        # Below what the draws resolve: as many independent tests as they act like at 1 %.
        tests = 0.01 / max(float(np.quantile(smallest, 0.01)), 1e-12)
        family = np.where(alone < smallest[20], np.minimum(alone * tests, 1.0), family)
        return dict(zip((s.effect.id for s in self.scores), map(float, family), strict=True))


def score_board(
    fit: Fit, driving: Driving, candidates: tuple[Effect, ...], noise: NoiseModel | None = None
) -> ScoreBoard:
    """Score every candidate at once.

    Parameters
    ----------
    fit : Fit
        A converged fit.
    driving : Driving
        What it was fitted to.
    noise : NoiseModel, optional
        Other noise than the fit's.
    """
    found = sensitivities(fit, driving, candidates, noise)
    basis = _basis(found.fitted)
    e = found.residual - basis @ (basis.T @ found.residual)
    if not found.candidates:
        return ScoreBoard((), {}, e, np.empty(0), np.empty((0, 0)))
    # All at once: most of the work is in passing over as many residuals.
    G = np.hstack([found.effects[c.id] for c in found.candidates])
    R = G - basis @ (basis.T @ G)
    before, after = (np.einsum("ij,ij->j", m, m) for m in (G, R))
    visible, kept, at = [], [], 0
    for effect in found.candidates:
        own = slice(at, at + found.effects[effect.id].shape[1])
        at = own.stop
        retained = float(np.sqrt(after[own].sum() / max(before[own].sum(), 1e-300)))
        if retained >= _INVISIBLE:
            visible.append((effect, retained, own.stop - own.start))
            kept += list(range(own.start, own.stop))
    R = R[:, kept] if len(kept) < R.shape[1] else R
    S, information = R.T @ e, R.T @ R
    scores, directions, at = [], {}, 0
    for effect, retained, width in visible:
        own = slice(at, at + width)
        at = own.stop
        directions[effect.id] = R[:, own]
        seconds = duration(driving)
        scores.append(
            _score(effect, R[:, own], e, S[own], information[own, own], retained, seconds)
        )
    scores.sort(key=lambda s: (s.p_value, -s.statistic))
    return ScoreBoard(tuple(scores), directions, e, S, information)


def _basis(G: FloatArray) -> FloatArray:
    """Orthonormal basis of the columns; directions that are copies of others are left out."""
    scaled = G / np.maximum(np.linalg.norm(G, axis=0), 1e-300)
    u, s, _ = np.linalg.svd(scaled, full_matrices=False)
    kept: FloatArray = u[:, s > 1e-7 * s[0]]
    return kept


def _pseudo_inverse(information: FloatArray) -> tuple[FloatArray, int]:
    scale = np.sqrt(np.maximum(np.diag(information), 1e-300))
    values, vectors = np.linalg.eigh(information / np.outer(scale, scale))
    kept = values > 1e-6 * values[-1]
    inverse = (vectors[:, kept] / values[kept]) @ vectors[:, kept].T
    return inverse / np.outer(scale, scale), int(kept.sum())


def _score(
    effect: Effect,
    R: FloatArray,
    e: FloatArray,
    S: FloatArray,
    information: FloatArray,
    retained: float,
    duration_s: float,
) -> Score:
    covariance, _ = _pseudo_inverse(information)
    value = covariance @ S
    ratio = _variance_ratio(R, e - R @ value, information)
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
    p: FloatArray = chi2_tail(degrees, T)
    return p


def _on_one_side(effect: Effect, directions: int) -> bool:
    one_sided = [p.one_sided for p in effect.parameters]
    return len(one_sided) == directions <= 2 and all(one_sided)


def _chi_squared(S: FloatArray, information: FloatArray) -> tuple[FloatArray, int]:
    """Statistics of scores, one a row, and their degrees of freedom."""
    inverse, rank = _pseudo_inverse(information)
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
    p: FloatArray = np.where(T > 0.0, 0.5 * chi2_tail(1, T) + both * chi2_tail(2, T), 1.0)
    return p


def _variance_ratio(R: FloatArray, e: FloatArray, information: FloatArray) -> float:
    """Long-run over naive variance of the score, the effect's own explanation taken out.

    Bartlett weights over 100 samples (Newey & West, Econometrica 1987), which are those of sums
    over all windows of so many; the largest over the effect's parameters.
    """
    channels = _core.CHANNELS
    terms = np.einsum("kcj,kc->kj", R.reshape(-1, channels, R.shape[1]), e.reshape(-1, channels))
    terms -= terms.mean(axis=0)
    n, lags = len(terms), min(100, len(terms) // 10)
    sums = np.zeros((n + 2 * lags + 2, terms.shape[1]))
    np.cumsum(terms, axis=0, out=sums[lags + 1 : n + lags + 1])
    sums[n + lags + 1 :] = sums[n + lags]
    windows = sums[lags + 1 :] - sums[: n + lags + 1]
    long_run = np.einsum("ij,ij->j", windows, windows) / (lags + 1)
    ratio = float(np.max(long_run / np.maximum(np.diag(information), 1e-300)))
    # An estimate from so many lags scatters: what it cannot tell from 1 counts as 1.
    uncertainty = np.sqrt(4.0 * lags / (3.0 * n))
    return ratio / (1.0 + 2.0 * float(uncertainty))
