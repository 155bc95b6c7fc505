"""Results as tables of pandas and xarray, which are imported only here and only when asked for."""

from __future__ import annotations

import importlib
import warnings
from collections.abc import Mapping, Sequence
from typing import Any

import numpy.typing as npt

from ..errors import InvalidInput


def imported(module: str, extra: str) -> Any:
    """Import a library that not everybody needs.

    Raises
    ------
    InvalidInput
        If it is not installed; the message names the extra that brings it.
    """
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", FutureWarning)  # what it plans for later versions
            return importlib.import_module(module)
    except ImportError as error:
        raise InvalidInput(
            f"{module} is not installed; pip install 'sysid-vehicle[{extra}]'"
        ) from error


def frame(columns: Mapping[str, Sequence[object] | npt.NDArray[Any]], index: str) -> Any:
    """A pandas DataFrame whose column `index` names the rows."""
    pandas = imported("pandas", "tables")
    return pandas.DataFrame(dict(columns)).set_index(index)


def dataset(
    variables: Mapping[str, tuple[Sequence[str], npt.NDArray[Any], str]],
    coordinates: Mapping[str, tuple[Sequence[object] | npt.NDArray[Any], str]],
    title: str,
) -> Any:
    """An xarray Dataset.

    Parameters
    ----------
    variables : mapping
        By name: dimensions, values, unit.
    coordinates : mapping
        By dimension: values, unit.
    title : str
    """
    xarray = imported("xarray", "tables")

    def attributes(unit: str) -> dict[str, str]:
        return {"units": unit} if unit else {}

    return xarray.Dataset(
        {name: (list(dims), v, attributes(unit)) for name, (dims, v, unit) in variables.items()},
        {name: ([name], v, attributes(unit)) for name, (v, unit) in coordinates.items()},
        {"title": title},
    )
