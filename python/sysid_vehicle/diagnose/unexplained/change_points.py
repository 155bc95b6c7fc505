"""Moments at which the car changed.

Had the car stayed the same, the scores of its parameters would sum up evenly over time. With z the
sensitivities of the whitened residuals e to everything that is taken as constant (the fitted
parameters, forces that are steady or depend on speed and acceleration alone), a, some of them,
change at time t by M^-1 S where

    S(t) = sum_k>t a_k' (I - P_z) e_k,   M(t) = sum_k>t a_k' a_k - its part that z explains,

and the largest S' M^-1 S over t tells whether they do (Andrews, Econometrica 1993). How large it
gets by chance depends on the driving and is drawn: residuals are white, so that the sums over
fifths of a second are independent normal variables of known covariance. Of a model that lacks
something at all times they are not. So a change has to stand out from what it leaves besides, too:
the scores of that, turned at random some seconds at a time. Where one was found both sides are
searched again (binary segmentation).

The disturbances of the filter soon take up a change, which shows at once or not at all. So the
moment is read from the response to forces that step there; its interval is that of Hansen
(Econometrica 2000): all moments whose statistic is within 7.35 of the largest.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy

from ..._common.arguments import generator
from ..._common.arrays import FloatArray, as_float64
from ..._common.threads import check_time
from ...effects import effect
from ...estimate import Driving
from ..evidence.coordinates import running_time
from ..evidence.evidence import Evidence, solve
from ..evidence.projection import orthonormal_basis, variance_ratio
from .change_directions import Kind, beginning, kinds_of_change, of_driving

_STEP_S, _MOST_STEPS = 0.2, 400
_LEAST_S = 1.5  # on both sides of a change
_INTERVAL = 7.35
_NEAR_S, _FINE = 1.2, 24  # how far around, and at how many places, the moment is read
_MOST = 5
# A fifth of the draws tells what is far from a change: ten times the rate that is claimed.
_FEWER, _HOPELESS = 5, 10.0
_TOGETHER_S = 5.0  # over which a wrong model errs alike: about one corner


@dataclass(frozen=True)
class ChangePoint:
    """A moment at which the car changed.

    Attributes
    ----------
    log : str
        Name of the log.
    time_s, from_s, until_s : float
        In that log, with its 95 % interval. The ends of an interval that reaches into another log
        are those of this log.
    driven_s : float
        The same moment in seconds driven, through all stretches.
    what : str
        `grip`, `side force` or `forward force`.
    size, std : dict of str to float
        What changed by how much: forces in N and N m, grip as a share.
    p_value : float
        Of a car that stays the same, over all moments and kinds of change together.
    """

    log: str
    time_s: float
    from_s: float
    until_s: float
    driven_s: float
    what: str
    size: dict[str, float]
    std: dict[str, float]
    p_value: float

    def __str__(self) -> str:
        sizes = ", ".join(
            f"{100 * v:+.2g} +- {100 * self.std[name]:.1g} %"
            if name == "grip"
            else f"{name} {v:+.3g} +- {self.std[name]:.2g} {'N m' if name == 'M_z' else 'N'}"
            for name, v in self.size.items()
        )
        return (
            f"{self.what} changes in {self.log} at {self.time_s:.1f} s "
            f"({self.from_s:.1f} to {self.until_s:.1f} s): {sizes} (p = {self.p_value:.1g})"
        )


def change_points(
    evidence: Evidence, *, alpha: float = 0.01, draws: int = 1000, seed: int = 0
) -> tuple[ChangePoint, ...]:
    """Find the moments at which the car changed.

    Parameters
    ----------
    evidence : Evidence
    alpha : float
        Rate of driving in which a change is claimed though the car stays the same.
    draws : int
        To calibrate with.
    """
    driving = evidence.driving
    kinds = kinds_of_change(evidence)
    constant = np.hstack([evidence.fitted, *(k.columns for k in kinds), of_driving(evidence)])
    rng = generator(seed)
    found: list[ChangePoint] = []
    to_search = [(0, driving.samples)]
    while to_search and len(found) < _MOST:
        begin, end = to_search.pop(0)
        at = _search(driving, kinds, constant, evidence.residual, (begin, end), alpha, draws, rng)
        change = None if at is None else _read(evidence, constant, *at, alpha)
        if at is not None and change is not None:
            found.append(change)
            to_search += [(begin, at[0]), (at[0], end)]
    return tuple(sorted(found, key=lambda c: c.driven_s))


def _search(
    driving: Driving,
    kinds: list[Kind],
    constant: FloatArray,
    residual: FloatArray,
    segment: tuple[int, int],
    alpha: float,
    draws: int,
    rng: np.random.Generator,
) -> tuple[int, Kind, float] | None:
    """The change that stands out most in samples of a segment, if any does."""
    check_time()
    begin, end = segment
    channels = len(residual) // driving.samples
    rate = driving.mean_rate_hz
    step = max(round(_STEP_S * rate), -(-driving.samples // _MOST_STEPS), 1)
    steps, edge = (end - begin) // step, max(round(_LEAST_S * rate / step), 1)
    if steps < 2 * edge + 2:
        return None
    rows = slice(channels * begin, channels * (begin + steps * step))
    Q = orthonormal_basis(constant[rows])
    e = residual[rows] - Q @ (Q.T @ residual[rows])
    by_step = (steps, step * channels)
    inner = slice(edge, steps - edge)  # steps before which a change may lie
    Q_steps = Q.reshape(*by_step, -1)
    results, walks = [], []
    for kind in kinds:
        A = kind.columns[rows].reshape(*by_step, -1)
        gram = _after(A.swapaxes(1, 2) @ A)[inner]
        across = _after(Q_steps.swapaxes(1, 2) @ A)[inner]
        # Of the columns after t, what the constant columns explain of them.
        M = gram - across.swapaxes(1, 2) @ across
        inverse = _inverses(M)
        S = _after(np.einsum("bki,bk->bi", A, e.reshape(by_step), optimize=True))[inner]
        T = np.einsum("bi,bij,bj->b", S, inverse, S)
        results.append((T, S, inverse))
        walks.append((A, across, inverse))
    best: tuple[float, int, int] | None = None
    ratios, left = [], e
    for i, (kind, (T, S, inverse)) in enumerate(zip(kinds, results, strict=True)):
        at = int(np.argmax(T))
        after = kind.columns[rows].copy()
        after[: (at + edge) * step * channels] = 0.0
        direction = after @ (inverse[at] @ S[at])
        direction -= Q @ (Q.T @ direction)
        ratios.append(variance_ratio(direction, e - direction))
        strength = -float(scipy.stats.chi2.logsf(T[at] / ratios[-1], S.shape[1]))
        if best is None or strength > best[0]:
            best, left = (strength, i, at), e - direction
    assert best is not None
    few = _noise(Q_steps, walks, draws // _FEWER, generator(0))
    rank, alike = Q_steps.shape[2], np.ones(len(kinds))
    if _p_value(best[0], _largest(few, rank, walks, inner, alike)) > _HOPELESS * alpha:
        return None
    noise = _noise(Q_steps, walks, draws, rng)
    p = _p_value(best[0], _largest(noise, rank, walks, inner, alike))
    if p <= alpha:
        # A model that is wrong in the same way throughout leaves more than white noise.
        misfit = _misfit(Q_steps, walks, left.reshape(by_step), step / rate, draws, rng)
        p = max(p, _p_value(best[0], _largest(misfit, rank, walks, inner, ratios)))
    if p > alpha:
        return None
    return begin + (best[2] + edge) * step, kinds[best[1]], p


def _read(
    evidence: Evidence, constant: FloatArray, about: int, kind: Kind, p: float, alpha: float
) -> ChangePoint | None:
    """The moment near a sample at which forces that step explain most, and their sizes.

    None where such a step explains nothing, or grip had to change by more than roads and tyres do:
    something else is wrong then.
    """
    driving = evidence.driving
    rate = driving.mean_rate_hz
    reach = max(round(_NEAR_S * rate), 2 * driving.samples // _MOST_STEPS)
    fine = max(2 * reach // _FINE, 1)
    tried = list(range(max(about - reach, 0), min(about + reach, driving.samples), fine))
    Q = orthonormal_basis(constant)
    e = evidence.residual - Q @ (Q.T @ evidence.residual)
    found = [solve(R - Q @ (Q.T @ R), e) for R in beginning(evidence, kind, tried)]
    statistic = np.array([f.statistic for f in found])
    place = int(np.argmax(statistic))
    best, at = found[place], tried[place]
    if best.statistic < scipy.stats.chi2.isf(alpha, len(kind.names)):
        return None
    if (
        kind.what == "grip"
        and abs(best.size[0]) > effect("friction_change").parameters[0].typical_high
    ):
        return None
    near = np.flatnonzero(statistic >= statistic.max() - _INTERVAL)
    low, high = max(near[0] - 1, 0), min(near[-1] + 1, len(tried) - 1)
    time, log = driving.channel("time_s"), driving.log_number
    own = np.flatnonzero(log == log[at])
    return ChangePoint(
        driving.logs[int(log[at])].name,
        float(time[at]),
        float(time[np.clip(tried[low], own[0], own[-1])]),
        float(time[np.clip(tried[high], own[0], own[-1])]),
        float(running_time(driving)[at]),
        kind.what,
        dict(zip(kind.names, map(float, best.size), strict=True)),
        dict(zip(kind.names, map(float, np.sqrt(np.diag(best.covariance))), strict=True)),
        p,
    )


_Walk = tuple[FloatArray, FloatArray, FloatArray]


def _noise(
    Q_steps: FloatArray, walks: list[_Walk], draws: int, rng: np.random.Generator
) -> FloatArray:
    """Scores of all columns step by step, (steps, draws, columns), were residuals white."""
    together = np.concatenate([Q_steps, *(A for A, _, _ in walks)], axis=2)
    gram = together.swapaxes(1, 2) @ together
    values, vectors = np.linalg.eigh(gram)
    roots = vectors * np.sqrt(np.maximum(values, 0.0))[:, None, :]
    normal = rng.standard_normal((len(roots), draws, roots.shape[2]))
    return as_float64(normal @ roots.swapaxes(1, 2))


def _misfit(
    Q_steps: FloatArray,
    walks: list[_Walk],
    left: FloatArray,
    step_s: float,
    draws: int,
    rng: np.random.Generator,
) -> FloatArray:
    """The same, were they what the change that was found leaves, its sign left to chance.

    Steps near each other are turned together, for what a wrong model leaves in one corner hangs
    together (dependent wild bootstrap; Shao, J. American Statistical Association 2010).
    """
    together = np.concatenate([Q_steps, *(A for A, _, _ in walks)], axis=2)
    scores = np.einsum("bki,bk->bi", together, left, optimize=True)
    steps, reach = len(scores), max(round(_TOGETHER_S / step_s), 1)
    # Moving averages of white noise are correlated by Bartlett's triangle.
    white = np.cumsum(rng.standard_normal((steps + reach, draws)), axis=0)
    turned = (white[reach:] - white[:-reach]) / np.sqrt(reach)
    return as_float64(turned[:, :, None] * scores[:, None, :])


def _largest(
    scores: FloatArray,
    rank: int,
    walks: list[_Walk],
    inner: slice,
    ratios: Sequence[float] | FloatArray,
) -> FloatArray:
    """The largest evidence over all moments and kinds, in draws of a car that stays the same."""
    later = _after(scores)[inner]
    total = scores[:, :, :rank].sum(axis=0)
    largest = np.zeros(scores.shape[1])
    first = rank
    for (A, across, inverse), ratio in zip(walks, ratios, strict=True):
        width = A.shape[2]
        S = later[:, :, first : first + width]
        S = S - np.einsum("bri,dr->bdi", across, total, optimize=True)
        first += width
        T = np.einsum("bdi,bij,bdj->bd", S, inverse, S, optimize=True).max(axis=0)
        largest = np.maximum(largest, -scipy.stats.chi2.logsf(T / ratio, width))
    return as_float64(largest)


def _p_value(found: float, by_chance: FloatArray) -> float:
    return float((1 + np.count_nonzero(by_chance >= found)) / (1 + len(by_chance)))


def _after(by_step: FloatArray) -> FloatArray:
    """Sums from each step to the end."""
    return as_float64(np.cumsum(by_step[::-1], axis=0)[::-1])


def _inverses(M: FloatArray) -> FloatArray:
    """Inverse of each matrix; directions that the driving hardly shows on one side left out."""
    scale = np.sqrt(np.maximum(M.diagonal(axis1=1, axis2=2).max(axis=0), 1e-300))
    values, vectors = np.linalg.eigh(M / np.outer(scale, scale))
    inverse = np.where(values > 1e-3, 1.0 / np.maximum(values, 1e-3), 0.0)
    return as_float64((vectors * inverse[:, None, :]) @ vectors.swapaxes(1, 2)) / np.outer(
        scale, scale
    )
