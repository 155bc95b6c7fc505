"""Results in files: written by one process, read by another, and by later versions.

A file is a NumPy archive: arrays, and one text of JSON that says of which objects they are part.
Nothing in it is run when it is read; only dataclasses of this package are made, by their
constructors, which check what they are given.
"""

from __future__ import annotations

import dataclasses
import hashlib
import importlib
import io
import json
import math
from pathlib import Path
from typing import Any

import numpy as np

from ._common.files import as_path, write_bytes
from ._common.typed import typed
from ._core import __version__
from .effects import Effect, effect
from .errors import InvalidInput

VERSION = 1
_NAME = "sysid_vehicle result"
_CONTENT = "content"
_NUMBERS = "biuf"  # kinds of arrays
_PACKAGE = __name__.rpartition(".")[0]
# Stations of the package whose dataclasses may stand in a file.
_STATIONS = (
    *("tyre", "vehicle", "effects", "model", "rules", "log", "estimate", "identify", "compare"),
    *("diagnose", "sensors", "study"),
)
# Where modules have moved to since a version wrote their classes: old name to new name.
_MOVED: dict[str, str] = {
    "compare.where": "compare.failure_map",
    "effects": "effects.catalogue",
    **{f"log._{module}": f"log.{module}" for module in ("build", "channels", "log")},
    **dict.fromkeys(("log._ranges", "log.ranges"), "log.laws.ranges"),
    "diagnose.doubt": "diagnose.candidates.reservation",
    **{
        f"diagnose.{module}": f"diagnose.{folder}.{module}"
        for folder, modules in {
            "evidence": "coordinates evidence",
            "candidates": "causes clocks constancy diagnosis instead reservation score "
            "single_effects verdicts",
            "unexplained": "ceiling change_points coherence delay force_map grammar omnibus "
            "proposals shape unknown where",
            "experiment": "hiding information next_drive suggestion",
            "change": "change",
        }.items()
        for module in modules.split()
    },
    **{
        f"{station}.{module}": f"{station}.{folder}.{module}"
        for station, folder, modules in (
            ("study", "ahead", "beyond horizons shares waterfall"),
            ("study", "judge", "answers disagree foretold structure"),
            ("study", "results", "added predicting"),
            ("identify", "search", "starts"),
            ("identify", "intervals", "estimates profile"),
        )
        for module in modules.split()
    },
}
# Classes that have another name or module since, by their place.
_CALLED: dict[str, str] = {
    "vehicle:Tyre": "tyre:Tyre",
    "rules.accept:Change": "rules.accept:ErrorChange",
    "diagnose.candidates.diagnosis:Candidate": "diagnose.candidates.candidate:Candidate",
}
# Fields that have another name since, by class.
_RENAMED: dict[str, dict[str, str]] = {
    "effects.catalogue:Effect": {"twins": "confounded_with"},
    "estimate.noise:NoiseModel": {"wander": "disturbance"},
    "diagnose.candidates.diagnosis:Diagnosis": {"causes": "proposed"},
    "diagnose.unexplained.proposals:Proposal": {
        "held_out_gain": "validation_gain",
        "held_out_error": "validation_gain_std",
    },
    "study.study:Study": {
        "held_out": "validation",
        "omnibus_held_out": "omnibus_together",
        "omnibus_validation": "omnibus_together",
    },
}


def save(result: object, path: str | Path) -> None:
    """Write a result: a model, a fit, a study, or what else the package returns of these stations.

    Parameters
    ----------
    result : Model, Fit, Study, ...
    path : str or Path
        File to write, complete or not at all; ``.npz`` is the usual ending.

    Raises
    ------
    InvalidInput
        If it holds something that no file can hold, or the file cannot be written.
    """
    write_bytes(path, packed(result))


def packed(result: object) -> bytes:
    """Return what :func:`save` writes to a file.

    Raises
    ------
    InvalidInput
        If the result holds something that no file can hold.
    """
    writer = _Writer()
    text = writer.text(result)
    held = io.BytesIO()
    arrays = {f"a{k}": array for k, array in enumerate(writer.arrays)}
    np.savez_compressed(held, **{_CONTENT: np.frombuffer(text, dtype=np.uint8)}, **arrays)  # type: ignore[arg-type]
    return held.getvalue()


def fingerprint(result: object) -> str:
    """A text that differs where what a file would hold differs, or the package's version.

    Raises
    ------
    InvalidInput
        If the result holds something that no file can hold.
    """
    writer = _Writer()
    held = hashlib.sha256(writer.text(result))
    for array in writer.arrays:
        held.update(np.ascontiguousarray(array).tobytes())
        held.update(f"{array.dtype}{array.shape}".encode())
    return held.hexdigest()


