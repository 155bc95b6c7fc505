"""Exported models drive like the compiled one."""

import io
import shutil
import subprocess
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from exported import module_of, typical

import sysid_vehicle as sv
from sysid_vehicle.errors import InvalidInput, SysidWarning
from sysid_vehicle.export import cpp_text, fmu_bytes, identified_vehicle, python_text, tir_text
from sysid_vehicle.export.equations import equations
from sysid_vehicle.simulate import drive_truth
from sysid_vehicle.twin import FMUTwin, FMUVariables

SENSORS = {
    *("accelerometer_bias", "accelerometer_scale", "body_attitude", "gyro_bias", "gyro_scale"),
    *("imu_lever_arm", "ins_lever_arm", "sensor_delay", "speed_sensor_lever_arm"),
    "speed_sensor_misalignment",
}
NOT_TOLD = {"friction_change", "steer_delay"}  # what they need: the time, the rate of the steering
CATALOGUE = tuple(e.id for e in sv.catalogue() if not e.acts)
ALL = tuple(e for e in CATALOGUE if e not in SENSORS | NOT_TOLD)
# Their states feed back on what they follow: `settled` does not find where they rest.
ROLLING = {"body_roll", "front_roll_steer", "rear_roll_steer"}
SETTLING = tuple(e for e in ALL if e not in ROLLING | {"tyre_temperature"})


def compiled(model: sv.Model, motion: np.ndarray, steer: float, force: float) -> np.ndarray:
    return model.core().evaluate(model.vector(), motion, steer, force).ravel()


@pytest.mark.parametrize(
    "effects", [(), *((e,) for e in SETTLING), SETTLING], ids=lambda e: "+".join(e)[:30]
)
def test_rates_are_those_of_the_compiled_model(
    truth: sv.Model, effects: tuple[str, ...], rng: np.random.Generator
) -> None:
    model = typical(truth, *effects)
    exported = module_of(model)
    lags = sum(sv.effect(e).states for e in effects)
    for _ in range(20):
        motion = rng.uniform((4.0, -2.0, -0.8), (50.0, 2.0, 0.8))
        steer, force = rng.uniform(-0.15, 0.15), rng.uniform(-9000.0, 6000.0)
        wanted = compiled(model, motion, steer, force)
        state = np.concatenate((motion, settled(exported, motion, steer, force, lags)))
        rate, a_x, a_y = exported["derivatives"](state, steer, force)
        np.testing.assert_allclose([*rate[:3], a_x, a_y], wanted[:5], rtol=1e-10, atol=1e-10)
        np.testing.assert_allclose(rate[3:], 0.0, atol=1e-6)


def settled(
    exported: dict[str, Any], motion: np.ndarray, steer: float, force: float, lags: int
) -> np.ndarray:
    """Values of lags at which they rest: each follows its target at its own rate."""
    x = np.zeros(lags)
    for _ in range(lags):
        zero = exported["derivatives"](np.concatenate((motion, x)), steer, force)[0][3:]
        slope = np.zeros(lags)
        for k in range(lags):
            moved = x.copy()
            moved[k] += 1.0
            slope[k] = (
                exported["derivatives"](np.concatenate((motion, moved)), steer, force)[0][3 + k]
                - zero[k]
            )
        x = x - zero / np.where(slope == 0.0, 1.0, slope) if lags else x
    return x


def test_heat_of_the_tyres_over_seconds_of_a_lap(truth: sv.Model) -> None:
    """With lags, from where they settle at the start; its states stand in no record of a drive."""
    model = typical(truth, "tyre_temperature", "steer_lag", "force_lag", "tyre_relaxation")
    calm = sv.RoadDisturbance(0.0, 0.0, 0.0)
    driven = drive_truth(model, sv.manoeuvres.lap(60.0), seed=1, disturbance=calm)
    exported = module_of(model)
    names = [s.name for s in equations(model).states]
    state = np.concatenate((driven.states[0, :3], np.zeros(len(names) - 3)))
    # The wheel force at the start is held as long as it lags.
    state[names.index("lagging_force")] = 1e-3 * driven.inputs[0, 1]
    for k in range(1000):
        state = exported["step"](state, driven.inputs[k], driven.inputs[k + 1], 0.01, substeps=2)
        np.testing.assert_allclose(state[:3], driven.states[k + 1, :3], rtol=0.0, atol=1e-4)
    assert state[names.index("sliding_front")] > 0.5  # kW: two percent of the grip


