"""Equations as a Functional Mock-up Unit: FMI 3.0, for model exchange and for co-simulation.

The unit holds its source and, where a C++ compiler was found, the library for this platform. The
interface is that of the standard (Modelica Association, FMI Specification 3.0.2, chapters 2 to 4).
"""

from __future__ import annotations

import io
import os
import platform
import shutil
import subprocess
import sys
import tempfile
import uuid
import zipfile
from pathlib import Path
from xml.sax.saxutils import quoteattr

from .._core import __version__
from ..errors import InvalidInput, warn
from ..model import Model
from .equations import Equations, equations
from .languages import cpp_assignments, title, using

_NAME = "identified_car"
_INTERFACE = Path(__file__).with_name("fmi3.cpp.in")
_FIRST_STATE, _FIRST_RATE, _FIRST_PARAMETER = 100, 200, 300  # value references
_INPUTS = (("steer", "rad", "angle of the road wheels"), ("force", "N", "total wheel force"))
_OUTPUTS = (
    ("a_x", "m/s2", "longitudinal acceleration of the centre of gravity"),
    ("a_y", "m/s2", "lateral acceleration of the centre of gravity"),
    ("sideslip", "rad", "angle of the velocity against the car's axis"),
)
_FIRST_INPUT, _FIRST_OUTPUT = 1, 10
_UNITS = {
    "rad": 'rad="1"',
    "rad/s": 'rad="1" s="-1"',
    "m/s": 'm="1" s="-1"',
    "m/s2": 'm="1" s="-2"',
    "N": 'kg="1" m="1" s="-2"',
    "kN": 'kg="1" m="1" s="-2" factor="1000"',
    "kW": 'kg="1" m="2" s="-3" factor="1000"',
}
_LONGEST_BUILD_S = 120.0


