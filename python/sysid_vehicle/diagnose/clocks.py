"""Clocks of inputs: what the car does comes later than the log says, or has to be advanced.

A delay of the catalogue has one sign. Steering that was logged late has the other: the car acts
before the log says so, and only a log can be wrong in that way.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .._arrays import FloatArray
from ..rules import Rules
from .delay import delayed, pieces_of
from .evidence import Evidence
from .projection import variance_ratio


@dataclass(frozen=True)
class Clock:
    """An input that may be shifted in time.

    Attributes
    ----------
    channel : str
    column : int
        Among the inputs of a driving.
    typical_s : float
        Usual time by which the car acts later than the log says; negative where it acts before.
    either : bool
        Whether the time may have either sign.
    """

    channel: str
    column: int
    typical_s: float
    either: bool = False

    @property
    def name(self) -> str:
        """What it is called among the causes."""
        return f"clock of {self.channel}"


CLOCKS = (
    Clock("steer_rad", 0, -0.04),  # that the wheels act late is an effect of the catalogue
    Clock("fx_n", 1, 0.1, either=True),
)


@dataclass(frozen=True, eq=False)
class ClockScore:
    """What a shifted clock does to the residuals.

    Attributes
    ----------
    direction : array, shape (5 n, 1)
        Sensitivity per second, projected off the fitted parameters.
    ratio : float
        Long-run over naive variance of its score, at least 1.
    """

    clock: Clock
    direction: FloatArray
    ratio: float


def clock_scores(evidence: Evidence, rules: Rules) -> list[ClockScore]:
    """Score the clocks that this driving can show, by a step to their typical sizes."""
    driving, fit, e = evidence.driving, evidence.fit, evidence.left
    inputs = driving.inputs() if evidence.inputs is None else evidence.inputs
    found = []
    for clock in CLOCKS:
        if clock.channel == "fx_n" and not driving.force_known:
            continue
        moved = inputs.copy()
        for begin, end, rate in pieces_of(driving):
            moved[begin:end, clock.column] = delayed(
                inputs[begin:end, clock.column], rate, clock.typical_s
            )
        problem = driving.problem(fit.model, other_inputs=moved)
        after = problem.residuals(fit.model.vector(), evidence.frozen).ravel()
        G = ((evidence.residual - after) / clock.typical_s)[:, None]
        R = evidence.project(G)
        if np.linalg.norm(R) > rules.retained * np.linalg.norm(G):
            along = R[:, 0]
            size = float(along @ e) / float(along @ along)
            found.append(ClockScore(clock, R, variance_ratio(along, e - size * along)))
    return found
