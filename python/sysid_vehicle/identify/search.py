"""Local searches from one start point, on prediction errors with frozen filter gains."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from .. import _core
from .._arrays import FloatArray

__all__ = ["METHODS", "Box", "Outcome", "minimise"]


@dataclass(frozen=True)
class Box:
    """The free parameters: their places in the core's vector, and their bounds."""

    columns: list[int]
    lower: FloatArray
    upper: FloatArray


@dataclass(frozen=True)
class Outcome:
    """Where a search ended: free parameters, half the sum of squares, whether it settled."""

    x: FloatArray
    cost: float
    settled: bool


def minimise(
    problem: _core.Problem,
    p: FloatArray,
    frozen: _core.FrozenFilter,
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


def _filled(p: FloatArray, box: Box, x: FloatArray) -> FloatArray:
    full = p.copy()
    full[box.columns] = x
    return full


def _gauss_newton(
    problem: _core.Problem,
    p: FloatArray,
    frozen: _core.FrozenFilter,
    box: Box,
    rounds: int,
    tolerance: float,
) -> Outcome:
    """Levenberg-Marquardt with projection onto the box."""
    x = np.clip(p[box.columns], box.lower, box.upper)
    cost, gradient, information = problem.normal_equations(_filled(p, box, x), frozen, box.columns)
    damping = 1e-3
    for _ in range(rounds):
        if not np.isfinite(cost):
            return Outcome(x, np.inf, False)
        free = ~(((x <= box.lower) & (gradient < 0)) | ((x >= box.upper) & (gradient > 0)))
        scale = np.sqrt(np.maximum(np.diag(information), 1e-12))
        if not free.any():
            return Outcome(x, cost, True)
        gained = None
        for _ in range(8):
            normal = information[np.ix_(free, free)] / np.outer(scale[free], scale[free])
            step = np.zeros_like(x)
            damped = normal + damping * np.eye(int(free.sum()))
            step[free] = np.linalg.solve(damped, gradient[free] / scale[free]) / scale[free]
            trial = np.clip(x + step, box.lower, box.upper)
            trial_cost = problem.half_sum_of_squares(_filled(p, box, trial), frozen)
            if trial_cost < cost:
                gained = cost - trial_cost
                x = trial
                damping = max(damping / 8.0, 1e-9)
                break
            damping *= 6.0
        if gained is None or gained < tolerance:
            return Outcome(x, cost if gained is None else cost - gained, True)
        cost, gradient, information = problem.normal_equations(
            _filled(p, box, x), frozen, box.columns
        )
    return Outcome(x, cost, False)


def _nlopt(
    problem: _core.Problem,
    p: FloatArray,
    frozen: _core.FrozenFilter,
    box: Box,
    rounds: int,
    tolerance: float,
) -> Outcome:
    """Sequential quadratic programming of NLopt on parameters scaled to the box."""
    import nlopt

    width = box.upper - box.lower
    best = Outcome(np.clip(p[box.columns], box.lower, box.upper), np.inf, False)

    def objective(z: FloatArray, gradient: FloatArray) -> float:
        nonlocal best
        x = box.lower + width * z
        full = _filled(p, box, x)
        cost, g, _ = problem.normal_equations(full, frozen, box.columns)
        if not np.isfinite(cost):
            cost, g = 1e12, np.zeros_like(x)
        if gradient.size:
            # The core's gradient is that of half the sum of squares, with the sign of a descent step.
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
    try:
        search.optimize(np.clip((best.x - box.lower) / width, 0.0, 1.0))
    except nlopt.RoundoffLimited:
        pass  # the best point so far stands
    settled = search.last_optimize_result() in (nlopt.FTOL_REACHED, nlopt.XTOL_REACHED)
    return Outcome(best.x, best.cost, settled)


def _scipy(
    problem: _core.Problem,
    p: FloatArray,
    frozen: _core.FrozenFilter,
    box: Box,
    rounds: int,
    tolerance: float,
) -> Outcome:
    """Trust-region reflective least squares of SciPy."""
    from scipy.optimize import least_squares

    inside = np.clip(p[box.columns], box.lower + 1e-9, box.upper - 1e-9)
    found = least_squares(
        lambda x: problem.residuals(_filled(p, box, x), frozen).ravel(),
        inside,
        jac=lambda x: -problem.sensitivities(_filled(p, box, x), frozen, box.columns),
        bounds=(box.lower, box.upper),
        x_scale="jac",
        max_nfev=rounds,
        ftol=max(1e-12, tolerance / problem.samples / _core.CHANNELS),
    )
    return Outcome(found.x, float(found.cost), bool(found.status > 0))


_Method = Callable[[_core.Problem, FloatArray, _core.FrozenFilter, Box, int, float], Outcome]
METHODS: dict[str, _Method] = {"gauss-newton": _gauss_newton, "nlopt": _nlopt, "scipy": _scipy}
"""The local optimisers there are to choose from."""