@pytest.mark.parametrize("effect", sorted(ROLLING))
def test_a_rolling_body_over_seconds_of_a_lap(truth: sv.Model, effect: str) -> None:
    model = typical(truth, effect)
    calm = sv.RoadDisturbance(0.0, 0.0, 0.0)
    driven = drive_truth(model, sv.manoeuvres.lap(60.0), seed=1, disturbance=calm)
    exported = module_of(model)
    leant = rolled = 0.0
    state = np.concatenate((driven.states[0, :3], (0.0, 0.0)))
    for k in range(4000):
        state = exported["step"](state, driven.inputs[k], driven.inputs[k + 1], 0.01)
        np.testing.assert_allclose(state[:3], driven.states[k + 1, :3], rtol=0.0, atol=1e-4)
        leant, rolled = np.maximum((leant, rolled), np.abs(state[-2:]))
    assert rolled > 0.5  # 1/s: 1.7 deg/s of roll
    assert 0.3 < leant < 1.2


@pytest.fixture(scope="module")
def lap_model(truth: sv.Model) -> sv.Model:
    """With effects that change speed, load and steering."""
    wanted = ("tyre_load_sensitivity", "aero_downforce", "steer_offset", "rolling_resistance")
    return typical(truth, *wanted, "combined_slip", "gyro_bias")


@pytest.fixture(scope="module")
def driven(lap_model: sv.Model) -> Any:
    calm = sv.RoadDisturbance(0.0, 0.0, 0.0)
    return drive_truth(lap_model, sv.manoeuvres.lap(60.0), seed=1, disturbance=calm)


def test_python_over_a_lap(lap_model: sv.Model, driven: Any) -> None:
    """Seconds of the lap side by side, as many cars; C++ drives it from end to end."""
    exported = module_of(lap_model)
    assert "Left out, because only sensors show it: gyro_bias" in exported["__doc__"]
    starts = np.arange(0, len(driven.states) - 100, 100)
    state = driven.states[starts, :3].T
    for k in range(100):
        before, after = driven.inputs[starts + k].T, driven.inputs[starts + k + 1].T
        state = exported["step"](state, before, after, 0.01)
        wanted = driven.states[starts + k + 1, :3].T
        np.testing.assert_allclose(state, wanted, rtol=0.0, atol=1e-6)


def test_python_drives_many_cars_at_once(truth: sv.Model) -> None:
    exported = module_of(typical(truth, *ALL))
    lags = sum(sv.effect(e).states for e in ALL)
    state = np.array([[10.0, 20.0], [0.1, -0.2], [0.1, 0.2], *[[0.01, 0.02]] * lags])
    both = exported["derivatives"](state, np.array([0.1, -0.1]), np.array([-900.0, 900.0]))[0]
    for k, (steer, force) in enumerate(((0.1, -900.0), (-0.1, 900.0))):
        one = exported["derivatives"](state[:, k], steer, force)[0]
        np.testing.assert_allclose(both[:, k], one, rtol=1e-12)


@pytest.mark.skipif(shutil.which("g++") is None, reason="there is no g++")
def test_cpp_over_a_lap(tmp_path: Path, lap_model: sv.Model, driven: Any) -> None:
    (written,) = sv.export(lap_model, tmp_path / "car.hpp")
    assert written.read_text("utf-8") == cpp_text(lap_model)
    (tmp_path / "main.cpp").write_text(
        '#include "car.hpp"\n#include <cstdio>\n'
        "int main() {\n"
        "    using namespace identified_car;\n"
        "    State x{};\n    std::array<double, 2> before{}, after{};\n"
        '    if (std::scanf("%lf %lf %lf %lf %lf", &x[0], &x[1], &x[2], &before[0], &before[1])'
        " != 5) return 1;\n"
        '    while (std::scanf("%lf %lf", &after[0], &after[1]) == 2) {\n'
        "        x = step(x, before, after, 0.01);\n        before = after;\n"
        '        std::printf("%.17g %.17g %.17g\\n", x[0], x[1], x[2]);\n'
        "    }\n}\n"
    )
    program = tmp_path / "car"
    build = ["g++", "-std=c++11", "-O1", "-Wall", "-Wextra", "-Werror", "-Wno-unused-variable"]
    subprocess.run([*build, "-o", program, tmp_path / "main.cpp"], check=True)
    rows = [" ".join(map(repr, map(float, row))) for row in driven.inputs]
    given = " ".join(map(repr, map(float, driven.states[0, :3]))) + " " + "\n".join(rows)
    told = subprocess.run([program], input=given, capture_output=True, text=True, check=True)
    found = np.array([line.split() for line in told.stdout.splitlines()], dtype=float)
    np.testing.assert_allclose(found, driven.states[1:, :3], rtol=0.0, atol=1e-6)


