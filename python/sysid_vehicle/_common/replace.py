"""Putting a whole file in the place of another, or of none, in one step."""

from __future__ import annotations

import contextlib
import hashlib
import os
import secrets
import stat
import sys
from pathlib import Path

from ..errors import InvalidInput

if sys.platform != "win32":
    import fcntl


def could_replace(target: Path, there: os.stat_result | None) -> None:
    """Raise what stands against replacing or creating the file; leaves nothing behind.

    Raises
    ------
    InvalidInput
        The file is write-protected.
    OSError
        What the system says of the folder or of the name.
    """
    with contextlib.suppress(FileNotFoundError):
        os.lstat(target)  # a name may be too long
    handle, temporary = _new_file(target)
    os.close(handle)
    if temporary is not None:
        os.unlink(temporary)
    _refuse_protected(target, there)


def replace_file(target: Path, there: os.stat_result | None, data: bytes) -> None:
    """Write the file; `there` is what stands in its place, if anything does.

    Raises
    ------
    InvalidInput
        The file is write-protected.
    OSError
        The system cannot write; the old content stands, and nothing else is left.
    """
    _remove_stale(target)
    try:
        _write(target, there, data, *_new_file(target))
    except _NoName:
        _write(target, there, data, *_named_file(target))


class _NoName(Exception):
    """The system makes files without a name, but gives them none later."""


def _refuse_protected(target: Path, there: os.stat_result | None) -> None:
    if there is not None and not os.access(target, os.W_OK):
        raise InvalidInput(f"{target}: is write-protected; choose another name")


def _write(
    target: Path, there: os.stat_result | None, data: bytes, handle: int, temporary: Path | None
) -> None:
    try:
        _refuse_protected(target, there)
        rest = memoryview(data)
        while rest:
            rest = rest[os.write(handle, rest) :]
        if there is not None:
            _take_over(handle, there)
        with contextlib.suppress(OSError):  # not every file system can
            os.fsync(handle)
        if temporary is None:
            temporary = _linked(handle, target, there)
        if temporary is not None:
            os.replace(temporary, target)
            temporary = None
    finally:
        os.close(handle)
        if temporary is not None:
            with contextlib.suppress(OSError):
                os.unlink(temporary)


def _take_over(handle: int, there: os.stat_result) -> None:
    """Give it owner and permissions of the file that is replaced, as far as allowed."""
    if sys.platform == "win32":
        return
    mode = stat.S_IMODE(there.st_mode)
    try:
        os.fchown(handle, there.st_uid, there.st_gid)
    except OSError:
        mode &= 0o777
        with contextlib.suppress(OSError):
            os.fchown(handle, -1, there.st_gid)
    os.fchmod(handle, mode)


def _start_of_name(target: Path) -> str:
    """How temporary names of a target begin; of one length, for its own may leave no room."""
    return f".sysid-{hashlib.sha256(os.fsencode(target.name)).hexdigest()[:16]}-"


def _temporary_name(target: Path) -> Path:
    return target.parent / (_start_of_name(target) + secrets.token_hex(8))


def _new_file(target: Path) -> tuple[int, Path | None]:
    """A new file in the target's folder: its handle, and its name if it has to have one.

    Where the system can it has none, and is gone with a process that is killed.
    """
    if hasattr(os, "O_TMPFILE") and os.path.isdir("/proc/self/fd"):
        with contextlib.suppress(OSError):
            handle = os.open(target.parent, os.O_TMPFILE | os.O_WRONLY, 0o666)
            _lock(handle)
            return handle, None
    return _named_file(target)


def _named_file(target: Path) -> tuple[int, Path]:
    while True:
        temporary = _temporary_name(target)
        flags = os.O_WRONLY | os.O_CREAT | os.O_EXCL | getattr(os, "O_BINARY", 0)
        handle = os.open(temporary, flags, 0o666)
        _lock(handle)
        if os.fstat(handle).st_nlink:  # else another writer has just taken it for stale
            return handle, temporary
        os.close(handle)


def _linked(handle: int, target: Path, there: os.stat_result | None) -> Path | None:
    """Give a nameless file its name: the target's, or a temporary one if that is taken."""
    source = f"/proc/self/fd/{handle}"
    try:
        if there is None:
            with contextlib.suppress(FileExistsError):
                os.link(source, target, follow_symlinks=True)
                return None
        temporary = _temporary_name(target)
        os.link(source, temporary, follow_symlinks=True)
    except OSError as error:
        raise _NoName from error
    return temporary


def _lock(handle: int) -> None:
    """Tell later writers that the file is in use; the lock ends with the process."""
    if sys.platform != "win32":
        with contextlib.suppress(OSError):
            fcntl.flock(handle, fcntl.LOCK_EX)


def _remove_stale(target: Path) -> None:
    """Remove what writers of this file left that were killed; one that lives holds its lock."""
    if sys.platform == "win32":
        return
    for left in target.parent.glob(_start_of_name(target) + "*"):
        with contextlib.suppress(OSError):
            handle = os.open(left, os.O_RDONLY | os.O_NOFOLLOW)
            try:
                fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
                os.unlink(left)
            finally:
                os.close(handle)
