"""MATLAB files up to version 7, by SciPy.

Read are arrays, in structs of any depth; Simulink's structures with time; what dSPACE records
(``X.Data``, ``Y.Name``, ``Y.Data``, ``Y.Unit``); structs of a time and a value, with a unit beside;
arrays of structs that hold their names.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from ...errors import InvalidInput
from ..recording import Recording
from ..table import Table
from .tree import VALUES, Leaf, contents_of

_NAME, _UNIT = ("name", "label"), ("unit", "units")


def read(path: Path, dbc: Path | None) -> Table | Recording:
    """Read a file; a table where all arrays are of one length."""
    from scipy.io import loadmat

    held = loadmat(path, squeeze_me=True, struct_as_record=False)
    leaves: list[Leaf] = []
    hidden = [name for name, value in held.items() if _is_opaque(value)]
    own = {n: v for n, v in held.items() if not n.startswith("__") and n not in hidden}
    _walk_all(own, (), leaves)
    if hidden and not leaves:
        raise InvalidInput(
            f"{path}: {hidden[0]} is an object of MATLAB (timeseries, table), which only MATLAB "
            f"can unpack; save structs of arrays: s.t = x.Time; s.vx = x.Data; save('log.mat', "
            f"'-struct', 's')"
        )
    return contents_of(leaves, str(path))


def _is_opaque(value: Any) -> bool:
    return type(value).__name__ in ("MatlabOpaque", "MatlabFunction") or (
        isinstance(value, np.ndarray)
        and value.dtype.names is not None
        and "s2" in value.dtype.names
    )


def _walk(value: Any, path: tuple[str, ...], leaves: list[Leaf]) -> None:
    if hasattr(value, "_fieldnames"):
        fields = {name: getattr(value, name) for name in value._fieldnames}
        if _recorded(fields, path, leaves):
            return
        begun = len(leaves)
        _walk_all(fields, path, leaves)
        unit = _named(fields, _UNIT)
        for k in range(begun, len(leaves) if unit else begun):
            *around, last = leaves[k].path
            if tuple(around) == path and last.lower() in VALUES:
                leaves[k] = replace(leaves[k], unit=unit)
    elif isinstance(value, np.ndarray):
        if value.dtype.kind in "biuf":
            leaves.append(Leaf(path, value))
        elif value.dtype.kind == "O":
            names = [_named(getattr(s, "__dict__", {}), _NAME) for s in value.flat]
            told = len({*names} - {""}) == value.size
            for k, inner in enumerate(value.flat, 1):
                own = (*path, names[k - 1]) if told else (*path[:-1], f"{path[-1]}({k})")
                _walk(inner, own, leaves)


def _walk_all(fields: dict[str, Any], path: tuple[str, ...], leaves: list[Leaf]) -> None:
    """Take what stands side by side; a list of names beside a matrix names its columns."""
    lists = [names for value in fields.values() if (names := _names(value))]
    for name, value in fields.items():
        fitting = [n for n in lists if np.ndim(value) == 2 and np.shape(value)[1] == len(n)]
        if len(fitting) == 1 and value.dtype.kind in "biuf":
            for column, own in zip(np.transpose(value), fitting[0], strict=True):
                leaves.append(Leaf((*path, own), column))
        else:
            _walk(value, (*path, name), leaves)


def _names(value: Any) -> list[str]:
    """A cell array of different words, or rows of text, as the list of them; empty of all else."""
    if not (isinstance(value, np.ndarray) and value.ndim == 1 and value.dtype.kind in "OU"):
        return []
    names = [str(name).strip() for name in value if isinstance(name, str)]
    return names if len({*names} - {""}) == value.size else []


def _recorded(fields: dict[str, Any], path: tuple[str, ...], leaves: list[Leaf]) -> bool:
    """Take the layouts of Simulink and dSPACE, in which names of channels are values."""
    if {"time", "signals"} <= set(fields):
        time = np.atleast_1d(np.asarray(fields["time"], dtype=np.float64))
        signals = np.atleast_1d(fields["signals"])
        for k, signal in enumerate(signals, 1):
            name = _text(getattr(signal, "label", ""))
            alone = signals.size == 1 and name in ("", *path[-1:])  # the struct is called like it
            own = path if alone and path else (*path, name or f"signals({k})")
            leaves.append(Leaf(own, np.asarray(signal.values), time_s=time))
        return True
    if {"X", "Y"} <= set(fields):
        axes = np.atleast_1d(fields["X"])
        for k, signal in enumerate(np.atleast_1d(fields["Y"]), 1):
            which = np.atleast_1d(getattr(signal, "XIndex", 1)).astype(int)
            axis = axes[min(max(int(which[0]) if which.size else 1, 1), axes.size) - 1]
            time = np.atleast_1d(np.asarray(axis.Data, dtype=np.float64))
            name = _text(getattr(signal, "Name", "")) or f"Y({k})"
            unit = _text(getattr(signal, "Unit", ""))
            leaves.append(Leaf((*path, name), np.asarray(signal.Data), unit, time))
        return True
    return False


def _named(fields: dict[str, Any], called: tuple[str, ...]) -> str:
    """The text in a struct that is called so."""
    return next((_text(x) for name, x in fields.items() if name.lower() in called), "")


def _text(value: Any) -> str:
    return str(value) if isinstance(value, str) else ""
