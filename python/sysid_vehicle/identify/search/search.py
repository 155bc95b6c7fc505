"""Local searches from one start point, on prediction errors with frozen filter gains."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
import scipy

from ... import _core
from ..._common.arrays import FloatArray, as_float64
from .objective import Problem

_LEAST_DAMPING = 1e-9
SLIGHT = 1e-6
"""Damping of a step that shows what is to be had."""
_ASTRAY = 1.5  # times what a step promised; where it loses more, it was far too long
_HARDER = 6.0  # times the damping after a step that gained nothing
# Of the tolerance: a step that promises less is not tried, nor a whole one for so little.
_NOTHING, _HALF = 0.1, 0.5


@dataclass(frozen=True)
class Box:
    """The free parameters: their places in the core's vector, and their bounds."""

    columns: list[int]
    lower: FloatArray
    upper: FloatArray

    @property
    def width(self) -> FloatArray:
        """From bound to bound."""
        return self.upper - self.lower

    @property
    def positive(self) -> npt.NDArray[np.bool_]:
        """Which parameters move on a logarithmic scale."""
        return np.asarray(self.lower > 0.0)

    def units(self, x: FloatArray) -> FloatArray:
        """How much of a parameter is one of its scale."""
        return np.where(self.positive, x, 1.0)

    def room(self, x: FloatArray) -> tuple[FloatArray, FloatArray]:
        """How far it is to the lower and to the upper bound, on the parameters' scales."""
        lower, upper, positive = self.lower - x, self.upper - x, self.positive
        lower[positive] = np.log(self.lower[positive] / x[positive])
        upper[positive] = np.log(self.upper[positive] / x[positive])
        return lower, upper

    def moved(self, x: FloatArray, step: FloatArray) -> FloatArray:
        """Free parameters after a step on their scales, inside the box."""
        positive = self.positive
        there = np.where(positive, x * np.exp(np.where(positive, step, 0.0)), x + step)
        return as_float64(np.clip(there, self.lower, self.upper))

    def on_scales(self, p: FloatArray, step: FloatArray) -> FloatArray:
        """A small step of the free parameters, from all parameters `p`, on their scales."""
        return as_float64(step / self.units(p[self.columns]))

    def apart(self, x: FloatArray, other: FloatArray) -> FloatArray:
        """The step, on the scales of the free parameters, from one point to another."""
        positive = self.positive
        ratio = np.divide(other, x, out=np.ones_like(x), where=positive)
        return as_float64(np.where(positive, np.log(ratio), other - x))

    def near(self, p: FloatArray, other: FloatArray, share: float) -> bool:
        """Whether the free ones of two sets of all parameters differ by less of the box."""
        return bool(np.all(np.abs(p - other)[self.columns] < share * self.width))

    def put(self, p: FloatArray, x: FloatArray) -> FloatArray:
        """All parameters `p`, with the free ones `x`; a row for each row of `x`."""
        full = np.broadcast_to(p, (*x.shape[:-1], p.size)).copy()
        full[..., self.columns] = x
        return full

    def inside(self, p: FloatArray) -> FloatArray:
        """All parameters `p`, the free ones at their nearest bound where they are beyond it."""
        return self.put(p, np.clip(p[self.columns], self.lower, self.upper))


@dataclass(frozen=True)
class Outcome:
    """Where a search ended: free parameters, half the sum of squares, whether it settled."""

    x: FloatArray
    cost: float
    settled: bool


def minimise(
    problem: Problem,
    p: FloatArray,
    frozen: Any,
    box: Box,
    *,
    method: str = "gauss-newton",
    rounds: int = 25,
    tolerance: float = 0.01,
) -> Outcome:
    """Least squares over the free parameters, from their values in `p`.

    The search has settled once a step gains less than `tolerance`, in units of log-likelihood: far
    less than the data can tell.
    """
    return METHODS[method](problem, p, frozen, box, rounds, tolerance)


