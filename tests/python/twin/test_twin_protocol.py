"""Any simulator as a twin: the built-in car, two functions, an FMU built here."""

import copy
import gc
import pickle
import re
import shutil
import subprocess
import tempfile
import zipfile
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest

from sysid_vehicle import InvalidInput, NumericalError
from sysid_vehicle.twin import (
    LOADED_SUV,
    NOMINAL_SUV,
    CallableTwin,
    FMUTwin,
    FMUVariables,
    NativeTwin,
    Observer,
    ParameterLaw,
    SideBySide,
    StateGain,
    Twin,
    TwinCar,
    Unknown,
    mass_law,
    measure,
    observe,
    observe_with,
    unknowns,
    urban_cycle,
)

MASS = Unknown("mass_kg", spread=300.0, apart=10.0, lower=500.0, upper=2000.0)
DT = 0.01


def pulled(n: int = 1500, mass: float = 1200.0) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """Forces, and what a point mass with drag reads under them."""
    t = np.arange(n) * DT
    force = 800.0 + 1500.0 * np.sin(0.8 * t) + 600.0 * np.sin(2.3 * t)
    v, speed, acceleration = 10.0, np.empty(n), np.empty(n)
    for k in range(n):
        speed[k], acceleration[k] = v, (force[k] - 50.0 * v) / mass
        v += DT * acceleration[k]
    noise = np.random.default_rng(1).standard_normal(n)
    return force.reshape(-1, 1), {"vx_mps": speed, "ax_mps2": acceleration + 0.05 * noise}


def point_mass() -> CallableTwin:
    def acceleration(x: np.ndarray, u: np.ndarray, p: dict[str, float]) -> float:
        return float((u[0] - 50.0 * x[0]) / p["mass_kg"])

    return CallableTwin(
        lambda x, u, p: x + DT * acceleration(x, u, p),
        lambda x, u, p: np.array([x[0], acceleration(x, u, p)]),
        np.array([10.0]),
        dt_s=DT,
        input_names=("force_n",),
        output_names=("vx_mps", "ax_mps2"),
        state_names=("vx_mps",),
        parameters={"mass_kg": 1000.0},
    )


@pytest.fixture(scope="module")
def town() -> object:
    return urban_cycle(TwinCar(), LOADED_SUV, duration_s=3.0)


def test_the_python_loop_does_what_the_compiled_one_does(town: object) -> None:
    readings = measure(town, ["ax_mps2", "pitch_rate_radps"], snr=10.0, seed=1)  # type: ignore[arg-type]
    first = LOADED_SUV.replace(mass_kg=NOMINAL_SUV.mass_kg)
    gains = [StateGain("pitch_rate_radps", "pitch_rate_radps", 5.0)]
    batch = SideBySide(unknowns("mass_kg", "cg_z_m"), {"ax_mps2": 0.1})
    measured = {n: readings[n] for n in ("ax_mps2", "pitch_rate_radps", "yaw_rate_radps")}
    for observer in (Observer(gains=gains, batch=batch), Observer(laws=[mass_law(150.0)])):
        fast = observe(
            TwinCar(),
            first,
            town.inputs,
            readings,
            observer,
            speed_mps=12.0,  # type: ignore[attr-defined]
        )
        twin = NativeTwin(TwinCar(), first, 12.0)
        assert isinstance(twin, Twin)
        slow = observe_with(twin, town.inputs, measured, observer)  # type: ignore[attr-defined]
        assert fast.moved() == slow.moved()
        for name in fast.moved():
            np.testing.assert_allclose(
                slow.parameters[name], fast.parameters[name], rtol=1e-9, err_msg=name
            )


def test_a_twin_of_functions_finds_its_mass() -> None:
    force, measured = pulled()
    observer = Observer(batch=SideBySide([MASS], {"ax_mps2": 0.05}))
    found = observe_with(point_mass(), force, measured, observer)
    assert found.last("mass_kg") == pytest.approx(1200.0, rel=0.01)
    law = ParameterLaw("mass_kg", "ax_mps2", 150.0)
    found = observe_with(point_mass(), force, measured, Observer(laws=[law]))
    assert found.last("mass_kg") == pytest.approx(1200.0, rel=0.05)


def test_what_nothing_tells_is_told_as_unknown() -> None:
    batch = SideBySide([MASS], {"ax_mps2": 0.05})
    still = {"ax_mps2": np.full(400, np.nan)}
    found = observe_with(point_mass(), np.zeros((400, 1)), still, Observer(batch=batch))
    assert str(found).endswith(f" 1000 -> 1000 +- {MASS.spread:g}")
    with pytest.raises(InvalidInput, match="'ax_mps2', which is not measured"):
        observe_with(point_mass(), np.zeros((9, 1)), {"ax_mps": np.zeros(9)}, Observer(batch=batch))


