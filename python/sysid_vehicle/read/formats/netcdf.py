"""netCDF 3 files, by SciPy: numeric variables over one or two dimensions; packed ones unpacked."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ..recording import Recording
from ..table import Table
from .hdf5 import unpacked
from .tree import Leaf, contents_of


def read(path: Path, dbc: Path | None) -> Table | Recording:
    """Read a file; a table where all variables are of one length."""
    from scipy.io import netcdf_file

    leaves: list[Leaf] = []
    with netcdf_file(path, mmap=False) as file:
        for name, variable in file.variables.items():
            values = np.asarray(variable.data)
            if values.dtype.kind in "biuf" and values.ndim in (1, 2):
                unit = getattr(variable, "units", b"")
                unit = unit.decode("utf-8", errors="replace") if isinstance(unit, bytes) else ""
                native = values.astype(values.dtype.newbyteorder("="))
                leaves.append(
                    Leaf((name,), np.squeeze(unpacked(native, variable._attributes)), unit)
                )
    return contents_of(leaves, str(path))