@pytest.mark.skipif(shutil.which("g++") is None, reason="there is no g++")
def test_cpp_of_every_effect_compiles(tmp_path: Path, truth: sv.Model) -> None:
    sv.export(typical(truth, *ALL), tmp_path / "car.h")
    build = ["g++", "-std=c++11", "-fsyntax-only", "-Wall", "-Wextra", "-Werror", "-x", "c++"]
    subprocess.run([*build, "-Wno-pragma-once-outside-header", tmp_path / "car.h"], check=False)
    source = tmp_path / "a.cpp"
    source.write_text('#include "car.h"\nint main() { return 0; }\n')
    subprocess.run([*build[:-2], source], check=True)


def test_casadi(truth: sv.Model, rng: np.random.Generator) -> None:
    pytest.importorskip("casadi")
    model = typical(truth, *ALL)
    exported, function = module_of(model), sv.casadi_function(model)
    lags = [0.1] * sum(sv.effect(e).states for e in ALL)
    for _ in range(20):
        state = rng.uniform((4, -2, -0.8, *(-x for x in lags)), (50, 2, 0.8, *lags))
        given = rng.uniform((-0.15, -9000.0), (0.15, 6000.0))
        rate, a_x, a_y = exported["derivatives"](state, *given)
        found = function(state, given)
        np.testing.assert_allclose(found[0].full().ravel(), rate, rtol=1e-10, atol=1e-10)
        np.testing.assert_allclose(found[1].full().ravel(), [a_x, a_y], rtol=1e-10)


@pytest.fixture(scope="module")
def unit(lap_model: sv.Model, tmp_path_factory: pytest.TempPathFactory) -> Path:
    pytest.importorskip("fmpy")
    if shutil.which("c++") is None:
        pytest.skip("there is no C++ compiler")
    (path,) = sv.export(lap_model, tmp_path_factory.mktemp("fmu") / "car.fmu")
    return path


class TestFMU:
    def test_it_is_valid_and_the_same_each_time(self, unit: Path, lap_model: sv.Model) -> None:
        from fmpy.validation import validate_fmu

        assert validate_fmu(str(unit)) == []
        with zipfile.ZipFile(unit) as archive:
            names = archive.namelist()
            assert {"sources/identified_car.cpp", "sources/buildDescription.xml"} <= set(names)
            assert sum(name.startswith("binaries/") for name in names) == 1
            again = zipfile.ZipFile(io.BytesIO(fmu_bytes(lap_model)))
            for name in names[:3]:
                assert archive.read(name) == again.read(name)

    @pytest.mark.parametrize("kind", ["model_exchange", "co_simulation"])
    def test_over_a_lap(self, unit: Path, driven: Any, lap_model: sv.Model, kind: Any) -> None:
        """A master holds inputs over its steps: ten to a sample follow what is linear between."""
        rates = ("v_x", "v_y", "r")
        variables = FMUVariables(
            {"steer": "steer", "force": "force"},
            {n: n for n in ("v_x", "v_y", "r", "a_x", "a_y", "sideslip")},
            start=dict(zip(rates, map(float, driven.states[0, :3]), strict=True)),
            states=rates if kind == "model_exchange" else (),
        )
        parts, count = 10, 400
        exported = module_of(lap_model)
        with FMUTwin(unit, variables, dt_s=0.01 / parts, kind=kind) as twin:
            state = np.array(driven.states[0, :3])
            for k in range(count):
                before, after = driven.inputs[k], driven.inputs[k + 1]
                for n in range(parts):
                    held = before + (after - before) * ((n + 0.5) / parts)
                    twin.step(held)
                    state = exported["step"](state, held, held, 0.01 / parts, substeps=1)
                told = twin.outputs(held)
                np.testing.assert_allclose(told[:3], state, rtol=0.0, atol=1e-8)
            assert told[5] == pytest.approx(np.arctan2(state[1], state[0]), abs=1e-9)
            np.testing.assert_allclose(told[:3], driven.states[count, :3], rtol=0.0, atol=1e-4)

    def test_its_parameters_can_be_tuned(self, unit: Path) -> None:
        variables = FMUVariables(
            {"steer": "steer", "force": "force"}, {"v_x": "v_x"}, {"mass_kg": "mass"}
        )
        speeds = []
        for factor in (1.0, 2.0):
            with FMUTwin(unit, variables, dt_s=0.01) as twin:
                twin.set_parameters({"mass_kg": factor * twin.get_parameters()["mass_kg"]})
                drive = np.array([0.0, 3000.0])
                twin.step(drive)
                speeds.append(float(twin.outputs(drive)[0]) - 20.0)
        assert speeds[0] / speeds[1] == pytest.approx(2.0, rel=0.2)

    def test_without_a_compiler_it_holds_its_source(
        self, monkeypatch: pytest.MonkeyPatch, lap_model: sv.Model, tmp_path: Path
    ) -> None:
        monkeypatch.setattr(shutil, "which", lambda name: None)
        monkeypatch.delenv("CXX", raising=False)
        with pytest.warns(SysidWarning, match="no C\\+\\+ compiler was found"):
            sv.export(lap_model, tmp_path / "car.fmu")
        with zipfile.ZipFile(tmp_path / "car.fmu") as archive:
            assert not [n for n in archive.namelist() if n.startswith("binaries/")]

    def test_a_compiler_that_fails_is_told(
        self, monkeypatch: pytest.MonkeyPatch, lap_model: sv.Model, tmp_path: Path
    ) -> None:
        monkeypatch.setenv("CXX", "false")
        with pytest.raises(InvalidInput, match="false failed"):
            sv.export(lap_model, tmp_path / "car.fmu")
        assert not (tmp_path / "car.fmu").exists()


