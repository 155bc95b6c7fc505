"""Tyre coefficients by regression on a motion that is taken as known: the published losses."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import cast

import numpy as np

from .. import _core
from .._arrays import FloatArray, as_float64
from .._text import html_table, number, text_table
from ..errors import InvalidInput
from ..identify import METHODS
from ..identify.search import Box, minimise
from .box import BOX, GIVEN, box_of, first_point
from .motion import TyreMotion
from .multistart import Ends, start_points
from .projection import Regression, SoftRows
from .tyre_data import GreyBoxVehicle
from .tyre_fit import PARAMETERS

__all__ = ["LOSSES", "PUBLISHED_BOX", "PUBLISHED_START", "TyreRegression", "regress_tyres"]

LOSSES = {
    "plain": "sum of squared errors of a_y",
    "weighted": "errors of a_y over their standard deviation, which has a floor",
    "regularised": "weighted, and drawn towards the start and towards equal axles",
    "joint": "errors of a_y and of the yaw acceleration, each over the size it turns out to have",
}
"""The losses there are; the first three are the published ones."""

_TYRE_BOX = {"B": (1.0, 40.0), "C": (0.5, 3.0), "D": (0.1, 3.0), "E": (0.7, 2.0)}
PUBLISHED_BOX = BOX | {
    f"{letter}_{axle}": bounds for axle in ("front", "rear") for letter, bounds in _TYRE_BOX.items()
}
"""Where the published search looks; E is kept near the value of the published car."""

_TYRE_START = {"B": 30.0, "C": 1.0, "D": 1.0, "E": 1.0}
PUBLISHED_START = {f"{x}_{axle}": v for axle in ("front", "rear") for x, v in _TYRE_START.items()}

_PRIOR_WEIGHT = 0.1
_PRIOR_OF_RESIDUAL_TERMS = 0.1  # relative to that of the tyres
_SIMILARITY_WEIGHT = 1000.0
_FLOOR = 1e-6  # of the variance of a_y [m2/s4]
_COARSE = 800  # samples of a first search
_PASSES = 3  # over the sizes of the errors, joint loss


@dataclass(frozen=True, eq=False)
class TyreRegression:
    """Tyre coefficients of a regression.

    Attributes
    ----------
    loss : str
        One of `LOSSES`.
    parameters : array, shape (14,)
        All of `lab.tyre_fit.PARAMETERS`.
    value : float
        The loss there, summed over all samples.
    starts : Ends
        With minus half the loss in place of the log-likelihood.
    """

    loss: str
    parameters: FloatArray
    value: float
    starts: Ends

    def tyre(self, axle: str) -> FloatArray:
        """B, C, D, E of an axle, `front` or `rear`."""
        first = 4 * ("front", "rear").index(axle)
        return as_float64(self.parameters[first : first + 4])

    def stiffness(self, axle: str) -> float:
        """Cornering stiffness over load, B C D [1/rad]."""
        return float(np.prod(self.tyre(axle)[:3]))

    _HEAD = ("axle", "B [1/rad]", "C", "D", "E", "B C D [1/rad]")

    def _rows(self) -> list[list[str]]:
        return [
            [axle, *(number(x, 5) for x in self.tyre(axle)), number(self.stiffness(axle), 5)]
            for axle in ("front", "rear")
        ]

    def __str__(self) -> str:
        head = f"Regression, {self.loss} loss {number(self.value, 7)}; {self.starts}"
        return f"{head}\n{text_table(self._HEAD, self._rows())}"

    def _repr_html_(self) -> str:
        head = f"Regression, {self.loss} loss {number(self.value, 7)}; {self.starts}"
        return f"<p>{head}</p>{html_table(self._HEAD, self._rows())}"


def regress_tyres(
    vehicle: GreyBoxVehicle,
    motion: TyreMotion,
    *,
    loss: str = "plain",
    start: Mapping[str, float] | None = None,
    box: Mapping[str, tuple[float, float]] | None = None,
    residual_terms: bool = False,
    projection: bool = True,
    starts: int = 1,
    method: str = "gauss-newton",
    seed: int = 0,
) -> TyreRegression:
    """Fit B, C, D, E of both axles to accelerations, the motion being taken as exact.

    It takes milliseconds, and is as good as the motion it is given: `identify_tyres` does not need
    that assumption, and has intervals. The published losses have no projection of the front force
    onto the car's lateral axis; the joint one has.

    Parameters
    ----------
    vehicle : GreyBoxVehicle
    motion : TyreMotion
    loss : str
        One of `LOSSES`.
    start : mapping, optional
        Starting values of some of `lab.tyre_fit.PARAMETERS`.
    box : mapping, optional
        Bounds; `BOX` if left out, `PUBLISHED_BOX` is the published one.
    residual_terms : bool
        Also fit P1, P2, P3 of a_y = ... + P1 v_x^2 + P2 v_y + P3 r.
    projection : bool
        Work D and P out wherever the search goes, instead of searching for them too.
    starts : int
        The given point, and others that fill the whole box evenly.
    method : str
        `gauss-newton`, `nlopt` or `scipy`.
    seed : int
        Of the start points.

    Returns
    -------
    TyreRegression

    Raises
    ------
    InvalidInput
        Unknown loss, method or parameter, less than one start, or a joint loss on a motion without
        yaw acceleration.
    """
    if loss not in LOSSES:
        raise InvalidInput(f"no loss is called '{loss}'; there are {', '.join(LOSSES)}")
    if method not in METHODS:
        raise InvalidInput(f"no optimiser is called '{method}'; there are {', '.join(METHODS)}")
    if starts < 1:
        raise InvalidInput(f"starts is {starts}; at least one is needed")
    if loss == "joint" and motion.yaw_acc_radps2 is None:
        raise InvalidInput("the joint loss needs yaw_acc_radps2 in the motion")
    free = list(PARAMETERS[:8]) + (["P1", "P2", "P3"] if residual_terms else [])
    bounds = box_of(free, box or BOX)
    p = first_point(GIVEN if start is None else start)
    p[bounds.columns] = np.clip(p[bounds.columns], bounds.lower, bounds.upper)
    begins = start_points(p[bounds.columns], bounds, list(range(8)), starts, seed)
    ends = [
        descend_regression(vehicle, motion, p, b, bounds, loss, projection, method) for b in begins
    ]
    values = np.array([-0.5 * value for _, value in ends])
    table = Ends(
        tuple(free), begins, as_float64([q[bounds.columns] for q, _ in ends]), as_float64(values)
    )
    best = int(np.argmax(values))
    return TyreRegression(loss, ends[best][0], ends[best][1], table)


def descend_regression(
    vehicle: GreyBoxVehicle,
    motion: TyreMotion,
    p: FloatArray,
    begin: FloatArray,
    box: Box,
    loss: str,
    projection: bool = True,
    method: str = "gauss-newton",
) -> tuple[FloatArray, float]:
    """Search from one start.

    Returns
    -------
    p : array, shape (parameters,)
    loss : float
    """
    start = p.copy()
    start[box.columns] = begin
    p = start.copy()
    if motion.n > 2 * _COARSE:
        # The way to the valley needs few samples, the place in it all of them.
        p, _ = descend_regression(
            vehicle, motion.thinned(_COARSE), p, begin, box, loss, projection, method
        )
    kept = [not projection or PARAMETERS[c][0] in "BCE" for c in box.columns]
    inner = Box(
        [c for c, k in zip(box.columns, kept, strict=True) if k], box.lower[kept], box.upper[kept]
    )
    worked_out = [not k for k in kept]
    linear = [c for c, k in zip(box.columns, kept, strict=True) if not k]
    ay, yaw = _first_weights(motion, loss)
    soft = _wishes(start) if loss == "regularised" else SoftRows.none(len(p))
    value = np.inf
    for _ in range(_PASSES if loss == "joint" else 1):
        problem = Regression(
            motion.loss(vehicle, ay, yaw, projects_steer=loss == "joint"),
            soft,
            linear,
            box.lower[worked_out],
            box.upper[worked_out],
        )
        # `minimise` asks no more of a problem than `Regression` gives it.
        found = minimise(
            cast(_core.Problem, problem),
            p,
            cast(_core.FrozenFilter, None),
            inner,
            method=method,
            rounds=60,
            tolerance=_tolerance(motion, loss),
        )
        p[inner.columns] = found.x
        p = problem.complete(p)
        value = 2.0 * found.cost
        if loss == "joint":
            errors = problem.loss.residuals(p) / np.column_stack([ay, yaw])
            size = np.sqrt(np.mean(errors**2, axis=0)) + 1e-9
            ay, yaw = (np.full(motion.n, 1.0 / s) for s in size)
    return p, value


def _first_weights(motion: TyreMotion, loss: str) -> tuple[FloatArray, FloatArray]:
    one, none = np.ones(motion.n), np.zeros(motion.n)
    if loss == "plain":
        return one, none
    if loss == "joint":
        rate = motion.yaw_acc_radps2
        assert rate is not None  # callers have seen to it
        return one / (0.1 * np.std(motion.ay_mps2) + 1e-6), one / (0.1 * np.std(rate) + 1e-6)
    variance = motion.ay_variance if motion.ay_variance is not None else one
    return as_float64(1.0 / np.sqrt(np.maximum(variance, _FLOOR))), none


def _tolerance(motion: TyreMotion, loss: str) -> float:
    """Gain of half the loss that ends a search."""
    if loss != "plain":
        return 1e-3
    return 1e-8 * float(np.sum(motion.ay_mps2**2))


def _wishes(start: FloatArray) -> SoftRows:
    scale = np.where(start == 0.0, 1.0, np.abs(start))
    rows, target = [], []
    for i in range(11):
        weight = np.sqrt(_PRIOR_WEIGHT) * (1.0 if i < 8 else _PRIOR_OF_RESIDUAL_TERMS) / scale[i]
        row = np.zeros(len(start))
        row[i] = weight
        rows.append(row)
        target.append(weight * start[i])
    for i in range(4):
        row = np.zeros(len(start))
        row[i] = np.sqrt(_SIMILARITY_WEIGHT) / scale[i]
        row[i + 4] = -row[i]
        rows.append(row)
        target.append(0.0)
    return SoftRows(as_float64(rows), as_float64(target))
