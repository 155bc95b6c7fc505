"""HDF5, netCDF 4 and MATLAB 7.3 files, by h5py: numeric data sets in groups of any depth.

What is packed by the conventions of netCDF (``scale_factor``, ``add_offset``, ``_FillValue``) is
unpacked. The fields of a compound data set, such as a table of PyTables, are arrays beside it; so
are the columns of a matrix with a list of their names as an attribute (``columns``, ``names``).
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from ...errors import InvalidInput
from ..recording import Recording
from ..table import Table
from .tree import Leaf, contents_of

_MATLAB_NUMBERS = (
    "double",
    "single",
    "logical",
    *(f"{s}int{b}" for s in ("", "u") for b in (8, 16, 32, 64)),
)
_UNITS = ("units", "unit", "Unit")
_NAMES = ("columns", "column_names", "names", "labels", "channels", "fields")
_MATLAB_OBJECTS = ("timetable", "table", "timeseries", "datetime", "duration")


def read(path: Path, dbc: Path | None) -> Table | Recording:
    """Read a file; a table where all data sets are of one length."""
    import h5py

    leaves: list[Leaf] = []
    hidden: list[str] = []

    def visit(name: str, node: Any) -> None:
        if not isinstance(node, h5py.Dataset) or name.startswith("#"):
            return  # what MATLAB keeps for its objects
        kind = _text(node.attrs.get("MATLAB_class", ""))
        if kind in _MATLAB_OBJECTS:
            hidden.append(name)
        if (kind and kind not in _MATLAB_NUMBERS) or "MATLAB_empty" in node.attrs:
            return  # text and cells
        unit = next((_text(node.attrs[k]) for k in _UNITS if k in node.attrs), "")
        parts = tuple(name.split("/"))
        if names := _columns(node):
            units = _texts(node.attrs, _UNITS) or [unit] * len(names)
            for column, name, own in zip(next(_arrays(node))[1].T, names, units, strict=False):
                leaves.append(Leaf((*parts, name), column, own))
            return
        for inner, values in _arrays(node):
            values = values.T if kind else values  # MATLAB stores columns first
            leaves.append(Leaf((*parts, *inner), np.squeeze(values), unit))

    with h5py.File(path) as file:
        file.visititems(visit)
    if hidden and not leaves:
        raise InvalidInput(
            f"{path}: {hidden[0]} is an object of MATLAB (timetable, timeseries), which only "
            f"MATLAB can unpack; save structs of arrays: s.t = seconds(x.Time - x.Time(1)); "
            f"s.vx = x.vx; save('log.mat', '-struct', 's')"
        )
    return contents_of(leaves, str(path))


def _columns(node: Any) -> list[str]:
    """Names of the columns of a matrix, where its attributes hold as many; else none."""
    names = _texts(node.attrs, _NAMES)
    fits = node.ndim == 2 and node.dtype.kind in "biuf" and len(names) == node.shape[1]
    return names if fits and len({*names}) == len(names) else []


def _texts(attributes: Any, called: tuple[str, ...]) -> list[str]:
    """The first attribute of these that is a list of texts."""
    for name in called:
        value = np.asarray(attributes.get(name, ""))
        if value.ndim == 1 and value.dtype.kind in "OSU":
            return [_text(text).strip() for text in value]
    return []


def _arrays(node: Any) -> Iterator[tuple[tuple[str, ...], npt.NDArray[Any]]]:
    """The numbers of a data set, or those of each field of a compound one, with its name."""
    if node.dtype.names:
        for name in node.dtype.names:
            if node.dtype[name].kind in "biuf" and node.ndim == 1:
                yield (name,), np.asarray(node[name])
    elif node.dtype.kind in "biuf" and node.ndim in (1, 2):
        yield (), unpacked(np.asarray(node), node.attrs)


def unpacked(values: npt.NDArray[Any], attributes: Any) -> npt.NDArray[Any]:
    """Return what packed values stand for, by the attributes of netCDF; missing ones are NaN."""
    missing = np.zeros(values.shape, dtype=bool)
    for name in ("_FillValue", "missing_value"):
        if name in attributes:
            missing |= np.isin(values, np.ravel(attributes[name]))
    if "scale_factor" in attributes or "add_offset" in attributes:
        scale = float(np.ravel(attributes.get("scale_factor", 1.0))[0])
        offset = float(np.ravel(attributes.get("add_offset", 0.0))[0])
        values = scale * values.astype(np.float64) + offset
    return np.where(missing, np.nan, values) if missing.any() else values


def _text(value: Any) -> str:
    if isinstance(value, bytes):
        return value.decode("utf-8", errors="replace")
    return str(value)
