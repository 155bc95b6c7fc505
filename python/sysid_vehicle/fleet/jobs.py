"""What is to be studied: a car, its logs, and how to study them."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from inspect import signature
from pathlib import Path, PurePosixPath
from typing import Any

from .._common.files import as_path, refuse_unknown
from .._common.typed import blaming
from ..effects import Effect
from ..errors import InvalidInput
from ..log import Log
from ..model import Model
from ..read import ChannelMap
from ..saved import fingerprint
from ..study import asked, improve
from ..vehicle import Vehicle

Car = Vehicle | Model | str | Path
Drive = Log | str | Path
Options = Mapping[str, Any]

_OURS = ("model", "train", "test", "workers", "progress", "tell")


@dataclass(frozen=True)
class Job:
    """One study to be done; it can be sent to another process.

    Attributes
    ----------
    name : str
        ``run``, or ``car/run``.
    model : Model
        The baseline.
    train, validation : tuple of Log or Path
        Paths are read where the study is done. Without validation data some of the driving is kept
        for them.
    channels : ChannelMap or None
    dbc : Path or None
    define : tuple of Path
        Python files that define effects.
    options : mapping
        Further arguments of `improve`.
    effects : tuple of Effect
        Effects that were defined in the session, which another process does not know.
    """

    name: str
    model: Model
    train: tuple[Log | Path, ...]
    validation: tuple[Log | Path, ...] = ()
    channels: ChannelMap | None = None
    dbc: Path | None = None
    define: tuple[Path, ...] = ()
    options: Options = field(default_factory=dict)
    effects: tuple[Effect, ...] = ()

    @property
    def car(self) -> str:
        """The car, as far as the name tells."""
        return self.name.partition("/")[0]

    def digest(self) -> str:
        """A text that differs where the study may come out differently.

        Raises
        ------
        InvalidInput
            If an option is something that no file can hold.
        """
        channels = None if self.channels is None else repr(self.channels)
        files = [None if self.dbc is None else _content(self.dbc), *map(_content, self.define)]
        logs = [[_content(x) for x in drives] for drives in (self.train, self.validation)]
        options = {name: self.options[name] for name in sorted(self.options)}
        asked = [self.model, channels, files, logs, options]
        return fingerprint([*asked, list(self.effects)] if self.effects else asked)


def _content(source: Log | Path) -> Log | str:
    """What tells one log from another: the samples, or what stands in the file or folder."""
    if isinstance(source, Log):
        return source
    held = hashlib.sha256()
    try:
        inside = sorted(p for p in source.rglob("*") if p.is_file()) if source.is_dir() else []
        for path in inside or [source]:
            with path.open("rb") as stream:
                while piece := stream.read(1 << 20):
                    held.update(piece)
    except OSError as error:  # the study will tell
        return f"{error.strerror}"
    return held.hexdigest()


def jobs_of(
    cars: Car | Mapping[str, Car],
    logs: Mapping[str, Drive | Sequence[Drive]] | Sequence[Drive | Sequence[Drive]],
    validation: Mapping[str, Drive | Sequence[Drive]] | None = None,
    **shared: Any,
) -> list[Job]:
    """Make the jobs of one car, or of a car for each name, and of logs.

    Raises
    ------
    InvalidInput
        A name that no file can have or that comes twice, a car without logs or logs without car.
    """
    named = logs if isinstance(logs, Mapping) else _named(logs)
    if not named:
        raise InvalidInput("improve_many: there are no logs; give one or more")
    if validation is not None and not isinstance(validation, Mapping):
        raise InvalidInput(
            f"improve_many: validation is a {type(validation).__name__}; give a mapping from the "
            f"names of the logs to their validation data"
        )
    kept_apart = dict(validation or {})
    refuse_unknown(kept_apart, named, "validation")
    models = {n: model_of(c) for n, c in cars.items()} if isinstance(cars, Mapping) else {}
    one = None if isinstance(cars, Mapping) else model_of(cars)
    jobs: list[Job] = []
    check_apart(named, "improve_many")
    for name, drives in named.items():
        check_name(name)
        model = one or models.get(name) or models.get(name.partition("/")[0])
        if model is None:
            either = " or ".join(dict.fromkeys((f"'{name}'", f"'{name.partition('/')[0]}'")))
            raise InvalidInput(f"{name}: no car is given for it; name {either} among the cars")
        kept = _drives(kept_apart.get(name, ()), name)
        jobs.append(Job(name, model, _drives(drives, name), kept, **shared))
    return jobs


def model_of(car: Car) -> Model:
    """The baseline of a car: the model itself, or that of a vehicle or of a vehicle's file."""
    if isinstance(car, Model):
        return car
    return Model(car if isinstance(car, Vehicle) else Vehicle.from_toml(as_path(car)))


