"""Output files are looked at before the work begins, not after it."""

from __future__ import annotations

from pathlib import Path

from .._files import check_outputs as refuse_unwritable
from ..errors import InvalidInput

__all__ = ["refuse_other_suffix", "refuse_unwritable"]


def refuse_other_suffix(path: Path | None, suffix: str) -> None:
    """Raise :class:`InvalidInput` if the name promises another kind of file than is written."""
    if path is not None and path.suffix.lower() != suffix:
        raise InvalidInput(f"{path}: the file will be {suffix}; end the name in {suffix}")
