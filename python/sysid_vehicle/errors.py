"""Errors and warnings of the package, and the wording helpers they share."""

from __future__ import annotations

import difflib
import os
import sys
import warnings
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from itertools import islice
from typing import Any

import numpy as np

__all__ = [
    "Interrupted",
    "InvalidInput",
    "NumericalError",
    "SysidError",
    "SysidWarning",
    "explained",
    "near_names",
    "warn",
]

_COMPARED = 1000  # near names are sought among so many
_PACKAGE_DIR = os.path.dirname(os.path.abspath(__file__)) + os.sep


class SysidError(Exception):
    """Base of every error the package raises on purpose."""


class InvalidInput(SysidError, ValueError):
    """A file, an array or an argument that cannot be used; the message says how to mend it."""


class NumericalError(SysidError, ArithmeticError):
    """A computation that left the range of numbers it can be trusted in.

    The compiled core raises it too.

    Attributes
    ----------
    sample : int or None
        Where it happened, if the computation goes from sample to sample.
    remedy : str
        What may help; part of the message. Empty as long as no caller knows.
    """

    sample: int | None = None
    remedy: str = ""


class Interrupted(KeyboardInterrupt):
    """Ctrl-C in the middle of a study; the message says what was known by then.

    Attributes
    ----------
    fits : tuple of Fit
        The baseline, then one for each effect added so far: in an interactive session
        `sys.last_value.fits`.
    """

    fits: tuple[Any, ...] = ()


class SysidWarning(UserWarning):
    """Something the user should know that does not stop the work."""


def warn(message: str) -> None:
    """Issue a :class:`SysidWarning` that points at the caller's line outside the package."""
    level, frame = 2, sys._getframe(1)
    while frame.f_back is not None and frame.f_code.co_filename.startswith(_PACKAGE_DIR):
        frame, level = frame.f_back, level + 1
    warnings.warn(message, SysidWarning, stacklevel=level)


@contextmanager
def explained(
    where: str | Callable[[], str] = "", remedy: str | Callable[[], str] = ""
) -> Iterator[None]:
    """Give numerical failures inside the block what only the caller knows.

    Failures of linear algebra become :class:`NumericalError` as well. A failure that has a remedy
    already passes unchanged.

    Parameters
    ----------
    where : str or callable
        What failed, such as the log's name; put in front of a failure that does not say its log.
    remedy : str or callable
        What the user may change. Callables are asked only after a failure.

    Raises
    ------
    NumericalError
        The failure, with place, sample and remedy.
    """
    try:
        yield
    except (NumericalError, np.linalg.LinAlgError) as failure:
        if isinstance(failure, NumericalError) and failure.remedy:
            raise
        text, sample = str(failure), getattr(failure, "sample", None)
        place = where() if callable(where) else where
        if place and f"(sample {sample})" not in text:  # so the core ends what it says of a log
            text = f"{place}: {text}"
        help_ = remedy() if callable(remedy) else remedy
        told = NumericalError(f"{text}; {help_}" if help_ else text)
        told.sample = sample
        told.remedy = help_
        raise told from failure


def near_names(name: str, known: Iterable[str], count: int = 3) -> str:
    """Return ``" (did you mean 'a', 'b'?)"`` for the known names like `name`, else ``""``."""
    by_lower = {candidate.lower(): candidate for candidate in islice(known, _COMPARED)}
    found = difflib.get_close_matches(name.lower(), by_lower, n=count, cutoff=0.5)
    if not found:
        return ""
    return " (did you mean " + ", ".join(f"'{by_lower[key]}'" for key in found) + "?)"
