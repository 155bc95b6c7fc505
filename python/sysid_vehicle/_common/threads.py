"""Threads that do not outlast the call that started them, and work that ends in time."""

import math
import os
import threading
import time
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from types import TracebackType
from typing import TypeVar

from .. import _core
from .arguments import whole

T = TypeVar("T")
R = TypeVar("R")

_here = threading.local()


def cores() -> int:
    """Cores that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def usual_count() -> int:
    """Threads of a pool that is told no number: all cores, or fewer where somebody said so."""
    return getattr(_here, "most", None) or cores()


@contextmanager
def at_most(threads: int | None) -> Iterator[None]:
    """Pools that this thread opens inside and that are told no number have so many threads."""
    before = getattr(_here, "most", None)
    _here.most = before if threads is None else threads
    try:
        yield
    finally:
        _here.most = before


class _SmallMatrices:
    """Linear algebra has one thread inside; see `small_matrices`."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._inside = 0

    def __enter__(self) -> None:
        with self._lock:
            if self._inside == 0:
                import scipy.linalg  # noqa: F401 - a library that is not loaded has no limit
                from threadpoolctl import ThreadpoolController

                self._controller = ThreadpoolController()
                self._heed_this_thread()
                self._limit = self._controller.limit(limits=1, user_api="blas")
            self._inside += 1

    def __exit__(self, *_: object) -> None:
        with self._lock:
            self._inside -= 1
            if self._inside == 0:
                self._heed_this_thread()
                self._limit.restore_original_limits()
                self._heed_this_thread()

    def _heed_this_thread(self) -> None:
        """Newer versions of threadpoolctl obey the first thread that ever set a limit, alone."""
        for library in self._controller.lib_controllers:
            if hasattr(library, "clear_controlling_thread"):
                library.clear_controlling_thread(force=True)


small_matrices = _SmallMatrices()
"""For `with`: on small matrices threads of linear algebra wait for each other most of the time.

Their number is one of the whole process, and sums differ with it in their last digits. The first
thread that comes in sets it, and the last one that leaves brings back what it was.
"""


class TimeUp(Exception):
    """The time that work was given is over (`before`)."""


def before(ends: float, work: Callable[[], R], otherwise: R) -> R:
    """What work gives, or something else if it is not done in time.

    Searches ask between two passes over the data whether it is time to stop (`check_time`), those
    in pools that the work opens too.

    Parameters
    ----------
    ends : float
        By `time.perf_counter`.
    work : callable
    otherwise : object
    """
    outer = _ends()
    _here.ends = min(ends, outer)
    try:
        check_time()
        return work()
    except TimeUp:
        if time.perf_counter() > outer:
            raise  # the work that this one is a part of has no time left either
        return otherwise
    finally:
        _here.ends = outer


def check_time() -> None:
    """Go on, or end what `before` gave its time to.

    Raises
    ------
    TimeUp
    """
    if time.perf_counter() > _ends():
        raise TimeUp


def _ends() -> float:
    found: float = getattr(_here, "ends", math.inf)
    return found


class Workers(ThreadPoolExecutor):
    """A pool of threads for a `with` block that ends with the block.

    When an error or Ctrl-C leaves the block, what has not begun is dropped, and kernels that run
    are stopped within about 50 ms. A plain pool would first finish everything.

    Parameters
    ----------
    count : int, optional
        How many threads; all cores if left out, but one inside a thread of another pool.

    Raises
    ------
    InvalidInput
        `count` is no whole number above zero; the message calls it ``workers``.
    """

    def __init__(self, count: int | None = None) -> None:
        self._stop, self._ends = _core.Stop(), _ends()
        threads = usual_count() if count is None else whole(count, "workers", 1)
        super().__init__(threads, initializer=self._begin)

    def _begin(self) -> None:
        _here.most, _here.ends = 1, self._ends
        self._stop.follow()

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> bool | None:
        """Wait for all work, or stop it after an error."""
        if kind is not None:
            self._stop.set()
            self.shutdown(wait=True, cancel_futures=True)
        return super().__exit__(kind, error, traceback)


def in_parallel(
    function: Callable[[T], R], items: Iterable[T], workers: int | None = None
) -> list[R]:
    """Results of a function for each item, in the order of the items.

    Useful where the function spends its time in kernels, which release the interpreter lock. The
    results are those of a loop; the first error in the order of the items is raised.

    Parameters
    ----------
    function : callable
    items : iterable
    workers : int, optional
        Threads; all cores if left out, but one inside a thread of another pool.
    """
    with Workers(workers) as pool:
        return list(pool.map(function, items))