def magic_52(text: str, alpha: np.ndarray, load: float) -> np.ndarray:
    """F_y of a property file: Pacejka, Tire and Vehicle Dynamics (2nd ed.), eq. (4.E19-30)."""
    rows = (line.split("=") for line in text.splitlines() if "=" in line and line[0] != "$")
    p = {k.strip(): v.strip() for k, v in rows}
    number = {k: float(v) for k, v in p.items() if "'" not in v}
    nominal = number["FNOMIN"]
    dfz = load / nominal - 1.0
    peak = (number["PDY1"] + number["PDY2"] * dfz) * load
    stiffness = number["PKY1"] * nominal * np.sin(2.0 * np.arctan(load / number["PKY2"] / nominal))
    b = stiffness / (number["PCY1"] * peak)
    x = b * alpha
    bent = np.arctan(x - number["PEY1"] * (x - np.arctan(x)))
    return np.asarray(peak * np.sin(number["PCY1"] * bent))


class TestTyres:
    ALPHA = np.linspace(-0.2, 0.2, 41)

    def test_without_load_sensitivity_at_every_load(self, truth: sv.Model) -> None:
        tyre = truth.vehicle.tyre_front
        text = tir_text(truth, "front")
        for load in (800.0, 3000.0, 6000.0):
            # The angle of the format is that of the velocity, ours that of the wheel against it.
            found = magic_52(text, -self.ALPHA, load)
            np.testing.assert_allclose(found, load * tyre.friction(self.ALPHA), rtol=1e-5)

    @pytest.mark.parametrize("loss", [0.1, 0.3])
    def test_with_load_sensitivity_near_the_static_load(self, truth: sv.Model, loss: float) -> None:
        model = truth.add("tyre_load_sensitivity").with_values(
            {"tyre_load_sensitivity.sensitivity": loss}
        )
        car = model.vehicle
        # The load from which the sensitivity counts is that of the car that was found.
        model = model.add("mass").with_values({"mass.relative_error": 0.2})
        static = 0.5 * 1.2 * car.mass_kg * 9.80665 * car.lf_m / car.wheelbase_m
        text = tir_text(model, "rear")
        for share, close in ((1.0, 1e-9), (0.98, 1e-3), (1.02, 1e-3), (1.3, 0.05)):
            load = share * static
            wanted = load * (1.0 - loss * (share - 1.0)) * car.tyre_rear.friction(self.ALPHA)
            found = magic_52(text, -self.ALPHA, load)
            np.testing.assert_allclose(found, wanted, rtol=close, atol=1e-9)

    def test_files(self, tmp_path: Path, truth: sv.Model) -> None:
        files = sv.export(truth, tmp_path / "tyre.tir")
        assert [f.name for f in files] == ["tyre_front.tir", "tyre_rear.tir"]
        assert files[1].read_text("utf-8") == tir_text(truth, "rear")

    def test_what_is_left_out_is_told(self, tmp_path: Path, truth: sv.Model) -> None:
        model = typical(truth, "tyre_load_sensitivity", "mass", "tyre_relaxation")
        with pytest.warns(SysidWarning, match=r"no place for effects \(mass, tyre_relaxation\)"):
            sv.export(model, tmp_path / "tyre.tir")

    def test_friction_that_rises_with_load(self, truth: sv.Model) -> None:
        model = truth.add("tyre_load_sensitivity").with_values(
            {"tyre_load_sensitivity.sensitivity": -0.1}
        )
        with pytest.raises(InvalidInput, match=r"MF 5\.2 has no stiffness"):
            tir_text(model, "front")


