"""The picture of a channel beside what it should have read."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from .._common.arrays import FloatArray
from .._common.style import AFTER, MEASURED, axes_or_new, tidy
from ..log import Log
from .kinematics.equations import Readings
from .kinematics.motion import Stretch
from .moments import Moment

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes


def drawn(
    readings: Readings,
    expected: FloatArray,
    stretches: Sequence[Stretch],
    logs: Sequence[Log],
    moments: Sequence[Moment],
    ax: Axes | None,
) -> Axes:
    """Draw one channel onto `ax`, or onto a new one: log after log, what was left out shaded."""
    ax = axes_or_new(ax, 8.0, 2.6)
    begins = np.cumsum([0.0, *(log["time_s"][-1] - log["time_s"][0] for log in logs)])
    shifts = [begins[k] - log["time_s"][0] if k else 0.0 for k, log in enumerate(logs)]
    for k, stretch in enumerate(stretches):
        at, shift = readings.stretch == k, shifts[stretch.log]
        time_s = readings.time_s[at] + shift
        (read,) = ax.plot(time_s, readings.values[at], color=MEASURED, linewidth=0.6)
        (of,) = ax.plot(time_s, expected[at], color=AFTER, linewidth=0.9)
    shown: list[Artist] = [read, of]
    told = ["read", "of the common motion"]
    for m in (m for m in moments if m.channel == readings.channel):
        shift = shifts[m.number]
        shown.append(ax.axvspan(m.from_s + shift, m.until_s + shift, color="0.85", zorder=0))
        told.append(f"left out, off by {m.off:.2g}")
    for begin, later in zip(begins[1:], logs[1:], strict=False):
        ax.axvline(begin, color="0.6", linewidth=0.8)
        at, by = ("data", "axes fraction"), "offset points"
        ax.annotate(later.name, (begin, 1.0), (3, -9), xycoords=at, textcoords=by)
    ax.legend(shown, told, fontsize="small")
    along = "time_s" if len(logs) == 1 else "time_s, log after log"
    return tidy(ax, xlabel=along, ylabel=readings.channel)
