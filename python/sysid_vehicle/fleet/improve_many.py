"""Studies of many logs, side by side, each kept when it ends."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, Executor, Future, wait
from dataclasses import replace
from itertools import islice
from pathlib import Path
from typing import Any

from .._common.arguments import expect, whole
from .._common.files import as_path, write_text
from .._common.progress import with_progress
from .._common.threads import cores
from .._common.typed import typed
from ..effects.catalogue import of_users
from ..errors import SysidError, warn
from ..read import ChannelMap
from .jobs import Car, Drive, Job, check_asked, check_options, jobs_of
from .page import fleet_page
from .pool import process_pool
from .results import Fleet, Row
from .store import Store
from .work import Outcome, define, do, failed

_SUMMARY_EVERY_S = 2.0


@typed
def improve_many(
    cars: Car | Mapping[str, Car],
    logs: Mapping[str, Drive | Sequence[Drive]] | Sequence[Drive | Sequence[Drive]],
    validation: Mapping[str, Drive | Sequence[Drive]] | None = None,
    *,
    out: str | Path,
    executor: Executor | None = None,
    workers: int | None = None,
    channels: str | Path | Mapping[str, Any] | ChannelMap | None = None,
    dbc: str | Path | None = None,
    define: Sequence[str | Path] = (),
    retry: bool = False,
    progress: bool | None = None,
    tell: Callable[[str], None] | None = None,
    **options: Any,
) -> Fleet:
    """Improve the models of many cars or logs, and rank the causes over all of them.

    Each study is written when it ends. The same call goes on where an earlier one stopped.

    Parameters
    ----------
    cars : Vehicle, Model, path, or mapping
        One for all studies, or one for each name of a study or of a car.
    logs : mapping or sequence
        For each study a log, the path of one, or a sequence of those that are fitted together. In
        a mapping by name: ``run``, or ``car/run``.
    validation : mapping, optional
        By name, logs the fit never sees; otherwise `improve` keeps some of the driving.
    out : str or Path
        Folder for the results; it is made if it is not there.
    executor : concurrent.futures.Executor, optional
        What runs the studies; by default processes, one for each core.
    workers : int, optional
        How many processes, if there is no executor.
    channels : str, Path, mapping or ChannelMap, optional
    dbc : str or Path, optional
        As for `read_log`, for all files.
    define : sequence of path
        Python files that define effects; this process and each other one run them. Effects that
        the session has defined go to the other processes with the studies.
    retry : bool
        Whether to try again what failed in an earlier run.
    progress : bool, optional
        Show progress; by default in a terminal or a notebook.
    tell : callable, optional
        Called with a sentence about each study that ends.
    **options
        Arguments of `improve`, for all studies.

    Returns
    -------
    Fleet

    Raises
    ------
    InvalidInput
        An argument cannot be used. What is wrong with a log stands in its row instead.
    SysidError
        The executor broke; all studies that ended are kept.

    Warns
    -----
    SysidWarning
        Of what a study warned of in another process.
    """
    check_options(options, "improve_many")
    if isinstance(channels, Mapping):
        channels = ChannelMap.from_dict(channels)
    elif isinstance(channels, str | Path):
        channels = ChannelMap.from_toml(channels)
    jobs = jobs_of(
        cars,
        logs,
        validation,
        channels=channels,
        dbc=None if dbc is None else as_path(dbc).absolute(),
        define=tuple(as_path(p).absolute() for p in define),
        options=options,
    )
    return run(jobs, out, executor, workers=workers, retry=retry, progress=progress, tell=tell)


def run(
    jobs: Sequence[Job],
    out: str | Path,
    executor: Executor | None = None,
    *,
    workers: int | None = None,
    retry: bool = False,
    progress: bool | None = None,
    tell: Callable[[str], None] | None = None,
) -> Fleet:
    """Do the jobs that `out` does not hold yet; the arguments are those of `improve_many`."""
    count = cores() if workers is None else whole(workers, "workers", 1)
    if executor is not None and not callable(getattr(executor, "submit", None)):
        expect(executor, Executor, "improve_many")
    files = define(dict.fromkeys(path for job in jobs for path in job.define), again=True)
    session = tuple(e for e in of_users() if e.id not in files)
    jobs = [replace(job, effects=session) for job in jobs]
    check_asked(jobs)
    store = Store(out)
    say = tell if tell is not None else _silent
    digests = {job.name: job.digest() for job in jobs}
    rows: dict[str, Row] = {}
    for job in jobs:
        row = store.earlier(job.name, digests[job.name])
        if row is not None and not (retry and row.failure):
            rows[job.name] = row
    if rows:
        say(f"{len(rows)} of {len(jobs)} studies are there already.")
    left = [job for job in jobs if job.name not in rows]
    found = _outcomes(executor, left) if executor is not None else _own(left, count)
    summarised = time.monotonic()
    for outcome in with_progress(found, "studies", total=len(left), shown=progress):
        row = outcome.row
        store.keep(outcome, digests[row.name])
        rows[row.name] = row
        for text in outcome.heard:
            warn(f"{row.name}: {text}")
        say(f"{row.name}: {row.failure or row.verdict.replace('_', ' ')}")
        if time.monotonic() - summarised > _SUMMARY_EVERY_S:
            store.summarise([rows[job.name] for job in jobs if job.name in rows])
            summarised = time.monotonic()
    fleet = Fleet(store.folder, tuple(rows[job.name] for job in jobs))
    store.summarise(fleet.rows)
    write_text(store.folder / "report.html", fleet_page(fleet))
    return fleet


def _outcomes(executor: Executor, jobs: Iterable[Job]) -> Iterator[Outcome]:
    """Outcomes as they come, from somebody else's executor, which takes all jobs at once."""
    jobs = list(jobs)
    left = len(jobs)
    for job, future in _as_they_end(executor, jobs, left):
        error = future.exception()
        if isinstance(error, BrokenExecutor):
            continue
        left -= 1
        # An error: the job could not be sent, or its worker ended.
        yield future.result() if error is None else failed(job, f"{type(error).__name__}: {error}")
    if left:
        raise SysidError(
            f"the executor broke with {left} of {len(jobs)} studies to be done; the others are "
            "kept: run it again"
        )