def test_a_vehicle_file(tmp_path: Path, fit: sv.Fit, truth: sv.Model) -> None:
    sv.export(fit, tmp_path / "car.toml")
    read = sv.Vehicle.from_toml(tmp_path / "car.toml")
    assert read.tyre_front == identified_vehicle(fit.model).tyre_front
    assert fit.model.value("D_front") == read.tyre_front.D
    with pytest.warns(SysidWarning, match=r"no place for effects \(steer_lag\)"):
        sv.export(truth.add("steer_lag"), tmp_path / "car.toml")


def test_what_cannot_be_exported(tmp_path: Path, truth: sv.Model) -> None:
    for effect in sorted(NOT_TOLD):
        with pytest.raises(
            InvalidInput, match=rf"{effect}: cannot be exported; drop it.*reads the time"
        ):
            python_text(truth.add(effect))
    with pytest.raises(InvalidInput, match=r"nothing is exported as '\.docx'; end the name in"):
        sv.export(truth, tmp_path / "car.docx")


def test_what_only_sensors_show_is_left_out(truth: sv.Model) -> None:
    found = equations(typical(truth, *sorted(SENSORS)))
    assert sorted(found.left_out) == sorted(SENSORS)
    assert found.sections == equations(truth).sections
    assert found.constants == equations(truth).constants


def test_a_lag_of_no_length_is_not_what_sensors_show(truth: sv.Model) -> None:
    model = truth.add("steer_lag", "gyro_scale").with_values({"steer_lag.time_constant_s": 0.0})
    found = equations(model)
    assert found.left_out == ("gyro_scale",)
    assert [s.name for s in found.states] == ["v_x", "v_y", "r"]
    assert not [name for name, _, _ in found.constants if name.startswith("steer_lag")]


def test_the_speeds_at_which_it_holds_are_told(truth: sv.Model) -> None:
    """It gives numbers at a standstill and backwards, too, and did so with no word."""
    said = "at a standstill and backwards slip angles mean nothing"
    assert said in python_text(truth)
    assert said in cpp_text(truth)
    with zipfile.ZipFile(io.BytesIO(fmu_bytes(truth))) as unit:
        assert said in unit.read("modelDescription.xml").decode()


def test_the_text_reads_like_the_equations(truth: sv.Model) -> None:
    text = python_text(typical(truth, *ALL))
    assert max(len(line) for line in text.partition("def derivatives")[2].splitlines()) <= 100
    for line in (
        "# slip angles",
        "delta = delta * (1.0 + steer_ratio_ratio_error)",
        "alpha_f = delta - atan2(v_road + l_f_times_r, v_x)",
        "lag_rate = fmin(1.0 / steer_lag_time_constant_s, 4000.0)",
        "steer_lag_rate = lag_rate * (delta - steer_lag)",
        "grip_r = grip_r * (1.0 - lateral_load_transfer_loss_rear * term_",
    ):
        assert f"\n    {line}" in text
    assert "accelerometer" not in text.partition("def derivatives")[2].partition('"""\n')[2]


def test_a_name_of_several_lines_stays_a_comment(car: sv.Vehicle) -> None:
    model = sv.Model(car.replace(name='x\n"""\nimport os\n#error'))  # type: ignore[arg-type]
    assert "\nimport os" not in python_text(model)
    assert "\n#error" not in cpp_text(model)
    assert "\nimport os" not in tir_text(model, "front")
