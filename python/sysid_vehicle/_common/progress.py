"""Progress of long calls, told where somebody watches.

One line at the foot of the terminal says what goes on. It appears after two seconds, is kept up by
a thread of its own however long a step takes, and goes when the work ends. Notebooks show the same
line.
"""

from __future__ import annotations

import contextlib
import os
import shutil
import sys
import threading
import time
from collections.abc import Callable, Iterable, Iterator, Sized
from contextlib import contextmanager
from typing import TypeVar

T = TypeVar("T")

_SILENT_S = 2.0  # before anything that nobody asked for
_REFRESH_S = 0.5


class Task:
    """Something that goes on, with a count where there is one."""

    def __init__(self, description: str, total: int | None, delay: float) -> None:
        self.description, self.total, self.done = description, total, 0
        self.began = time.monotonic()
        self.shown_from = self.began + delay

    def advance(self, count: int = 1) -> None:
        """Count so many more."""
        self.done += count

    def __str__(self) -> str:
        if self.total is None:
            return self.description
        text = f"{self.description} {self.done}/{self.total}"
        if 0 < self.done < self.total:
            left = (time.monotonic() - self.began) * (self.total - self.done) / self.done
            text += f", about {_duration(left)} left"
        return text


def _duration(seconds: float) -> str:
    if seconds < 100.0:
        return f"{seconds:.0f} s"
    minutes = round(seconds / 60.0)
    return f"{minutes} min" if minutes < 100 else f"{minutes // 60} h {minutes % 60} min"


class _Line:
    """The line that tells the outermost and the innermost of what goes on."""

    def __init__(self) -> None:
        self._lock = threading.RLock()
        self._tasks: list[Task] = []
        self._width = 0  # of what stands in the line
        self._wake = threading.Event()
        self._thread: threading.Thread | None = None

    def enter(self, task: Task) -> None:
        with self._lock:
            self._tasks.append(task)
            if self._thread is None or not self._thread.is_alive():
                self._wake = threading.Event()
                self._thread = threading.Thread(
                    target=self._keep_up, args=(self._wake,), name="progress", daemon=True
                )
                self._thread.start()

    def leave(self, task: Task) -> None:
        with self._lock:
            if task in self._tasks:  # not in a process that was forked meanwhile
                self._tasks.remove(task)
            if not self._tasks:
                self._wake.set()
                self._thread = None
                self.clear()

    def _keep_up(self, wake: threading.Event) -> None:
        while not wake.wait(_REFRESH_S):
            with self._lock:
                if wake.is_set():
                    return
                self.draw()

    def draw(self) -> None:
        """Write the line anew, if it is time for it."""
        with self._lock:
            now = time.monotonic()
            if not self._tasks or now < min(t.shown_from for t in self._tasks):
                return
            first, last = self._tasks[0], self._tasks[-1]
            parts = [str(first)] if last is first else [first.description, str(last)]
            text = f"{': '.join(parts)} ({_duration(now - first.began)})"
            text = text[: max(shutil.get_terminal_size().columns - 1, 10)]
            _write("\r" + text.ljust(self._width))
            self._width = len(text)

    def clear(self) -> None:
        """Take the line away, for others to print."""
        with self._lock:
            if self._width:
                _write("\r" + " " * self._width + "\r")
                self._width = 0


def _write(text: str) -> None:
    with contextlib.suppress(OSError, ValueError):  # a terminal that is gone
        if sys.stderr is not None:
            sys.stderr.write(text)
            sys.stderr.flush()


_line = _Line()
if hasattr(os, "register_at_fork"):  # a child has no thread of this, and perhaps a lock held
    os.register_at_fork(after_in_child=_line.__init__)  # type: ignore[misc]


def watched() -> bool:
    """Whether this process writes to a terminal or to a notebook."""
    kernel = sys.modules.get("ipykernel.kernelapp")
    if kernel is not None and kernel.IPKernelApp.initialized():
        return True
    return sys.stderr is not None and sys.stderr.isatty()


@contextmanager
def doing(description: str, shown: bool | None = None, total: int | None = None) -> Iterator[Task]:
    """Tell that something goes on, from when it has taken two seconds.

    Parameters
    ----------
    description : str
    shown : bool, optional
        None: where somebody watches.
    total : int, optional
        How often `advance` of the task that this gives will be called.
    """
    task = Task(description, total, _SILENT_S if shown is None else 0.0)
    main = threading.current_thread() is threading.main_thread()
    if not main or not (watched() if shown is None else shown):
        yield task
        return
    _line.enter(task)
    try:
        yield task
    finally:
        if shown:
            _line.draw()
        _line.leave(task)


def with_progress(
    items: Iterable[T], description: str, *, total: int | None = None, shown: bool | None
) -> Iterator[T]:
    """Pass items on, and count them in the line of progress.

    Parameters
    ----------
    items : iterable
    description : str
        What is counted.
    total : int, optional
        How many, where `items` have no length.
    shown : bool, optional
        None: where somebody watches, once it has taken two seconds.
    """
    if total is None and isinstance(items, Sized):
        total = len(items)
    with doing(description, shown, total) as task:
        for item in items:
            yield item
            task.advance()


def note(text: str) -> None:
    """Print a line to the error stream, above the line of progress."""
    _line.clear()
    print(text, file=sys.stderr, flush=True)


def teller(shown: bool | None) -> Callable[[str], None]:
    """Return what tells a sentence about each step: to the error stream, or to nobody."""
    return note if (watched() if shown is None else shown) else _silent


def _silent(_: str) -> None:
    pass
