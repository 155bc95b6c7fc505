"""Sensors that drop out to a value that a car may well have, such as zero, and stand there.

The speeds and the yaw rate of a car are states: they never jump. Taken for measurements, such
values bend whatever is learned around them, and no range of a channel tells them.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from .._common.arrays import FloatArray
from .channels import CHANNELS
from .grid import between
from .signals import runs, standing

STATES = ("vx_mps", "vy_mps", "yaw_rate_radps")
CREEP_MPS = 1.0  # below, many sensors of speed read zero: it is no dropout


def blank_standing(
    columns: Mapping[str, FloatArray], time_s: FloatArray, notes: list[str]
) -> dict[str, FloatArray]:
    """Return the columns without what states of the car jump to and stand at; tell of it.

    Parameters
    ----------
    columns : mapping of ndarray, shape (n,)
        Channels by name.
    time_s : ndarray, shape (n,)
        Their times, for messages.
    notes : list of str
        Where the warnings go.
    """
    result = dict(columns)
    for name in STATES:
        found = standing(columns[name]) if name in columns else np.empty(0, dtype=np.intp)
        if found.size == 0:
            continue
        lost = np.zeros(time_s.size, dtype=bool)
        lost[found] = True
        known = np.flatnonzero(np.isfinite(columns[name]))
        for a, b in runs(lost):
            before = columns[name][known[np.searchsorted(known, a) - 1]]
            if name == "vx_mps" and abs(columns[name][a] - before) < CREEP_MPS:
                lost[a:b] = False
        blocks = runs(lost)
        if not blocks:
            continue
        a, b = max(blocks, key=lambda block: block[1] - block[0])
        more = f" and {len(blocks) - 1} more time(s)" if len(blocks) > 1 else ""
        notes.append(
            f"{name}: jumps to {columns[name][a]:.4g} {CHANNELS[name].unit} and stands there at "
            f"{between(a, b, time_s)}{more}, as no car moves; {np.count_nonzero(lost)} samples "
            f"count as missing: check the sensor"
        )
        result[name] = np.where(lost, np.nan, columns[name])
    return result
