"""Scales that act otherwise above zero than below."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..._common.arrays import FloatArray
from .system import Normal


class OneSided:
    """Steps of scales of accelerometers that stand for gravity by roll or pitch where they add.

    That gravity comes late, a scale does not: the likelihood has a kink at zero. A search that
    steps over it, from where one side points down to where the other points up, goes on for ever.
    It lands on zero, and stays there while both sides point at it.

    Parameters
    ----------
    names : sequence of str
        Of the faults, in the order of their values.
    """

    def __init__(self, names: Sequence[str]) -> None:
        axes = [name.removeprefix("lean.") for name in names if name.startswith("lean.")]
        self._at = [names.index(f"gain.{axis}") for axis in axes if f"gain.{axis}" in names]
        self._from_above: set[int] = set()

    def forget(self) -> None:
        """What was seen from above may have changed."""
        self._from_above.clear()

    def step(self, normal: Normal, now: FloatArray) -> FloatArray:
        """Return the step that the equations ask for, no farther than to zero.

        Parameters
        ----------
        normal : Normal
            At zero they are those of a scale that is negative.
        now : ndarray, shape (n,)
            Values of the faults.
        """
        fixed: dict[int, float] = {}
        step = normal.step
        while True:
            over = [i for i in self._at if i not in fixed and self._ends_at_zero(i, now, step)]
            if not over:
                break
            fixed |= {i: -float(now[i]) for i in over}
            step = normal.step_beside(fixed)
        self._from_above |= {i for i in fixed if now[i] > 0.0}
        return step

    def _ends_at_zero(self, i: int, now: FloatArray, step: FloatArray) -> bool:
        if now[i] == 0.0:
            return i in self._from_above and bool(step[i] > 0.0)
        return bool(np.sign(now[i] + step[i]) == -np.sign(now[i]))
