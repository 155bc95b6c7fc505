"""Noise of maximum likelihood at fixed parameters: Fisher scoring on its logarithms."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from typing import NamedTuple, Protocol

import numpy as np
import numpy.typing as npt
import scipy

from .._common.arrays import FloatArray, as_float64
from .._common.threads import check_time
from ..errors import NumericalError
from ..vehicle import Vehicle
from .noise import NoiseModel, noise_range
from .pieces import DrivingProblem

_FAR, _TINY = 1.5, 1e-12  # of a logarithm, in one step
_LITTLE = 0.05  # nats for which no other step is tried
# Of a step, nats that it promises and its largest logarithm: what scoring leaves of so little is
# next to nothing.
_NEARLY, _SHORT = 1.0, 0.3


def learn_noise(
    problem: DrivingProblem, p: FloatArray, start: NoiseModel, vehicle: Vehicle, *, rounds: int = 8
) -> tuple[NoiseModel, float]:
    """Noise of maximum likelihood at fixed model parameters, and the log-likelihood."""
    found = maximise_noise(problem, p, start.vector(), *noise_range(vehicle), rounds=rounds)
    return NoiseModel.from_vector(found.noise), found.log_likelihood


class Learned(NamedTuple):
    """Noise of maximum likelihood, or what was found on the way there.

    Attributes
    ----------
    noise : array, shape (noises,)
    log_likelihood : float
    stands : bool
        Whether another step promises next to nothing; steps had not merely run out.
    """

    noise: FloatArray
    log_likelihood: float
    stands: bool


class _Scored(Protocol):
    def noise_score(
        self, p: FloatArray, noise: FloatArray, /
    ) -> tuple[float, FloatArray, FloatArray]: ...


def maximise_noise(
    problem: _Scored,
    p: FloatArray,
    start: FloatArray,
    lowest: FloatArray,
    highest: FloatArray,
    *,
    rounds: int,
    enough: float = 0.01,
    likelihood: Callable[[FloatArray], float] | None = None,
    along: bool = False,
) -> Learned:
    """Noise of maximum likelihood at fixed parameters of any model.

    Fisher scoring on the logarithms of the noise parameters, each step the best one within a box
    that shrinks where the likelihood would fall; it never does.

    Parameters
    ----------
    problem : object with `noise_score`
        Such as `_core.Problem`.
    p : array, shape (parameters,)
    start, lowest, highest : array, shape (noises,)
        Where to begin, and the range that is searched.
    rounds : int
        Most steps.
    enough : float
        What a step has to promise [nats].
    likelihood : callable, optional
        The log-likelihood alone, from noise, where that costs less than its score: after the last
        step nobody asks for more.
    along : bool
        Whether a score costs little more where the likelihood is known: then steps that lower it
        are not scored either.

    Notes
    -----
    What is zero at the start is not there, and stays so.
    """
    low, high = np.log(lowest), np.log(highest)
    there_is = start > 0.0
    eta = np.clip(np.log(np.maximum(start, 1e-12)), low, high)

    def noise_of(logarithms: FloatArray) -> FloatArray:
        return as_float64(np.where(there_is, np.exp(logarithms), 0.0))

    value, gradient, information = problem.noise_score(p, noise_of(eta))
    reach = _FAR
    stands = False
    for left in reversed(range(rounds)):
        check_time()
        whole, promised = _step(gradient, information, low - eta, high - eta, there_is)
        if promised < enough:
            stands = True
            break
        gained = 0.0
        stands = promised < _NEARLY and float(np.abs(whole).max()) < _SHORT
        last = likelihood is not None and (left == 0 or stands)
        for _ in range(6):
            step, _ = _step(gradient, information, low - eta, high - eta, there_is, reach)
            trial = np.clip(eta + step, low, high)
            there = (-np.inf, gradient, information)
            with suppress(NumericalError):
                if likelihood is not None and (last or along):
                    there = (likelihood(noise_of(trial)), gradient, information)
                if not last and (there[0] > value or not along):
                    there = problem.noise_score(p, noise_of(trial))
            if there[0] > value:
                gained = there[0] - value
                eta, (value, gradient, information) = trial, there
                reach = min(2.0 * reach, _FAR)
                break
            reach *= 0.25
            if promised < _LITTLE:
                break
        if last or gained < max(_LITTLE, enough):
            break
    return Learned(noise_of(eta), float(value), stands)


def promised_by_noise(
    problem: _Scored,
    p: FloatArray,
    noise: FloatArray,
    lowest: FloatArray,
    highest: FloatArray,
) -> float:
    """What a step of Fisher scoring within the range promises to gain [nats].

    Parameters
    ----------
    problem : object with `noise_score`
    p : array, shape (parameters,)
    noise, lowest, highest : array, shape (noises,)
        Noise, of which what is zero is not there, and its range.
    """
    _, gradient, information = problem.noise_score(p, noise)
    there_is = noise > 0.0
    eta = np.log(np.where(there_is, noise, lowest))
    within = (np.log(lowest) - eta, np.log(highest) - eta)
    return _step(gradient, information, *within, there_is)[1]


def _step(
    gradient: FloatArray,
    information: FloatArray,
    low: FloatArray,
    high: FloatArray,
    there_is: npt.NDArray[np.bool_],
    reach: float = _FAR,
) -> tuple[FloatArray, float]:
    """The best step within the range and `reach`, and what it promises to gain.

    Cut at the box, the best step without one may lead downhill: what is next to nothing acts like
    its neighbours.
    """
    step = np.zeros_like(gradient)
    free = (np.diag(information) > 1e-9) & there_is
    if not free.any():
        return step, 0.0
    size = np.sqrt(np.diag(information)[free])
    slope = gradient[free] / size
    scaled = information[np.ix_(free, free)] / np.outer(size, size)
    root = np.linalg.cholesky(scaled + 1e-3 * np.eye(len(size))).T
    bounds = (np.clip(low[free], -reach, -_TINY) * size, np.clip(high[free], _TINY, reach) * size)
    aim = np.linalg.solve(root.T, slope)
    best = np.linalg.solve(root, aim)
    if not np.all((bounds[0] <= best) & (best <= bounds[1])):
        best = scipy.optimize.lsq_linear(root, aim, bounds=bounds, method="bvls").x
    step[free] = best / size
    return as_float64(step), float(slope @ best - 0.5 * best @ scaled @ best)
