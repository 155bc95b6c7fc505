"""Whether noise of another time scale leads parameters to a better maximum.

Disturbances take up what a model does not explain. Where that has a slow and a fast part a
disturbance follows either, and parameters explain what it leaves: two maxima of the likelihood of
both together, although at the parameters of either the noise has one alone. Searches that move
parameters and noise in turn end at the one that is nearer.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from ..._common.arrays import FloatArray
from ..._common.threads import in_parallel
from ...errors import NumericalError
from ...estimate import Learned
from ...estimate.noise import DISTURBANCE, TIMES
from .climb import FAR_BELOW, to_the_top
from .objective import Objective
from .search import SLIGHT, Box, stride
from .settle import settle

_APART = 5.0  # times as long, or as short, is the correlation time that is tried
_OTHER = 2.0  # times: what is nearer is the same maximum
_WORTH = 10.0  # nats on few samples that a disturbance takes up, or its time scale is nothing
_STEPS = 3  # of the noise, the time held
_TWICE = 2.0  # times what a step of the parameters promises
_STANDS = 0.5  # nats
_ROUNDS = 3
_BELOW_BY_FEW = 5.0  # nats on few samples, from where nothing comes up


def likelier_noise(
    objective: Objective,
    at_top: tuple[FloatArray, FloatArray],
    box: Box,
    few: Objective,
) -> tuple[FloatArray, FloatArray]:
    """Parameters and noise of a maximum, or of a likelier one with noise of other time scales.

    One disturbance at a time is given another correlation time. Where the other noise, learned with
    this time held, and a step of the parameters under it make up what that costs on few samples,
    both are searched from there. All samples are asked where few lead to another maximum.

    Parameters
    ----------
    objective : Objective
    at_top : (p, noise)
        Of the maximum that was found.
    box : Box
    few : Objective
        The same on fewer samples.

    Returns
    -------
    p : array, shape (parameters,)
    noise : array, shape (noises,)
        Never less likely than those that are given.
    """
    best, value = _idle_times(objective, at_top, box, few)
    known: list[FloatArray] = []
    for _ in range(_ROUNDS):
        found, reached = _one_round(objective, best, value, box, few, known)
        if reached < value + _STANDS:
            return found
        best, value = found, reached  # where other disturbances may be there
    return best


def _idle_times(
    objective: Objective, at_top: tuple[FloatArray, FloatArray], box: Box, few: Objective
) -> tuple[tuple[FloatArray, FloatArray], float]:
    """The same maximum, or a likelier one with another time of disturbances that are not there.

    Of a disturbance at its least the likelihood has a maximum at either end of the times, as what
    is short may be white and what is long a constant, and searches end at the nearer one. Precise
    sensors tell them apart: a model would end below one that it contains by the time alone.

    Returns
    -------
    at_top : (p, noise)
    log_likelihood : float
    """
    p, noise = at_top
    value = begin = objective.log_likelihood(p, noise)
    for size, place in _disturbances(noise):
        if noise[size] <= 0.0 or not _is_nothing(few, p, noise, size):
            continue
        for time_s in (objective.lowest[place], objective.highest[place]):
            trial = noise.copy()
            trial[[size, place]] = objective.lowest[size], time_s
            reached = float(objective.log_likelihoods(p[None], trial)[0])
            if reached > value:
                noise, value = trial, reached
    if value < begin + _STANDS:
        return at_top, begin
    top = to_the_top(objective, p, noise, box)
    return top, objective.log_likelihood(*top)


def _disturbances(noise: FloatArray) -> Iterator[tuple[int, int]]:
    """Places of the sizes and of the correlation times."""
    places = np.arange(noise.size)
    yield from zip(places[DISTURBANCE].tolist(), places[TIMES].tolist(), strict=True)


def _is_nothing(few: Objective, p: FloatArray, noise: FloatArray, size: int) -> bool:
    """Whether a disturbance takes up so little that its time scale is nothing."""
    least = noise.copy()
    least[size] = few.lowest[size]
    return bool(few.log_likelihoods(p[None], least)[0] > few.log_likelihood(p, noise) - _WORTH)


def _one_round(
    objective: Objective,
    at_top: tuple[FloatArray, FloatArray],
    value: float,
    box: Box,
    few: Objective,
    known: list[FloatArray],
) -> tuple[tuple[FloatArray, FloatArray], float]:
    """As `likelier_noise`, from one maximum; what is `known` by then is not tried again."""
    best, tops = at_top, [at_top[1]]
    here = few.learn_noise(*at_top, rounds=_STEPS)
    known.append(here.noise)
    least = few.log_likelihood(at_top[0], here.noise) - _BELOW_BY_FEW
    ways = list(_other_times(few, at_top[0], here))
    ends = in_parallel(lambda way: _led(few, at_top[0], here, *way, box), ways)
    for end in (e for e in ends if e is not None):
        p, told, reached = end
        if any(_same(told, other) for other in known):
            continue
        known.append(told)
        if reached < least:
            continue
        try:
            p, told, _ = settle(objective, p, told, box, least=value - FAR_BELOW)
            settled = objective.log_likelihood(p, told)
            # By all samples it may be the noise of a maximum that is known.
            back = settled < value and any(_same(told, other) for other in tops)
            if back or settled < value - FAR_BELOW:
                continue
            rival = to_the_top(objective, p, told, box, least=value)
            reached = objective.log_likelihood(*rival)
        except (NumericalError, np.linalg.LinAlgError):
            continue
        tops.append(rival[1])
        if reached > value:
            best, value = rival, reached
    return best, value


def _other_times(few: Objective, p: FloatArray, here: Learned) -> Iterator[tuple[int, float]]:
    """Places of correlation times in the noise, and other times; of disturbances that are there."""
    noise = here.noise
    for size, place in _disturbances(noise):
        if _is_nothing(few, p, noise, size):
            continue
        for times in (1.0 / _APART, _APART):
            time_s = float(np.clip(times * noise[place], few.lowest[place], few.highest[place]))
            if max(time_s / noise[place], noise[place] / time_s) >= _OTHER:
                yield place, time_s


def _led(
    few: Objective, p: FloatArray, here: Learned, place: int, time_s: float, box: Box
) -> tuple[FloatArray, FloatArray, float] | None:
    """Where few samples lead with another correlation time, and the log-likelihood there.

    None where nothing comes of it.
    """
    held = replace(few)  # with a memory of its own
    try:
        noise = _with_time(held, p, here, place, time_s, box)
        if noise is None:
            return None
        end, told, _ = settle(held, p, noise, box, parameters_first=True)
        return end, told, held.log_likelihood(end, told)
    except (NumericalError, np.linalg.LinAlgError):
        return None


def _with_time(
    few: Objective, p: FloatArray, here: Learned, place: int, time_s: float, box: Box
) -> FloatArray | None:
    """Noise with that correlation time; None where it costs more than can come back."""
    lowest, highest = few.lowest.copy(), few.highest.copy()
    lowest[place] = highest[place] = time_s
    held = replace(few, lowest=lowest, highest=highest)
    learned = held.learn_noise(p, here.noise, rounds=_STEPS)
    gains = held.freeze(p, learned.noise)
    _, slope, information = held.normal_equations(p, gains, box.columns)
    _, promised = stride(p[box.columns], slope, information, SLIGHT, box)
    _, by_noise, _ = held.noise_score(p, learned.noise)
    if by_noise[place] * np.log(time_s / here.noise[place]) > 0.0:
        # Let go, the time would not go back: another maximum lies beyond.
        promised += few.noise_promises(p, learned.noise)
    lost = here.log_likelihood - learned.log_likelihood
    return learned.noise if lost < _TWICE * promised + _STANDS else None


def _same(noise: FloatArray, other: FloatArray) -> bool:
    """Whether no correlation time is another one."""
    return bool(np.all(np.abs(np.log(noise[TIMES] / other[TIMES])) < np.log(_OTHER)))
