"""A pool of processes that does not outlive the process that opened it, however that ends."""

from __future__ import annotations

import os
import signal
import threading
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from multiprocessing import get_context
from multiprocessing.connection import Connection

# Each process has one core: threads of linear algebra would compete with the other processes.
_ALONE = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")


@contextmanager
def process_pool(count: int) -> Iterator[ProcessPoolExecutor]:
    """Open a pool; an error inside the block, Ctrl-C, or the end of this process ends its work.

    Parameters
    ----------
    count : int
        How many processes.
    """
    context = get_context("spawn")  # a copy of a process with threads may hang
    theirs, ours = context.Pipe(duplex=False)
    set_here = [name for name in _ALONE if name not in os.environ]
    for name in set_here:
        os.environ[name] = "1"
    pool = ProcessPoolExecutor(count, mp_context=context, initializer=_begin, initargs=(theirs,))
    try:
        yield pool
    except BaseException:
        ours.close()
        _terminate(pool)  # one that is still being loaded hears nothing else
        raise
    finally:
        pool.shutdown(wait=True, cancel_futures=True)
        ours.close()
        theirs.close()
        for name in set_here:
            os.environ.pop(name, None)


def _terminate(pool: ProcessPoolExecutor) -> None:
    """End the processes of a pool; `terminate_workers` of Python 3.14 does no more."""
    for process in list((getattr(pool, "_processes", None) or {}).values()):
        process.terminate()


def _begin(alive: Connection) -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the process that opened the pool decides
    threading.Thread(target=_end_with, args=(alive,), daemon=True).start()


def _end_with(alive: Connection) -> None:
    try:
        alive.recv()
    except (EOFError, OSError):
        os._exit(1)
