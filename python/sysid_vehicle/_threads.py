"""Threads that do not outlast the call that started them."""

from concurrent.futures import ThreadPoolExecutor
from types import TracebackType

from . import _core
from ._arguments import whole


class Workers(ThreadPoolExecutor):
    """A pool of threads for a `with` block that ends with the block.

    When an error or Ctrl-C leaves the block, what has not begun is dropped, and kernels that run
    are stopped within about 50 ms. A plain pool would first finish everything.

    Parameters
    ----------
    count : int
        How many threads.

    Raises
    ------
    InvalidInput
        `count` is no whole number above zero; the message calls it ``workers``.
    """

    def __init__(self, count: int) -> None:
        self._stop = _core.Stop()
        super().__init__(whole(count, "workers", 1), initializer=self._stop.follow)

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
