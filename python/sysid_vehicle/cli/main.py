"""From the command line to an exit status."""

from __future__ import annotations

import os
import sys
import warnings
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, redirect_stderr, redirect_stdout
from typing import Any, TextIO

from .._common.progress import note
from .._common.starting import INTERRUPTED, ending, interruptible
from .._common.text import columns, wrapped
from ..errors import Interrupted, SysidError
from .commands import run
from .outputs import refuse_outputs
from .parser import parse

_FAILED = 2


def main(argv: list[str] | None = None) -> int:
    """Run a command.

    Parameters
    ----------
    argv : list of str, optional
        Arguments; those of the process if left out.

    Returns
    -------
    int
        Exit status: 0, 2 for input that cannot be used, 130 after Ctrl-C.
    """
    try:
        with interruptible():
            args = parse(argv)
            with _warnings_as_lines() as heard, _read_to_the_end_or_not(args.command):
                refuse_outputs(args)
                run(args, heard)
                sys.stdout.flush()
    except (SysidError, OSError) as error:
        print(f"sysid-vehicle: error: {_one_line(str(error))}", file=sys.stderr)
        return _FAILED
    except KeyboardInterrupt as interrupt:
        ending()
        known = f" {interrupt}" if isinstance(interrupt, Interrupted) else ""
        print(f"sysid-vehicle: interrupted{known}", file=sys.stderr)
        return INTERRUPTED
    return 0


class _Printed:
    """A stream whose reader may leave; in a terminal lines are broken between words.

    A reader such as `head` has seen enough; the files that were asked for are written all the same.
    """

    def __init__(self, stream: TextIO, width: int | None) -> None:
        self._stream, self._width = stream, width

    def write(self, text: str) -> int:
        with self._unread():
            self._stream.write(text if self._width is None else wrapped(text, self._width))
        return len(text)

    def flush(self) -> None:
        with self._unread():
            self._stream.flush()

    @contextmanager
    def _unread(self) -> Iterator[None]:
        try:
            yield
        except BrokenPipeError:
            # What is still buffered goes there too: Python would complain at exit.
            os.dup2(os.open(os.devnull, os.O_WRONLY), self._stream.fileno())

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stream, name)


@contextmanager
def _read_to_the_end_or_not(command: str) -> Iterator[None]:
    """Break long lines in a terminal, but none of a file that is to be copied from it."""
    width = None if command == "map" else columns()
    with ExitStack() as streams:
        if sys.stdout is not None:
            streams.enter_context(redirect_stdout(_Printed(sys.stdout, width)))
        if sys.stderr is not None:
            streams.enter_context(redirect_stderr(_Printed(sys.stderr, None)))
        yield


@contextmanager
def _warnings_as_lines() -> Iterator[list[str]]:
    """Print each warning once, as one line, and collect the texts."""
    heard: list[str] = []

    def show(
        message: Warning | str,
        category: type[Warning],
        filename: str,
        lineno: int,
        file: TextIO | None = None,
        line: str | None = None,
    ) -> None:
        text = _one_line(str(message))
        if text not in heard:
            heard.append(text)
            note(f"sysid-vehicle: warning: {text}")

    with warnings.catch_warnings():
        warnings.simplefilter("default")
        warnings.showwarning = show
        yield heard


def _one_line(text: str) -> str:
    return " ".join(text.split())
