"""From where searches with frozen gains stand still to the maximum of the likelihood itself.

The gains, and the spread that they predict, change with the parameters. Derivatives with frozen
gains leave that out: they vanish elsewhere. In a flat valley, as that of tyres whose B C D is the
same, this is far from the maximum, often with a parameter at its bound. Here the slope of the
likelihood itself is worked out by differences. Nor do parameters and noise stand by themselves:
disturbances take up what a model does not explain, and a search that moves one and the other in
turn creeps along the valley of both. Here they move together. The curvature to begin with is that
of the frozen gains and of the score of the noise; the slopes that are met on the way correct it
(BFGS, damped: Nocedal & Wright, Numerical Optimization, 2006, 6.1 and 18.3). Steps are damped as
much as the likelihood itself asks for.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from ... import _core
from ..._common.arrays import FloatArray, as_float64
from ..._common.threads import in_parallel
from ...errors import NumericalError
from .objective import LinearRows, Objective
from .search import SLIGHT, Box, least_within, minimise, stride
from .settle import risen

_GAIN = 0.05  # nats: what promises less is not worth a step
_STANDS = 0.5  # nats that two steps gain: with less it stands still
_CLIMBS, _TOP = 10, 40  # most steps
_ASKED = 3  # steps after which it is asked whether to go on
_NUDGE = 0.02  # standard errors by which the likelihood is differentiated
_NARROW = 0.01  # of the box, which is narrower than that for what the data do not tell
_TINY = 1e-300
_DAMPINGS = (0.0, 1e-3, 0.01, 0.03, 0.1, 0.3, 1.0, 3.0, 10.0, 100.0)
_FIRST = 4  # of these
_FREER = 0.2  # root of how much less the noise is damped than parameters are
_FAR = 1.5  # of a logarithm of the noise, in one step
_LEARNED = 2  # steps of the noise alone after each: those cost far less
_STIFF = 1e3  # root of nats
_KEPT = 10  # slopes that correct the curvature
_BENT = 0.2  # of the curvature that was expected: what is less is damped (Nocedal & Wright, 18.3)
FAR_BELOW = 20.0
"""Nats below another maximum, from where neither a lag nor noise of another time climbs up to it.

