"""Time: refuse what cannot be ordered, and bring every log onto a uniform grid."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import combinations

import numpy as np

from .._common.arrays import FloatArray
from ..errors import InvalidInput
from .channels import CHANNELS, MEASURED
from .interpolate import ROUNDED, evenness, interpolated, quantum_of

_JITTER = 0.01  # relative step variation up to which a log counts as uniform
_GAP_STEPS = 5.0
_LONGEST_S = 1e18  # nanoseconds of thirty years: time beyond is broken
_SECONDS_BELOW = 1.0
# Steps below these look like that unit: a rate from 2.5 Hz to 2.5 kHz.
_FINER = ((400.0, "milli", "0.001"), (4e5, "micro", "1e-6"), (np.inf, "nano", "1e-9"))
_SHORTEST_S = 1e-5  # no car is logged at 100 kHz: 0.5 s is more than that in days
_MIN_STEP = 1e-6  # of the usual step: below, two rows are one that was written twice
_OWN_GAP = 1.5  # a channel is interpolated between samples that are no farther apart, in periods
_BEATS = 5  # longer steps, evenly spaced, that show a step of no whole number of decimals
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
            repeats = int(np.count_nonzero(step == 0.0))
            often = f" ({repeats} such samples)" if repeats > 1 else ""
            rounded = (
                ", or, where the times are rounded, number the rows in the channel map: "
                "time_s = { rate_hz = 100 }, with the rate of the log"
            )
            raise InvalidInput(
                f"time_s: repeats at {at(i, time_s)}, equal to sample {i - 1}{often}; "
                f"delete one of the two rows{rounded if repeats > 1 else ''}"
            )
        raise InvalidInput(
            f"time_s: goes back at {at(i, time_s)} after {time_s[i - 1]:.6g} s; sort the rows, "
            f"or cut the log there and read the parts as separate logs"
        )
    span = float(time_s[-1]) - float(time_s[0])
    if not span < _LONGEST_S:
        raise InvalidInput(
            f"time_s: goes from {time_s[0]:.6g} to {time_s[-1]:.6g} s (sample {time_s.size - 1}), "
            f"which is no drive; give the time in seconds"
        )
    typical = float(np.median(step)) if step.size else 0.0
    if typical >= _SECONDS_BELOW:
        unit, factor = next((u, f) for below, u, f in _FINER if typical < below)
        raise InvalidInput(
            f"time_s: steps of {typical:.4g} from sample 0 (t = {time_s[0]:.6g}) on look like "
            f"{unit}seconds; put factor = {factor} in the channel map"
        )
    if step.size and typical < _SHORTEST_S:
        raise InvalidInput(
            f"time_s: steps of {typical:.4g} from sample 0 (t = {time_s[0]:.6g}) on look like "
            f"days, as spreadsheets count them, or hours; put factor = 86400 or 3600 in the "
            f"channel map"
        )
    if step.size and float(step.min()) < _MIN_STEP * typical:
        i = int(np.argmin(step)) + 1
        raise InvalidInput(
            f"time_s: nearly repeats at {at(i, time_s)}, {step[i - 1]:.3g} s after sample {i - 1}; "
            f"delete one of the two rows"
        )


def own_period(time_s: FloatArray, values: FloatArray) -> float:
    """Return the usual time between two samples at which a channel holds a value [s]."""
    own = time_s[np.isfinite(values)]
    return float(np.median(np.diff(own))) if own.size > 1 else float(time_s[-1] - time_s[0])


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
        The columns on that grid: as they were if time was uniform to 1 %. Else each is
        interpolated between its own samples, at the rate of the quickest channel, with NaN in its
        holes and inside gaps of more than five steps: linearly, or where a measured channel has
        a rate of its own as `interpolated` does, which leaves white noise white. A channel
        that is sampled more slowly than the grid keeps as many values as it had, each at the
        nearest grid point.
    note : str
        What was done, in words; empty if nothing had to be done.
    """
    step = np.diff(time_s)
    n = time_s.size
    even = np.linspace(time_s[0], time_s[-1], n)
    mean_step = (time_s[-1] - time_s[0]) / (n - 1)
    regular = np.abs(step / mean_step - 1.0).max() <= _JITTER
    several = not regular and _are_several_clocks(time_s, columns)
    if regular or (not several and _is_rounded(time_s, mean_step)):
        return even, dict(columns), ""

    periods = {name: own_period(time_s, values) for name, values in columns.items()}
    # Rows of several sources may lie between each other: the quickest one sets the rate.
    dt = min(
        (periods[name] for name in columns if name in CHANNELS), default=float(np.median(step))
    )
    count = int(np.floor((time_s[-1] - time_s[0]) / dt + 1e-6)) + 1
    worst = int(np.argmax(step))
    if count > _MAX_GROWTH * n + 1000:
        raise InvalidInput(
            f"time_s: jumps by {step[worst]:.6g} s at {at(worst + 1, time_s)} while the usual step "
            f"is {dt:.4g} s; cut the log there and read the parts as separate logs"
        )
    grid = time_s[0] + dt * np.arange(count)
    result = {
        name: _on_grid(grid, dt, time_s, values, periods[name], sharp=name in MEASURED)
        for name, values in columns.items()
    }
    slow = {name: p for name, p in periods.items() if name in CHANNELS and is_slow(p, dt)}
    remedy = "trigger all sensors by one clock" if several else "record at a fixed rate"
    return grid, result, f"{_note(time_s, step, dt, slow)}; {remedy} to avoid this"


