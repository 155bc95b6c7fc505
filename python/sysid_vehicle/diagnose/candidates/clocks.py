"""Clocks of inputs that no effect of the catalogue shifts: the wheel force acts later or before.

The clock of the steering is an effect of its own, `steer_delay`.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from ... import _core
from ..._common.arrays import FloatArray
from ...effects import Parameter
from ...estimate.pieces import DrivingProblem
from ...rules import Rules
from ..evidence.directions import Ask, Directions
from ..evidence.evidence import Evidence, Section
from ..unexplained.delay import later


@dataclass(frozen=True)
class Clock:
    """An input that may be shifted in time.

    Attributes
    ----------
    channel : str
    column : int
        Among the inputs of a driving.
    typical_s : float
        Usual time by which the car acts later than the log says, or before.
    """

    channel: str
    column: int
    typical_s: float

    @property
    def name(self) -> str:
        """What it is called among the causes."""
        return f"clock of {self.channel}"

    def late(self, evidence: Evidence, by_s: float) -> DrivingProblem:
        """The problem of some evidence with the input later than it is there."""
        inputs = evidence.driving.inputs() if evidence.inputs is None else evidence.inputs
        return evidence.problem_of(later(inputs, self.column, evidence.driving.spans, by_s))


CLOCKS = (Clock("fx_n", 1, 0.1),)


def clock_parameter(clock: Clock) -> Parameter:
    """The time by which an input is shifted, as a parameter."""
    most, usual = 5.0 * clock.typical_s, clock.typical_s
    return Parameter(
        name="delay_s",
        unit="s",
        null_value=0.0,
        typical=usual,
        matters=0.2 * usual,
        lower=-most,
        upper=most,
        typical_low=0.3 * usual,
        typical_high=2.0 * usual,
        mirrored=False,
        scan="",
        column=-1,
    )


@dataclass(frozen=True, eq=False)
class ClockScore:
    """What a shifted clock does to the residuals.

    Attributes
    ----------
    column : int
        Its direction among all that were projected: the sensitivity per second.
    ratio : float
        Long-run over naive variance of its score, at least 1.
    """

    clock: Clock
    column: int
    ratio: float


def shifts(evidence: Evidence) -> tuple[Shifts, ...]:
    """Sensitivities to the clocks that the driving can show; nothing where there are none."""
    clocks = [c for c in CLOCKS if c.channel != "fx_n" or evidence.driving.force_known]
    return (Shifts(evidence, clocks),) if clocks else ()


class Shifts:
    """Sensitivities to clocks, by a step to their typical sizes."""

    groups = ()

    def __init__(self, evidence: Evidence, clocks: list[Clock]) -> None:
        self.evidence, self.clocks = evidence, clocks
        self._moved = [clock.late(evidence, clock.typical_s) for clock in clocks]

    @property
    def width(self) -> int:
        """Number of columns."""
        return len(self.clocks)

    def asks(self, projected: Directions) -> Ask:
        """The colour along each, without what it explains itself."""
        place = projected.place(self)
        after = np.maximum(np.diag(projected.information)[place], 1e-300)
        return Ask(None, np.diag(projected.score[place] / after))

    def of(self, section: Section) -> FloatArray:
        """Those of a section's residuals."""
        p = self.evidence.fit.model.vector()

        def work(problem: _core.Problem, gains: Any, at: slice) -> FloatArray:
            here = problem.residuals(p, gains).ravel()
            there = [
                self.evidence.section_of(moved, at).residuals(p, gains).ravel()
                for moved in self._moved
            ]
            return np.column_stack([here - t for t in there]) / [c.typical_s for c in self.clocks]

        return section.rows(work, "clocks")


def clock_scores(projected: Directions, rules: Rules) -> list[ClockScore]:
    """Score the clocks of which something is left beside the fitted parameters."""
    shifts = next((s for s in projected.sources if isinstance(s, Shifts)), None)
    if shifts is None:
        return []
    place = projected.place(shifts)
    after, before = np.diag(projected.information)[place], projected.before[place]
    ratios = projected.answer(shifts).ratios
    return [
        ClockScore(clock, place.start + i, max(float(ratios[i]), 1.0))
        for i, clock in enumerate(shifts.clocks)
        if np.sqrt(after[i]) > rules.retained * np.sqrt(before[i])
    ]
