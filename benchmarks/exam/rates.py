"""Counts with their Wilson intervals."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

_NORMAL = 1.959963984540054  # 97.5 %


@dataclass(frozen=True)
class Rate:
    """So many of so many."""

    hits: int
    of: int

    @classmethod
    def over(cls, answers: Iterable[bool]) -> Rate:
        """Count answers."""
        found = [bool(a) for a in answers]
        return cls(sum(found), len(found))

    @property
    def share(self) -> float:
        """The rate itself; NaN of nothing."""
        return self.hits / self.of if self.of else float("nan")

    @property
    def interval(self) -> tuple[float, float]:
        """95 % interval (Wilson, J. American Statistical Association 1927)."""
        if self.of == 0:
            return 0.0, 1.0
        z2, n, p = _NORMAL**2, self.of, self.share
        middle = (p + z2 / (2 * n)) / (1 + z2 / n)
        half = _NORMAL * np.sqrt(p * (1 - p) / n + z2 / (4 * n * n)) / (1 + z2 / n)
        return float(max(middle - half, 0.0)), float(min(middle + half, 1.0))

    def __str__(self) -> str:
        if self.of == 0:
            return "none"
        low, high = self.interval
        return (
            f"{self.hits}/{self.of} = {100 * self.share:.1f} % ({100 * low:.0f}-{100 * high:.0f})"
        )
