"""The time that a comparison has: what was not fitted in it is kept, to be told."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterable
from typing import TypeVar

from ..._common.text import few
from ..._common.threads import before

R = TypeVar("R")


class InTime:
    """Work that ends in time, and what was left out.

    Parameters
    ----------
    ends : float
        By `time.perf_counter`.

    Attributes
    ----------
    ends : float
    late : dict of frozenset to tuple of str
        What was to be put in together, and was not fitted.
    reference : bool
        Whether it was not asked what the reference alone lacks.
    twos : bool
        Whether not all was tried that may hold only together.
    maxima : bool
        Whether searches were not followed to the maximum of the likelihood.
    unknown : bool
        Whether it was not asked what changed beside what no effect explains.
    """

    def __init__(self, ends: float = math.inf) -> None:
        self.ends = ends
        self.late: dict[frozenset[str], tuple[str, ...]] = {}
        self.reference = self.twos = self.maxima = self.unknown = False

    @property
    def over(self) -> bool:
        """Whether no time is left."""
        return time.perf_counter() >= self.ends

    @property
    def left_s(self) -> float | None:
        """Seconds that are left, above zero; None where there is no end."""
        return None if self.ends == math.inf else max(self.ends - time.perf_counter(), 1e-9)

    def part(self, share: float) -> InTime:
        """A share of the time that is left, for one question beside others."""
        left = self.left_s
        return InTime() if left is None else InTime(time.perf_counter() + share * left)

    def of(self, work: Callable[[], R], otherwise: R) -> R:
        """What work gives, or something else if it is not done in time."""
        return before(self.ends, work, otherwise)

    def effects(self, put: Iterable[str]) -> tuple[str, ...]:
        """What was to be put in beside some changes, or in their place, in any state."""
        known = {*put}
        late = (e for several in self.late.values() for e in several)
        return tuple(dict.fromkeys(e for e in late if e not in known))

    def in_place_of(self, effect: str, put: Iterable[str]) -> tuple[str, ...]:
        """What was to be fitted in place of an effect of some changes, and was not."""
        rest = frozenset(put) - {effect}
        one_more = (key - rest for key in self.late if rest < key and len(key - rest) == 1)
        return tuple(e for few in one_more for e in few if e != effect)

    def facts(self, put: Iterable[str]) -> tuple[str, ...]:
        """What the time limit left out, in words."""
        told = []
        if others := self.effects(put):
            told.append(f"{few(others)} {'was' if len(others) == 1 else 'were'} not tried")
        if self.twos or (self.late and not others):
            told.append("what may have changed together was not all tried")
        if self.reference:
            told.append("what the reference lacks was not asked for, and may look like a change")
        if self.maxima:
            told.append("the likelihood was not followed to its maximum")
        if self.unknown:
            told.append("what stands in for what no effect explains was not asked for")
        return tuple(told)
