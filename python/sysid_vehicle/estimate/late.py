"""Readings that arrive late, for the filters of models written in Python."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from typing import Any

from .._common.arrays import FloatArray, as_float64
from ..errors import InvalidInput
from .filters import FilterState, StateFilter


class LateMeasurements:
    """Takes readings that arrive late: keeps the last samples and runs them again.

    Parameters
    ----------
    state_filter : StateFilter
        The filter; it is copied.
    longest_delay : int
        In samples.
    """

    def __init__(self, state_filter: StateFilter, longest_delay: int) -> None:
        if longest_delay < 0:
            raise InvalidInput(f"longest_delay: {longest_delay} is below 0")
        self.filter = state_filter.copy()
        self._past: deque[tuple[StateFilter, Any, FloatArray]] = deque(maxlen=longest_delay + 1)

    def step(self, u: Any, y: FloatArray | Sequence[float]) -> FilterState:
        """Use what is measured now."""
        y = as_float64(y).copy()
        self._past.append((self.filter.copy(), u, y))
        return self.filter.step(u, y)

    def late(self, delay: int, row: int, value: float) -> FilterState:
        """Use element `row` of what was measured `delay` samples before the latest one."""
        if not 0 <= delay < len(self._past):
            raise InvalidInput(
                f"delay: {delay} samples ago is not kept; the last {len(self._past)} are"
            )
        if not 0 <= row < len(self._past[-1][2]):
            raise InvalidInput(f"row: there is no measurement {row}")
        first = len(self._past) - 1 - delay
        again = list(self._past)[first:]
        again[0][2][row] = value
        self.filter = again[0][0]
        for _ in again:
            self._past.pop()
        for _, u, y in again:
            found = self.step(u, y)
        return found
