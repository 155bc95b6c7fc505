"""Readings that a file gives a name, such as "signal not available", in place of a measurement."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import numpy.typing as npt

from ..._common.arrays import FloatArray


def without_named(
    channel: str,
    values: FloatArray,
    texts: Mapping[str, npt.NDArray[np.bool_]],
    notes: list[str],
) -> FloatArray:
    """Return values without those that have a name; all of them where every one has.

    A channel of which some readings are numbers measures; its named ones say why there is none. One
    of which all have names is a state, such as a gear, and keeps its numbers.

    Parameters
    ----------
    channel : str
        Its name, for the note.
    values : ndarray, shape (n,)
        What the readings are as numbers.
    texts : mapping of ndarray of bool, shape (n,)
        Where each name stands.
    notes : list of str
        Where the warning goes.
    """
    named = np.zeros(values.size, dtype=bool)
    for where in texts.values():
        named |= where
    if not named.any() or named.all():
        return values
    first = int(np.argmax(named))
    word = next(text for text, where in texts.items() if where[first])
    notes.append(
        f"{channel}: {np.count_nonzero(named)} samples are '{word}' or have another name in place "
        f"of a number, first sample {first}; they count as missing: check the sensor"
    )
    return np.where(named, np.nan, values)
