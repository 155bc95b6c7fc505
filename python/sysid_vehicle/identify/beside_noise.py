"""What standard errors owe to the noise that was learned beside the parameters.

The inverse of the information is the covariance where the noise is known. That of disturbances is
learned from the same innovations, and what parameters say of how fast the car answers it says too:
a relaxation length and the correlation time of a side force. With the information about parameters
p, about noise n, and what is between them,

    cov(p) = (I_pp - I_pn I_nn^-1 I_np)^-1

(Kay, Fundamentals of Statistical Signal Processing: Estimation Theory, 1993, sec. 3.7). I_np is the
change of the score of the noise with the parameters. Without disturbances there is next to nothing
between them.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt

from .._common.arrays import FloatArray, as_float64
from .._common.threads import in_parallel
from ..errors import NumericalError
from ..estimate.noise import DISTURBANCE
from .fit import Fit
from .intervals.estimates import Estimate, spread_of
from .search.box import free_box, objective_of
from .search.objective import Objective
from .search.search import Box

_SAMPLES = 20_000  # that tell what is between noise and parameters; of more it is a share
_STEP, _BEND = 0.05, 0.3  # standard errors: for a change of scores, for the bend of the likelihood
_BEFOREHAND = 0.1  # of what is known of a combination: with more its valley is not straight
_STRAIGHT = 0.5  # of the same, of what the likelihood tells by its own bend: with less, as well
_LEAST = 0.1  # of what is known of a combination that is left beside the noise: rounding counts
_LITTLE = 0.01  # of the same, which changes half a percent of a standard error
_KNOWN = 3.0  # standard errors of its logarithm: the score of noise that hardly shows is not linear
_ALIKE = 1e-3  # relative, of eigenvalues of what is known of the noise: times and sizes may be one


def beside_noise(fit: Fit) -> Fit:
    """The fit with the standard errors of parameters whose noise was learned beside them.

    The fit itself where the noise takes nothing worth printing, and where it cannot be worked out.

    Parameters
    ----------
    fit : Fit
        Of the likelihood, with the standard errors of noise that is held.
    """
    box, p, noise = free_box(fit.model), fit.model.vector(), fit.noise.vector()
    x = p[box.columns]
    unit, looked = box.units(x), _looked(box, x)
    told = np.array([np.isfinite(e.std) for e in fit.estimates])
    few = fit.driving.problem(fit.model, most_samples=_SAMPLES)
    objective = objective_of(fit.model, few, fit.driving)
    if not told.any():
        return fit
    scale = fit.driving.samples / few.samples
    try:
        axes = _axes(fit.by_noise, looked + _priors(objective, p, box), unit, told)
        if not axes.size:
            return fit
        p = _with_room(p, box, axes)
        shares, turn = np.linalg.eigh(scale * _taken(objective, p, noise, box, axes))
        axes, shares = axes @ turn[:, shares > _LITTLE], shares[shares > _LITTLE]
        if not shares.size:
            return fit
        bend = scale * _bend(objective, p, noise, box, axes)
        boxed = axes.T @ (looked * np.outer(unit, unit)) @ axes
        known, turn = _beside(bend + boxed, shares)
    except (NumericalError, np.linalg.LinAlgError):
        return fit
    ways = unit[:, None] * (axes @ turn)
    more = 1.0 / np.clip(known, _LEAST, 1.0) - 1.0
    covariance = as_float64(fit.covariance + (ways * more) @ ways.T)
    wider = np.sqrt(np.diag(covariance))
    estimates = tuple(_as_sure(e, float(std)) for e, std in zip(fit.estimates, wider, strict=True))
    return replace(fit, estimates=estimates, covariance=covariance)


def _beside(bend: FloatArray, shares: FloatArray) -> tuple[FloatArray, FloatArray]:
    """What is known of combinations beside the noise, and the combinations, a column for each.

    Where the likelihood bends by far less than frozen gains tell the valley is not straight, and
    the score of the noise is that of other parameters.
    """
    told, turn = np.linalg.eigh(bend)
    turn = turn[:, told > _STRAIGHT]
    known, along = np.linalg.eigh(turn.T @ (bend - np.diag(shares)) @ turn)
    return as_float64(known), as_float64(turn @ along)


def _as_sure(estimate: Estimate, std: float) -> Estimate:
    return replace(estimate, std=std) if np.isfinite(estimate.std) else estimate


def _looked(box: Box, x: FloatArray) -> FloatArray:
    """Information about the parameters by the box, of which the noise takes nothing."""
    return as_float64(np.diag(1.0 / spread_of(box, x) ** 2))


def _priors(objective: Objective, p: FloatArray, box: Box) -> FloatArray:
    """The same by priors, which the likelihood of an objective counts."""
    known = np.zeros((len(box.columns),) * 2)
    for rows in objective.prior:
        slopes = rows(p)[1][:, box.columns]
        known += slopes.T @ slopes
    return as_float64(known)


def _axes(
    covariance: FloatArray, beforehand: FloatArray, unit: FloatArray, told: npt.NDArray[np.bool_]
) -> FloatArray:
    """Combinations of parameters, on their scales, of one standard error each; a column for each.

    Those that the data tell: along a valley that only the box ends the score of the noise would be
    that of other parameters. What a bound holds stays where it is.
    """
    unit, some = unit[told], np.ix_(told, told)
    own = _held(covariance, told) / np.outer(unit, unit)
    std = np.sqrt(np.diag(own))
    values, vectors = np.linalg.eigh(own / np.outer(std, std))
    root = std[:, None] * vectors * np.sqrt(np.maximum(values, 0.0))
    before, turn = np.linalg.eigh(root.T @ (beforehand[some] * np.outer(unit, unit)) @ root)
    axes = np.zeros((len(told), int(np.count_nonzero(before < _BEFOREHAND))))
    axes[told] = root @ turn[:, before < _BEFOREHAND]
    return as_float64(axes)


def _held(covariance: FloatArray, told: npt.NDArray[np.bool_]) -> FloatArray:
    """The covariance of what is told where all else stays, as it does along an axis."""
    free, held = np.flatnonzero(told), np.flatnonzero(~told)
    std = np.sqrt(np.diag(covariance))
    scaled = covariance / np.outer(std, std)
    across = scaled[np.ix_(free, held)]
    known = scaled[np.ix_(held, held)]
    own = scaled[np.ix_(free, free)] - across @ np.linalg.solve(known, across.T)
    return as_float64(own * np.outer(std[free], std[free]))


def _with_room(p: FloatArray, box: Box, axes: FloatArray) -> FloatArray:
    """The parameters, moved off bounds by what is stepped there: no step is to end at one."""
    x = p[box.columns]
    low, high = box.room(x)
    reach = _BEND * np.sqrt(2.0) * np.linalg.norm(axes, axis=1)
    reach = np.minimum(reach, 0.5 * (high - low))
    return box.put(p, box.moved(x, np.maximum(low + reach, 0.0) + np.minimum(high - reach, 0.0)))


def _taken(
    objective: Objective, p: FloatArray, noise: FloatArray, box: Box, axes: FloatArray
) -> FloatArray:
    """Information about the combinations that is as well one about the noise, (axes, axes).

    None where no disturbance is told: the noise of sensors says nothing of the car.
    """
    _, here, information = objective.problem.noise_score(p, noise)
    size = np.sqrt(np.maximum(np.diag(information), 0.0))
    free = (size > _KNOWN) & (objective.lowest < noise) & (noise < objective.highest)
    if not free[DISTURBANCE].any():
        return np.zeros((axes.shape[1],) * 2)

    def slope(axis: FloatArray) -> FloatArray:
        there = box.put(p, box.moved(p[box.columns], _STEP * axis))
        score = objective.problem.noise_score(there, noise)[1]
        return as_float64((score - here)[free] / (_STEP * size[free]))

    between = np.reshape(in_parallel(slope, list(axes.T)), (axes.shape[1], -1))
    known = information[np.ix_(free, free)] / np.outer(size[free], size[free])
    return as_float64(between @ np.linalg.pinv(known, rcond=_ALIKE, hermitian=True) @ between.T)


def _bend(
    objective: Objective, p: FloatArray, noise: FloatArray, box: Box, axes: FloatArray
) -> FloatArray:
    """Information about the combinations under this noise, the gains of the filter included.

    A share of it is of the spread of the innovations alone, and the noise may take more than all
    that frozen gains tell.
    """
    n, x = axes.shape[1], p[box.columns]
    h = _BEND * np.eye(n)
    steps = [np.zeros(n), *h, *-h]
    pairs = [(i, j) for i in range(n) for j in range(i)]
    for i, j in pairs:
        steps += [h[i] + h[j], h[i] - h[j], h[j] - h[i], -h[i] - h[j]]
    sets = np.array([box.put(p, box.moved(x, axes @ step)) for step in steps])
    value = objective.log_likelihoods(sets, noise)
    if not np.isfinite(value).all():
        raise NumericalError("the likelihood cannot be worked out beside its maximum")
    bend = np.diag(2.0 * value[0] - value[1 : n + 1] - value[n + 1 : 2 * n + 1])
    for k, (i, j) in enumerate(pairs):
        both = value[2 * n + 1 + 4 * k :][:4]
        bend[i, j] = bend[j, i] = 0.25 * (both[1] + both[2] - both[0] - both[3])
    return as_float64(bend / _BEND**2)
