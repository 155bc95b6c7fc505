"""Ctrl-C in the program: one line, status 130, whenever it comes.

While the package is loaded an exception may come up in the middle of any library, which turns it
into another error or prints a traceback: importing this module, which the package does first, makes
Ctrl-C end the program at once. A command is interrupted by `KeyboardInterrupt`; where a library
swallows that, as compiled code and destructors do, it is raised again. None of it touches processes
that import the package for other ends.
"""

from __future__ import annotations

import _thread
import os
import signal
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from itertools import pairwise
from pathlib import Path
from types import FrameType, TracebackType
from typing import Any, NoReturn

INTERRUPTED = 130  # what shells report for Ctrl-C
_AGAIN_S = 0.05
_NAMES = ("sysid-vehicle", "sysid-vehicle-script")


def _is_program() -> bool:
    """Whether this process runs a command, or was started by one that does."""
    given, asked = Path((getattr(sys, "argv", None) or [""])[0]), sys.orig_argv
    by_name = given.stem in _NAMES or given.parts[-2:] == ("sysid_vehicle", "__main__.py")
    return by_name or (given.name == "-m" and ("-m", "sysid_vehicle") in pairwise(asked))


def _is_worker() -> bool:
    processes = sys.modules.get("multiprocessing.process")
    return processes is not None and processes.parent_process() is not None


def _says_so(_signal: int, _frame: FrameType | None) -> NoReturn:
    os.write(2, b"sysid-vehicle: interrupted\n")
    os._exit(INTERRUPTED)


def _at_once(_signal: int, _frame: FrameType | None) -> NoReturn:
    os._exit(INTERRUPTED)


def _begin() -> bool:
    """Take Ctrl-C over, in the program alone, and if nobody has done it yet."""
    if (
        not _is_program()
        or threading.current_thread() is not threading.main_thread()
        or signal.getsignal(signal.SIGINT) is not signal.default_int_handler
    ):
        return False
    # The process that opened a pool decides for its workers.
    signal.signal(signal.SIGINT, signal.SIG_IGN if _is_worker() else _says_so)
    return True


_TAKEN = _begin()


@contextmanager
def interruptible() -> Iterator[None]:
    """Let Ctrl-C raise `KeyboardInterrupt` inside, and none get lost; the program then ends."""
    hooks = sys.unraisablehook, sys.excepthook

    def unraisable(lost: sys.UnraisableHookArgs) -> None:
        if isinstance(lost.exc_value, KeyboardInterrupt):
            # In a moment: as long as this runs it would be swallowed once more.
            threading.Timer(_AGAIN_S, _thread.interrupt_main).start()
        else:
            hooks[0](lost)

    def printed(
        kind: type[BaseException], error: BaseException, trace: TracebackType | None
    ) -> Any:
        if not issubclass(kind, KeyboardInterrupt):  # compiled code shows it before it swallows it
            hooks[1](kind, error, trace)

    sys.unraisablehook, sys.excepthook = unraisable, printed
    try:
        if _TAKEN:
            signal.signal(signal.SIGINT, signal.default_int_handler)
        yield
    finally:
        ending()
        sys.unraisablehook, sys.excepthook = hooks


def ending() -> None:
    """From here on Ctrl-C ends the program without another word."""
    if _TAKEN:
        signal.signal(signal.SIGINT, _at_once)
