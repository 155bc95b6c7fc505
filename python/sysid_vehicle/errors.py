"""Errors and warnings of the package, and the wording helpers they share."""

from __future__ import annotations

import difflib
import os
import sys
import warnings
from collections.abc import Iterable

__all__ = ["InvalidInput", "NumericalError", "SysidError", "SysidWarning", "near_names", "warn"]

_PACKAGE_DIR = os.path.dirname(os.path.abspath(__file__)) + os.sep


class SysidError(Exception):
    """Base of every error the package raises on purpose."""


class InvalidInput(SysidError, ValueError):
    """A file, an array or an argument that cannot be used; the message says how to mend it."""


class NumericalError(SysidError, ArithmeticError):
    """A computation that left the range of numbers it can be trusted in."""


class SysidWarning(UserWarning):
    """Something the user should know that does not stop the work."""


def warn(message: str) -> None:
    """Issue a :class:`SysidWarning` that points at the caller's line outside the package."""
    level, frame = 2, sys._getframe(1)
    while frame.f_back is not None and frame.f_code.co_filename.startswith(_PACKAGE_DIR):
        frame, level = frame.f_back, level + 1
    warnings.warn(message, SysidWarning, stacklevel=level)


def near_names(name: str, known: Iterable[str], count: int = 3) -> str:
    """Return ``" (did you mean 'a', 'b'?)"`` for the known names like `name`, else ``""``."""
    by_lower = {candidate.lower(): candidate for candidate in known}
    found = difflib.get_close_matches(name.lower(), by_lower, n=count, cutoff=0.5)
    if not found:
        return ""
    return " (did you mean " + ", ".join(f"'{by_lower[key]}'" for key in found) + "?)"
