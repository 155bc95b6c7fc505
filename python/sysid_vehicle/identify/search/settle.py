"""Local searches that work the filter's gains, and the noise, out anew on their way."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from ..._common.arrays import FloatArray
from ...errors import NumericalError
from .objective import Objective
from .search import Box, minimise
from .starts import SAME_VALLEY
from .valley import down_the_valley

_STANDS = 0.5  # nats
_STILL = 3e-4  # nats
_LITTLE = 0.1  # nats for which the noise is not learned once more while parameters still move
_GAIN = 0.05  # nats
_TWICE = 2.0  # times what a score promises
_REFREEZES = 8
_ROUNDS = 12
_SHARES = (1.0, 0.5, 0.25, 0.1, 0.03)  # of a step, tried until the likelihood rises


def descend(
    objective: Objective,
    p: FloatArray,
    noise: FloatArray,
    box: Box,
    *,
    method: str = "gauss-newton",
    refreezes: int = 2,
) -> tuple[FloatArray, float]:
    """One local search: gains are worked out anew wherever it has settled.

    Returns
    -------
    p : array, shape (parameters,)
    log_likelihood : float
        Priors included.
    """
    for _ in range(refreezes):
        gains = objective.freeze(p, noise)
        found = minimise(objective, p, gains, box, method=method, rounds=40)
        before, p = p, box.put(p, found.x)
        if box.near(p, before, 1e-3):
            break
    return p, objective.log_likelihood(p, noise)


def risen(
    objective: Objective, p: FloatArray, gains: Any, x: FloatArray, noise: FloatArray, box: Box
) -> tuple[FloatArray, Any]:
    """As far from `p` towards `x` as the likelihood rises, and the gains there.

    A search holds the gains of its start. With its own the point that it found may be a worse one.

    Parameters
    ----------
    p : array, shape (parameters,)
    gains : object
        Those of `p`.
    x : array, shape (free parameters,)
    noise : array, shape (noises,)

    Returns
    -------
    p : array, shape (parameters,)
    gains : object
    """
    least = objective.reached(p, gains)
    begin = p[box.columns]
    for share in _SHARES:
        # Rounding may lead beyond a bound.
        trial = box.inside(box.put(p, begin + share * (x - begin)))
        try:
            there = objective.freeze(trial, noise)
        except NumericalError:
            continue
        if objective.reached(trial, there) >= least:
            return trial, there
    return p, gains


def settle(
    objective: Objective,
    p: FloatArray,
    noise: FloatArray,
    box: Box,
    *,
    thin: Sequence[Objective] = (),
    method: str = "gauss-newton",
    parameters_first: bool = False,
    led: tuple[FloatArray, FloatArray] | None = None,
    least: float = -np.inf,
    rounds: int = 10,
) -> tuple[FloatArray, FloatArray, bool]:
    """Alternate between noise and parameters until the likelihood stands still.

    It never ends below the likelihood of its start.

    Parameters
    ----------
    objective : Objective
    p : array, shape (parameters,)
    noise : array, shape (noises,)
    box : Box
    thin : sequence of Objective
        The same on fewer samples, the fewest first, which lead most of the way.
    method : str
        Local optimiser.
    parameters_first : bool
        Noise learned at poor parameters is large, and large noise makes poor parameters look good
        enough: where they may be poor and the noise is not, they move first.
    led : (p, noise), optional
        Where few samples have led already, in place of `thin`.
    least : float
        Log-likelihood below which nobody asks for the end: it stops where that is out of reach.
    rounds : int

    Returns
    -------
    p : array, shape (parameters,)
    noise : array, shape (noises,)
    converged : bool
        Whether it came to a stand.
    """
    p, followed = box.inside(p), False
    if parameters_first:
        p, _ = descend(objective, p, noise, box, method=method)
    steps = 6
    if thin:
        # Few samples lead most of the way, unless where it begins is better already.
        led = settle(thin[-1], p, noise, box, thin=thin[:-1], method=method, rounds=rounds)[:2]
    if led is not None:
        near, told = box.inside(led[0]), led[1]
        if objective.log_likelihood(near, told) > objective.log_likelihood(p, noise):
            p, noise, steps, followed = near, told, 3, True
    best = -np.inf
    gains = objective.freeze(p, noise)
    if followed and least > -np.inf and _hopeless(objective, least, p, gains, noise)[0]:
        return p, noise, False
    for _ in range(rounds):
        learned = objective.learn_noise(p, noise, rounds=steps, enough=_LITTLE)
        steps = 3
        there = objective.freeze(p, learned.noise)
        if there.log_likelihood >= gains.log_likelihood:
            noise, gains = learned.noise, there
        value = objective.reached(p, gains)
        if value < best + _STANDS:
            return p, noise, True
        best = value
        p, gains = moved(objective, p, noise, box, method=method, rounds=8)
        if learned.stands and objective.reached(p, gains) < value + _LITTLE:
            return p, noise, True  # the noise was learned where the parameters still are
        if least > -np.inf and _hopeless(objective, least, p, gains, noise)[0]:
            break
    return p, noise, False


def moved(
    objective: Objective,
    p: FloatArray,
    noise: FloatArray,
    box: Box,
    *,
    method: str = "gauss-newton",
    rounds: int = 25,
    tolerance: float = _GAIN,
) -> tuple[FloatArray, Any]:
    """The end of a search, as far as the likelihood rises, and the gains there."""
    gains = objective.freeze(p, noise)
    found = minimise(objective, p, gains, box, method=method, rounds=rounds, tolerance=tolerance)
    return risen(objective, p, gains, found.x, noise, box)


def rivalled(
    objective: Objective,
    best: tuple[FloatArray, FloatArray, bool],
    p: FloatArray,
    box: Box,
    thin: Sequence[Objective] = (),
) -> tuple[FloatArray, FloatArray, bool]:
    """What `settle` found, or what it finds from other parameters, where that is likelier.

    Those move first, under the noise that was found. What noise of their own could add there is
    told by its score: where that is next to nothing they are settled too, and where it is far less
    than what they lack they are not followed. Nor are they where few samples lead both to one end.

    Parameters
    ----------
    objective : Objective
    best : tuple
        Parameters, noise, and whether the search came to a stand.
    p : array, shape (parameters,)
    box : Box
    thin : sequence of Objective
        The same on fewer samples, the fewest first: what lacks too much on these is not followed
        on more.
    """
    found, noise, converged = best
    try:
        if thin:
            few = thin[0]
            near, gains = moved(few, found, noise, box)
            p, there = moved(few, p, noise, box)
            if box.near(near, p, SAME_VALLEY):
                return best
            if _hopeless(few, few.reached(near, gains), p, there, noise)[0]:
                return best
        for some in thin[1:]:
            p, _ = moved(some, p, noise, box)
        value = objective.log_likelihood(found, noise)
        p, gains = moved(objective, p, noise, box)
        hopeless, more = _hopeless(objective, value, p, gains, noise)
        if hopeless:
            return best
        rival = settle(objective, p, noise, box) if more > _STANDS else (p, noise, converged)
        return rival if objective.log_likelihood(*rival[:2]) > value else best
    except (NumericalError, np.linalg.LinAlgError):
        return best


def _hopeless(
    objective: Objective, value: float, p: FloatArray, gains: Any, noise: FloatArray
) -> tuple[bool, float]:
    """Whether parameters lack more than noise of their own can add, and what it can add."""
    more = objective.noise_promises(p, noise)
    there = objective.reached(p, gains)
    return there + _TWICE * more + _STANDS < value, more


def bottom(
    objective: Objective, p: FloatArray, noise: FloatArray, box: Box
) -> tuple[FloatArray, float]:
    """From near an optimum to the optimum itself, to a thousandth of a nat.

    `descend` ends where steps gain little, which in a valley of tyres that look alike may be a nat
    above its bottom: near enough to tell starts apart, too far to call it the maximum.

    Returns
    -------
    p : array, shape (parameters,)
    log_likelihood : float
        Priors included.
    """
    gains = objective.freeze(p, noise)
    value = objective.reached(p, gains)
    for _ in range(_REFREEZES):
        trial = down_the_valley(objective, p, gains, box)
        gains = objective.freeze(trial, noise)
        reached = objective.reached(trial, gains)
        if reached > value:
            p = trial
        if reached < value + _STILL:
            return p, max(value, reached)
        value = reached
    return p, value


def settle_finely(
    objective: Objective, p: FloatArray, noise: FloatArray, box: Box
) -> tuple[FloatArray, FloatArray, float]:
    """Parameters and noise to the bottom of the valley that `settle` has found.

    Returns
    -------
    p : array, shape (parameters,)
    noise : array, shape (noises,)
    log_likelihood : float
        Priors included.
    """
    value = objective.log_likelihood(p, noise)
    for _ in range(_ROUNDS):
        p, _ = bottom(objective, p, noise, box)
        noise = objective.learn_noise(p, noise, enough=_STILL).noise
        before = value
        value = objective.log_likelihood(p, noise)
        if value < before + _STILL:
            break
    # Noise has moved once more since the parameters did.
    p, value = bottom(objective, p, noise, box)
    return p, noise, value
