"""Reading text and TOML, and writing files that are whole or not there at all."""

from __future__ import annotations

import contextlib
import errno
import json
import math
import os
import stat
import sys
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any

from ..errors import InvalidInput, near_names
from .kinds import EMPTY, REMEDIES, kind_of
from .replace import could_replace, replace_file

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

_HINTS = {
    errno.ENOSPC: "make room, or choose another disk",
    errno.EDQUOT: "make room, or choose another disk",
    errno.EFBIG: "raise the limit of file sizes, or choose another disk",
    errno.ENAMETOOLONG: "choose a shorter name",
    errno.EPIPE: "its reader has gone; start it anew",
}


def as_path(path: object) -> Path:
    """The path, checked for what no file can be called.

    Raises
    ------
    InvalidInput
        It is neither text nor a path, is empty, or holds a NUL.
    """
    if not isinstance(path, str | os.PathLike):
        raise InvalidInput(f"{path!r} is no path; give the file's name as text or as a Path")
    name = os.fspath(path)
    if isinstance(name, bytes):
        name = os.fsdecode(name)
    if not name or "\0" in name:
        raise InvalidInput(f"{name!r} is no file name; remove the NUL, or give a name")
    return Path(name)


def read_bytes(path: str | Path, most: int = -1) -> bytes:
    """Return the bytes of a file, or so many of its first ones.

    Raises
    ------
    InvalidInput
        If the file is not there or cannot be read.
    """
    try:
        with as_path(path).open("rb") as file:
            return file.read(most)
    except OSError as error:
        raise InvalidInput(f"{path}: cannot be read ({error.strerror}); check the path") from error


def read_text(path: str | Path) -> str:
    """Return the text of a UTF-8 file (other bytes are read as Latin-1).

    Raises
    ------
    InvalidInput
        If the file is not there or cannot be read.
    """
    raw = read_bytes(path)
    try:
        return raw.decode("utf-8-sig")
    except UnicodeDecodeError:
        return raw.decode("latin-1")


def read_toml(path: str | Path, wanted: str) -> dict[str, Any]:
    """Return the content of a TOML file of a kind (`kinds.py`).

    Raises
    ------
    InvalidInput
        If the file cannot be read, is of another kind, or is not TOML; the message then gives line
        and column.
    """
    kind = kind_of(read_bytes(path))
    if kind not in ("", EMPTY, wanted):
        raise InvalidInput(f"{path}: is {kind}, not {wanted}; {REMEDIES[wanted]}")
    text = read_text(path)
    try:
        return tomllib.loads(text)
    except ValueError as error:  # TOMLDecodeError, and integers beyond Python's limit of digits
        raise InvalidInput(f"{path}: not a TOML file: {error}; mend that line") from error
    except RecursionError:
        raise InvalidInput(
            f"{path}: not a TOML file: its brackets are nested too deeply; flatten them"
        ) from None


def read_json(path: str | Path, wanted: str) -> dict[str, Any]:
    """Return the content of a JSON file of a kind (`kinds.py`).

    Raises
    ------
    InvalidInput
        If the file cannot be read or is of another kind.
    """
    raw = read_bytes(path)
    kind = kind_of(raw)
    if kind != wanted:
        raise InvalidInput(f"{path}: is {kind or 'no JSON'}, not {wanted}; {REMEDIES[wanted]}")
    told: dict[str, Any] = json.loads(raw)
    return told


def write_text(path: str | Path, text: str) -> None:
    """Write `text` as UTF-8; see :func:`write_bytes`."""
    # A file name that is no UTF-8 may stand in a title.
    write_bytes(path, text.encode("utf-8", errors="backslashreplace"))


def write_json(path: str | Path, content: dict[str, Any]) -> None:
    """Write `content` as JSON, with null for NaN and infinity, which JSON lacks."""
    write_text(path, json.dumps(_plain(content), indent=2, allow_nan=False) + "\n")


def write_bytes(path: str | Path, data: bytes) -> None:
    """Write a file at once: whatever happens, it holds the old content or all of the new.

    A link is followed, and its target replaced. A file that is there keeps its permissions, and
    its owner where the process may give files away. Pipes, terminals and other devices are written
    through. Of two writers the last one wins whole.

    Raises
    ------
    InvalidInput
        The folder does not exist or is not writable, the file is write-protected, the disk is
        full; the message names the file.
    """
    path = as_path(path)
    with _told(path):
        there = _status(path)
        if there is not None and not stat.S_ISREG(there.st_mode):
            _write_through(path, there, data)
        elif there is not None and (stream := _own_stream(there)) is not None:
            _write_all(stream, data)
        else:
            replace_file(Path(os.path.realpath(path)), there, data)