def _are_several_clocks(time_s: FloatArray, columns: Mapping[str, FloatArray]) -> bool:
    """Tell whether channels with rates of their own have their rows between each other's.

    Two of 100 Hz that are 4 ms apart make steps of 4 and 6 ms, which look like 5 ms that were
    rounded to whole ones.
    """
    masks = {np.isfinite(x).tobytes(): np.isfinite(x) for c, x in columns.items() if c in CHANNELS}
    even = [mask for mask in masks.values() if evenness(time_s[mask]) is not None]
    return any(not (a & b).any() for a, b in combinations(even, 2))


def _on_grid(
    grid: FloatArray,
    dt: float,
    time_s: FloatArray,
    values: FloatArray,
    period: float,
    *,
    sharp: bool,
) -> FloatArray:
    """Interpolate one channel between its own samples, never across its holes."""
    rows = np.flatnonzero(np.isfinite(values))
    result = np.full(grid.size, np.nan)
    if rows.size == 0:
        return result
    own, known = time_s[rows], values[rows]
    if rows.size > 1:
        step = np.diff(own)
        left = np.clip(np.searchsorted(own, grid + 1e-6 * dt, side="right") - 1, 0, own.size - 2)
        weight = np.clip((grid - own[left]) / step[left], 0.0, 1.0)
        weight[weight * step[left] < 1e-6 * dt] = 0.0
        weight[(1.0 - weight) * step[left] < 1e-6 * dt] = 1.0
        inside = (grid > own[0] - 1e-6 * dt) & (grid < own[-1] + 1e-6 * dt)
        # Rows that are lost altogether may be bridged farther than values that are missing.
        longest = np.where(np.diff(rows) == 1, max(_GAP_STEPS * dt, _OWN_GAP * period), 0.0)
        bridged = (step <= np.maximum(longest, _OWN_GAP * period))[left]
        known_there = inside & (bridged | (weight == 0.0) | (weight == 1.0))
        mixed = (1.0 - weight) * known[left] + weight * known[left + 1]
        mixed = np.where(
            weight == 0.0, known[left], np.where(weight == 1.0, known[left + 1], mixed)
        )
        if sharp:
            between = np.flatnonzero(known_there & (weight != 0.0) & (weight != 1.0))
            better = interpolated(own, known, grid[between])
            mixed[between] = np.where(np.isfinite(better), better, mixed[between])
        result[known_there] = mixed[known_there]
    if not is_slow(period, dt) and rows.size > 1:
        return result
    fresh = np.full(grid.size, np.nan)
    nearest = np.clip(np.round((own - grid[0]) / dt).astype(np.intp), 0, grid.size - 1)
    fresh[nearest] = known  # where there is nothing to interpolate with, the sample as it is
    both = np.isfinite(fresh) & np.isfinite(result)
    fresh[both] = result[both]
    return fresh


def is_slow(period: float, dt: float) -> bool:
    """Tell whether a channel is sampled more slowly than a grid of step `dt`."""
    return period > _OWN_GAP * dt


def _is_rounded(time_s: FloatArray, mean_step: float) -> bool:
    """Tell whether uneven steps come only from writing an even time with few decimals, or bits."""
    quantum = quantum_of(time_s)
    if not quantum:
        return False
    steps = np.diff(np.round(time_s / quantum))
    usual = np.median(steps)
    if np.all(steps % usual == 0.0) and np.count_nonzero(steps > usual) < _BEATS:
        return False  # so few longer steps are lost rows: a rate a hair off is rarer
    index = np.arange(time_s.size)
    line = np.polyval(np.polyfit(index, time_s - time_s[0], 1), index) + time_s[0]
    return bool(quantum < mean_step and np.abs(time_s - line).max() <= ROUNDED * quantum)


def _note(time_s: FloatArray, step: FloatArray, dt: float, slow: Mapping[str, float]) -> str:
    gaps = np.flatnonzero(step > _GAP_STEPS * dt)
    inside = step[step <= _GAP_STEPS * dt]
    # Lost rows leave whole multiples of dt; only other steps mean that values were interpolated.
    whole = np.maximum(np.round(inside / dt), 1.0)
    uneven = np.flatnonzero(np.abs(inside / dt - whole) > _JITTER)
    parts = []
    if uneven.size:
        spread = f"{inside.min():.3g} to {inside.max():.3g} s"
        apart = "".join(f", {name} at its own {1.0 / p:.3g} Hz" for name, p in slow.items())
        parts.append(
            f"has steps of {spread}; all channels were resampled at {1.0 / dt:.4g} Hz{apart}"
        )
    elif gaps.size == 0:
        lost = np.flatnonzero(step > 1.5 * dt)
        if lost.size:
            parts.append(
                f"lacks rows in {lost.size} places, first at {at(int(lost[0]) + 1, time_s)}; "
                f"the missing samples were interpolated"
            )
        else:
            parts.append(
                f"drifts from even steps; all channels were resampled at {1.0 / dt:.4g} Hz"
            )
    if gaps.size:
        first = int(gaps[0])
        parts.append(
            f"has {gaps.size} gap{'s' if gaps.size > 1 else ''} of up to {step[gaps].max():.4g} s, "
            f"first before {at(first + 1, time_s)}; the gaps hold NaN now, and no run of the "
            f"model crosses one longer than 0.1 s"
        )
    return "time_s: " + "; it also ".join(parts)
