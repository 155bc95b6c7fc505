"""How likely other driving is under a fit, with parameters no surer than the fit left them.

Of a sine in the linear range nothing is learnt about the peak of a tyre. Taken at its word beyond
the peak the fit is wrong there whatever effect is in it, and by so much that nothing else counts.
The predictive density asks less: with p^ and J the fitted parameters and their information,

    log p(y | fit) = log of the integral of p(y | p) N(p; p^, J^-1) dp

by Laplace's approximation around the p that serves both (Tierney & Kadane, J. American Statistical
Association 1986). Where the fitted driving determines every parameter, p is p^.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from .._common.arrays import FloatArray, as_float64
from .._common.memo import remembered
from ..estimate import Driving, NoiseModel
from ..estimate.pieces import DrivingProblem
from ..model import Model
from .fit import Fit
from .offsets import driving_of
from .search.box import free_box, objective_of
from .search.objective import Penalised
from .search.search import Box, minimise

_PASSES, _ROUNDS = 3, 20
_ENOUGH = 0.1  # nats
_SETTLED = 1e-4  # the same: along the valley of one B C D many small steps lead far


@dataclass(frozen=True)
class _Remembered:
    """What it costs to leave the parameters of the fit.

    The fit is remembered as a parabola. To ask its driving anew for every step takes a study 1.4
    times as long, and the exam named more wrong effects where the right one was no candidate.
    Positive parameters count by their logarithms, by which the tyres of one cornering stiffness,
    B C D, lie on a straight line.
    """

    box: Box
    fitted: FloatArray
    root: FloatArray  # upper triangular; its square is the information

    @property
    def information(self) -> FloatArray:
        """Of the fit, in these coordinates."""
        return as_float64(self.root.T @ self.root)

    def __call__(self, p: FloatArray) -> tuple[FloatArray, FloatArray]:
        """How far parameters are from the fit, in its standard errors, as residuals."""
        x = p[self.box.columns]
        off = self.box.apart(self.fitted, x)
        slopes = np.zeros((len(x), len(p)))
        slopes[:, self.box.columns] = self.root / self.box.units(x)
        return as_float64(-self.root @ off), slopes

    def occam(self, problem: DrivingProblem, p: FloatArray, frozen: Any) -> float:
        """Half the log of by how much the other driving narrows the parameters down."""
        _, _, learnt = problem.normal_equations(p, frozen, self.box.columns)
        units = self.box.units(p[self.box.columns])
        known = self.information
        scale = np.sqrt(np.diag(known))
        before, after = (
            np.linalg.slogdet(m / np.outer(scale, scale))[1]
            for m in (known, known + learnt * np.outer(units, units))
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
    remembered = _remembered(fit)
    # A lag of which nothing was searched stands at none, which no box of lags holds.
    box, p = remembered.box, remembered.box.inside(fit.model.vector())
    problem = driving_of(fit, driving).problem(fit.model)
    other = Penalised(problem, (remembered,))
    frozen = problem.freeze(p, noise.vector())
    best = frozen.log_likelihood
    for _ in range(_PASSES):
        trial = p.copy()
        trial[box.columns] = minimise(other, p, frozen, box, rounds=_ROUNDS, tolerance=_SETTLED).x
        moved = problem.freeze(trial, noise.vector())
        reached = moved.log_likelihood - other.prior_cost(trial)
        gained = reached - best
        if gained > 0.0:
            p, frozen, best = trial, moved, reached
        if gained < _ENOUGH:
            break
    trace = problem.trace(p, noise.vector(), False)
    density = -0.5 * np.sum(trace["whitened"] ** 2, axis=1) + trace["log_density"]
    density -= (other.prior_cost(p) + remembered.occam(problem, p, frozen)) / len(density)
    return Prediction(
        fit.model.from_vector(p), as_float64(density), float(np.mean(trace["log_density"]))
    )


# A fit is asked under the noise of either of two models.
@remembered(8)
def _remembered(fit: Fit) -> _Remembered:
    """What the fitted driving told; of what it did not show, what the parameters' bounds tell."""
    box = free_box(fit.model)
    p = box.inside(fit.model.vector())
    objective = objective_of(fit.model, fit.driving.problem(fit.model), fit.driving)
    _, _, information = objective.normal_equations(
        p, objective.freeze(p, fit.noise.vector()), box.columns
    )
    information = information + np.diag(12.0 / box.width**2)
    units = box.units(p[box.columns])
    scaled = information * np.outer(units, units)
    size = np.sqrt(np.diag(scaled))
    # A root of what is scaled to ones loses no digits to units.
    root = np.linalg.cholesky(scaled / np.outer(size, size)).T * size
    return _Remembered(box, p[box.columns], as_float64(root))