def _gauss_newton(
    problem: Problem, p: FloatArray, frozen: Any, box: Box, rounds: int, tolerance: float
) -> Outcome:
    """Levenberg-Marquardt whose every step is the best one within the box."""

    def linearised(x: FloatArray) -> tuple[float, FloatArray, FloatArray]:
        cost, gradient, information = problem.normal_equations(box.put(p, x), frozen, box.columns)
        # Far away derivatives grow beyond all numbers sooner than errors do: no step begins there.
        known = np.isfinite(gradient).all() and np.isfinite(information).all()
        return cost if known else np.inf, gradient, information

    def cost_of(x: FloatArray) -> float:
        return problem.half_sum_of_squares(box.put(p, x), frozen)

    x = np.clip(p[box.columns], box.lower, box.upper)
    cost, gradient, information = linearised(x)
    damping = 1e-3
    for _ in range(rounds):
        if not np.isfinite(cost):
            return Outcome(x, np.inf, False)
        gained, begin = 0.0, x
        there, little = None, False
        for attempt in range(10):
            trial, promised = stride(begin, gradient, information, damping, box)
            little = attempt == 0 and promised < _NOTHING * tolerance
            if little:
                break
            # Most first steps are taken: the derivatives there cost as much again as the value.
            ahead = linearised(trial) if attempt == 0 else None
            trial_cost = cost_of(trial) if ahead is None else ahead[0]
            if ahead is not None and cost <= trial_cost < np.inf:
                # A long step leaves a bent valley; the next one from there leads back into it.
                back, more = stride(trial, ahead[1], ahead[2], damping, box)
                near = trial_cost < cost + _ASTRAY * promised
                promised += more
                trial = back if near else _halfway(begin, trial, back, box)
                ahead = linearised(trial) if near else None
                trial_cost = cost_of(trial) if ahead is None else ahead[0]
            if trial_cost < cost:
                gained = cost - trial_cost
                x, cost, there = trial, trial_cost, ahead
                damping = max(_eased(damping, gained, promised), _LEAST_DAMPING)
                break
            damping *= _HARDER
        if gained == 0.0 and not little:
            return Outcome(x, cost, True)
        if gained < tolerance:
            # Where parameters copy each other damping makes steps short, and a small gain is no
            # end: the whole step has to gain as little.
            whole, promised = stride(begin, gradient, information, _LEAST_DAMPING, box)
            if promised < gained + _HALF * tolerance:
                return Outcome(x, cost, True)
            whole_cost = cost_of(whole)
            if not whole_cost < cost - tolerance:
                return Outcome(x, cost, True)
            x, cost, damping, there = whole, whole_cost, _LEAST_DAMPING, None
        cost, gradient, information = linearised(x) if there is None else there
    return Outcome(x, cost, False)


def _halfway(x: FloatArray, ahead: FloatArray, back: FloatArray, box: Box) -> FloatArray:
    """Middle of the parabola that leaves `x` towards `ahead` and ends at `back`."""
    ways = np.array([x, ahead, back])
    positive = box.positive
    ways[:, positive] = np.log(ways[:, positive])
    middle = np.array([0.5, 0.25, 0.25]) @ ways
    middle[positive] = np.exp(middle[positive])
    return as_float64(np.clip(middle, box.lower, box.upper))


def _eased(damping: float, gained: float, promised: float) -> float:
    """Damping of the next step: less where this one gained what the quadratic model promised.

    In a bent valley a step gains less than promised. Were the next one longer all the same, every
    second one would fail. After Nielsen, Damping Parameter in Marquardt's Method (1999).
    """
    share = min(max(gained / promised, 0.5), 1.0) if promised > 0.0 else 1.0
    return damping * max(1.0 / 8.0, 1.0 - (2.0 * share - 1.0) ** 3)


