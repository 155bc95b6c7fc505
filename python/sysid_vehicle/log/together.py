"""Runs of one car that are used together: one log or many, and whether any holds corners."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from .._common.arguments import expect
from .._common.typed import typed
from ..errors import InvalidInput, warn
from .checks import excitation_note
from .log import Log


def several_logs(logs: Log | Sequence[Log], function: str = "driving") -> tuple[Log, ...]:
    """One log or many as many, as they were given to a function.

    Raises
    ------
    InvalidInput
        There is none, or something else; the message says what to make of that.
    """
    single = isinstance(logs, Log | str | Mapping) or hasattr(logs, "columns")
    found: tuple[Any, ...] = tuple(logs) if isinstance(logs, Iterable) and not single else (logs,)
    if not found:
        raise InvalidInput(f"{function}: no log was given; pass one Log or a list of them")
    for log in found:
        expect(log, Log, function)
    return found


@typed
def check_excitation(logs: Log | Sequence[Log]) -> bool:
    """Warn if none of the runs holds corners, so that lateral parameters cannot be determined.

    Parameters
    ----------
    logs : Log or sequence of Log
        Runs that are identified together.

    Returns
    -------
    bool
        Whether at least one run is excited.

    Warns
    -----
    SysidWarning
        If none is; the message tells how far steering and lateral acceleration went.
    """
    found = unexcited(several_logs(logs, "check_excitation"))
    if found:
        warn(found)
    return not found


def unexcited(logs: Sequence[Log]) -> str:
    """What is too little in each of the runs; empty where at least one holds corners."""
    notes = []
    for log in logs:
        columns: dict[str, Any] = {name: log[name] for name in ("ay_mps2", "steer_rad")}
        note = excitation_note(columns, log.rate_hz)
        if not note:
            return ""
        notes.append(f"{log.name}: {note}")
    return "; ".join(notes)


def copies(logs: Sequence[Log], others: Sequence[Log] | None = None) -> list[str]:
    """Names of logs that hold what another one holds, by their readings.

    Parameters
    ----------
    logs : sequence of Log
    others : sequence of Log, optional
        Those to compare with; by default those of `logs` that stand before each.
    """
    return [
        log.name
        for i, log in enumerate(logs)
        if any(_same(log, other) for other in (logs[:i] if others is None else others))
    ]


def _same(log: Log, other: Log) -> bool:
    if log is other:
        return True
    if log.n != other.n or set(log) != set(other):
        return False
    return all(np.array_equal(log[name], other[name], equal_nan=True) for name in log)