def check_outputs(outputs: Sequence[str | Path | None], inputs: Sequence[str | Path] = ()) -> None:
    """Refuse outputs that could not be written, or would replace an input or each other.

    To be called before any work is done; leaves nothing behind.

    Raises
    ------
    InvalidInput
        What :func:`write_bytes` would raise, as far as it can be known beforehand.
    """
    taken = {_identity(as_path(path)): "an input" for path in inputs}
    for given in outputs:
        if given is None:
            continue
        path = as_path(given)
        with _told(path):
            there = _status(path)
            if there is not None and stat.S_ISCHR(there.st_mode):
                continue
            if there is None or stat.S_ISREG(there.st_mode):
                could_replace(Path(os.path.realpath(path)), there)
            elif stat.S_ISDIR(there.st_mode):
                raise _is_folder(path)
        identity = _identity(path)
        if identity in taken:
            raise InvalidInput(
                f"{path}: is also {taken[identity]} of this command; choose another name"
            )
        taken[identity] = "another output"


def refuse_unknown(
    keys: Iterable[str], known: Iterable[str], where: str, likely: Iterable[str] = ()
) -> None:
    """Raise :class:`InvalidInput` naming the first of `keys` that is not in `known`.

    Near names are sought among `likely`, which are missing, first, then among all of `known`.
    """
    known, likely = tuple(known), tuple(likely)
    lacks = f"; the file lacks {', '.join(likely)}" if likely else ""
    for key in keys:
        if key not in known:
            hint = near_names(key, likely) or near_names(key, known)
            if not hint:
                hint = f" (known are {', '.join(known)})"
            raise InvalidInput(f"{where}: unknown key '{key}'{hint}; correct or remove it{lacks}")


def _plain(x: Any) -> Any:
    if isinstance(x, dict):
        return {k: _plain(v) for k, v in x.items()}
    if isinstance(x, list | tuple):
        return [_plain(v) for v in x]
    if isinstance(x, float):
        return x if math.isfinite(x) else None
    return x


@contextlib.contextmanager
def _told(path: Path) -> Iterator[None]:
    """Errors of the system inside the block name the file and say what to do."""
    try:
        yield
    except OSError as error:
        folder = path.parent
        if error.errno == errno.ENOENT and not folder.is_dir():
            raise InvalidInput(
                f"{path}: cannot be written (the folder {folder} does not exist); create it, or "
                "choose a folder that exists"
            ) from error
        hint = _HINTS.get(error.errno or 0, "choose a folder that exists and is writable")
        raise InvalidInput(
            f"{path}: cannot be written ({error.strerror or error}); {hint}"
        ) from error


def _status(path: Path) -> os.stat_result | None:
    """What stands there, links followed; None if nothing does."""
    try:
        return os.stat(path)
    except FileNotFoundError:
        return None


def _identity(path: Path) -> object:
    """Equal for two names of one file."""
    try:
        there = os.stat(path)
    except (OSError, ValueError):
        return os.path.normcase(os.path.realpath(path))
    return there.st_dev, there.st_ino


def _is_folder(path: Path) -> InvalidInput:
    return InvalidInput(f"{path}: is a folder; give the name of a file")


def _own_stream(there: os.stat_result) -> int | None:
    """The process's output or error stream, if it goes to this file (as /dev/stdout does)."""
    for stream in (sys.stdout, sys.stderr):
        with contextlib.suppress(AttributeError, OSError, ValueError):
            if os.path.samestat(os.fstat(stream.fileno()), there):
                stream.flush()
                return stream.fileno()
    return None


def _write_through(path: Path, there: os.stat_result, data: bytes) -> None:
    if stat.S_ISDIR(there.st_mode):
        raise _is_folder(path)
    handle = os.open(path, os.O_WRONLY)
    try:
        _write_all(handle, data)
    finally:
        os.close(handle)


def _write_all(handle: int, data: bytes) -> None:
    rest = memoryview(data)
    while rest:
        rest = rest[os.write(handle, rest) :]