def test_without_states_to_set_velocities_are_corrected_by_a_push() -> None:
    car = TwinCar()
    inputs = np.zeros((400, 24))
    measured = {"vx_mps": np.full(400, 21.0)}
    gains = [StateGain("vx_mps", "vx_mps", 20.0)]
    speeds = []
    for able in ({"state"}, {"wrench", "parameters"}):
        twin = NativeTwin(car, NOMINAL_SUV, 20.0)
        twin.capabilities = frozenset(able)
        observe_with(twin, inputs, measured, Observer(gains=gains))
        speeds.append(twin.get_state()[6])
    assert speeds[0] == pytest.approx(21.0, abs=0.05)
    # A push sets in a step later than a state that is set.
    assert speeds[1] == pytest.approx(speeds[0], abs=0.03)


def test_what_a_twin_cannot_do_is_said() -> None:
    force, measured = pulled(10)
    twin = point_mass()
    twin.capabilities = frozenset({"parameters"})
    with pytest.raises(InvalidInput, match="'clone'"):
        observe_with(twin, force, measured, Observer(batch=SideBySide([MASS], {"ax_mps2": 0.05})))
    with pytest.raises(InvalidInput, match="'wrench'"):
        observe_with(twin, force, measured, Observer(gains=[StateGain("vx_mps", "vx_mps", 1.0)]))
    with pytest.raises(InvalidInput, match="stride = 0"):
        observe_with(twin, force, measured, Observer(), stride=0)
    with pytest.raises(InvalidInput, match=r"\(n, 1\)"):
        observe_with(twin, np.zeros((10, 2)), measured, Observer())
    with pytest.raises(InvalidInput, match="yaw_rate_radps"):
        observe_with(twin, force, measured, Observer(laws=[mass_law(100.0)]))
    with pytest.raises(InvalidInput, match="10 samples"):
        observe_with(twin, np.zeros((9, 1)), measured, Observer())
    broken = point_mass()
    broken.set_state(np.array([np.nan]))
    with pytest.raises(
        NumericalError, match=r"vx_mps is no number \(sample 0, t = 0 s, mass_kg = 1000\)"
    ):
        observe_with(broken, force, measured, Observer())


def test_a_snapshot_brings_a_twin_back() -> None:
    for twin, u in (
        (point_mass(), np.array([700.0])),
        (NativeTwin(TwinCar(), NOMINAL_SUV, 10.0), np.full(24, 0.01)),
    ):
        kept = twin.snapshot()
        before = twin.outputs(u)
        other = twin.clone()
        for _ in range(5):
            twin.step(u)
        assert not np.array_equal(twin.outputs(u), before)
        np.testing.assert_array_equal(other.outputs(u), before)
        twin.restore(kept)
        np.testing.assert_array_equal(twin.outputs(u), before)


_DESCRIPTION = """<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="{version}" modelName="car" {id}="{{1}}">
  <ModelExchange modelIdentifier="car"/>
  <CoSimulation modelIdentifier="car" canGetAndSetFMU{s}tate="true"
    canSerializeFMU{s}tate="true" canHandleVariableCommunicationStepSize="true"/>
  <ModelVariables>{variables}</ModelVariables>
  <ModelStructure>{structure}</ModelStructure>
</fmiModelDescription>"""
_ROWS = (
    ("F", 'causality="input"', 'start="0"'),
    ("body.m", 'causality="parameter" variability="tunable"', 'start="1000"'),
    ("v", 'causality="output" initial="exact"', 'start="10"'),
    ("a", 'causality="output"', ""),
    ("c", 'causality="parameter" variability="fixed"', 'start="50"'),
    ("time", 'causality="independent" variability="continuous"', ""),
)


def _variables(version: int) -> str:
    out = []
    for i, (name, causality, start) in enumerate(_ROWS):
        derivative = f'derivative="{3 if version == 2 else 2}"' if name == "a" else ""
        if version == 2:
            out.append(
                f'<ScalarVariable name="{name}" valueReference="{i}" {causality}>'
                f"<Real {start} {derivative}/></ScalarVariable>"
            )
        else:
            out.append(
                f'<Float64 name="{name}" valueReference="{i}" {causality} {start} {derivative}/>'
            )
    return "".join(out)


