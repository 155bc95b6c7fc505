"""One side of a profile likelihood: from the optimum out to where the data object."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np

from ..._common.arrays import FloatArray, as_float64
from ..._common.text import HALF_95
from ..search.objective import Objective, Penalised
from ..search.search import Box
from ..search.valley import down_the_valley
from .quantities import Quantity

LEVEL = HALF_95
"""Root of the 95 % quantile of chi-square with one degree of freedom."""

_CLOSE = 0.04  # of the level
_POINTS = 20  # on each side
_ASTRAY = 4.0  # of the level
_ROUNDS = 20
_ENOUGH = 0.01  # nats
_STIFF = 30.0  # how much harder the wish pulls than the data
_BETTER = 0.1  # nats
_STEP = 3.0  # most by which the distance grows from one point to the next
_AIMED = 4  # times


@dataclass(frozen=True, eq=False)
class Optimum:
    """Where a search ended, and what it searched.

    Parameters
    ----------
    objective : Objective
    noise : array, shape (noises,)
    gains : object
        Those of the problem there, by which searches go.
    box : Box
    p : array, shape (parameters,)
    covariance : array, shape (free, free)
        Of the free parameters.
    cost : float
        Minus the log-likelihood.
    held : array, shape (free, free), optional
        Their covariance were the noise known, with which the gains were made; by default the same.
    """

    objective: Objective
    noise: FloatArray
    gains: Any
    box: Box
    p: FloatArray
    covariance: FloatArray
    cost: float
    held: FloatArray | None = None

    @classmethod
    def of(
        cls,
        objective: Objective,
        p: FloatArray,
        noise: FloatArray,
        box: Box,
        covariance: FloatArray,
        held: FloatArray | None = None,
    ) -> Optimum:
        """Of parameters and noise that were found."""
        gains = objective.freeze(p, noise)
        cost = -objective.reached(p, gains)
        return cls(objective, noise, gains, box, p, covariance, cost, held)

    def cost_of(self, p: FloatArray) -> float:
        """Minus the log-likelihood of other parameters, whose gains are their own."""
        return -float(self.objective.log_likelihoods(p[None], self.noise)[0])

    def across(self, what: Quantity) -> tuple[FloatArray, float]:
        """Covariance of the free parameters with a quantity, and its variance."""
        gradient = _felt(what, self.p)[self.box.columns]
        across = self.covariance @ gradient
        return as_float64(across), float(gradient @ across)

    def left_by_noise(self, what: Quantity) -> float:
        """What is lost where the noise is learned anew, of what is lost where it is held.

        To first order, as of variances.
        """
        if self.held is None:
            return 1.0
        gradient = _felt(what, self.p)[self.box.columns]
        return float(gradient @ self.held @ gradient) / self.across(what)[1]

    def bottom(self, objective: Penalised, p: FloatArray, box: Box) -> FloatArray:
        """The way down from `p`."""
        return down_the_valley(objective, p, self.gains, box, tolerance=_ENOUGH, rounds=_ROUNDS)


@dataclass(frozen=True, eq=False)
class Side:
    """Where the likelihood was worked out on one side of an optimum, and what was found.

    Attributes
    ----------
    values, lost : list of float
        In the order in which they were asked for.
    end : float
        Of the 95 % interval, or of what could be searched.
    unbounded : bool
        The likelihood does not fall enough before that.
    better : array, shape (parameters,), or None
        A point of higher likelihood, where one was come upon.
    """

    values: list[float]
    lost: list[float]
    end: float
    unbounded: bool
    better: FloatArray | None = None


def side_of(at: Optimum, what: Quantity, sign: float) -> Side:
    """Follow the profile of a quantity to one side: `sign` is 1 upwards, -1 downwards."""
    centre, box = what.of(at.p), at.box
    across, variance = at.across(what)
    nowhere = Side([], [], centre, True)
    if not (np.isfinite(centre) and np.isfinite(variance) and variance > 0.0):
        return nowhere
    limit = sign * np.inf
    if what.column is not None:
        i = box.columns.index(what.column)
        limit = box.upper[i] if sign > 0.0 else box.lower[i]
    std, bounded = float(np.sqrt(variance)), bool(np.isfinite(limit))
    furthest = abs(limit - centre) if bounded else max(20.0 * std, 3.0 * abs(centre))
    if furthest <= 1e-9 * max(abs(centre), 1.0):
        return nowhere
    along, left = box.on_scales(at.p, across / variance), at.left_by_noise(what)
    begin = _Known(0.0, 0.0, at.p)
    return _Walk(at, what, sign, centre, std, furthest, bounded, along, left, begin).walked()


class _Known(NamedTuple):
    """Distance from the optimum, root of twice the likelihood lost there, and parameters."""

    distance: float
    root: float
    p: FloatArray


@dataclass(eq=False)
class _Walk:
    """From the optimum to where the profile meets the level, between what is inside and outside.

    Attributes
    ----------
    centre, std : float
        Of the quantity.
    furthest : float
        Distance beyond which nothing is asked for.
    bounded : bool
        Whether the search box ends there.
    along : array, shape (free parameters,)
        Change of the free parameters, on their scales, with the quantity.
    left_by_noise : float
        Of `Optimum`.
    inside, outside : _Known
        The furthest point below the level, and the last one above it, which there need not be.
    longest : float
        Step after which the search does not lose the valley.
    """

    at: Optimum
    what: Quantity
    sign: float
    centre: float
    std: float
    furthest: float
    bounded: bool
    along: FloatArray
    left_by_noise: float
    inside: _Known
    outside: _Known | None = None
    longest: float = np.inf
    values: list[float] = field(default_factory=list)
    lost: list[float] = field(default_factory=list)

    def walked(self) -> Side:
        """The side, to its end."""
        distance = min(LEVEL * self.std, self.furthest)
        for _ in range(_POINTS):
            there, loss = self._searched(distance)
            if loss < -_BETTER:
                return Side(self.values, self.lost, self.centre, True, there)
            step = distance - self.inside.distance
            distance = self.sign * (self.what.of(there) - self.centre)
            if not (np.isfinite(loss) and np.isfinite(distance) and distance > 0.0):
                break
            found = _Known(distance, float(np.sqrt(2.0 * max(loss, 0.0))), there)
            if found.root > _ASTRAY * LEVEL:
                # The search may have lost the valley: what it found says nothing of this value.
                self.longest = 0.5 * step
                if self.longest < _CLOSE * self.inside.distance:
                    return self._met(self.inside.distance)
                distance = self.inside.distance + self.longest
                continue
            self.values.append(self.centre + self.sign * distance)
            self.lost.append(max(loss, 0.0))
            if abs(found.root - LEVEL) < _CLOSE * LEVEL:
                # The last step is small: along a straight root.
                straight = LEVEL / found.root if self.inside.distance == 0.0 else 1.0
                return self._met(distance * straight)
            if not self._goes_on(found):
                break
            distance = self._next()
        return self._where_it_stopped()

    def _searched(self, distance: float) -> tuple[FloatArray, float]:
        """Best other parameters at a distance, and the likelihood lost."""
        target = self.centre + self.sign * distance
        start = moved(self.inside.p, self.at.box, self.along, self.what, target)
        there, loss = pinned(self.at, start, self.what, target, self.std)
        return there, self.left_by_noise * loss

    def _goes_on(self, found: _Known) -> bool:
        """Take up a point; whether there is more to be asked for."""
        if found.root >= LEVEL:
            self.outside = found
            return True
        if found.distance <= self.inside.distance:
            return False  # the wish is not heard any more
        # From here on the valley goes on as it came.
        columns = self.at.box.columns
        came = self.at.box.apart(self.inside.p[columns], found.p[columns])
        self.along = came / (self.sign * (found.distance - self.inside.distance))
        self.inside = found
        self.longest *= 2.0
        return found.distance < self.furthest * (1.0 - 1e-9)

    def _next(self) -> float:
        """Distance at which to look next for the level."""
        near, far = self.inside, self.outside
        if far is None:
            guess = near.distance * np.clip(LEVEL / max(near.root, 1e-9), 1.15, _STEP)
        else:
            share = (LEVEL - near.root) / (far.root - near.root)
            guess = near.distance + np.clip(share, 0.1, 0.9) * (far.distance - near.distance)
        return min(float(guess), near.distance + self.longest, self.furthest)

    def _met(self, distance: float) -> Side:
        """The interval ends there."""
        return Side(self.values, self.lost, self.centre + self.sign * distance, False)

    def _where_it_stopped(self) -> Side:
        """Without a point at the level: between two of them, or with none outside an open end."""
        near, far = self.inside, self.outside
        if far is not None:
            roots, distances = [near.root, far.root], [near.distance, far.distance]
            return self._met(float(np.interp(LEVEL, roots, distances)))
        distance = self.furthest if self.bounded else near.distance
        return Side(self.values, self.lost, self.centre + self.sign * distance, True)


def moved(p: FloatArray, box: Box, along: FloatArray, what: Quantity, target: float) -> FloatArray:
    """From a point that is known, along the direction that costs least, to a quantity's target.

    On the parameters' scales: where B, C and D move by shares B C D stays what it is, which a
    straight line leaves.

    Parameters
    ----------
    along : array, shape (free parameters,)
        Change of the free parameters, on their scales, with the quantity.
    """
    x, now = p[box.columns], what.of(p)
    step = along * (target - now)
    there = p
    for _ in range(_AIMED):
        there = box.put(p, box.moved(x, step))
        reached = what.of(there) - now
        if not (np.isfinite(reached) and reached * (target - now) > 0.0):
            break
        step = step * min((target - now) / reached, _STEP)
    return there


def pinned(
    at: Optimum, start: FloatArray, what: Quantity, target: float, std: float
) -> tuple[FloatArray, float]:
    """Best other parameters with the quantity held at `target`, and the likelihood lost."""
    box = at.box
    if what.column is not None:
        i = box.columns.index(what.column)
        others = [j for j in range(len(box.columns)) if j != i]
        there = start.copy()
        there[what.column] = float(np.clip(target, box.lower[i], box.upper[i]))
        inner = Box([box.columns[j] for j in others], box.lower[others], box.upper[others])
        there = at.bottom(at.objective, there, inner)
        return there, at.cost_of(there) - at.cost
    weight = _STIFF / std

    def wish(p: FloatArray) -> tuple[FloatArray, FloatArray]:
        error = np.array([weight * (target - what.of(p))])
        return error, weight * _felt(what, p)[None, :]

    there = at.bottom(at.objective.also(wish), start, box)
    return there, at.cost_of(there) - at.cost


def _felt(what: Quantity, p: FloatArray) -> FloatArray:
    """Gradient of a quantity by what moves it smoothly.

    The slip at the peak changes infinitely fast where E loses the peak: there the others move it.
    """
    slope = what.slope(p)
    return as_float64(np.where(np.isfinite(slope), slope, 0.0))
