"""Studies to be done, from a TOML file."""

from __future__ import annotations

import glob
import re
from pathlib import Path
from typing import Any

from .._common.files import as_path, read_toml, refuse_unknown
from .._common.kinds import MANIFEST
from ..errors import InvalidInput
from ..model import Model
from ..read import ChannelMap
from .jobs import Job, check_apart, check_name, check_options, model_of

_FILES = ("vehicle", "channels", "dbc")
_SHARED = (*_FILES, "nuisances")


def manifest_jobs(path: str | Path) -> list[Job]:
    """Read the studies that a manifest asks for.

    Raises
    ------
    InvalidInput
        The file or a vehicle file cannot be read, a key is unknown, or no log matches.
    """
    path = as_path(path)
    told = read_toml(path, MANIFEST)
    refuse_unknown(told, (*_SHARED, "logs", "define", "improve", "study"), str(path))
    options = told.get("improve", {})
    if not isinstance(options, dict):
        raise InvalidInput(f"{path}: improve is no table; write [improve]")
    check_options(options, f"{path}: [improve]")
    define = tuple(path.parent / p for p in _texts(told, "define", str(path)))
    shared = {key: told[key] for key in _SHARED if key in told}
    entries = [
        {**shared, "name": name, "logs": [str(log)]}
        for pattern in _texts(told, "logs", str(path))
        for name, log in _matches(path, pattern)
    ]
    studies = told.get("study", [])
    if not isinstance(studies, list) or not all(isinstance(s, dict) for s in studies):
        raise InvalidInput(f"{path}: study is no list of tables; write [[study]]")
    for i, study in enumerate(studies, start=1):
        where = f"{path}: [[study]] {i}"
        refuse_unknown(study, (*_SHARED, "name", "logs", "validation"), where)
        entries.append({**shared, **study})
    jobs = [_job(path, i, e, define, options) for i, e in enumerate(entries, start=1)]
    if not jobs:
        raise InvalidInput(f'{path}: it names no log; give logs = "*.csv", or [[study]] tables')
    check_apart([job.name for job in jobs], str(path))
    return jobs


def _job(
    path: Path, at: int, told: dict[str, Any], define: tuple[Path, ...], options: dict[str, Any]
) -> Job:
    logs = _texts(told, "logs", f"{path}: study {at}")
    name = told.get("name") or (Path(logs[0]).stem if logs else None)
    where = f"{path}: study {at}" + (f" ({name})" if name else "")
    if not logs:
        raise InvalidInput(f'{where}: it has no logs; give logs = ["..."]')
    check_name(name)
    if "vehicle" not in told:
        raise InvalidInput(f'{where}: it has no car; give vehicle = "car.toml"')
    vehicle, channels, dbc = (_file(path, told, key, where) for key in _FILES)
    assert vehicle is not None
    return Job(
        str(name),
        _with_nuisances(model_of(vehicle), told.get("nuisances", False), where),
        tuple(path.parent.absolute() / log for log in logs),
        tuple(path.parent.absolute() / log for log in _texts(told, "validation", where)),
        None if channels is None else ChannelMap.from_toml(channels),
        dbc,
        define,
        options,
    )


def _with_nuisances(model: Model, asked: object, where: str) -> Model:
    if isinstance(asked, bool):
        return model.with_nuisances() if asked else model
    if not isinstance(asked, list) or not all(isinstance(n, str) for n in asked):
        raise InvalidInput(
            f"{where}: nuisances = {asked!r}; give true for the usual ones, or a list of effects"
        )
    return model.with_nuisances(asked)


def _file(path: Path, told: dict[str, Any], key: str, where: str) -> Path | None:
    if key not in told:
        return None
    if not isinstance(told[key], str):
        raise InvalidInput(f"{where}: {key} = {told[key]!r} is no path; write it in quotes")
    return path.parent.absolute().joinpath(told[key])


def _texts(told: dict[str, Any], key: str, where: str) -> list[str]:
    """The texts of a key: one, a list of them, or none."""
    given = told.get(key, [])
    texts = [given] if isinstance(given, str) else given
    if not isinstance(texts, list) or not all(isinstance(t, str) and t for t in texts):
        raise InvalidInput(f"{where}: {key} = {given!r}; give a path in quotes, or a list of them")
    return texts


def _matches(manifest: Path, pattern: str) -> list[tuple[str, Path]]:
    """Files that match, and their names: what follows the last folder without a wildcard."""
    folders = Path(pattern).parts[:-1]
    fixed = next((i for i, p in enumerate(folders) if re.search(r"[*?\[]", p)), len(folders))
    here = manifest.parent.absolute()  # its name may hold what is a wildcard in a pattern
    root = here.joinpath(*folders[:fixed])
    found = sorted(here / p for p in glob.glob(pattern, root_dir=here, recursive=True))
    if not found:
        raise InvalidInput(f"{manifest}: no file matches logs = '{pattern}'; correct the path")
    return [(p.relative_to(root).with_suffix("").as_posix(), p) for p in found]
