"""Outcomes on disk as they come, one JSON line each, so that an exam can be broken off."""

from __future__ import annotations

import json
import os
from collections.abc import Iterable, Iterator, Sequence
from concurrent.futures import Executor, Future, ProcessPoolExecutor, as_completed
from contextlib import nullcontext
from pathlib import Path

from design import Trial
from trial import Outcome, examine


def read(path: Path) -> dict[str, Outcome]:
    """Outcomes by the key of their trial; a last line that was cut off is left out."""
    found: dict[str, Outcome] = {}
    if path.exists():
        for line in path.read_text(encoding="utf-8").splitlines():
            try:
                outcome = json.loads(line)
            except json.JSONDecodeError:
                continue
            found[outcome["key"]] = outcome
    return found


def append(path: Path, outcome: Outcome) -> None:
    """Add one line in a single write, which no other process can come between."""
    cut_off = path.exists() and path.stat().st_size > 0 and path.read_bytes()[-1:] != b"\n"
    line = ("\n" if cut_off else "") + json.dumps(outcome) + "\n"
    handle = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_APPEND, 0o644)
    try:
        os.write(handle, line.encode())
    finally:
        os.close(handle)


def run(
    trials: Sequence[Trial],
    *,
    executor: Executor | None = None,
    workers: int = 1,
    path: Path | None = None,
) -> Iterator[Outcome]:
    """Give the outcomes of trials as they come, those on disk first.

    Parameters
    ----------
    executor : concurrent.futures.Executor, optional
        Of any kind, also of a cluster; it has to find the modules of this folder.
    workers : int
        Processes, where no executor is given; one works in this process.
    path : Path, optional
        File to which outcomes are added. Trials that are in it are not done again.
    """
    known = {} if path is None else read(path)
    yield from (known[t.key] for t in trials if t.key in known)
    left = [t for t in trials if t.key not in known]
    for outcome in _outcomes(left, executor, workers):
        if path is not None:
            append(path, outcome)
        yield outcome


def _outcomes(
    trials: Sequence[Trial], executor: Executor | None, workers: int
) -> Iterable[Outcome]:
    if executor is None and workers <= 1:
        yield from map(examine, trials)
        return
    own = ProcessPoolExecutor(workers) if executor is None else nullcontext(executor)
    with own as pool:
        pending: list[Future[Outcome]] = [pool.submit(examine, t) for t in trials]
        for done in as_completed(pending):
            yield done.result()
