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

import numpy as np
from scipy.stats import chi2

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
    """

    scores: tuple[Score, ...]
    directions: dict[str, FloatArray]
    residual: FloatArray

    def joint_statistic(self, *names: str) -> float:
        """T of several effects together."""
        R = np.hstack([self.directions[n] for n in names])
        return _quadratic(R, self.residual)[0]

    def family_p_values(self, draws: int = 4000, seed: int = 0) -> dict[str, float]:
        """P-values corrected for testing all effects at once.

        The smallest p-value of all is simulated under a complete model, with the effects' true
        correlation (Westfall & Young, Resampling-Based Multiple Testing, 1993).
        """
        if not self.scores:
            return {}
        names = [s.effect.id for s in self.scores]
        R = np.hstack([self.directions[n] for n in names])
        # In units of their own: rounding at the largest would drown the smallest.
        R = R / np.maximum(np.linalg.norm(R, axis=0), 1e-300)
        covariance = R.T @ R
        values, vectors = np.linalg.eigh(covariance)
        root = vectors * np.sqrt(np.maximum(values, 0.0))
        normal = np.random.default_rng(seed).standard_normal((draws, len(values))) @ root.T
        smallest = np.ones(draws)
        at = 0
        for s in self.scores:
            q = self.directions[s.effect.id].shape[1]
            block = slice(at, at + q)
            at += q
            inverse, rank = _pseudo_inverse(covariance[block, block])
            statistic = np.einsum("ij,jk,ik->i", normal[:, block], inverse, normal[:, block])
            p = _p_value(s.effect, statistic, (normal[:, block] @ inverse)[:, 0], rank)
            smallest = np.minimum(smallest, p)
        smallest.sort()
        alone = np.array([s.p_value for s in self.scores])
        family = np.searchsorted(smallest, alone, side="right") / draws
        # Below what the draws resolve: as many independent tests as they act like at 1 %.
        tests = 0.01 / max(float(np.quantile(smallest, 0.01)), 1e-12)
        family = np.where(alone < smallest[20], np.minimum(alone * tests, 1.0), family)
        return dict(zip(names, map(float, family), strict=True))


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
    e, G, columns = found.residual, found.fitted, found.effects
    basis = _basis(G)
    e_left = e - basis @ (basis.T @ e)
    scores, directions = [], {}
    for effect in found.candidates:
        G_j = columns[effect.id]
        R = G_j - basis @ (basis.T @ G_j)
        size = float(np.linalg.norm(G_j))
        retained = float(np.linalg.norm(R)) / size if size > 0 else 0.0
        if retained < _INVISIBLE:
            continue
        directions[effect.id] = R
        scores.append(_score(effect, R, e_left, retained, duration(driving)))
    scores.sort(key=lambda s: (s.p_value, -s.statistic))
    return ScoreBoard(tuple(scores), directions, e_left)


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


def _quadratic(R: FloatArray, e: FloatArray) -> tuple[float, FloatArray, FloatArray, int]:
    """T, the predicted parameters, their covariance, and the rank."""
    inverse, rank = _pseudo_inverse(R.T @ R)
    S = R.T @ e
    value = inverse @ S
    return float(S @ value), value, inverse, rank


def _score(
    effect: Effect, R: FloatArray, e: FloatArray, retained: float, duration_s: float
) -> Score:
    statistic, value, covariance, rank = _quadratic(R, e)
    ratio = _variance_ratio(R, e - R @ value, covariance)
    statistic /= max(ratio, 1.0)
    p = float(_p_value(effect, np.array([statistic]), value[:1], rank)[0])
    std = np.sqrt(np.maximum(np.diag(covariance) * max(ratio, 1.0), 0.0))
    if effect.scanned is not None:
        # The best of the grid, known as closely as the grid is fine.
        grid = effect.scanned.grid(duration_s)
        squares = np.maximum((R**2).sum(axis=0), 1e-300)
        best = int(np.argmax((R.T @ e) ** 2 / squares))
        value = np.array([(R[:, best] @ e) / squares[best], grid[best]])
        std = np.array([np.sqrt(max(ratio, 1.0) / squares[best]), float(np.gradient(grid)[best])])
    return Score(
        effect, statistic, p, tuple(map(float, value)), tuple(map(float, std)), retained, ratio
    )


def _p_value(effect: Effect, statistic: FloatArray, value: FloatArray, rank: int) -> FloatArray:
    p: FloatArray = chi2.sf(statistic, rank)
    first = effect.parameters[0]
    if len(effect.parameters) == 1 and first.one_sided:
        # Only one sign exists: half the two-sided p-value, or no evidence at all.
        right_sign = np.sign(value) == np.sign(first.typical - first.null_value)
        p = np.where(right_sign, 0.5 * p, 1.0)
    return p


def _variance_ratio(R: FloatArray, e: FloatArray, inverse: FloatArray) -> float:
    """Long-run over naive variance of the score, the effect's own explanation taken out.

    Bartlett weights over 100 samples (Newey & West, Econometrica 1987); the largest over the
    effect's parameters.
    """
    channels = _core.CHANNELS
    terms = (R * e[:, None]).reshape(-1, channels, R.shape[1]).sum(axis=1)
    terms = terms - terms.mean(axis=0)
    n, lags = len(terms), min(100, len(terms) // 10)
    padded = 1 << int(np.ceil(np.log2(n + lags)))
    spectrum = np.fft.rfft(terms, padded, axis=0)
    covariances = np.fft.irfft(np.abs(spectrum) ** 2, padded, axis=0)[: lags + 1]
    weights = 1.0 - np.arange(1, lags + 1) / (lags + 1)
    long_run = covariances[0] + 2.0 * weights @ covariances[1:]
    naive = np.diag(R.T @ R)
    ratio = float(np.max(long_run / np.maximum(naive, 1e-300)))
    # An estimate from so many lags scatters: what it cannot tell from 1 counts as 1.
    uncertainty = np.sqrt(4.0 * lags / (3.0 * n))
    return ratio / (1.0 + 2.0 * float(uncertainty))
