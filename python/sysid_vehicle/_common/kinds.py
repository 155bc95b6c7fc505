"""What a file is, by its content: of this package's own kinds, and of what is given for them."""

from __future__ import annotations

import io
import json
import sys
import zipfile
from typing import Any

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

VEHICLE = "a vehicle file"
MAP = "a channel map"
MANIFEST = "a manifest of improve-many"
GAINS = "gains of `sysid-vehicle twin calibrate --json`"
TYRES = "tyres of `sysid-vehicle lab identify --json`"
SAVED = "a saved result of sysid_vehicle"
EMPTY = "empty"
TABLE = "a table, such as a log in CSV"

REMEDIES = {
    VEHICLE: "give the TOML file with the car's mass_kg, lf_m, lr_m and its other numbers",
    MAP: "give the TOML file with the table [channels]; `sysid-vehicle map LOG` proposes it",
    MANIFEST: "give the TOML file that names vehicle and logs",
    GAINS: "give what that command wrote, or calibrate again",
    TYRES: "give what that command wrote, or identify again",
}
"""What to give in place of another kind."""

_LARGEST = 4_000_000  # bytes of text that this package writes
_SIGNATURES = (
    (b"\x89PNG", "a picture"),
    (b"\xff\xd8\xff", "a picture"),
    (b"%PDF", "a PDF document"),
    (b"<svg", "a picture"),
    (b"<!DOCTYPE", "a web page"),
    (b"<!doctype", "a web page"),
    (b"<html", "a web page"),
    (b"<?xml", "an XML document"),
    (b"\x93NUMPY", "a NumPy array"),
    (b"\x89HDF", "an HDF5 file"),
    (b"PAR1", "a Parquet file"),
)
# Keys of which a TOML file has one, by its kind.
_TOML = ((VEHICLE, ("mass_kg", "lf_m", "lr_m")), (MANIFEST, ("logs", "study", "improve")))
# Keys of which JSON has all, by its kind.
_JSON = (
    (GAINS, ("law", "gains")),
    (TYRES, ("vehicle", "parameters", "noise")),
    ("figures of `sysid-vehicle changed --json`", ("headline", "lacks", "effects")),
    ("figures of a study (`--json`)", ("verdict",)),
    ("figures of another command (`--json`)", ("warnings",)),
)


def own_kind(raw: bytes) -> str:
    """The kind of a file that this package wrote or asks for; empty of all others."""
    own = (VEHICLE, MAP, MANIFEST, GAINS, TYRES, SAVED)
    few = raw.startswith(b"PK") or len(raw) < _LARGEST
    kind = kind_of(raw) if few else ""
    return kind if kind in own or kind.startswith("figures of ") else ""


def kind_of(raw: bytes) -> str:
    """What a file is, in words that follow "is"; empty where its content does not tell."""
    text = raw.removeprefix(b"\xef\xbb\xbf").strip()
    if not text:
        return EMPTY
    for signature, kind in _SIGNATURES:
        if text.startswith(signature):
            return kind
    if raw.startswith(b"PK\x03\x04"):
        return _archive(raw)
    if text[:1] in (b"{", b"[") and (kind := _json(text)):
        return kind
    if b"\0" in raw:
        return "no text"
    return _toml(text) or (TABLE if _rows(text) else "")


def _archive(raw: bytes) -> str:
    try:
        with zipfile.ZipFile(io.BytesIO(raw)) as archive:
            return SAVED if "content.npy" in archive.namelist() else "a ZIP archive"
    except zipfile.BadZipFile:
        return "a ZIP archive that breaks off"


def _json(text: bytes) -> str:
    """The kind of JSON; empty of what may be a table of TOML."""
    try:
        told = json.loads(text)
    except RecursionError:
        return "JSON that is nested too deeply"
    except ValueError as error:
        if not text.startswith(b"{"):
            return ""
        at = getattr(error, "lineno", 0), getattr(error, "colno", 0)
        return f"broken JSON (line {at[0]}, column {at[1]})" if all(at) else "broken JSON"
    if not isinstance(told, dict):
        return "a list in JSON"
    return next((k for k, keys in _JSON if all(n in told for n in keys)), "JSON of another kind")


def _toml(text: bytes) -> str:
    try:
        told: dict[str, Any] = tomllib.loads(text.decode("utf-8", errors="replace"))
    except (ValueError, RecursionError):
        return ""
    if any(isinstance(told.get(n), dict) for n in ("channels", "ground")):
        return MAP
    return next((k for k, keys in _TOML if any(n in told for n in keys)), "")


def _rows(text: bytes) -> bool:
    """Whether the first two lines are cells of a table."""
    lines = text.splitlines()[:2]
    if len(lines) < 2 or b"=" in lines[0]:
        return False
    return any(lines[0].count(sep) == lines[1].count(sep) > 1 for sep in (b",", b";", b"\t"))
