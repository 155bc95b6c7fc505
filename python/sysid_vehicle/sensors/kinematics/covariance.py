"""How well faults of sensors are known where errors depend on each other over time.

The information of independent errors is too large. Its sandwich with the scores summed over blocks
of time says by how much.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..._common.arrays import FloatArray, as_float64
from .equations import Readings
from .system import Linearised, Normal

_BLOCKS_S = (2.0, 10.0)  # errors further apart are taken as independent


def covariance_of(readings: Sequence[Readings], system: Linearised, normal: Normal) -> FloatArray:
    """Covariance of the faults, with the errors' dependence over time allowed for."""
    inverse = as_float64(np.linalg.inv(normal.information))
    robust = [
        np.diag(inverse @ _meat(readings, system, normal.across, block) @ inverse)
        for block in _BLOCKS_S
    ]
    return inflated(inverse, np.max(robust, axis=0))


def inflated(naive: FloatArray, robust: FloatArray) -> FloatArray:
    """Covariance whose variances are the larger of two; few blocks make the second one noisy."""
    ratio = np.clip(robust / np.diag(naive), 1.0, None)
    scale = np.sqrt(ratio)
    result: FloatArray = naive * np.outer(scale, scale)
    return result


def _meat(
    readings: Sequence[Readings], system: Linearised, across: FloatArray, block_s: float
) -> FloatArray:
    """Sum over blocks of time of the squared scores of the faults, free of the motion."""
    k = across.shape[1]
    sums: dict[tuple[int, int], FloatArray] = {}
    for r in readings:
        c = r.channel
        own = system.by_faults[c] - system.motion[c] @ across
        scores = own * (system.weights[c] * system.white[c])[:, None]
        block = np.floor(r.time_s / block_s).astype(np.intp)
        keys, at = np.unique(np.stack([r.stretch, block], 1), axis=0, return_inverse=True)
        total = np.zeros((len(keys), k))
        np.add.at(total, np.ravel(at), scores)
        for key, row in zip(map(tuple, keys.tolist()), total, strict=True):
            sums[key] = sums.get(key, 0.0) + row
    stacked = np.array(list(sums.values()))
    result: FloatArray = stacked.T @ stacked
    return result
