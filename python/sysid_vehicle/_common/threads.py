"""Threads that do not outlast the call that started them, and work that ends in time."""

import math
import os
import threading
import time
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager, suppress
from types import TracebackType
from typing import Any, Generic, TypeVar

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
        How many threads; all cores if left out, but one inside a thread of another pool. There
        `map` has those of that pool help which have nothing to do.

    Raises
    ------
    InvalidInput
        `count` is no whole number above zero; the message calls it ``workers``.
    """

    def __init__(self, count: int | None = None) -> None:
        self._stop, self._ends = _core.Stop(), _ends()
        self._outer = _outer() if count is None else None
        threads = usual_count() if count is None else whole(count, "workers", 1)
        super().__init__(threads, initializer=self._begin)

    def _begin(self) -> None:
        _here.most, _here.ends, _here.pool = 1, self._ends, self._outer or self
        self._stop.follow()

    def map(
        self,
        fn: Callable[..., R],
        *iterables: Iterable[Any],
        timeout: float | None = None,
        chunksize: int = 1,
    ) -> Iterator[R]:
        """Results in order; inside a thread of another pool they are there when this returns."""
        if self._outer is None:
            return super().map(fn, *iterables, timeout=timeout, chunksize=chunksize)
        items = zip(*iterables, strict=False)
        return iter(_shared(self._outer, lambda item: fn(*item), list(items)))

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
        Threads; all cores if left out. Inside a thread of another pool that thread works, and those
        of the pool that have nothing to do.
    """
    outer = _outer() if workers is None else None
    if outer is not None:
        return _shared(outer, function, list(items))
    with Workers(workers) as pool:
        return list(pool.map(function, items))


def _outer() -> Workers | None:
    """The pool whose thread this is."""
    found: Workers | None = getattr(_here, "pool", None)
    return found


def _shared(pool: Workers, function: Callable[[T], R], items: list[T]) -> list[R]:
    """Results of a function, from this thread and from those of its pool that are idle."""
    work = _Work(function, items)
    with suppress(RuntimeError):  # a pool that ends takes no more
        for _ in range(min(len(items), pool._max_workers) - 1):
            pool.submit(work.go_on)
    work.go_on()
    return work.results()


class _Work(Generic[T, R]):
    """Items that several threads take in turn.

    A thread that waits for the others waits for what they have begun only. So none waits in a ring,
    however deep calls stand in each other.
    """

    def __init__(self, function: Callable[[T], R], items: list[T]) -> None:
        self._function, self._items, self._ends = function, items, _ends()
        self._changed = threading.Condition()
        self._next = self._busy = 0
        self._found: dict[int, R] = {}
        self._errors: dict[int, BaseException] = {}

    def go_on(self) -> None:
        """Do items until none is left, in the time of the thread that asked."""
        outer = _ends()
        _here.ends = self._ends
        try:
            while (i := self._taken()) is not None:
                try:
                    self._found[i] = self._function(self._items[i])
                except BaseException as error:
                    self._errors[i] = error
                finally:
                    with self._changed:
                        self._busy -= 1
                        self._changed.notify_all()
        finally:
            _here.ends = outer

    def _taken(self) -> int | None:
        with self._changed:
            if self._errors or self._next == len(self._items):
                return None
            self._next, self._busy = self._next + 1, self._busy + 1
            return self._next - 1

    def results(self) -> list[R]:
        """In the order of the items, or the first error in that order."""
        with self._changed:
            self._changed.wait_for(lambda: self._busy == 0)
            self._next = len(self._items)
        if self._errors:
            raise self._errors[min(self._errors)]
        return [self._found[i] for i in range(len(self._items))]
