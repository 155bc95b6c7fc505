"""Channels that repeat one value for a second or more while the car demonstrably moves.

So reads a receiver without satellites, or a bus that has lost a sender. Taken for measurements,
hundreds of equal readings bend whatever is learned beside them.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from .._common.arrays import FloatArray, filled
from .channels import CHANNELS
from .checks import excitation_note
from .grid import between
from .signals import STANDS_JUMP, runs, smoothed
from .standing import CREEP_MPS, STATES

_FROZEN_S = 1.0
# What a channel must have missed, in its reference's unit, before a constant run counts as frozen.
_MISSES = {
    "ay_mps2": 1.0,
    "yaw_rate_radps": 1.0,
    "vx_mps": 2.0,
    "ax_mps2": 2.0,
    "vy_mps": 2.0,
}
_ONE_QUANTUM = 1.5  # times the smallest step, up to which a step is one quantum
_LATERAL = ("yaw_rate_radps", "ay_mps2", "vy_mps")
_MOST = 0.5  # of a channel's samples: what stands longer than it moves is another kind of column

Run = tuple[int, int]


def blank_frozen(
    columns: Mapping[str, FloatArray], time_s: FloatArray, notes: list[str]
) -> dict[str, FloatArray]:
    """Return the columns without what is frozen; tell of it in one note per channel.

    Without lateral excitation the lateral channels may well be constant, so only the others are
    looked at then.

    Parameters
    ----------
    columns : mapping of ndarray, shape (n,)
        Channels by name.
    time_s : ndarray, shape (n,)
        Their times.
    notes : list of str
        Where the warnings go.
    """
    rate_hz = 1.0 / float(np.median(np.diff(time_s)))
    excited = not excitation_note(columns, rate_hz)
    references = _references(columns, rate_hz)
    result = dict(columns)
    for name, values in columns.items():
        known = np.flatnonzero(np.isfinite(values))
        still = name in _LATERAL and not excited
        if name not in _MISSES or still or np.ptp(values[known]) == 0.0:
            continue
        blocks = _frozen(name, values, time_s, references.get(name))
        if not blocks:
            continue
        lost = np.zeros(values.size, dtype=bool)
        for a, b in blocks:
            lost[a:b] = True
        a, b = max(blocks, key=lambda block: block[1] - block[0])
        count, most = np.count_nonzero(lost), np.mean(lost[known]) > _MOST
        told = (
            f"these are {count} of {known.size} samples, too many to go without: check the sensor "
            f"and the column"
            if most
            else f"{count} samples count as missing: check the sensor and its link, or cut the log "
            f"there"
        )
        more = f" and {len(blocks) - 1} more time(s)" if len(blocks) > 1 else ""
        notes.append(
            f"{name}: frozen at {values[a]:.6g} {CHANNELS[name].unit} at {between(a, b, time_s)}"
            f"{more} while the car moves on; {told}"
        )
        result[name] = values if most else np.where(lost, np.nan, values)
    return result


def _frozen(
    name: str, values: FloatArray, time_s: FloatArray, reference: FloatArray | None
) -> list[Run]:
    """Runs of equal values over which another channel moves, or which end by a long jump."""
    known = np.flatnonzero(np.isfinite(values))
    step = np.diff(values[known])
    # Of a run the steps numbered a to b - 1 are none: it holds the known samples a to b.
    at_s = time_s[known]
    apart_s = np.diff(at_s)
    # A slower channel is empty between its own samples; where it is empty for longer a run ends.
    on = apart_s <= 1.5 * np.median(apart_s)
    equal = [(a, b) for a, b in runs((step == 0.0) & on) if at_s[b] - at_s[a] > _FROZEN_S]
    jumps = _jumps(name, step, apart_s, equal)
    found = []
    for a, b in equal:
        first, stop = int(known[a]), int(known[b]) + 1
        if name == "vx_mps" and abs(values[first]) < CREEP_MPS:
            continue
        missed = reference is not None and np.ptp(reference[first:stop]) > _MISSES[name]
        if (missed and not _is_quiet(step, a, b)) or b in jumps:
            found.append((first, stop))
    return found


def _is_quiet(step: FloatArray, a: int, b: int) -> bool:
    """Whether a run ends as one of a channel that moves by less than it counts in: by one quantum.

    Of a run to the end of the log it is asked how it began.
    """
    size = np.abs(step)
    edge = b if b < step.size else a - 1
    return edge >= 0 and bool(size[edge] < _ONE_QUANTUM * size[size > 0.0].min())


def _jumps(name: str, step: FloatArray, apart_s: FloatArray, equal: list[Run]) -> set[int]:
    """Of runs of equal values, the ends after which a state of the car jumps: it had moved on.

    A state goes on from where it was. The jump is far longer than all steps elsewhere.
    """
    ends = [b for _, b in equal if b < step.size]
    if name not in STATES or not ends:
        return set()
    size = np.abs(step)
    elsewhere = np.delete(size, [*ends, *(a - 1 for a, _ in equal if a > 0)])
    least = STANDS_JUMP * float(np.max(elsewhere, initial=0.0))
    if name == "vx_mps":
        least = max(least, CREEP_MPS)
    usual_s = 1.5 * float(np.median(apart_s))
    return {b for b in ends if size[b] > least > 0.0 and apart_s[b] < usual_s}


def _references(columns: Mapping[str, FloatArray], rate_hz: float) -> dict[str, FloatArray]:
    """Return for some channels another one that cannot move while they stand still."""
    width = round(0.2 * rate_hz)
    ay = smoothed(columns["ay_mps2"], width)
    references = {
        "ay_mps2": smoothed(filled(columns["vx_mps"]) * filled(columns["yaw_rate_radps"]), width),
        "yaw_rate_radps": ay,
        "vy_mps": ay,
    }
    if "ax_mps2" in columns:
        references["vx_mps"] = smoothed(columns["ax_mps2"], width)
        speed = smoothed(columns["vx_mps"], width)
        references["ax_mps2"] = np.gradient(speed, 1.0 / rate_hz)
    return references
