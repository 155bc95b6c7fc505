"""Commands that stand until the next one, as a controller sends them.

A model takes its inputs along straight lines between samples. A command that is held is on average
half its period later than the line through its samples, which would be found as a delay of the
car. So it is given at each sample as its mean over the step around it, which lines keep.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from ..._common.arrays import FloatArray
from ...log import CHANNELS, own_period

_LONGEST = 5.0  # periods of its own for which a command stands: then it was lost


def stand(columns: Mapping[str, FloatArray], held: Mapping[str, float]) -> dict[str, FloatArray]:
    """Return columns whose commands stand until the next one, at the rows of the quickest other.

    Parameters
    ----------
    columns : mapping of ndarray, shape (n,)
        With ``time_s``; a channel that is slower than the rows is missing in between.
    held : mapping of str to float
        Which of them are such commands, and how late each was written [s].
    """
    result = dict(columns)
    time_s = columns["time_s"]
    if time_s.size < 2 or not (np.diff(time_s) > 0.0).all():
        return result  # the log is refused for it
    others = [x for c, x in columns.items() if c in CHANNELS and c != "time_s" and c not in held]
    periods = [own_period(time_s, x) for x in others]
    for channel, delay_s in held.items():
        values = columns[channel]
        known = np.isfinite(values)
        if np.count_nonzero(known) < 2 or not others:
            continue
        quickest = int(np.argmin(periods))
        at = np.isfinite(others[quickest])
        filled = np.full(time_s.shape, np.nan)
        filled[at] = _means(
            time_s[known], values[known], time_s[at] + delay_s, float(periods[quickest])
        )
        result[channel] = filled
    return result


def _means(time_s: FloatArray, values: FloatArray, at_s: FloatArray, step_s: float) -> FloatArray:
    """Means over a step about each time; not known before the first and long after one."""
    changes = np.append(True, np.diff(values) != 0.0)
    period = float(np.median(np.diff(time_s)))
    last = np.searchsorted(time_s, at_s + 1e-9 * step_s, side="right") - 1
    known = (last >= 0) & (at_s - time_s[last] < max(_LONGEST * period, step_s))
    begins, levels = time_s[changes], values[changes]
    passed = np.append(0.0, np.cumsum(levels[:-1] * np.diff(begins)))
    low, high = at_s - 0.5 * step_s, at_s + 0.5 * step_s
    first, then = (np.maximum(np.searchsorted(begins, x, side="right") - 1, 0) for x in (low, high))
    held = passed[then] - passed[first]
    held += levels[then] * (high - begins[then]) - levels[first] * (low - begins[first])
    mean = np.where(first == then, levels[then], held / step_s)
    return np.where(known, mean, np.nan)