_STRUCTURE = {
    2: '<Outputs><Unknown index="3"/><Unknown index="4"/></Outputs>'
    '<Derivatives><Unknown index="4"/></Derivatives>'
    '<InitialUnknowns><Unknown index="4"/></InitialUnknowns>',
    3: '<Output valueReference="2"/><Output valueReference="3"/>'
    '<ContinuousStateDerivative valueReference="3"/><InitialUnknown valueReference="3"/>',
}
VARIABLES = FMUVariables(
    inputs={"force_n": "F"},
    outputs={"vx_mps": "v", "ax_mps2": "a"},
    parameters={"mass_kg": "body.m"},
    states=("vx_mps",),
)


def _missing(version: int, source: str) -> str:
    """The functions that FMPy wants to see and nobody calls."""
    from fmpy import fmi2, fmi3

    kinds = (fmi2.FMU2Model, fmi2.FMU2Slave) if version == 2 else (fmi3.FMU3Model, fmi3.FMU3Slave)
    wanted = {n for kind in kinds for n in dir(kind) if n.startswith(f"fmi{version}")}
    there = set(re.findall(rf"\b(fmi{version}\w+)\(", source))
    there |= {f"fmi{version}{n}" for n in re.findall(r"TAG\((\w+)\)", source)}
    return "".join(f"int {n}(void) {{ return 3; }}\n" for n in sorted(wanted - there))


