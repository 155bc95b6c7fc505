"""From the command line to an exit status."""

from __future__ import annotations

import os
import sys
import warnings
from collections.abc import Iterator
from contextlib import contextmanager, redirect_stdout
from typing import Any, TextIO

from .._common.progress import note
from .._common.text import columns, wrapped
from ..errors import Interrupted, SysidError
from .commands import COMMANDS
from .outputs import refuse_outputs
from .parser import parse

_FAILED = 2
_INTERRUPTED = 130  # what shells report for Ctrl-C


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
        args = parse(argv)
        with _warnings_as_lines() as heard, _lines_that_fit(args.command):
            refuse_outputs(args)
            COMMANDS[args.command](args, heard)
        sys.stdout.flush()
    except BrokenPipeError:
        # The reader, such as `head`, has seen enough. Python would complain once more at exit.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0
    except (SysidError, OSError) as error:
        print(f"sysid-vehicle: error: {_one_line(str(error))}", file=sys.stderr)
        return _FAILED
    except KeyboardInterrupt as interrupt:
        known = f" {interrupt}" if isinstance(interrupt, Interrupted) else ""
        print(f"sysid-vehicle: interrupted{known}", file=sys.stderr)
        return _INTERRUPTED
    return 0


class _Fitting:
    """A terminal whose lines are broken between words, not where they end."""

    def __init__(self, stream: TextIO, width: int) -> None:
        self._stream, self._width = stream, width

    def write(self, text: str) -> int:
        self._stream.write(wrapped(text, self._width))
        return len(text)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stream, name)


@contextmanager
def _lines_that_fit(command: str) -> Iterator[None]:
    """Break long lines in a terminal, but none of a file that is to be copied from it."""
    width = columns()
    if width is None or command == "map":
        yield
        return
    with redirect_stdout(_Fitting(sys.stdout, width)):
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
