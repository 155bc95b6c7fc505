"""Does drive and brake force cost side force? The friction ellipse, asked of the likelihood.

A driven or braked tyre has less side force left. A model without that takes a smaller D for it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..._common.arrays import FloatArray
from ...errors import warn
from ...identify.intervals.estimates import box_covariance
from ...identify.search.objective import Objective
from ...identify.search.search import Box
from ...identify.search.settle import settle
from ...identify.search.tyre_shape import stiffness
from ...rules import USUAL
from ...vehicle import AXLES
from .fit import ELLIPSE, PARAMETERS, TyreFit
from .problem import BOX

_COLUMN = PARAMETERS.index(ELLIPSE)
_WORTH_A_SEARCH = 1.0  # nats that the score promises
_CIRCLE = 1.0
_MATTERS = 0.02  # share of D, or of the stiffness, below which it is not warned of
_TOLD = 0.25  # standard deviation of the ellipse below which 0 and a circle are told apart


def with_ellipse(box: Box) -> Box:
    """The box with the ellipse as a further free parameter."""
    low, high = BOX[ELLIPSE]
    return Box([*box.columns, _COLUMN], np.append(box.lower, low), np.append(box.upper, high))


@dataclass(frozen=True, eq=False)
class _Score:
    """What the data say of the ellipse at an optimum without one, all others following.

    Attributes
    ----------
    estimate, std : float
        Of the ellipse, to first order.
    along : array, shape (free,)
        Change of the others with the ellipse.
    """

    estimate: float
    std: float
    along: FloatArray

    @property
    def gain(self) -> float:
        """Nats that it promises; none where the estimate is negative."""
        return 0.5 * (max(self.estimate, 0.0) / self.std) ** 2


def _score(objective: Objective, p: FloatArray, noise: FloatArray, box: Box) -> _Score | None:
    more = with_ellipse(box)
    gains = objective.freeze(p, noise)
    _, slope, information = objective.normal_equations(p, gains, more.columns)
    inner = np.linalg.inv(box_covariance(information[:-1, :-1], box, p[box.columns]))
    along = -np.linalg.solve(inner, information[:-1, -1])
    left = float(information[-1, -1] + information[-1, :-1] @ along)
    # Of rounding nothing is learned: no force along the car, or none beside a side force.
    if not left > 1e-9 * float(information[-1, -1]) > 0.0:
        return None
    return _Score(float(slope[-1] + along @ slope[:-1]) / left, left**-0.5, along)


def asks_for_ellipse(
    objective: Objective, p: FloatArray, noise: FloatArray, box: Box, method: str
) -> tuple[bool, FloatArray, FloatArray]:
    """Whether the likelihood asks for the ellipse, and parameters and noise as they then are."""
    told = _score(objective, p, noise, box)
    if told is None or told.gain < _WORTH_A_SEARCH:
        return False, p, noise
    start = p.copy()
    start[_COLUMN] = np.clip(told.estimate, *BOX[ELLIPSE])
    found, its, _ = settle(
        objective, start, noise, with_ellipse(box), method=method, parameters_first=True
    )
    without, with_it = objective.log_likelihood(p, noise), objective.log_likelihood(found, its)
    return (True, found, its) if with_it - without > USUAL.apart else (False, p, noise)


def warn_of_ellipse(fit: TyreFit, objective: Objective, box: Box) -> None:
    """Say that the readings ask for an ellipse, or that D depends on one they do not tell."""
    if ELLIPSE in [e.name for e in fit.estimates]:
        return
    told = _score(objective, fit.parameters, fit.noise, box)
    if told is None:
        return
    shown = told.gain > USUAL.apart
    if not shown and told.std < _TOLD:
        return
    size = min(told.estimate, BOX[ELLIPSE][1]) if shown else _CIRCLE
    circle = fit.parameters.copy()
    circle[box.columns] += size * told.along
    off = ", ".join(_off(fit, box.inside(circle)))
    if shown:
        warn(
            f"drive and brake force cost side force: the readings ask for a friction ellipse of "
            f"{size:.2g}, and without one the tyres are wrong{f' ({off})' if off else ''}; "
            "identify with combined_slip=True"
        )
    elif off:
        warn(
            "whether drive and brake force cost side force the readings do not tell: of tyres "
            f"with a friction circle {off}; brake and accelerate in corners, or do neither"
        )


def _off(fit: TyreFit, circle: FloatArray) -> Sequence[str]:
    """What would be larger by more than its interval allows for, and by enough to matter."""
    found = []
    for axle in AXLES:
        first = PARAMETERS.index(f"B_{axle}")
        for name, of in (("D", lambda tyre: tyre[2]), ("BCD", stiffness)):
            here, there = (float(of(p[first : first + 4])) for p in (fit.parameters, circle))
            low, high = fit.interval(f"{name}_{axle}")
            if there > max(high + 0.5 * (high - low), (1.0 + _MATTERS) * here):
                found.append(f"{name}_{axle} is too small by {100.0 * (1.0 - here / there):.2g} %")
    return found