def fmu_bytes(model: Model) -> bytes:
    """Return the model as an FMU.

    Inputs are the angle of the road wheels and the total force of the wheels; states are the motion
    and the lags; outputs are the accelerations and the sideslip. Constants are tunable parameters.

    Raises
    ------
    InvalidInput
        If the model has an effect that cannot be exported, or a compiler was found and failed.

    Warns
    -----
    SysidWarning
        If there is no compiler: the FMU then holds its source only.
    """
    e = equations(model)
    source = _source(model, e)
    files = {
        "modelDescription.xml": _description(model, e, source).encode(),
        "sources/buildDescription.xml": _BUILD.encode(),
        f"sources/{_NAME}.cpp": source.encode(),
    }
    library = _library(source)
    if library is not None:
        files[f"binaries/{_platform()}/{_NAME}{_suffix()}"] = library
    held = io.BytesIO()
    with zipfile.ZipFile(held, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in files.items():
            # A fixed date: the same model gives the same file.
            archive.writestr(zipfile.ZipInfo(name), content, zipfile.ZIP_DEFLATED)
    return held.getvalue()


def _source(model: Model, e: Equations) -> str:
    states, count = [state.name for state in e.states], len(e.states)
    about = "\n".join(f"// {line}" for line in title(model, e)).replace("\\", "")
    read = [f"const double {n} = car.p[{k}];" for k, (n, _, _) in enumerate(e.constants)]
    read += [f"const double {name} = x[{k}];" for k, name in enumerate(states)]
    write = [f"rate[{k}] = {name}_rate;" for k, name in enumerate(states)]
    write += ["felt[0] = a_x;", "felt[1] = a_y;", "felt[2] = atan2(v_y, v_x);"]
    body = "\n".join(f"    {line}" for line in (*read, *cpp_assignments(e), *write))
    starts = ", ".join(repr(state.start) for state in e.states)
    parameters = ",\n    ".join(f"{value!r} /* {name} */" for name, value, _ in e.constants)
    held = {
        "about": about,
        "token": _token(body + parameters),
        "states": count,
        "parameters": len(e.constants),
        "outputs": len(_OUTPUTS),
        "starts": starts,
        "using": using(e, "atan2"),
        "values": parameters,
        "body": body,
        "first_input": _FIRST_INPUT,
        "first_output": _FIRST_OUTPUT,
        "first_state": _FIRST_STATE,
        "first_rate": _FIRST_RATE,
        "first_parameter": _FIRST_PARAMETER,
    }
    text = _INTERFACE.read_text("utf-8")
    for name, value in held.items():
        text = text.replace(f"@{name}@", str(value))
    return text


def _token(text: str) -> str:
    return "{" + str(uuid.uuid5(uuid.NAMESPACE_URL, text)) + "}"


def _description(model: Model, e: Equations, source: str) -> str:
    token = source.partition('kToken[] = "')[2].partition('"')[0]
    about = quoteattr(" ".join(title(model, e)))
    variables = [_variable("time", 0, "independent", "continuous", "", "s")]
    for k, (name, unit, what) in enumerate(_INPUTS):
        given = f'start="0" unit="{unit}"'
        variables.append(_variable(name, _FIRST_INPUT + k, "input", "continuous", given, what))
    for k, (name, unit, what) in enumerate(_OUTPUTS):
        given = f'unit="{unit}"'
        variables.append(_variable(name, _FIRST_OUTPUT + k, "output", "continuous", given, what))
    for k, s in enumerate(e.states):
        given = f'unit={quoteattr(s.unit)} initial="exact" start="{s.start!r}"'
        variables.append(
            _variable(s.name, _FIRST_STATE + k, "output", "continuous", given, "state")
        )
    for k, s in enumerate(e.states):
        given = f'derivative="{_FIRST_STATE + k}"'
        what = f"rate of {s.name}"
        variables.append(
            _variable(f"der({s.name})", _FIRST_RATE + k, "local", "continuous", given, what)
        )
    for k, (name, value, what) in enumerate(e.constants):
        given = f'initial="exact" start="{value!r}"'
        variables.append(_variable(name, _FIRST_PARAMETER + k, "parameter", "tunable", given, what))
    units = "\n".join(
        f'    <Unit name="{name}"><BaseUnit {base}/></Unit>' for name, base in _UNITS.items()
    )
    foreign = {s.unit: None for s in e.states if s.unit not in _UNITS}
    units += "".join(f"\n    <Unit name={quoteattr(unit)}/>" for unit in foreign)
    outputs = [_FIRST_OUTPUT + k for k in range(len(_OUTPUTS))]
    states = [_FIRST_STATE + k for k in range(len(e.states))]
    rates = [_FIRST_RATE + k for k in range(len(e.states))]
    structure = [f'    <Output valueReference="{r}"/>' for r in (*outputs, *states)]
    structure += [f'    <ContinuousStateDerivative valueReference="{r}"/>' for r in rates]
    structure += [f'    <InitialUnknown valueReference="{r}"/>' for r in (*outputs, *rates)]
    keeps = 'canGetAndSetFMUState="true" canSerializeFMUState="true"'
    told = "\n".join(variables)
    shape = "\n".join(structure)
    return f"""<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="3.0" modelName={quoteattr(" ".join(model.vehicle.name.split()))}
    instantiationToken="{token}" description={about}
    generationTool="sysid_vehicle {__version__}" variableNamingConvention="structured">
  <ModelExchange modelIdentifier="{_NAME}" {keeps}/>
  <CoSimulation modelIdentifier="{_NAME}" canHandleVariableCommunicationStepSize="true" {keeps}/>
  <UnitDefinitions>
{units}
  </UnitDefinitions>
  <ModelVariables>
{told}
  </ModelVariables>
  <ModelStructure>
{shape}
  </ModelStructure>
</fmiModelDescription>
"""


def _variable(name: str, place: int, causality: str, varies: str, given: str, what: str) -> str:
    return (
        f'    <Float64 name="{name}" valueReference="{place}" causality="{causality}" '
        f'variability="{varies}" {given} description={quoteattr(what)}/>'
    )


_BUILD = f"""<?xml version="1.0" encoding="UTF-8"?>
<fmiBuildDescription fmiVersion="3.0">
  <BuildConfiguration modelIdentifier="{_NAME}">
    <SourceFileSet language="C++11"><SourceFile name="{_NAME}.cpp"/></SourceFileSet>
  </BuildConfiguration>
</fmiBuildDescription>
"""


def _library(source: str) -> bytes | None:
    compiler = os.environ.get("CXX") or next(
        filter(None, map(shutil.which, ("c++", "g++", "clang++"))), None
    )
    if compiler is None or sys.platform == "win32":
        warn(
            "no C++ compiler was found: the FMU holds its source only; compile it where it is "
            "used, or set CXX to a compiler and export again"
        )
        return None
    with tempfile.TemporaryDirectory(prefix="sysid_vehicle_") as folder:
        file, made = Path(folder) / f"{_NAME}.cpp", Path(folder) / f"{_NAME}{_suffix()}"
        file.write_text(source, "utf-8")
        command = [*compiler.split(), "-std=c++11", "-O2", "-fPIC", "-shared", "-o", str(made)]
        try:
            done = subprocess.run(
                [*command, str(file)],
                capture_output=True,
                text=True,
                timeout=_LONGEST_BUILD_S,
                check=False,
            )
        except (OSError, subprocess.TimeoutExpired) as error:
            raise InvalidInput(
                f"{compiler}: cannot be run ({error}); set CXX to another"
            ) from error
        if done.returncode != 0:
            raise InvalidInput(
                f"{compiler} failed: {done.stderr.strip()[-500:]}; set CXX to another"
            )
        return made.read_bytes()


def _platform() -> str:
    machine = {"amd64": "x86_64", "arm64": "aarch64"}.get(
        platform.machine().lower(), platform.machine().lower()
    )
    system = {"darwin": "darwin", "win32": "windows"}.get(sys.platform, "linux")
    return f"{machine}-{system}"


def _suffix() -> str:
    return {"darwin": ".dylib", "win32": ".dll"}.get(sys.platform, ".so")
