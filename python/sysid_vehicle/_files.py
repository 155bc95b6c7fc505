"""Reading TOML files and writing files that are complete or not there at all."""

from __future__ import annotations

import json
import math
import os
import sys
import tempfile
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from .errors import InvalidInput, near_names

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib


def read_text(path: str | Path) -> str:
    """Return the text of a UTF-8 file (other bytes are read as Latin-1).

    Raises
    ------
    InvalidInput
        If the file is not there or cannot be read.
    """
    try:
        raw = Path(path).read_bytes()
    except OSError as error:
        raise InvalidInput(f"{path}: cannot be read ({error.strerror}); check the path") from error
    try:
        return raw.decode("utf-8-sig")
    except UnicodeDecodeError:
        return raw.decode("latin-1")


def read_toml(path: str | Path) -> dict[str, Any]:
    """Return the content of a TOML file.

    Raises
    ------
    InvalidInput
        If the file cannot be read or is not TOML; the message gives line and column.
    """
    try:
        return tomllib.loads(read_text(path))
    except tomllib.TOMLDecodeError as error:
        raise InvalidInput(f"{path}: not a TOML file: {error}; mend that line") from error


def write_text(path: str | Path, text: str) -> None:
    """Write `text` beside `path` and move it there, so that no half-written file can appear.

    Raises
    ------
    InvalidInput
        If the folder does not exist or is not writable.
    """
    target = Path(path)
    try:
        handle, temporary = tempfile.mkstemp(dir=target.parent, prefix=f".{target.name}.")
    except OSError as error:
        raise InvalidInput(
            f"{path}: cannot be written ({error.strerror}); choose a folder that exists"
        ) from error
    try:
        with os.fdopen(handle, "w", encoding="utf-8", newline="\n") as stream:
            stream.write(text)
        # mkstemp makes a private file; the result should have the permissions of any new file.
        umask = os.umask(0)
        os.umask(umask)
        os.chmod(temporary, 0o666 & ~umask)
        os.replace(temporary, target)
    except BaseException:
        os.unlink(temporary)
        raise


def write_json(path: str | Path, content: dict[str, Any]) -> None:
    """Write `content` as JSON, with null for NaN and infinity, which JSON lacks."""
    write_text(path, json.dumps(_plain(content), indent=2, allow_nan=False) + "\n")


def _plain(x: Any) -> Any:
    if isinstance(x, dict):
        return {k: _plain(v) for k, v in x.items()}
    if isinstance(x, list | tuple):
        return [_plain(v) for v in x]
    if isinstance(x, float):
        return x if math.isfinite(x) else None
    return x


def refuse_unknown(
    keys: Iterable[str], known: Iterable[str], where: str, likely: Iterable[str] = ()
) -> None:
    """Raise :class:`InvalidInput` naming the first of `keys` that is not in `known`.

    Near names are sought among `likely` first, then among all of `known`.
    """
    known = tuple(known)
    for key in keys:
        if key not in known:
            hint = near_names(key, likely) or near_names(key, known)
            if not hint:
                hint = f" (known are {', '.join(known)})"
            raise InvalidInput(f"{where}: unknown key '{key}'{hint}; correct or remove it")
