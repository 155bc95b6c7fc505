"""HDF5, netCDF 4 and MATLAB 7.3 files, by h5py: numeric data sets in groups of any depth."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from ..recording import Recording
from ..table import Table
from .tree import Leaf, contents_of

_MATLAB_NUMBERS = (
    "double",
    "single",
    "logical",
    *(f"{s}int{b}" for s in ("", "u") for b in (8, 16, 32, 64)),
)


def read(path: Path, dbc: Path | None) -> Table | Recording:
    """Read a file; a table where all data sets are of one length."""
    import h5py

    leaves: list[Leaf] = []

    def visit(name: str, node: Any) -> None:
        if not isinstance(node, h5py.Dataset) or node.dtype.kind not in "biuf":
            return
        kind = _text(node.attrs.get("MATLAB_class", ""))
        if name.startswith("#") or (kind and kind not in _MATLAB_NUMBERS):
            return  # text, cells, and what MATLAB keeps for its objects
        if "MATLAB_empty" in node.attrs or node.ndim not in (1, 2):
            return
        values = np.asarray(node).T if kind else np.asarray(node)  # MATLAB stores columns first
        unit = next(
            (_text(node.attrs[k]) for k in ("units", "unit", "Unit") if k in node.attrs), ""
        )
        leaves.append(Leaf(tuple(name.split("/")), np.squeeze(values), unit))

    with h5py.File(path) as file:
        file.visititems(visit)
    return contents_of(leaves, str(path))


def _text(value: Any) -> str:
    if isinstance(value, bytes):
        return value.decode("utf-8", errors="replace")
    return str(value)