@pytest.fixture(scope="module", params=[2, 3], ids=["FMI 2", "FMI 3"])
def unit(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Path:
    compiler = shutil.which("cc") or shutil.which("gcc")
    if compiler is None:
        pytest.skip("no C compiler to build an FMU with")
    if find_spec("fmpy") is None:
        pytest.skip("FMPy is not installed")
    from fmpy import platform, sharedLibraryExtension

    version: int = request.param
    folder = tmp_path_factory.mktemp(f"fmu{version}")
    library = folder / f"car{sharedLibraryExtension}"
    source = Path(__file__).parents[1] / "fmu" / "point_mass.c"
    tag = f"-DTAG(name)=fmi{version}##name"
    others = folder / "others.c"
    others.write_text(_missing(version, source.read_text(encoding="utf-8")), encoding="utf-8")
    flags = ["-shared", "-fPIC", "-O1", f"-DFMI={version}", tag]
    subprocess.run([compiler, *flags, source, others, "-o", library], check=True)
    structure = _STRUCTURE[version]
    text = _DESCRIPTION.format(
        version="2.0" if version == 2 else "3.0",
        id="guid" if version == 2 else "instantiationToken",
        s="s" if version == 2 else "S",
        variables=_variables(version),
        structure=structure,
    )
    place = platform if version == 2 else "x86_64-linux" if platform == "linux64" else platform
    path = folder / "car.fmu"
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("modelDescription.xml", text)
        for where in {platform, place}:
            archive.write(library, f"binaries/{where}/{library.name}")
    return path


@pytest.mark.parametrize("kind", ["model_exchange", "co_simulation"])
def test_an_fmu_finds_its_mass(unit: Path, kind: str) -> None:
    force, measured = pulled(1000)
    twin = FMUTwin(unit, VARIABLES, dt_s=DT, kind=kind)  # type: ignore[arg-type]
    assert isinstance(twin, Twin)
    assert {"parameters", "snapshot", "clone"} <= twin.capabilities
    assert ("state" in twin.capabilities) == (kind == "model_exchange")
    observer = Observer(batch=SideBySide([MASS], {"ax_mps2": 0.05}))
    found = observe_with(twin, force, measured, observer)
    assert found.last("mass_kg") == pytest.approx(1200.0, rel=0.02)
    kept, u = twin.snapshot(), np.array([700.0])
    before = twin.outputs(u)
    twin.step(u)
    assert twin.outputs(u)[0] != before[0]
    twin.restore(kept)
    np.testing.assert_array_equal(twin.outputs(u), before)


@pytest.mark.parametrize(
    ("outputs", "names"),
    [
        ({"vx_mps": "v", "ax_mps2": "a"}, ("vx_mps",)),
        ({"ax_mps2": "a"}, ("v",)),
        ({"vx_mps": "v", "wheels_mps": "v"}, ("vx_mps",)),
    ],
)
def test_states_of_an_fmu_are_named_by_what_shows_them(
    unit: Path, outputs: dict[str, str], names: tuple[str, ...]
) -> None:
    twin = FMUTwin(unit, FMUVariables(inputs={"force_n": "F"}, outputs=outputs), dt_s=DT)
    assert twin.state_names == names


def test_an_fmu_that_begins_too_slow_finds_the_mass(unit: Path) -> None:
    """Its states had no names and its start was taken as exact: 147 kg, with a spread of 16."""
    force, measured = pulled(1000)
    measured = {"vx_mps": measured["vx_mps"], "ax_mps2": measured["ax_mps2"]}
    given = FMUVariables(
        {"force_n": "F"}, {"vx_mps": "v", "ax_mps2": "a"}, {"mass_kg": "body.m"}, {"v": 9.5}
    )
    batch = SideBySide([MASS], {"vx_mps": 0.03, "ax_mps2": 0.05}, input_std=0.0)
    found = observe_with(FMUTwin(unit, given, dt_s=DT), force, measured, Observer(batch=batch))
    assert abs(found.last("mass_kg") - 1200.0) < 4.0 * found.spread["mass_kg"]
    assert found.spread["mass_kg"] < 24.0


def test_what_an_fmu_lacks_is_said(unit: Path, tmp_path: Path) -> None:
    def made(**changes: object) -> FMUTwin:
        given = {"inputs": {"force_n": "F"}, "outputs": {"vx_mps": "v"}, **changes}
        return FMUTwin(unit, FMUVariables(**given), dt_s=DT)  # type: ignore[arg-type]

    with pytest.raises(InvalidInput, match=r"no variable 'body.M'.*did you mean 'body.m'"):
        made(parameters={"mass_kg": "body.M"})
    with pytest.raises(InvalidInput, match="not tunable"):
        made(parameters={"drag": "c"})
    with pytest.raises(InvalidInput, match="1 states but 2 names"):
        made(states=("a", "b"))
    with pytest.raises(InvalidInput, match="no such file"):
        FMUTwin(tmp_path / "none.fmu", VARIABLES)
    with pytest.raises(InvalidInput, match="start of 'v' is nan; give a number"):
        made(start={"v": float("nan")})
    with pytest.raises(InvalidInput, match=r"dt_s = 0\.0; give seconds"):
        FMUTwin(unit, VARIABLES, dt_s=0.0)
    started = made(start={"v": 3.0})
    assert started.outputs(np.array([0.0]))[0] == 3.0


@pytest.mark.parametrize("inside", [None, {}, {"modelDescription.xml": "<fmi"}])
def test_a_file_that_is_no_fmu_is_named(tmp_path: Path, inside: dict[str, str] | None) -> None:
    path = tmp_path / "car.fmu"
    path.write_text("no archive")
    if inside is not None:
        with zipfile.ZipFile(path, "w") as archive:
            for name, text in inside.items():
                archive.writestr(name, text)
    with pytest.raises(InvalidInput, match=r"car\.fmu: is no FMU that can be read .* export"):
        FMUTwin(path, VARIABLES)


def test_an_fmu_for_another_machine_is_named(unit: Path, tmp_path: Path) -> None:
    path = tmp_path / "car.fmu"
    with zipfile.ZipFile(unit) as given, zipfile.ZipFile(path, "w") as archive:
        for name in given.namelist():
            if not name.startswith("binaries"):
                archive.writestr(name, given.read(name))
    with pytest.raises(InvalidInput, match=r"car\.fmu: the FMU cannot be loaded .* a library for"):
        FMUTwin(path, VARIABLES)


def test_an_fmu_leaves_no_folder_behind(unit: Path) -> None:
    twin = FMUTwin(unit, VARIABLES, dt_s=DT)
    folder = Path(twin._alive.folder)
    assert folder.is_dir()
    with pytest.raises(TypeError, match="cannot be pickled; make it anew from the file"):
        pickle.dumps(twin)
    twin.step(np.array([700.0]))
    other = copy.deepcopy(twin)
    another = Path(other._alive.folder)
    assert another != folder
    np.testing.assert_array_equal(other.outputs(np.array([1.0])), twin.outputs(np.array([1.0])))
    with twin:
        pass
    twin.close()
    assert not folder.exists()
    with pytest.raises(InvalidInput, match="this twin is closed; make it anew"):
        twin.outputs(np.array([1.0]))
    del other
    gc.collect()
    assert not another.exists()


def test_an_fmu_that_is_refused_leaves_no_folder_behind(
    unit: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    for changes in ({"parameters": {"drag": "c"}}, {"states": ("a", "b")}):
        given: dict[str, object] = {"inputs": {"force_n": "F"}, "outputs": {"v": "v"}, **changes}
        with pytest.raises(InvalidInput):
            FMUTwin(unit, FMUVariables(**given), dt_s=DT)  # type: ignore[arg-type]
    gc.collect()
    assert list(tmp_path.iterdir()) == []
