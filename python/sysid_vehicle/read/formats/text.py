"""Files of text in any encoding, and what files without a reader are by their first bytes."""

from __future__ import annotations

import codecs
import re
from pathlib import Path

from ..._common.files import read_bytes
from ..._common.kinds import own_kind
from ...errors import InvalidInput

_ARRAYS = "and give a dict of its one-dimensional arrays to read_log in place of the path"
_EXPORT = "export it as CSV"

# First bytes, what has them, what to do.
_SIGNATURES: tuple[tuple[bytes, str, str], ...] = (
    (b"\x93NUMPY", "a NumPy file", f"load it with numpy.load {_ARRAYS}"),
    (b"PK\x03\x04", "a ZIP archive (Excel, .npz, zipped CSV)", f"unpack or load it {_ARRAYS}"),
    (b"\xd0\xcf\x11\xe0", "an old Excel or Office file", _EXPORT),
    (b"\x1f\x8b", "a gzip archive", "unpack it with gunzip"),
    (b"BZh", "a bzip2 archive", "unpack it with bunzip2"),
    (b"\xfd7zXZ", "an xz archive", "unpack it with unxz"),
    (b"\x28\xb5\x2f\xfd", "a Zstandard archive", "unpack it with unzstd"),
    (b"7z\xbc\xaf\x27\x1c", "a 7z archive", "unpack it"),
    (b"TDSm", "a TDMS file", f"read it with nptdms {_ARRAYS}"),
    (b"\x80\x04\x95", "a pickle", f"load it in Python {_ARRAYS}"),
    (b"%PDF", "a PDF document", _EXPORT),
    (b"<!DOCTYPE", "a web page", "download the file itself"),
    (b"<html", "a web page", "download the file itself"),
    (b"<?xml", "an XML document, such as GPX", _EXPORT),
    (b"$GP", "a record of NMEA sentences", _EXPORT),
    (b"$GN", "a record of NMEA sentences", _EXPORT),
    (b"version https://git-lfs", "a pointer of Git LFS", "fetch the file with git lfs pull"),
)
# Binary files of loggers that no reader here has, by the ends of their names.
_AIM = ("a log of AiM", "export it as CSV from Race Studio")
_LOGGERS = {
    ".ld": ("a log of MoTeC", "export it as CSV from i2"),
    ".ibt": ("telemetry of iRacing", _EXPORT),
    **dict.fromkeys((".xrk", ".xrz", ".drk"), _AIM),
}
# Objects, or rows of them; in one line or in one for each row.
_JSON = re.compile(rb'\A(\xef\xbb\xbf)?\s*(\{\s*"|\[\s*[\[{])')
_UTF_32 = ((codecs.BOM_UTF32_LE, "utf-32"), (codecs.BOM_UTF32_BE, "utf-32"))
_UTF_16 = ((codecs.BOM_UTF16_LE, "utf-16"), (codecs.BOM_UTF16_BE, "utf-16"))


def read_text_table(path: str | Path) -> str:
    """Return the text of a CSV file: UTF-8, UTF-16 or UTF-32, else Latin-1.

    Raises
    ------
    InvalidInput
        If the file cannot be read, or is none of text; the message says what it is.
    """
    raw = read_bytes(path)
    if kind := own_kind(raw):
        raise InvalidInput(f"{path}: is {kind}, no log; give the log of a drive")
    for signature, what, remedy in _SIGNATURES:
        if raw.startswith(signature):
            raise InvalidInput(f"{path}: is {what}, not CSV; {remedy}")
    if _JSON.match(raw):
        first, _, rest = raw.strip().partition(b"\n")
        lines = rest and first.rstrip().endswith(b"}")
        raise InvalidInput(
            f"{path}: is JSON, not CSV; give read_log the table that pandas makes of it: "
            f"pandas.read_json(path{', lines=True' if lines else ''})"
        )
    for mark, encoding in (*_UTF_32, *_UTF_16):
        if raw.startswith(mark):
            return _decoded(raw, encoding, path)
    if b"\0" in raw[:4096]:
        even, odd = raw[:4096:2], raw[1:4096:2]
        for encoding, zeros, others in (("utf-16-le", odd, even), ("utf-16-be", even, odd)):
            if zeros.count(0) > 0.9 * len(zeros) and others.count(0) < 0.1 * len(others):
                return _decoded(raw, encoding, path)
        what, remedy = _LOGGERS.get(Path(path).suffix.lower(), ("", ""))
        if what:
            raise InvalidInput(f"{path}: is {what}, which cannot be read; {remedy}")
        raise InvalidInput(
            f"{path}: holds bytes that are no text (first at byte {raw.index(0)}); export the log "
            f"as CSV"
        )
    try:
        return raw.decode("utf-8-sig")
    except UnicodeDecodeError:
        return raw.decode("latin-1")


def _decoded(raw: bytes, encoding: str, path: str | Path) -> str:
    try:
        return raw.decode(encoding)
    except UnicodeDecodeError as error:
        raise InvalidInput(
            f"{path}: begins as {encoding.upper()} text but is not at byte {error.start}; save it "
            f"as UTF-8"
        ) from error
