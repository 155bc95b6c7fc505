"""Parameters that predict best some seconds ahead.

The likelihood is that of one step. What a model lacks it lays upon disturbances, and these follow
slow errors so well that parameters serve fast ones: a car whose tyres answer late may be given half
its cornering stiffness. The prediction over a longer time knows no disturbance. Its errors, squared
and summed, are the criterion of the simulation error, or of prediction many steps ahead (Ljung,
System Identification, 2nd ed., sec. 7.2 and 8.5; Farina & Piroddi, Int. J. Control 2011). Where the
model is the car, both give the same car within their uncertainty, and the likelihood is the surer.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import groupby
from operator import itemgetter

import numpy as np
import numpy.typing as npt
import scipy

from .. import _core
from .._arrays import FloatArray, as_float64
from ..errors import InvalidInput
from ..estimate import Driving, NoiseModel, turning
from ..model import Model
from .box import free_box, free_prior
from .estimates import wald
from .fit import Fit
from .objective import Penalised
from .search import minimise

_MOST = 400  # windows
# Windows that err by more than so many times the typical error count as lost, but of all windows
# no more than a tenth: they are left out (trimmed squares, Rousseeuw, JASA 1984). Both are those of
# windows in which the car turns: beside a straight every corner would be lost.
_LOST, _KEPT = 3.0, 0.9
_PASSES, _ROUNDS = 3, 60
_SETTLED = 1e-3  # observations
_BLOCK_S, _FEWEST = 10.0, 6  # windows of one such time are wrong alike; fewest such times
_TINY = 1e-300
_ERRS = 0.1  # of the motion: what a fair model leaves; a car whose a_y shakes by 4 m/s2 chose it
_BLIND = 1e4  # standard deviations of a channel: a sensor that corrects nothing
_STILL = 1e-6  # noise of a motion that is certain


_Gains = tuple[_core.FrozenFilter, ...]


@dataclass(frozen=True)
class _Windows:
    """Prediction errors over windows, whose mean square over a window and channel is near one.

    Logs have rates of their own: a window counts as one observation of each channel, however many
    samples it has.
    """

    problems: tuple[_core.Problem, ...]  # one for each length of windows
    units: tuple[float, ...]

    @property
    def samples(self) -> int:
        return sum(problem.samples for problem in self.problems)

    def freeze(self, p: FloatArray, noise: FloatArray) -> _Gains:
        return tuple(problem.freeze(p, noise) for problem in self.problems)

    def _each(self, gains: _Gains) -> Iterator[tuple[_core.Problem, float, _core.FrozenFilter]]:
        return zip(self.problems, self.units, gains, strict=True)

    def residuals(self, p: FloatArray, gains: _Gains) -> FloatArray:
        return np.vstack([one.residuals(p, g) / unit for one, unit, g in self._each(gains)])

    def sensitivities(self, p: FloatArray, gains: _Gains, columns: list[int]) -> FloatArray:
        each = self._each(gains)
        return np.vstack([one.sensitivities(p, g, columns) / unit for one, unit, g in each])

    def half_sum_of_squares(self, p: FloatArray, gains: _Gains) -> float:
        return sum(one.half_sum_of_squares(p, g) / unit**2 for one, unit, g in self._each(gains))

    def normal_equations(
        self, p: FloatArray, gains: _Gains, columns: list[int]
    ) -> tuple[float, FloatArray, FloatArray]:
        cost, descent = 0.0, np.zeros(len(columns))
        information = np.zeros((len(columns), len(columns)))
        for one, unit, g in self._each(gains):
            own = one.normal_equations(p, g, columns)
            cost += own[0] / unit**2
            descent += own[1] / unit**2
            information += own[2] / unit**2
        return cost, descent, information


def predicting_ahead(fit: Fit, horizon_s: float = 2.0) -> Fit:
    """Fit the free parameters to predictions over windows, from a fit of the likelihood.

    Each window begins with the smoothed motion, and from there on knows steering and wheel force
    alone. Errors count in standard deviations of their channel over the driving, together with ten
    times the noise of its sensor: beside an accelerometer that shakes other channels decide.
    Windows in which the model loses the car do not count, a tenth at most. Standard errors are
    those of windows that are wrong alike for ten seconds (sandwich of Huber and White over such
    blocks).

    Parameters
    ----------
    fit : Fit
        Of the likelihood.
    horizon_s : float

    Returns
    -------
    Fit
        Its log-likelihood is still that of one step, with the noise of the fit it began from.

    Raises
    ------
    InvalidInput
        No time above zero, or longer than every stretch of the driving.
    """
    if not (np.isfinite(horizon_s) and horizon_s > 0.0):
        raise InvalidInput(f"horizon_s = {horizon_s}: give a time above zero, in seconds")
    box = free_box(fit.model)
    driving, model = fit.driving, fit.model
    windows = _windows_of(driving, horizon_s)
    turns = _turns(driving, windows)
    noise = _blind_noise(driving, fit.noise.floor())
    known = model.parameters
    prior = free_prior(model)
    whole = driving.problem(model)
    p = box.inside(model.vector())
    for _ in range(_PASSES):
        # What is not measured is smoothed with the parameters that are being sought.
        motion = as_float64(whole.trace(p, fit.noise.vector(), True)["state"])
        every = driving.windows(model, windows, motion)
        squares = _squares(every.residuals(p, every.freeze(p, noise)), windows)
        typical = float(np.median(squares[turns]))
        most = max(_LOST**2 * typical, float(np.quantile(squares[turns], _KEPT)))
        kept = [w for w, square in zip(windows, squares, strict=True) if square <= most]
        counted = sorted(kept, key=lambda window: window[::-1])
        errors = _counting(driving, model, counted, motion, typical)
        gains = errors.freeze(p, noise)
        found = minimise(
            Penalised(errors, prior), p, gains, box, rounds=_ROUNDS, tolerance=_SETTLED
        )
        p = box.put(p, found.x)
    information = _information(
        errors.sensitivities(p, gains, box.columns),
        errors.residuals(p, gains).ravel(),
        np.repeat(_blocks(driving, counted), [_core.CHANNELS * size for _, size in counted]),
    )
    for rows in prior:
        stated = rows(p)[1][:, box.columns]
        information = information + stated.T @ stated
    names = model.free_names
    units = {n: parameter.unit for n, parameter in known.items()}
    x = p[box.columns]
    estimates, covariance = wald(names, units, x, as_float64(information), box)
    return replace(
        fit,
        model=model.with_values(dict(zip(names, map(float, x), strict=True))),
        estimates=estimates,
        covariance=covariance,
        log_likelihood=float(whole.freeze(p, fit.noise.vector()).log_likelihood),
        converged=found.settled,
        profiles=(),
        horizon_s=float(horizon_s),
    )


def _counting(
    driving: Driving,
    model: Model,
    windows: list[tuple[int, int]],
    motion: FloatArray,
    square: float,
) -> _Windows:
    """Windows, sorted by their length, of which the typical mean square is known."""
    alike = [(length, list(few)) for length, few in groupby(windows, key=itemgetter(1))]
    return _Windows(
        tuple(driving.windows(model, few, motion) for _, few in alike),
        tuple(float(np.sqrt(max(square * length, _TINY))) for length, _ in alike),
    )


def _windows_of(driving: Driving, horizon_s: float) -> list[tuple[int, int]]:
    """First sample and number of samples of windows that begin half a horizon apart."""
    found = []
    for first, end, rate in driving.spans:
        length = max(round(horizon_s * rate), 1) + 1
        found += [(k, length) for k in range(first, end - length + 1, max(length // 2, 1))]
    if not found:
        raise InvalidInput(
            f"horizon_s = {horizon_s:g}: no stretch of {driving} is as long; give a shorter one"
        )
    if len(found) <= _MOST:
        return found
    return [found[i] for i in np.linspace(0, len(found) - 1, _MOST).round().astype(int)]


def _turns(driving: Driving, windows: list[tuple[int, int]]) -> npt.NDArray[np.bool_]:
    """In which windows the car turns half of the time; all, where it does in none."""
    turned = np.concatenate([[0], np.cumsum(turning(driving))])
    found = np.array([2 * (turned[at + size] - turned[at]) >= size for at, size in windows])
    return found if found.any() else ~found


def _blind_noise(driving: Driving, noise: NoiseModel) -> FloatArray:
    """Noise with which a filter only predicts, and whitens errors by what a model may err.

    That is a share of the motion, and the noise of the sensor, both told by the spread of the
    channel.
    """
    sensor = np.array(noise.sensor)
    spread = np.array(
        [np.std(y[np.isfinite(y)]) if np.isfinite(y).any() else 1.0 for y in driving.measured.T]
    )
    motion = np.maximum(spread**2 - sensor**2, 0.0)
    spread = np.sqrt(motion + (sensor / _ERRS) ** 2)
    spread[~(spread > 0.0)] = 1.0
    return as_float64(
        [*(_BLIND * spread), *(_STILL,) * 3, 0.0, 0.0, 0.0, 0.1, 0.1, 0.1, 0.0, 0.0, 5.0]
    )


def _squares(errors: FloatArray, windows: list[tuple[int, int]]) -> FloatArray:
    """Mean square error of each window, over samples and channels that were measured."""
    begins = np.cumsum([0, *(size for _, size in windows[:-1])])
    sums = np.add.reduceat((errors**2).sum(axis=1), begins)
    counts = np.add.reduceat(np.count_nonzero(errors, axis=1), begins)
    return as_float64(sums / np.maximum(counts, 1))


def _blocks(driving: Driving, windows: list[tuple[int, int]]) -> npt.NDArray[np.intp]:
    """For each window the number of its block, from zero on without gaps."""
    length = max(min(_BLOCK_S, driving.usable_s / _FEWEST) * driving.mean_rate_hz, 1.0)
    return np.unique([int(first / length) for first, _ in windows], return_inverse=True)[1]


@lru_cache
def of_few(blocks: int) -> float:
    """How much wider Student's 95 % interval of so many blocks is than that of many."""
    return float(scipy.special.stdtrit(max(blocks - 1, 1), 0.975) / scipy.special.ndtri(0.975))


def _information(
    slope: FloatArray, residual: FloatArray, blocks: npt.NDArray[np.intp]
) -> FloatArray:
    """Inverse of the sandwich covariance, H J^-1 H.

    Blocks are hardly more than parameters. The scatter of their scores is drawn towards that of
    blocks which differ in nothing but how many alike samples one of them counts for. It is itself
    known from few blocks (`of_few`).
    """
    H = slope.T @ slope
    count = int(blocks.max()) + 1
    scores = np.zeros((count, H.shape[0]))
    np.add.at(scores, blocks, slope * residual[:, None])
    J = scores.T @ scores * (count / max(count - 1, 1) * of_few(count) ** 2)
    felt = np.sqrt(np.maximum(np.diag(H), 1e-300))
    alike = float(np.trace(np.linalg.pinv(H / np.outer(felt, felt)) @ (J / np.outer(felt, felt))))
    own = count / (count + len(H))
    J = own * J + (1.0 - own) * max(alike / len(H), 1e-12) * H
    return as_float64(H @ np.linalg.pinv(J, hermitian=True) @ H)
