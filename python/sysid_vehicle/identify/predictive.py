"""How likely other driving is under a fit, with parameters no surer than the fit left them.

Of a sine in the linear range nothing is learnt about the peak of a tyre. Taken at its word beyond
the peak the fit is wrong there whatever effect is in it, and by so much that nothing else counts.
The predictive density asks less: with p^ and J the fitted parameters and their information,

    log p(y | fit) = log of the integral of p(y | p) N(p; p^, J^-1) dp

by Laplace's approximation around the p that serves both (Tierney & Kadane, J. American Statistical
Association 1986). Where the fitted driving determines every parameter, p is p^.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import cast

import numpy as np

from .. import _core
from .._arrays import FloatArray, as_float64
from ..estimate import Driving, NoiseModel
from ..model import Model
from .fit import Fit
from .identify import free_box
from .search import Box, minimise

__all__ = ["Prediction", "predict"]

_PASSES, _ROUNDS = 3, 20
_ENOUGH = 0.1  # nats
_SETTLED = 1e-4  # the same: along the valley of one B C D many small steps lead far


@dataclass(frozen=True)
class _Remembered:
    """The misfit on other driving, and what it costs to leave the parameters of the fit.

    The fit is remembered as a parabola. To ask its driving anew for every step takes a study 1.4
    times as long, and the exam named more wrong effects where the right one was no candidate.
    Positive parameters count by their logarithms, by which the tyres of one cornering stiffness,
    B C D, lie on a straight line.
    """

    problem: _core.Problem
    box: Box
    fitted: FloatArray
    information: FloatArray

    def units(self, x: FloatArray) -> FloatArray:
        """How much of a parameter is one of its coordinate."""
        return np.where(self.box.lower > 0.0, x, 1.0)

    def off(self, x: FloatArray) -> FloatArray:
        """How far parameters are from the fit."""
        positive = self.box.lower > 0.0
        ratio = np.where(positive, x, 1.0) / np.where(positive, self.fitted, 1.0)
        return np.where(positive, np.log(ratio), x - self.fitted)

    def price(self, p: FloatArray) -> float:
        off = self.off(p[self.box.columns])
        return float(0.5 * off @ self.information @ off)

    def half_sum_of_squares(self, p: FloatArray, frozen: _core.FrozenFilter) -> float:
        return self.problem.half_sum_of_squares(p, frozen) + self.price(p)

    def normal_equations(
        self, p: FloatArray, frozen: _core.FrozenFilter, columns: list[int]
    ) -> tuple[float, FloatArray, FloatArray]:
        cost, descent, information = self.problem.normal_equations(p, frozen, columns)
        units = self.units(p[columns])
        pull = self.information @ self.off(p[columns]) / units
        known = self.information / np.outer(units, units)
        return cost + self.price(p), descent - pull, information + known

    def occam(self, p: FloatArray, frozen: _core.FrozenFilter) -> float:
        """Half the log of by how much the other driving narrows the parameters down."""
        _, _, learnt = self.problem.normal_equations(p, frozen, self.box.columns)
        units = self.units(p[self.box.columns])
        scale = np.sqrt(np.diag(self.information))
        before, after = (
            np.linalg.slogdet(m / np.outer(scale, scale))[1]
            for m in (self.information, self.information + learnt * np.outer(units, units))
        )
        return float(0.5 * (after - before))


@dataclass(frozen=True, eq=False)
class Prediction:
    """Other driving under a fit.

    Attributes
    ----------
    model : Model
        With the parameters that serve both drivings.
    log_density : array, shape (n,)
        Sample by sample, up to what all models share; what the parameters had to move for, and how
        unsure they were, is shared out evenly.
    sureness : float
        Mean log density of a sample that is just as predicted.
    """

    model: Model
    log_density: FloatArray
    sureness: float


def predict(fit: Fit, driving: Driving, noise: NoiseModel) -> Prediction:
    """The predictive density of other driving.

    Parameters
    ----------
    fit : Fit
    driving : Driving
        Not what it was fitted to.
    noise : NoiseModel
        Of the other driving.

    Returns
    -------
    Prediction

    Raises
    ------
    NumericalError
        The model fails on the other driving.
    """
    other = _remembered(fit, driving)
    box, p = other.box, fit.model.vector()
    frozen = other.problem.freeze(p, noise.vector())
    best = frozen.log_likelihood
    for _ in range(_PASSES):
        trial = p.copy()
        trial[box.columns] = minimise(
            cast(_core.Problem, other), p, frozen, box, rounds=_ROUNDS, tolerance=_SETTLED
        ).x
        moved = other.problem.freeze(trial, noise.vector())
        reached = moved.log_likelihood - other.price(trial)
        gained = reached - best
        if gained > 0.0:
            p, frozen, best = trial, moved, reached
        if gained < _ENOUGH:
            break
    trace = other.problem.trace(p, noise.vector(), False)
    density = -0.5 * np.sum(trace["whitened"] ** 2, axis=1) + trace["log_density"]
    density -= (other.price(p) + other.occam(p, frozen)) / len(density)
    return Prediction(
        fit.model.from_vector(p), as_float64(density), float(np.mean(trace["log_density"]))
    )


def _remembered(fit: Fit, driving: Driving) -> _Remembered:
    """What the fitted driving told; of what it did not show, what the parameters' bounds tell."""
    box = free_box(fit.model)
    p = fit.model.vector()
    problem = fit.driving.problem(fit.model)
    _, _, information = problem.normal_equations(
        p, problem.freeze(p, fit.noise.vector()), box.columns
    )
    information = information + np.diag(12.0 / (box.upper - box.lower) ** 2)
    other = _Remembered(driving.problem(fit.model), box, p[box.columns], information)
    units = other.units(other.fitted)
    return replace(other, information=as_float64(information * np.outer(units, units)))
