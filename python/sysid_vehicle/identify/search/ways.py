"""The likelihood around a place of parameters and noise: its slope, and steps from there."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from ... import _core
from ..._common.arrays import FloatArray, as_float64
from ..._common.threads import in_parallel
from ...errors import NumericalError
from .objective import LinearRows, Objective
from .search import Box, minimise
from .settle import risen

GAIN = 0.05
"""Nats: what promises less is not worth a step."""
_NUDGE = 0.02  # standard errors by which the likelihood is differentiated
_NARROW = 0.01  # of the box, which is narrower than that for what the data do not tell
_TINY = 1e-300
_FAR = 1.5  # of a logarithm of the noise, in one step
_LEARNED = 2  # steps of the noise alone, which cost far less than those of parameters
_STIFF = 1e3  # root of nats


class Place(NamedTuple):
    """Parameters and noise, and their log-likelihood, priors included."""

    p: FloatArray
    noise: FloatArray
    value: float


@dataclass(frozen=True)
class Ways:
    """What moves: free parameters, on their scales, and logarithms of some of the noise."""

    objective: Objective
    box: Box
    learned: npt.NDArray[np.intp]

    def at(self, here: Place) -> FloatArray:
        """Coordinates."""
        x, positive = here.p[self.box.columns], self.box.positive
        scaled = np.where(positive, np.log(np.where(positive, x, 1.0)), x)
        return np.concatenate([scaled, np.log(here.noise[self.learned])])

    def room(self, here: Place) -> tuple[FloatArray, FloatArray]:
        """How far it is to the lower and to the upper bounds."""
        lower, upper = self.box.room(here.p[self.box.columns])
        noise = np.log(here.noise[self.learned])
        low, high = (np.log(v[self.learned]) for v in self._limits)
        low, high = np.maximum(low - noise, -_FAR), np.minimum(high - noise, _FAR)
        return (
            np.minimum(np.concatenate([lower, low]), 0.0),
            np.maximum(np.concatenate([upper, high]), 0.0),
        )

    def moved(self, here: Place, step: FloatArray) -> Place:
        """The place after a step; minus infinity where the model fails."""
        free = len(self.box.columns)
        p = self.box.put(here.p, self.box.moved(here.p[self.box.columns], step[:free]))
        noise, places = here.noise.copy(), self.learned
        low, high = (v[places] for v in self._limits)
        noise[places] = np.clip(noise[places] * np.exp(step[free:]), low, high)
        try:
            return Place(p, noise, self.objective.log_likelihood(p, noise))
        except NumericalError:
            return Place(p, noise, -np.inf)

    def led(self, here: Place, slope: FloatArray) -> Place:
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
        found = minimise(leaning, p, gains, self.box, rounds=8, tolerance=GAIN)
        p, gains = risen(self.objective, p, gains, found.x, noise, self.box)
        return Place(p, noise, self.objective.reached(p, gains))

    def learned_at(self, here: Place) -> Place:
        """The same parameters with noise of their own, where that is likelier."""
        if not len(self.learned):
            return here
        noise = self.objective.learn_noise(here.p, here.noise, rounds=_LEARNED).noise
        value = self.objective.log_likelihood(here.p, noise)
        return Place(here.p, noise, value) if value > here.value else here

    def slope(self, here: Place) -> tuple[FloatArray, FloatArray]:
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

    def slope_of_parameters(self, here: Place) -> tuple[FloatArray, FloatArray]:
        """The same of the free parameters themselves."""
        p, noise, _ = here
        gains = self.objective.freeze(p, noise)
        _, _, information = self.objective.normal_equations(p, gains, self.box.columns)

        def values_at(trials: FloatArray) -> FloatArray:
            return self.objective.log_likelihoods(trials, noise)

        return slope_of(values_at, p, information, self.box), information

    @property
    def _limits(self) -> tuple[FloatArray, FloatArray]:
        return self.objective.lowest, self.objective.highest


def slope_of(
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
