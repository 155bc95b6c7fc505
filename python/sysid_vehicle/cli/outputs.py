"""Output files are looked at before the work begins, not after it."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path

from ..errors import InvalidInput

__all__ = ["refuse_other_suffix", "refuse_unwritable"]


def refuse_other_suffix(path: Path | None, suffix: str) -> None:
    """Raise :class:`InvalidInput` if the name promises another kind of file than is written."""
    if path is not None and path.suffix.lower() != suffix:
        raise InvalidInput(f"{path}: the file will be {suffix}; end the name in {suffix}")


def refuse_unwritable(outputs: Sequence[Path | None], inputs: Sequence[Path]) -> None:
    """Raise :class:`InvalidInput` if an output could not be written or would replace an input."""
    taken = {path.resolve(): "an input" for path in inputs}
    for path in outputs:
        if path is None:
            continue
        if path.is_dir():
            raise InvalidInput(f"{path}: is a folder; give the name of a file")
        folder = path.resolve().parent
        if not folder.is_dir():
            raise InvalidInput(f"{path}: the folder {folder} does not exist; create it first")
        if not os.access(folder, os.W_OK):
            raise InvalidInput(f"{path}: the folder {folder} is not writable; choose another")
        if path.resolve() in taken:
            raise InvalidInput(
                f"{path}: is also {taken[path.resolve()]} of this command; choose another name"
            )
        taken[path.resolve()] = "another output"