@typed
def load(path: str | Path) -> Any:
    """Read what :func:`save` or a method ``save`` wrote.

    Raises
    ------
    InvalidInput
        If the file cannot be read, is no such file, or was written by a later version.
    """
    path = as_path(path)
    try:
        with path.open("rb") as stream, np.load(stream, allow_pickle=False) as archive:
            content = json.loads(bytes(archive[_CONTENT]))
            arrays = {name: archive[name] for name in archive.files if name != _CONTENT}
    except Exception as error:  # of damaged bytes zlib, zipfile and NumPy say many things
        if isinstance(error, OSError) and error.strerror:
            raise InvalidInput(
                f"{path}: cannot be read ({error.strerror}); check the path"
            ) from error
        raise InvalidInput(
            f"{path}: is no saved result of sysid_vehicle, or is broken; save it again"
        ) from error
    if not isinstance(content, dict) or content.get("format") != _NAME:
        raise InvalidInput(f"{path}: is no saved result of sysid_vehicle; give one that save wrote")
    version = content.get("version")
    if not isinstance(version, int) or not 1 <= version <= VERSION:
        raise InvalidInput(
            f"{path}: has version {version!r} of the format, written by sysid_vehicle "
            f"{content.get('package', 'of another release')}; this one, {__version__}, reads "
            f"versions up to {VERSION}: install a later sysid_vehicle"
        )
    try:
        for name, array in arrays.items():
            if array.dtype.kind not in _NUMBERS:
                raise TypeError(f"{name} holds {array.dtype}")
        reader = _Reader(content["objects"], arrays)
        return reader.value(content["root"])
    except InvalidInput as error:
        raise InvalidInput(f"{path}: {error}") from error
    except (
        LookupError,
        TypeError,
        ValueError,
        AttributeError,
        ImportError,
        RecursionError,
    ) as error:
        raise InvalidInput(
            f"{path}: holds what this version cannot make again "
            f"({type(error).__name__}: {error}); save it again with sysid_vehicle {__version__}"
        ) from error


class _Writer:
    """Values as JSON, each object and array once however often it is referred to."""

    def __init__(self) -> None:
        self.objects: list[Any] = []
        self.arrays: list[Any] = []
        self._places: dict[int, dict[str, int]] = {}
        self._kept: list[object] = []  # as long as ids count

    def text(self, result: object) -> bytes:
        content = {
            "format": _NAME,
            "version": VERSION,
            "package": __version__,
            "root": self.value(result),
            "objects": self.objects,
        }
        return json.dumps(content, allow_nan=False, separators=(",", ":")).encode()

    def value(self, x: Any) -> Any:
        if x is None or isinstance(x, bool | str) or type(x) is int:
            return x
        if isinstance(x, np.generic):
            return self.value(x.item())
        if isinstance(x, float):
            return float(x) if math.isfinite(x) else {"float": repr(float(x))}
        if isinstance(x, list):
            return [self.value(y) for y in x]
        if isinstance(x, tuple):
            return {"tuple": [self.value(y) for y in x]}
        if isinstance(x, dict):
            return {"dict": [[self.value(k), self.value(v)] for k, v in x.items()]}
        if isinstance(x, slice):
            return {"slice": [x.start, x.stop, x.step]}
        if isinstance(x, np.ndarray) and x.dtype.kind in _NUMBERS:
            return self._once(x, lambda: {"array": self._array(x)})
        if dataclasses.is_dataclass(x) and not isinstance(x, type):
            return self._once(x, lambda: {"object": self._object(x)})
        raise InvalidInput(
            f"{type(x).__name__}: cannot be saved; save the model, the fit or the study"
        )

    def _once(self, x: object, make: Any) -> dict[str, int]:
        if id(x) not in self._places:
            self._kept.append(x)
            self._places[id(x)] = make()
        return self._places[id(x)]

    def _array(self, x: Any) -> int:
        self.arrays.append(x)
        return len(self.arrays) - 1

    def _object(self, x: Any) -> int:
        module = type(x).__module__.removeprefix(_PACKAGE + ".")
        if module.split(".")[0] not in _STATIONS:
            raise InvalidInput(
                f"{type(x).__name__}: cannot be saved; save the model, the fit or the study"
            )
        if isinstance(x, Effect) and x.__reduce__()[0] is effect:
            self.objects.append({"effect": x.id})
            return len(self.objects) - 1
        held = {f.name: self.value(getattr(x, f.name)) for f in dataclasses.fields(x) if f.init}
        self.objects.append({"class": f"{module}:{type(x).__qualname__}", "fields": held})
        return len(self.objects) - 1


class _Reader:
    """The way back."""

    def __init__(self, objects: list[Any], arrays: dict[str, Any]) -> None:
        self._objects = objects
        self._arrays = arrays
        self._made: dict[int, Any] = {}

    def value(self, x: Any) -> Any:
        if isinstance(x, list):
            return [self.value(y) for y in x]
        if not isinstance(x, dict):
            return x
        ((kind, held),) = x.items()
        if kind == "float":
            return float(held)
        if kind == "tuple":
            return tuple(self.value(y) for y in held)
        if kind == "dict":
            return {self.value(k): self.value(v) for k, v in held}
        if kind == "slice":
            return slice(*held)
        if kind == "array":
            return self._arrays[f"a{held}"]
        if kind == "object":
            if held not in self._made:
                self._made[held] = self._object(self._objects[held])
            return self._made[held]
        raise KeyError(kind)

    def _object(self, told: dict[str, Any]) -> Any:
        if "effect" in told:
            return effect(told["effect"])
        module, _, name = told["class"].partition(":")
        place = f"{_MOVED.get(module, module)}:{name}"
        module, _, name = _CALLED.get(place, place).partition(":")
        place = f"{module}:{name}"
        if module.split(".")[0] not in _STATIONS:
            raise KeyError(place)
        cls = getattr(importlib.import_module(f"{_PACKAGE}.{module}"), name)
        if not (isinstance(cls, type) and dataclasses.is_dataclass(cls)):
            raise KeyError(place)
        if cls.__module__ != f"{_PACKAGE}.{module}":
            raise KeyError(place)
        known = {f.name for f in dataclasses.fields(cls) if f.init}
        # What later versions no longer keep is left; what they keep more has its default.
        renamed = _RENAMED.get(place, {})
        told_fields = {renamed.get(n, n): v for n, v in told["fields"].items()}
        given = {n: self.value(v) for n, v in told_fields.items() if n in known}
        made = cls(**given)
        if module.split(".")[0] == "log":
            for array in getattr(made, "_data", {}).values():
                array.flags.writeable = False
        return made
