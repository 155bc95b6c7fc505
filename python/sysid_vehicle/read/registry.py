"""The one table of what can be read: how a file is recognised, who reads it, what that needs."""

from __future__ import annotations

import importlib
import os
import re
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

from .._common.files import read_bytes
from ..errors import InvalidInput
from .recording import Recording
from .table import Table

_BEGINNING = 4096  # bytes by which a file is recognised


class Reader(Protocol):
    """What the home file of a format defines."""

    def read(self, path: Path, dbc: Path | None) -> Table | Recording:
        """Read a file."""


@dataclass(frozen=True)
class Format:
    """A format of logs.

    Attributes
    ----------
    what : str
        With its article, for messages.
    module : str
        Home file in this folder, whose ``read`` reads it.
    suffixes : tuple of str
        Usual endings of file names.
    signatures : tuple of bytes
        What such files begin with.
    pattern : regular expression or None
        What the beginning of a file of text holds.
    extra : str
        Extra of the package that brings the libraries; empty if none is needed.
    libraries : tuple of str
        Modules that have to be there.
    mend : str
        What to do with a broken one.
    """

    what: str
    module: str
    suffixes: tuple[str, ...]
    signatures: tuple[bytes, ...] = ()
    pattern: re.Pattern[bytes] | None = None
    extra: str = ""
    libraries: tuple[str, ...] = ()
    mend: str = "record or export it again"


_HDF5 = b"\x89HDF\r\n\x1a\n"
_CAN_LIBRARIES = ("can", "cantools")

FORMATS: tuple[Format, ...] = (
    Format(
        "a Parquet file",
        "parquet",
        (".parquet", ".pq"),
        (b"PAR1",),
        extra="parquet",
        libraries=("pyarrow",),
    ),
    Format(
        "an Arrow file",
        "arrow",
        (".arrow", ".arrows", ".feather", ".ipc"),
        (b"ARROW1", b"\xff\xff\xff\xff"),
        extra="parquet",
        libraries=("pyarrow",),
    ),
    Format(
        "a MATLAB file",
        "matlab",
        (".mat",),
        (b"MATLAB 5.0 MAT-file",),
        # Version 4 begins with type, rows, columns, whether complex, length of the name, the name.
        re.compile(rb"(?s)\A[\0-\x34]\0{3}.{8}[\0\1]\0{3}[\x02-\x40]\0{3}[A-Za-z]\w*\0"),
    ),
    Format("a netCDF 3 file", "netcdf", (".nc",), (b"CDF\x01", b"CDF\x02")),
    Format(
        "a MATLAB 7.3 file",
        "hdf5",
        (".mat",),
        (b"MATLAB 7.3 MAT-file",),
        extra="hdf5",
        libraries=("h5py",),
    ),
    Format(
        "an HDF5 file", "hdf5", (".h5", ".hdf5", ".nc"), (_HDF5,), extra="hdf5", libraries=("h5py",)
    ),
    Format(
        "an ASAM MDF file",
        "mdf",
        (".mf4", ".mdf", ".dat"),
        (b"MDF     ", b"UnFinMF "),
        extra="mdf",
        libraries=("asammdf",),
    ),
    Format(
        "an MCAP file",
        "mcap_file",
        (".mcap",),
        (b"\x89MCAP0\r\n",),
        extra="mcap",
        libraries=("mcap", "mcap_ros2"),
        mend="mend it with mcap recover, or record it again",
    ),
    Format(
        "a ROS bag",
        "ros_bag",
        (".bag", ".db3", "/"),
        (b"#ROSBAG V", b"SQLite format 3"),
        extra="ros",
        libraries=("rosbags",),
        mend="mend it with rosbag reindex or ros2 bag reindex, a data base that is malformed with "
        "sqlite3 old.db3 .recover | sqlite3 new.db3, or record it again",
    ),
    Format(
        "a CAN log",
        "can_log",
        (".blf", ".asc", ".log", ".trc"),
        (b"LOGG", b";$FILEVERSION"),
        re.compile(
            rb"\A(\(\d+\.\d+\) +\w+ +[0-9A-Fa-f]+#|date [^\n]*\n\s*base +(hex|dec)"
            rb"|\s*(\([-\d. :]+\) +)?[a-z]\w* +([RT]X [-BE ]+)?[0-9A-F]{3,8} +\[\d+\] "
            rb"|timestamp,arbitration_id,)"
        ),
        extra="can",
        libraries=_CAN_LIBRARIES,
    ),
    Format(
        "a VBOX file",
        "vbox",
        (".vbo",),
        (),
        re.compile(rb"(?i)\A\s*File created on|^\[header\]", re.M),
    ),
    Format(
        "a MoTeC CSV file",
        "motec",
        (".csv",),
        (),
        re.compile(rb"(?i)\A(\xef\xbb\xbf)?\"?Format\"?[,;\t] *\"?(MoTeC|AiM) CSV"),
    ),
)


def recognised(path: Path) -> Format | None:
    """Return the format of a file, by what it begins with; None for plain columns of text.

    Raises
    ------
    InvalidInput
        If the file cannot be read.
    """
    if path.is_dir():
        if not (path / "metadata.yaml").exists():
            raise InvalidInput(
                f"{path}: is a folder without metadata.yaml, so no ROS 2 bag; give one file in it, "
                f"or make that with ros2 bag reindex"
            )
        return next(f for f in FORMATS if "/" in f.suffixes)
    begin = read_bytes(path, _BEGINNING)
    for entry in FORMATS:
        if any(begin.startswith(signature) for signature in entry.signatures):
            return entry
        if entry.pattern is not None and entry.pattern.search(begin):
            return entry
    return None


def read_with(entry: Format, path: Path, dbc: Path | None) -> Table | Recording:
    """Read a file of a recognised format.

    Raises
    ------
    InvalidInput
        If a library is absent; the message names the extra.
    """
    require(entry, str(path))
    home: Reader = importlib.import_module(f".formats.{entry.module}", __package__)
    return home.read(path, dbc)


@contextmanager
def located(where: str, run: str | None = None, entry: Format | None = None) -> Iterator[None]:
    """Whatever is refused inside the block names the file, in place of the name of the run.

    What a library raises at a broken file of the format `entry` is one sentence of what it is.
    """
    inside = f"{where}{os.sep}"  # of a file of a folder
    try:
        yield
    except InvalidInput as error:
        told = str(error)
        if told.startswith((f"{where}: ", inside)):
            raise
        told = told if run is None else told.removeprefix(f"{run}: ")
        raise InvalidInput(f"{where}: {told}") from error
    except MemoryError:
        raise
    except Exception as error:
        if entry is None:
            raise
        reader = f"{entry.libraries[0]} cannot read it" if entry.libraries else "it is broken"
        told = str(error).replace(inside, "")
        raise InvalidInput(
            f"{where}: is {entry.what}, but {reader} ({type(error).__name__}: {told}); {entry.mend}"
        ) from error


def require(entry: Format, who: str) -> None:
    """Raise :class:`InvalidInput` that names the extra if a library of a format is absent."""
    for library in entry.libraries:
        try:
            importlib.import_module(library)
        except ImportError as error:
            raise InvalidInput(
                f"{who}: is {entry.what}, which needs {library}, and that is not installed; "
                f"pip install 'sysid-vehicle[{entry.extra}]'"
            ) from error
