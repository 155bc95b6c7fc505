"""Time: refuse what cannot be ordered, and bring every log onto a uniform grid."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from ..errors import InvalidInput
from ._channels import FloatArray

_JITTER = 0.01  # relative step variation up to which a log counts as uniform
_GAP_STEPS = 5.0
_MAX_GROWTH = 20  # a grid this many times longer than the log means a broken time channel


def at(index: int, time_s: FloatArray) -> str:
    """Return ``sample 12 (t = 0.12 s)`` for messages."""
    return f"sample {index} (t = {time_s[index]:.6g} s)"


def between(start: int, stop: int, time_s: FloatArray) -> str:
    """Return ``samples 3 to 8 (t = 0.03 to 0.08 s)`` for the half-open range start:stop."""
    last = stop - 1
    return f"samples {start} to {last} (t = {time_s[start]:.6g} to {time_s[last]:.6g} s)"


def check_time(time_s: FloatArray) -> None:
    """Raise :class:`InvalidInput` unless time is finite, increasing and plausibly in seconds."""
    missing = np.flatnonzero(~np.isfinite(time_s))
    if missing.size:
        i = int(missing[0])
        before = f" after t = {time_s[i - 1]:.6g} s" if i > 0 else ""
        raise InvalidInput(
            f"time_s: not a finite number at sample {i}{before} ({missing.size} such samples); "
            f"fill in the time or delete these rows"
        )
    step = np.diff(time_s)
    wrong = np.flatnonzero(step <= 0.0)
    if wrong.size:
        i = int(wrong[0]) + 1
        if step[i - 1] == 0.0:
            raise InvalidInput(
                f"time_s: repeats at {at(i, time_s)}, equal to sample {i - 1}; "
                f"delete one of the two rows"
            )
        raise InvalidInput(
            f"time_s: goes back at {at(i, time_s)} after {time_s[i - 1]:.6g} s; sort the rows, "
            f"or cut the log there and read the parts as separate logs"
        )
    typical = float(np.median(step)) if step.size else 0.0
    if typical >= 1.0:
        factor = "1e-6" if typical >= 1000.0 else "0.001"
        unit = "micro" if typical >= 1000.0 else "milli"
        raise InvalidInput(
            f"time_s: steps of {typical:.4g} from sample 0 (t = {time_s[0]:.6g}) on look like "
            f"{unit}seconds; put factor = {factor} in the channel map"
        )


def to_grid(
    time_s: FloatArray, columns: Mapping[str, FloatArray]
) -> tuple[FloatArray, dict[str, FloatArray], str]:
    """Bring all columns onto a uniform time grid.

    Parameters
    ----------
    time_s : ndarray, shape (n,)
        Time that :func:`check_time` accepted, n >= 2.
    columns : mapping of ndarray, shape (n,)
        The other channels.

    Returns
    -------
    grid : ndarray, shape (m,)
        Uniform time.
    columns : dict of ndarray, shape (m,)
        The columns on that grid: as they were if time was uniform to 1 %, else interpolated
        linearly at the median rate, with NaN inside gaps of more than five steps.
    note : str
        What was done, in words; empty if nothing had to be done.
    """
    step = np.diff(time_s)
    n = time_s.size
    even = np.linspace(time_s[0], time_s[-1], n)
    mean_step = (time_s[-1] - time_s[0]) / (n - 1)
    regular = np.abs(step / mean_step - 1.0).max() <= _JITTER
    if regular or _is_rounded(time_s, mean_step):
        return even, dict(columns), ""

    dt = float(np.median(step))
    count = int(np.floor((time_s[-1] - time_s[0]) / dt + 1e-6)) + 1
    worst = int(np.argmax(step))
    if count > _MAX_GROWTH * n + 1000:
        raise InvalidInput(
            f"time_s: jumps by {step[worst]:.6g} s at {at(worst + 1, time_s)} while the usual step "
            f"is {dt:.4g} s; cut the log there and read the parts as separate logs"
        )
    grid = time_s[0] + dt * np.arange(count)
    left = np.clip(np.searchsorted(time_s, grid + 1e-6 * dt, side="right") - 1, 0, n - 2)
    weight = np.clip((grid - time_s[left]) / step[left], 0.0, 1.0)
    on_left, on_right = weight < 1e-6, weight > 1.0 - 1e-6
    in_gap = (step[left] > _GAP_STEPS * dt) & ~on_left & ~on_right
    result = {}
    for name, values in columns.items():
        a, b = values[left], values[left + 1]
        mixed = np.where(on_left, a, np.where(on_right, b, (1.0 - weight) * a + weight * b))
        mixed[in_gap] = np.nan
        result[name] = mixed
    return grid, result, _note(time_s, step, dt)


def _is_rounded(time_s: FloatArray, mean_step: float) -> bool:
    """Tell whether uneven steps come only from writing an even time with few decimals."""
    for decimals in range(2, 7):
        quantum = 10.0**-decimals
        ticks = time_s / quantum
        if np.abs(ticks - np.round(ticks)).max() < 1e-3:
            index = np.arange(time_s.size)
            line = np.polyval(np.polyfit(index, time_s - time_s[0], 1), index) + time_s[0]
            return bool(quantum < mean_step and np.abs(time_s - line).max() <= 0.55 * quantum)
    return False


def _note(time_s: FloatArray, step: FloatArray, dt: float) -> str:
    gaps = np.flatnonzero(step > _GAP_STEPS * dt)
    inside = step[step <= _GAP_STEPS * dt]
    # Lost rows leave whole multiples of dt; only other steps mean that values were interpolated.
    uneven = np.flatnonzero(np.abs(inside / dt - np.round(inside / dt)) > _JITTER)
    parts = []
    if uneven.size:
        spread = f"{inside.min():.3g} to {inside.max():.3g} s"
        parts.append(f"has steps of {spread}; all channels were resampled at {1.0 / dt:.4g} Hz")
    elif gaps.size == 0:
        lost = np.flatnonzero(step > 1.5 * dt)
        parts.append(
            f"lacks rows in {lost.size} places, first at {at(int(lost[0]) + 1, time_s)}; "
            f"the missing samples were interpolated"
        )
    if gaps.size:
        first = int(gaps[0])
        parts.append(
            f"has {gaps.size} gap{'s' if gaps.size > 1 else ''} of up to {step[gaps].max():.4g} s, "
            f"first before {at(first + 1, time_s)}; the gaps hold NaN now, and no run of the "
            f"model crosses one longer than 0.1 s"
        )
    return "time_s: " + "; it also ".join(parts) + "; record at a fixed rate to avoid this"
