"""Channels that a logger repeats: recorded more slowly than the rows, each value held for several.

A held value is an old measurement. Taken for a fresh one it counts several times over and comes
late by half its period on average, which bends what is identified from it.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import numpy.typing as npt

from .._common.arrays import FloatArray
from .channels import CHANNELS, COMMANDS

_FEWEST_CHANGES = 20
_ON_BEAT = 0.97  # share of the changes that lie whole holding times apart
_EVERY_BEAT = 0.6  # share that are one holding time apart: a moving channel changes at each beat
_LARGEST_EQUAL = 0.8  # share of equal steps from which a channel merely counts in quanta


def blank_held(
    columns: Mapping[str, FloatArray], rate_hz: float, notes: list[str]
) -> dict[str, FloatArray]:
    """Return the columns with repeated values of held channels missing, and tell of it.

    Parameters
    ----------
    columns : mapping of ndarray, shape (n,)
        Channels by name.
    rate_hz : float
        Rate of the rows.
    notes : list of str
        Where the warnings go.
    """
    result = dict(columns)
    for name, values in columns.items():
        rows = held_rows(values) if name in CHANNELS and name != "time_s" else 0.0
        if not rows:
            continue
        repeated = _repeated(values, rows, known=name in COMMANDS)
        result[name] = values.copy()
        result[name][repeated] = np.nan
        notes.append(
            f"{name}: each value is held for {rows:.3g} samples (a channel of "
            f"{rate_hz / rows:.3g} Hz in a log of {rate_hz:.4g} Hz); only the first of each counts "
            f"now, the {repeated.size} repeated ones are missing; record it faster, or leave the "
            f"cells between its samples empty"
        )
    return result


def _repeated(values: FloatArray, beat: float, *, known: bool) -> npt.NDArray[np.intp]:
    """Rows at which the value before is written again.

    A channel that counts in quanta reads the same twice by chance, though no more often than it
    changes by one quantum: what is equal at a beat is a reading then, or only changes would count.
    What drives the model is `known` where it stands: a force that is off for seconds is no gap.
    """
    there = np.flatnonzero(np.isfinite(values))
    step = np.diff(values[there])
    first = np.append(0, np.flatnonzero(step) + 1)
    lengths = np.diff(first)
    several = np.maximum(np.round(lengths / beat), 1.0).astype(np.intp)
    sizes = np.abs(step[step != 0.0])
    if not known and np.sum(several - 1) > np.sum(sizes < 1.5 * sizes.min()):
        several[:] = 1
    again = np.ones(there.size, dtype=bool)
    again[first] = False
    more = several - 1
    nth = np.arange(np.sum(more)) - np.repeat(np.cumsum(more) - more, more) + 1
    begin, length, count = (np.repeat(a, more) for a in (first[:-1], lengths, several))
    again[begin + np.round(nth * length / count).astype(np.intp)] = False
    return there[again]


def held_rows(values: FloatArray) -> float:
    """Return for how many rows each value of a channel is held; 0 if it is not held.

    The changes of a held channel come at a fixed beat, by steps of any size. Those of a quiet
    channel in coarse quanta come at any time, by one quantum.
    """
    known = values[np.isfinite(values)]
    step = np.diff(known)
    changes = np.flatnonzero(step != 0.0)
    if changes.size < _FEWEST_CHANGES:
        return 0.0
    gaps = np.diff(changes)
    low = int(np.percentile(gaps, 5))
    if low < 2:
        return 0.0
    # A beat that is no whole number of rows alternates between two of them.
    beat = float(gaps[(gaps == low) | (gaps == low + 1)].mean())
    multiple = np.maximum(np.round(gaps / beat), 1.0)
    off = np.abs(gaps - multiple * beat)
    on_beat = off <= np.where(multiple == 1.0, max(1.0 - 1e-9, abs(beat - low)), 1.0)
    if np.mean(on_beat) < _ON_BEAT or np.mean(multiple == 1.0) < _EVERY_BEAT:
        return 0.0
    sizes = np.abs(step[changes])
    _, counts = np.unique(np.round(sizes / sizes.min(), 3), return_counts=True)
    return 0.0 if counts.max() > _LARGEST_EQUAL * sizes.size else beat