def _own(jobs: Iterable[Job], count: int) -> Iterator[Outcome]:
    """Outcomes as they come, from processes of this one.

    Only as many jobs as there are processes are on their way: when a process is killed, they are
    those that may have been the reason. Each of them is tried once more, alone.
    """
    left = deque(jobs)
    while left:
        suspects: list[Job] = []
        with process_pool(min(count, len(left))) as pool:
            for job, future in _as_they_end(pool, _taken(left), count):
                if isinstance(future.exception(), BrokenExecutor):
                    suspects.append(job)
                else:
                    yield future.result()
        for job in suspects:
            with process_pool(1) as pool:
                future = pool.submit(do, job)
                if isinstance(future.exception(), BrokenExecutor):
                    yield failed(
                        job,
                        "the process that worked on it was killed twice, perhaps for want of "
                        "memory; study it on a machine with more, or shorten the log",
                    )
                else:
                    yield future.result()


def _taken(left: deque[Job]) -> Iterator[Job]:
    while left:
        yield left.popleft()


def _as_they_end(
    executor: Executor, jobs: Iterable[Job], most: int
) -> Iterator[tuple[Job, Future[Outcome]]]:
    """Jobs and their futures when they end, at most so many on their way; ends where it breaks."""
    jobs = iter(jobs)
    on_the_way: dict[Future[Outcome], Job] = {}
    broken = False
    while True:
        if not broken:
            for job in islice(jobs, most - len(on_the_way)):
                try:
                    on_the_way[executor.submit(do, job)] = job
                except BrokenExecutor as error:
                    broken = True
                    lost: Future[Outcome] = Future()
                    lost.set_exception(error)
                    on_the_way[lost] = job
                    break
        if not on_the_way:
            return
        ended, _ = wait(on_the_way, return_when=FIRST_COMPLETED)
        for future in ended:
            broken = broken or isinstance(future.exception(), BrokenExecutor)
            yield on_the_way.pop(future), future


def _silent(_: str) -> None:
    pass
