"""Local searches that work the filter's gains, and the noise, out anew on their way."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from .. import _core
from .._common.arrays import FloatArray, as_float64
from .._common.threads import in_parallel
from ..errors import NumericalError
from .objective import LinearRows, Objective
from .search import Box, minimise, stride
from .starts import SAME_VALLEY
from .valley import down_the_valley

_STANDS = 0.5  # nats
_STILL = 3e-4  # nats
_LITTLE = 0.1  # nats for which the noise is not learned once more while parameters still move
_GAIN = 0.05  # nats
_TWICE = 2.0  # times what a score promises
_REFREEZES = 8
_ROUNDS = 12
_CLIMBS = 10  # steps
_CLIMBED = 4  # times, with noise learned anew
_NUDGE = 0.02  # standard errors by which the likelihood is differentiated
_NARROW = 0.01  # of the box, which is narrower than that for what the data do not tell
_SLIGHT = 1e-6  # damping at which a step shows what is to be had
_TINY = 1e-300
_STIFF = 1e3  # root of nats
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
        trial = box.put(p, begin + share * (x - begin))
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
    rounds : int

    Returns
    -------
    p : array, shape (parameters,)
    noise : array, shape (noises,)
    converged : bool
        Whether it came to a stand.
    """
    p = box.inside(p)
    if parameters_first:
        p, _ = descend(objective, p, noise, box, method=method)
    steps = 6
    if thin:
        # Few samples lead most of the way, unless where it begins is better already.
        led = settle(thin[-1], p, noise, box, thin=thin[:-1], method=method, rounds=rounds)[:2]
    if led is not None:
        near, told = led
        if objective.log_likelihood(near, told) > objective.log_likelihood(p, noise):
            p, noise, steps = near, told, 3
    best = -np.inf
    gains = objective.freeze(p, noise)
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


def climb(
    objective: Objective, p: FloatArray, noise: FloatArray, box: Box
) -> tuple[FloatArray, float, float]:
    """From where searches with frozen gains stand still to the maximum of the likelihood itself.

    The gains, and the spread that they predict, change with the parameters. Derivatives with frozen
    gains leave that out: they vanish elsewhere. In a flat valley, as that of tyres whose B C D is
    the same, this is far from the maximum, often with a parameter at its bound. Here the part that
    they leave out is worked out by differences and added to them, as a slope that stays as it is
    during a search (first-order model management: Alexandrov et al., AIAA 2000-4886).

    Parameters
    ----------
    objective : Objective
    p : array, shape (parameters,)
    noise : array, shape (noises,)
    box : Box

    Returns
    -------
    p : array, shape (parameters,)
    begin, reached : float
        Log-likelihoods of the start and there, priors included; the second is never the lower one.
    """

    def values_at(trials: FloatArray) -> FloatArray:
        return objective.log_likelihoods(trials, noise)

    gains = objective.freeze(p, noise)
    begin = value = objective.reached(p, gains)
    for _ in range(_CLIMBS):
        _, seen, information = objective.normal_equations(p, gains, box.columns)
        x = p[box.columns]
        slope = _slope(values_at, p, information, box)
        if stride(x, slope, information, _SLIGHT, box)[1] < _GAIN:
            break
        leaning = objective.also(_leaning(p, slope - seen, box))
        found = minimise(leaning, p, gains, box, rounds=8, tolerance=_GAIN)
        p, gains = risen(objective, p, gains, found.x, noise, box)
        reached = objective.reached(p, gains)
        if reached < value + _GAIN:
            value = reached
            break
        value = reached
    return p, begin, value


def _leaning(p: FloatArray, slope: FloatArray, box: Box) -> LinearRows:
    """A residual whose half square falls by that slope, and hardly bends."""
    rows = np.zeros((1, p.size))
    rows[0, box.columns] = slope / _STIFF
    return LinearRows(rows, as_float64(rows @ p + _STIFF))


def to_the_top(
    objective: Objective, p: FloatArray, noise: FloatArray, box: Box
) -> tuple[FloatArray, FloatArray]:
    """Parameters and noise of the maximum, from where `settle` came to a stand.

    Returns
    -------
    p : array, shape (parameters,)
    noise : array, shape (noises,)
    """
    for _ in range(_CLIMBED):
        p, begin, reached = climb(objective, p, noise, box)
        stands = reached < begin + _STANDS
        noise = objective.learn_noise(p, noise, rounds=1 if stands else 3).noise
        if stands:
            break
    return p, noise


def _slope(
    values_at: Callable[[FloatArray], FloatArray],
    p: FloatArray,
    information: FloatArray,
    box: Box,
) -> FloatArray:
    """Derivatives by differences; zero where the model fails.

    Central ones where both ends of all parameters go through the filter together, in its lanes. Of
    more parameters from `p` to one end, less what the likelihood bends on the way. The value at `p`
    comes out of the same lanes: one that was rounded in another way would give a slope to what the
    driving never felt, and send it to its bound.
    """
    curvature = np.diag(information)
    step = np.minimum(_NUDGE / np.sqrt(np.maximum(curvature, _TINY)), _NARROW * box.width)
    x = p[box.columns]
    low, high = np.maximum(x - step, box.lower), np.minimum(x + step, box.upper)
    central = 2 * len(x) <= _core.LANES
    far = np.where(high - x < x - low, low, high)
    ends = np.array([low, high] if central else [far])
    trials = np.tile(p, (len(ends), len(x), 1))
    trials[:, np.arange(len(x)), box.columns] = ends
    trials = np.vstack([trials.reshape(-1, p.size), *([] if central else [p])])
    together = np.array_split(trials, -(-len(trials) // _core.LANES))
    found = np.concatenate(in_parallel(values_at, together))
    if central:
        slope = (found[len(x) :] - found[: len(x)]) / np.maximum(high - low, _TINY)
    else:
        way = far - x
        slope = (found[:-1] - found[-1]) / np.where(way == 0.0, _TINY, way) + 0.5 * curvature * way
    return as_float64(np.where(np.isfinite(slope), slope, 0.0))


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