def check_name(name: object) -> None:
    """Refuse what cannot be the name of a file below the folder of results.

    Raises
    ------
    InvalidInput
        As it says.
    """
    parts = PurePosixPath(name).parts if isinstance(name, str) else ()
    plain = "/".join(parts) == name and len(parts) in (1, 2)
    if not plain or any(p in (".", "..") or set(p) & set('\\:*?"<>|\0\n') for p in parts):
        raise InvalidInput(
            f"{name!r} is no name of a study; give one such as 'monday' or 'car 17/monday'"
        )


def check_apart(names: Iterable[object], where: str) -> None:
    """Refuse names that come twice, also those that some disks hold for the same.

    Raises
    ------
    InvalidInput
        As it says.
    """
    files: dict[str, object] = {}
    for name in names:
        file = str(name).casefold()
        if file in files:
            twice = f"two studies are called '{name}'"
            alike = f"'{files[file]}' and '{name}' are one file on some disks"
            raise InvalidInput(f"{where}: {twice if files[file] == name else alike}; rename one")
        files[file] = name


def check_options(options: Options, where: str) -> None:
    """Refuse what is no argument of `improve` that can be chosen here.

    Raises
    ------
    InvalidInput
        An unknown argument, or one that is given otherwise.
    """
    known = [p for p in signature(improve).parameters if p not in _OURS]
    refuse_unknown(options, known, where)
    if options.get("sensors") is not None and options["sensors"] is not False:
        raise InvalidInput(
            f"{where}: sensors: each study checks the sensors of its own logs; give False to leave "
            f"logs as they are"
        )


def check_asked(jobs: Iterable[Job]) -> None:
    """Refuse values of options that `improve` refuses whatever the log; effects are defined by now.

    Raises
    ------
    InvalidInput
        As `improve` says it.
    """
    usual = {name: p.default for name, p in signature(improve).parameters.items()}
    for job in jobs:
        given = {
            name: job.options.get(name, usual[name])
            for name in signature(asked).parameters
            if name != "model"
        }
        with blaming(improve, given):
            asked(job.model, **given)


def _named(logs: Sequence[Drive | Sequence[Drive]]) -> dict[str, Drive | Sequence[Drive]]:
    """Logs by the names of the first of each study."""
    named: dict[str, Drive | Sequence[Drive]] = {}
    for entry in _many(logs, "improve_many"):
        first = next(iter(_many(entry, "improve_many")), None)
        if first is None:
            raise InvalidInput("improve_many: a study has no logs; give one or more")
        name = first.name if isinstance(first, Log) else as_path(first).stem
        if name in named:
            raise InvalidInput(
                f"two studies are called '{name}'; give a mapping from names to logs"
            )
        named[name] = entry
    return named


def _many(given: Any, name: str) -> list[Any]:
    """One log, or those of a sequence."""
    if isinstance(given, str | Path | Log):
        return [given]
    if not isinstance(given, Iterable):
        raise InvalidInput(f"{name}: {given!r} is no log; give a Log or the path of a file")
    return list(given)


def _drives(entry: Drive | Sequence[Drive], name: str) -> tuple[Log | Path, ...]:
    drives = _many(entry, name)
    for x in drives:
        if not isinstance(x, str | Path | Log):
            raise InvalidInput(f"{name}: {x!r} is no log; give a Log or the path of a file")
    return tuple(x if isinstance(x, Log) else as_path(x).absolute() for x in drives)