Of 36 lags that began at their typical size (exam at 100 Hz, seed 424201) those more than 50 below
on few samples ended 60 or more below on all. From where they settle climbs take lags and such noise
up by 1 to 4 nats on two measured cars, effects of sensors by up to 97, several effects together by
up to 260: those are not given up for so little. This is effort of the search: what is claimed of a
model that was fitted is asked of `Rules`.
"""


def climb(
    objective: Objective, p: FloatArray, noise: FloatArray, box: Box, *, steps: int = _CLIMBS
) -> tuple[FloatArray, float, float]:
    """Climb by the slope of the likelihood, whose gains move with the parameters.

    Parameters
    ----------
    objective : Objective
    p : array, shape (parameters,)
    noise : array, shape (noises,)
        Which stays as it is.
    box : Box
    steps : int
        Most steps.

    Returns
    -------
    p : array, shape (parameters,)
    begin, reached : float
        Log-likelihoods of the start and there, priors included; the second is never the lower one.
    """
    begin = _Place(p, noise, objective.log_likelihood(p, noise))
    ways = _Ways(objective, box, np.empty(0, dtype=np.intp))
    end = _climbed(ways, begin, steps, lambda *_: True)
    return end.p, begin.value, end.value


def to_the_top(
    objective: Objective,
    p: FloatArray,
    noise: FloatArray,
    box: Box,
    goes_on: Callable[[FloatArray, FloatArray], bool] = lambda *_: True,
) -> tuple[FloatArray, FloatArray]:
    """Parameters and noise of the maximum, from where `settle` came to a stand.

    Parameters
    ----------
    objective : Objective
    p : array, shape (parameters,)
    noise : array, shape (noises,)
        What is zero is not there, and stays so.
    box : Box
    goes_on : callable, optional
        From parameters and noise on the way to whether they are worth climbing from.

    Returns
    -------
    p : array, shape (parameters,)
    noise : array, shape (noises,)
    """
    free = (noise > 0.0) & (objective.lowest < objective.highest)
    ways = _Ways(objective, box, np.flatnonzero(free))
    noise = as_float64(np.where(free, np.clip(noise, objective.lowest, objective.highest), noise))
    end = _climbed(ways, _Place(p, noise, objective.log_likelihood(p, noise)), _TOP, goes_on)
    return end.p, end.noise


class _Place(NamedTuple):
    """Parameters and noise, and their log-likelihood, priors included."""

    p: FloatArray
    noise: FloatArray
    value: float


@dataclass(frozen=True)
class _Ways:
    """What moves: free parameters, on their scales, and logarithms of some of the noise."""

    objective: Objective
    box: Box
    learned: npt.NDArray[np.intp]

    def at(self, here: _Place) -> FloatArray:
        """Coordinates."""
        x, positive = here.p[self.box.columns], self.box.positive
        scaled = np.where(positive, np.log(np.where(positive, x, 1.0)), x)
        return np.concatenate([scaled, np.log(here.noise[self.learned])])

    def room(self, here: _Place) -> tuple[FloatArray, FloatArray]:
        """How far it is to the lower and to the upper bounds."""
        lower, upper = self.box.room(here.p[self.box.columns])
        noise = np.log(here.noise[self.learned])
        low, high = (np.log(v[self.learned]) for v in self._limits)
        low, high = np.maximum(low - noise, -_FAR), np.minimum(high - noise, _FAR)
        return (
            np.minimum(np.concatenate([lower, low]), 0.0),
            np.maximum(np.concatenate([upper, high]), 0.0),
        )

    def moved(self, here: _Place, step: FloatArray) -> _Place:
        """The place after a step; minus infinity where the model fails."""
        free = len(self.box.columns)
        p = self.box.put(here.p, self.box.moved(here.p[self.box.columns], step[:free]))
        noise, places = here.noise.copy(), self.learned
        low, high = (v[places] for v in self._limits)
        noise[places] = np.clip(noise[places] * np.exp(step[free:]), low, high)
        try:
            return _Place(p, noise, self.objective.log_likelihood(p, noise))
        except NumericalError:
            return _Place(p, noise, -np.inf)

    def led(self, here: _Place, slope: FloatArray) -> _Place:
        """The end of a search of parameters with frozen gains that leans as the likelihood does.

        What the gains leave out of the slope stays as it is during the search (first-order model
        management: Alexandrov et al., AIAA 2000-4886).
        """
        p, noise, _ = here
        columns = self.box.columns
        gains = self.objective.freeze(p, noise)
        _, seen, _ = self.objective.normal_equations(p, gains, columns)
        rows = np.zeros((1, p.size))
        rows[0, columns] = (slope - seen) / _STIFF
        leaning = self.objective.also(LinearRows(rows, as_float64(rows @ p + _STIFF)))
        found = minimise(leaning, p, gains, self.box, rounds=8, tolerance=_GAIN)
        p, gains = risen(self.objective, p, gains, found.x, noise, self.box)
        return _Place(p, noise, self.objective.reached(p, gains))

    def learned_at(self, here: _Place) -> _Place:
        """The same parameters with noise of their own, where that is likelier."""
        if not len(self.learned):
            return here
        noise = self.objective.learn_noise(here.p, here.noise, rounds=_LEARNED).noise
        value = self.objective.log_likelihood(here.p, noise)
        return _Place(here.p, noise, value) if value > here.value else here

    def slope(self, here: _Place) -> tuple[FloatArray, FloatArray]:
        """Slope of the likelihood, and the curvature that frozen gains and the score tell."""
        slope, information = self.slope_of_parameters(here)
        unit, free = self.box.units(here.p[self.box.columns]), len(self.box.columns)
        curvature = np.zeros((free + len(self.learned),) * 2)
        curvature[:free, :free] = information * np.outer(unit, unit)
        if not len(self.learned):
            return as_float64(slope * unit), curvature
        _, score, information = self.objective.noise_score(here.p, here.noise)
        curvature[free:, free:] = information[np.ix_(self.learned, self.learned)]
        return np.concatenate([slope * unit, score[self.learned]]), curvature

    def slope_of_parameters(self, here: _Place) -> tuple[FloatArray, FloatArray]:
        """The same of the free parameters themselves."""
        p, noise, _ = here
        gains = self.objective.freeze(p, noise)
        _, _, information = self.objective.normal_equations(p, gains, self.box.columns)

        def values_at(trials: FloatArray) -> FloatArray:
            return self.objective.log_likelihoods(trials, noise)

        return _slope(values_at, p, information, self.box), information

    @property
    def _limits(self) -> tuple[FloatArray, FloatArray]:
        return self.objective.lowest, self.objective.highest


@dataclass
class _Met:
    """Slopes that were met on the way, and how they changed: the curvature itself."""

    last: tuple[FloatArray, FloatArray] | None = None
    changes: list[tuple[FloatArray, FloatArray]] = field(default_factory=list)

    def meet(self, at: FloatArray, slope: FloatArray) -> None:
        """One slope more."""
        if self.last is not None:
            self.changes = [*self.changes[1 - _KEPT :], (at - self.last[0], self.last[1] - slope)]
        self.last = at, slope

    def corrected(self, curvature: FloatArray, scale: FloatArray) -> FloatArray:
        """The curvature in units of `scale`, such that the slopes change as they did."""
        found = curvature / np.outer(scale, scale)
        for way, change in self.changes:
            step, seen = way * scale, change / scale
            expected = found @ step
            most, seen_most = step @ expected, step @ seen
            if not most > 0.0:
                continue
            if seen_most < _BENT * most:
                share = (1.0 - _BENT) * most / (most - seen_most)
                seen = share * seen + (1.0 - share) * expected
            found = (
                found - np.outer(expected, expected) / most + np.outer(seen, seen) / (step @ seen)
            )
        return as_float64(found)


def _climbed(
    ways: _Ways, here: _Place, steps: int, goes_on: Callable[[FloatArray, FloatArray], bool]
) -> _Place:
    here, promised = _searched(ways, here)
    met, damping, before = _Met(), _FIRST, np.inf
    for done in range(1, steps + 1 if promised > _STANDS else 1):
        slope, curvature = ways.slope(here)
        met.meet(ways.at(here), slope)
        scale = np.sqrt(np.maximum(np.diag(curvature), 1e-12))
        scale[len(ways.box.columns) :] *= _FREER
        trials = _Trials(ways, here, slope, met.corrected(curvature, scale), scale)
        if trials.promised < _GAIN:
            break
        damping, there = trials.best(damping)
        there = ways.learned_at(there)
        gained, here = there.value - here.value, there
        if gained + before < _STANDS or (done % _ASKED == 0 and not goes_on(here.p, here.noise)):
            break
        before = gained
    return here


def _searched(ways: _Ways, here: _Place) -> tuple[_Place, float]:
    """Where a search of the parameters leads, and what a step of them promised [nats].

    It follows a valley that bends, of which steps are tangents.
    """
    slope, information = ways.slope_of_parameters(here)
    x = here.p[ways.box.columns]
    promised = stride(x, slope, information, SLIGHT, ways.box)[1]
    if promised < _GAIN:
        return here, promised
    return ways.learned_at(ways.led(here, slope)), promised


class _Trials:
    """Steps from one place that are damped more or less."""

    def __init__(
        self,
        ways: _Ways,
        here: _Place,
        slope: FloatArray,
        curvature: FloatArray,
        scale: FloatArray,
    ) -> None:
        self._ways, self._here, self._scale = ways, here, scale
        self._slope, self._curvature = slope / scale, curvature
        self._values, self._vectors = np.linalg.eigh(curvature)
        self._room = [r * scale for r in ways.room(here)]
        self._known: dict[int, _Place] = {}

    @property
    def promised(self) -> float:
        """What a step that is hardly damped promises to gain [nats]."""
        step = self._step(SLIGHT)
        return float(self._slope @ step - 0.5 * step @ self._curvature @ step)

    def best(self, damping: int) -> tuple[int, _Place]:
        """The damping that gains most, beginning with one that did, and where it leads."""
        most = len(_DAMPINGS) - 1
        while damping < most and not self._at(damping).value > self._here.value:
            damping += 1
        for way in (-1, 1):
            while (
                0 <= damping + way <= most
                and self._at(damping + way).value > self._at(damping).value
            ):
                damping += way
        there = self._at(damping)
        return damping, there if there.value > self._here.value else self._here

    def _at(self, damping: int) -> _Place:
        if damping not in self._known:
            step = self._step(SLIGHT + _DAMPINGS[damping]) / self._scale
            self._known[damping] = self._ways.moved(self._here, step)
        return self._known[damping]

    def _step(self, damping: float) -> FloatArray:
        values = np.maximum(self._values, 0.0) + damping
        return least_within(values, self._vectors, self._slope, *self._room)


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
