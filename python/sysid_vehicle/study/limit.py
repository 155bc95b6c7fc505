"""How a study shares out the time that it may take."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any, TypeVar

from .._common.threads import before, in_parallel

R = TypeVar("R")

TOGETHER = "whether several effects explain it that hold only together"
"""What is open where the time limit ended the search for them."""

# Of the time limit, when each stage ends: what one leaves goes to the next. They decide how far a
# search comes, not what is claimed of what it found: that is asked of `Rules` alone.
_SENSORS, _BASELINE, _SEARCHED, _STEP = 0.15, 0.4, 0.78, 0.85


@dataclass(frozen=True)
class Schedule:
    """When each stage of a study ends, wherever it is, by `time.perf_counter`.

    Attributes
    ----------
    sensors, baseline, search, judging : float
    step : float
        When validation data are asked last whether what the search refitted is added.
    """

    sensors: float
    baseline: float
    search: float
    step: float
    judging: float

    @classmethod
    def of(cls, began: float, limit_s: float) -> Schedule:
        """The schedule of a study with so many seconds from a time on; they may be infinite."""
        shares = (_SENSORS, _BASELINE, _SEARCHED, _STEP, 1.0)
        return cls(*(began + share * limit_s for share in shares))

    def again(self, took_s: float) -> Schedule | None:
        """The schedule of a second search, as long as the first; None where no time is left."""
        now = time.perf_counter()
        left = self.search - now
        if took_s > left:
            return None
        share = (_BASELINE - _SENSORS) / (_SEARCHED - _SENSORS)
        return replace(self, baseline=now + share * left)


class Judging:
    """Work that is left out where its time is over, and what was left out, in words."""

    def __init__(self, ends: float) -> None:
        self.ends = ends
        self.left_out: list[str] = []

    def asked(self, what: str, work: Callable[[], R]) -> R | None:
        """What work gives; None, and noted, where it is not done in time."""
        found = before(self.ends, lambda: (work(),), None)
        if found is None:
            if what not in self.left_out:  # two questions may be one to who reads of it
                self.left_out.append(what)
            return None
        return found[0]

    def side_by_side(self, *questions: tuple[str, Callable[[], Any]] | None) -> list[Any]:
        """As `asked` for each question, on all cores; None for what is no question."""
        found = in_parallel(
            lambda q: None if q is None else before(self.ends, lambda: (q[1](),), None), questions
        )
        for question, answer in zip(questions, found, strict=True):
            if question is not None and answer is None and question[0] not in self.left_out:
                self.left_out.append(question[0])
        return [None if answer is None else answer[0] for answer in found]

    def note(self, effects: Sequence[str], what: str) -> None:
        """Note what is unknown of some effects, if there are any."""
        if effects:
            self.left_out.append(what.format(", ".join(effects)))
