"""Identified models for use elsewhere: Python, C++, CasADi, FMU, property files of tyres, TOML."""

from __future__ import annotations

from pathlib import Path

from .._common.arguments import expect
from .._common.files import as_path, write_bytes, write_text
from .._common.typed import typed
from ..errors import InvalidInput, warn
from ..identify import Fit
from ..model import Model
from ..vehicle import AXLES, Vehicle
from .equations import equations
from .fmu import fmu_bytes
from .languages import casadi_function, cpp_text, python_text
from .tyres import left_out_of_tir, tir_text
from .vehicle_file import vehicle_and_rest

__all__ = [
    "casadi_function",
    "cpp_text",
    "export",
    "fmu_bytes",
    "identified_vehicle",
    "python_text",
    "tir_text",
]

_SHIFT = "cg_position.shift_rearward_m"
_SUFFIXES = ".py, .hpp, .h, .fmu, .tir or .toml"


@typed
def export(what: Model | Fit, path: str | Path) -> tuple[Path, ...]:
    """Write a model for use elsewhere; the ending of the name says as what.

    Parameters
    ----------
    what : Model or Fit
    path : str or Path
        ``.py``: a module of Python that needs NumPy alone. ``.hpp`` or ``.h``: a header of C++ that
        needs the standard library alone. ``.fmu``: a Functional Mock-up Unit of FMI 3.0 for model
        exchange and co-simulation, compiled for this platform, with its source. ``.tir``: property
        files of MF 5.2, one for each axle, ``_front`` and ``_rear`` added to the name. ``.toml``: a
        vehicle file with the tyres and the yaw inertia of the model, and with the numbers that its
        effects changed, such as mass, centre of gravity or drag. Effects for which a file has no
        place are named in a warning, and so is what each log has of its own (`with_nuisances`).

    Returns
    -------
    tuple of Path
        The files that were written.

    Raises
    ------
    InvalidInput
        If the ending is none of these, the model has an effect that cannot be exported, or the file
        cannot be written.
    """
    model = what.model if isinstance(what, Fit) else what
    expect(model, Model, "export")
    path = as_path(path)
    suffix = path.suffix.lower()
    if suffix == ".fmu":
        write_bytes(path, fmu_bytes(model))
        _tell_offsets(model, path)
        return (path,)
    if suffix == ".tir":
        files = {path.with_stem(f"{path.stem}_{a}"): tir_text(model, a) for a in AXLES}
        if left := left_out_of_tir(model):
            warn(
                f"{path}: the file of a tyre has no place for effects ({', '.join(left)}); export "
                f"the car too, as .toml, .py, .hpp or .fmu"
            )
    elif suffix == ".py":
        files = {path: python_text(model)}
    elif suffix in (".hpp", ".h"):
        files = {path: cpp_text(model)}
    elif suffix == ".toml":
        _write_vehicle(model, path)
        return (path,)
    else:
        raise InvalidInput(
            f"{path}: nothing is exported as '{suffix}'; end the name in {_SUFFIXES}"
        )
    for file, text in files.items():
        write_text(file, text)
    if suffix != ".tir":
        _tell_offsets(model, path)
    return tuple(files)


def _tell_offsets(model: Model, path: Path) -> None:
    """Warn of what was of the logs, and is now of the car: a bank, a zero of the steering."""
    own = dict.fromkeys(name.split(".")[0] for name in model.offset_names)
    there = [e for e in own if e not in equations(model).left_out]
    if there:
        names = ", ".join(f"'{e}'" for e in there)
        warn(
            f"{path}: {', '.join(there)}: what each log has of its own is in it, with the value of "
            f"the fit; for a car that is driven elsewhere export model.drop({names})"
        )


def identified_vehicle(model: Model) -> Vehicle:
    """Return the vehicle as the model has it: its tyres, and the numbers that effects changed."""
    return vehicle_and_rest(model)[0]


def _write_vehicle(model: Model, path: Path) -> None:
    car, rest = vehicle_and_rest(model)
    car.to_toml(path)
    moved = model.value(_SHIFT) if _SHIFT in model.names and car.lf_m != model.vehicle.lf_m else 0.0
    left = [e for e in rest.effects if e in model.effects]
    if left:
        warn(f"{path}: a vehicle file has no place for effects ({', '.join(left)})")
    if moved:
        warn(
            f"{path}: the centre of gravity is {abs(moved):.3g} m further "
            f"{'back' if moved > 0.0 else 'forward'} than before, and the sensors stay where they "
            f"are; a model of this file reads them with .add('ins_lever_arm')"
            f".with_values({{'ins_lever_arm.forward_m': "
            f"{rest.value('ins_lever_arm.forward_m'):.6g}}})"
        )
