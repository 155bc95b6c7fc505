"""Tyre coefficients by regression on a motion that is taken as known: the published losses."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from .._common.arguments import whole
from .._common.arrays import FloatArray, as_float64
from .._common.printed import Part, Printed, Table
from .._common.progress import doing
from .._common.text import number
from ..errors import InvalidInput
from ..identify.search.search import METHODS
from ..identify.search.starts import Starts, space_filling
from ..lab.tyres.data import GreyBoxVehicle
from ..lab.tyres.fit import PARAMETERS
from ..lab.tyres.motion import TyreMotion
from ..lab.tyres.problem import BOX, GIVEN, box_of, first_point
from ..vehicle import AXLES
from .tyre_search import LossTask, search

LOSSES = {
    "plain": "sum of squared errors of a_y",
    "weighted": "errors of a_y over their standard deviation, which has a floor",
    "regularised": "weighted, and drawn towards the start and towards equal axles",
    "joint": "errors of a_y and of the yaw acceleration, each over the size it turns out to have",
}
"""The losses there are; the first three are the published ones."""

_BOX = {"B": (1.0, 40.0), "C": (0.5, 3.0), "D": (0.1, 3.0), "E": (0.7, 2.0)}
TYRE_BOX = BOX | {f"{letter}_{axle}": bounds for axle in AXLES for letter, bounds in _BOX.items()}
"""Where the published search looks; E is kept near the value of the published car."""

_START = {"B": 30.0, "C": 1.0, "D": 1.0, "E": 1.0}
TYRE_START = {f"{letter}_{axle}": value for axle in AXLES for letter, value in _START.items()}
"""Where the published search begins."""


@dataclass(frozen=True, eq=False)
class TyreRegression(Printed):
    """Tyre coefficients of a regression.

    Attributes
    ----------
    loss : str
        One of `LOSSES`.
    parameters : array, shape (15,)
        All of `lab.tyre_fit.PARAMETERS`.
    value : float
        The loss there, summed over all samples.
    starts : Starts
        With minus half the loss in place of the log-likelihood; for the joint loss, whose weights
        are worked out at every end, the log-likelihood itself up to a constant.
    """

    loss: str
    parameters: FloatArray
    value: float
    starts: Starts

    def tyre(self, axle: str) -> FloatArray:
        """B, C, D, E of an axle, `front` or `rear`."""
        first = 4 * AXLES.index(axle)
        return as_float64(self.parameters[first : first + 4])

    def stiffness(self, axle: str) -> float:
        """Cornering stiffness over load, B C D [1/rad]."""
        return float(np.prod(self.tyre(axle)[:3]))

    _HEAD = ("axle", "B [1/rad]", "C", "D", "E", "B C D [1/rad]")

    def _rows(self) -> list[list[str]]:
        return [
            [axle, *(number(x, 5) for x in self.tyre(axle)), number(self.stiffness(axle), 5)]
            for axle in AXLES
        ]

    def _parts(self) -> list[Part]:
        return [self._headline(), Table(self._HEAD, self._rows())]

    def _headline(self) -> str:
        return f"Regression, {self.loss} loss {number(self.value, 7)}; {self.starts}"


@doing("regression of the tyres")
def regress_tyres(
    vehicle: GreyBoxVehicle,
    motion: TyreMotion,
    *,
    loss: str = "plain",
    start: Mapping[str, float] | None = None,
    box: Mapping[str, tuple[float, float]] | None = None,
    residual_terms: bool = False,
    projection: bool = True,
    starts: int = 16,
    method: str = "gauss-newton",
    seed: int = 0,
) -> TyreRegression:
    """Fit B, C, D, E of both axles to accelerations, the motion being taken as exact.

    It takes about a second, some milliseconds from one start, and is as good as the motion it is
    given: `identify_tyres` does not need that assumption, and has intervals. The published losses
    have no projection of the front force onto the car's lateral axis; the joint one has.

    Tyres of other curvature are minima of their own, often of nearly the same loss, and a quarter
    of the starts or fewer may lead to the lowest: from one start the search finds the minimum next
    to it, no more.

    Parameters
    ----------
    vehicle : GreyBoxVehicle
    motion : TyreMotion
    loss : str
        One of `LOSSES`.
    start : mapping, optional
        Starting values of some of `lab.tyre_fit.PARAMETERS`.
    box : mapping, optional
        Bounds; `BOX` if left out, `TYRE_BOX` is the published one.
    residual_terms : bool
        Also fit P1, P2, P3 of a_y = ... + P1 v_x^2 + P2 v_y + P3 r.
    projection : bool
        Work D and P out wherever the search goes, instead of searching for them too.
    starts : int
        The given point, and others that fill the whole box evenly. The regularised loss draws all
        of them towards the given one.
    method : str
        `gauss-newton`, `nlopt` or `scipy`.
    seed : int
        Of the start points.

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
    whole(starts, "starts", 1)
    if loss == "joint" and motion.yaw_acc_radps2 is None:
        raise InvalidInput("the joint loss needs yaw_acc_radps2 in the motion")
    free = list(PARAMETERS[:8]) + (["P1", "P2", "P3"] if residual_terms else [])
    bounds = box_of(free, box or BOX)
    p = bounds.inside(first_point(GIVEN if start is None else start))
    begins = space_filling(
        p[bounds.columns], bounds.lower, bounds.upper, starts, seed, list(range(8))
    )
    task = LossTask(vehicle, motion, bounds, p, projection, method, loss)
    ends, values, merits = search(task, begins)
    table = Starts(tuple(free), begins, as_float64(ends[:, bounds.columns]), merits)
    best = int(np.argmax(merits))
    return TyreRegression(loss, ends[best], float(values[best]), table)