def stride(
    x: FloatArray, gradient: FloatArray, information: FloatArray, damping: float, box: Box
) -> tuple[FloatArray, float]:
    """Give the minimum of the damped quadratic model over the box, and what it promises to gain.

    Cutting the unbounded minimum at the box is not enough: where parameters can copy each other, as
    B, C, D and E can, the cut step may lead uphill however much is to be gained inside. Positive
    parameters move on a logarithmic scale, on which the valley of equal cornering stiffness, B C D,
    is straight.
    """
    unit = box.units(x)
    lower, upper = box.room(x)
    scale = np.sqrt(np.maximum(np.diag(information), 1e-12)) * unit
    normal = information * np.outer(unit, unit) / np.outer(scale, scale)
    values, vectors = np.linalg.eigh(normal + damping * np.eye(len(x)))
    downhill = gradient * unit / scale
    step = least_within(np.maximum(values, 1e-12), vectors, downhill, lower * scale, upper * scale)
    gain = downhill @ step - 0.5 * step @ normal @ step
    return box.moved(x, step / scale), float(gain)


def least_within(
    values: FloatArray,
    vectors: FloatArray,
    downhill: FloatArray,
    lower: FloatArray,
    upper: FloatArray,
) -> FloatArray:
    """Minimum within bounds of a quadratic, given the eigenvalues, above zero, of its curvature."""
    alone = vectors @ ((vectors.T @ downhill) / values)
    if np.all((lower <= alone) & (alone <= upper)):
        return as_float64(alone)
    root = np.sqrt(values)
    found = scipy.optimize.lsq_linear(
        root[:, None] * vectors.T,
        (vectors.T @ downhill) / root,
        bounds=(lower, upper),
        method="bvls",
    )
    return as_float64(found.x)


def _nlopt(
    problem: Problem, p: FloatArray, frozen: Any, box: Box, rounds: int, tolerance: float
) -> Outcome:
    """Sequential quadratic programming of NLopt on parameters scaled to the box."""
    import nlopt

    width = box.width
    best = Outcome(np.clip(p[box.columns], box.lower, box.upper), np.inf, False)

    def objective(z: FloatArray, gradient: FloatArray) -> float:
        nonlocal best
        x = box.lower + width * z
        full = box.put(p, x)
        cost, g, _ = problem.normal_equations(full, frozen, box.columns)
        if not np.isfinite(cost):
            cost, g = 1e12, np.zeros_like(x)
        if gradient.size:
            # The core gives the direction of descent of half the sum of squares.
            gradient[:] = -g * width
        if cost < best.cost:
            best = Outcome(x.copy(), float(cost), False)
        return float(cost)

    search = nlopt.opt(nlopt.LD_SLSQP, len(width))
    search.set_min_objective(objective)
    search.set_lower_bounds(np.zeros(len(width)))
    search.set_upper_bounds(np.ones(len(width)))
    search.set_ftol_abs(0.1 * tolerance)
    search.set_maxeval(4 * rounds)
    # Whatever stops it, the best point so far stands.
    with suppress(nlopt.RoundoffLimited, nlopt.runtime_error):
        search.optimize(np.clip((best.x - box.lower) / width, 0.0, 1.0))
    settled = search.last_optimize_result() in (nlopt.FTOL_REACHED, nlopt.XTOL_REACHED)
    return Outcome(best.x, best.cost, settled)


def _scipy(
    problem: Problem, p: FloatArray, frozen: Any, box: Box, rounds: int, tolerance: float
) -> Outcome:
    """Trust-region reflective least squares of SciPy."""
    inside = np.clip(p[box.columns], box.lower + 1e-9, box.upper - 1e-9)
    found = scipy.optimize.least_squares(
        lambda x: problem.residuals(box.put(p, x), frozen).ravel(),
        inside,
        jac=lambda x: -problem.sensitivities(box.put(p, x), frozen, box.columns),
        bounds=(box.lower, box.upper),
        x_scale="jac",
        max_nfev=rounds,
        ftol=max(1e-12, tolerance / problem.samples / _core.CHANNELS),
    )
    return Outcome(found.x, float(found.cost), bool(found.status > 0))


_Method = Callable[[Problem, FloatArray, Any, Box, int, float], Outcome]
METHODS: dict[str, _Method] = {"gauss-newton": _gauss_newton, "nlopt": _nlopt, "scipy": _scipy}
"""The local optimisers there are to choose from."""
