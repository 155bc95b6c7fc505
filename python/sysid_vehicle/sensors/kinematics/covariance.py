"""How well faults of sensors are known where errors depend on each other over time.

The information of independent errors is too large. Its sandwich with the scores summed over blocks
of time says by how much.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..._common.arrays import FloatArray, as_float64
from .equations import Readings
from .motion import IntArray
from .system import Linearised, Normal

_BLOCKS_S = (2.0, 10.0)  # errors further apart are taken as independent


def covariance_of(readings: Sequence[Readings], system: Linearised, normal: Normal) -> FloatArray:
    """Covariance of the faults, with the errors' dependence over time allowed for."""
    inverse = as_float64(np.linalg.inv(normal.information))
    scores = [
        (system.by_faults[c] - system.motion[c] @ normal.across)
        * (system.weights[c] * system.white[c])[:, None]
        for c in (r.channel for r in readings)
    ]
    stretch, time_s, of_all = (
        np.concatenate(parts)
        for parts in ([r.stretch for r in readings], [r.time_s for r in readings], scores)
    )
    robust = [
        np.diag(inverse @ _meat(stretch, np.floor(time_s / block), of_all) @ inverse)
        for block in _BLOCKS_S
    ]
    return inflated(inverse, np.max(robust, axis=0))


def inflated(naive: FloatArray, robust: FloatArray) -> FloatArray:
    """Covariance whose variances are the larger of two; few blocks make the second one noisy."""
    ratio = np.clip(robust / np.diag(naive), 1.0, None)
    scale = np.sqrt(ratio)
    result: FloatArray = naive * np.outer(scale, scale)
    return result


def _meat(stretch: IntArray, block: FloatArray, scores: FloatArray) -> FloatArray:
    """Sum over blocks of time of the squared scores of the faults, free of the motion."""
    order = np.lexsort((block, stretch))
    change = np.diff(stretch[order]) + np.abs(np.diff(block[order]))
    first = np.concatenate(([0], np.flatnonzero(change) + 1))
    sums = np.add.reduceat(scores[order], first, axis=0)
    result: FloatArray = sums.T @ sums
    return result
