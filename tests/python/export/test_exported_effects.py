"""Effects that users define are exported like those of the catalogue."""

import shutil
import subprocess
import zipfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from exported import module_of, typical

import sysid_vehicle as sv
from sysid_vehicle.effects import Parameter
from sysid_vehicle.errors import InvalidInput
from sysid_vehicle.export import cpp_text, fmu_bytes, python_text
from sysid_vehicle.export.equations import equations


def gain(name: str = "gain", typical: float = 50.0) -> Parameter:
    return sv.parameter(name, "N\n\\", typical=typical, lower=-1e4, upper=1e4)


def defined() -> dict[str, dict[str, Any]]:
    heat = sv.state(
        "heat",
        "kJ",
        rate=lambda d, p: 1e-3 * np.abs(d.F_yf * d.alpha_f * d.v_x) - 0.2 * d.heat,
        usual=(0.0, 20.0),
        initial=3.0,
    )
    wear = sv.state("wear", "1", rate=lambda d, p: 0.01, usual=(0.0, 1.0), initial=0.5)
    return {
        "every_form": {
            "parameters": [gain(), gain("other")],
            "force_x": lambda d, p: -p.gain * np.minimum(d.v_x, 20.0) * np.sign(d.v_y),
            "force_y": lambda d, p: (
                p.gain * np.where(d.F_x > 500.0, np.tanh(d.alpha_f), np.exp(-np.abs(d.r)))
            ),
            "moment_z": lambda d, p: p.other * np.maximum(d.alpha_f, d.alpha_r) * np.log(d.v_x),
            "force_y_rear": lambda d, p: p.gain * d.F_zrl / d.F_zrr * d.v_xfr,
        },
        "warm": {
            "parameters": [gain()],
            "force_y_front": lambda d, p: -p.gain * d.heat * np.sin(d.alpha_f),
            "states": [heat],
        },
        "drift": {
            "parameters": [gain()],
            "moment_z": lambda d, p: p.gain * d.wear,
            "states": [wear],
        },
        "only_read": {
            "parameters": [gain(typical=0.1)],
            "reads": {"ay_mps2": lambda d, p: p.gain * d.a_x},
        },
        "timed": {
            "parameters": [gain()],
            "force_y": lambda d, p: p.gain * np.sin(d.time),
        },
        "of_a_column": {
            "parameters": [gain()],
            "force_y": lambda d, p: p.gain * d.flap_rad,
            "channels": {"flap_rad": (0.0, 0.5)},
        },
    }


@pytest.fixture(scope="module", autouse=True)
def known() -> Iterator[None]:
    all_of_them = defined()
    for name, what in all_of_them.items():
        sv.define_effect(name, title="a\nb", **what)
    yield
    for name in all_of_them:
        sv.forget_effect(name)


def test_rates_are_those_of_the_compiled_model(truth: sv.Model, rng: np.random.Generator) -> None:
    model = typical(truth, "every_form", "aero_drag")
    exported = module_of(model)
    for _ in range(50):
        motion = rng.uniform((4.0, -2.0, -0.8), (50.0, 2.0, 0.8))
        steer, force = rng.uniform(-0.15, 0.15), rng.uniform(-9000.0, 6000.0)
        wanted = model.core().evaluate(model.vector(), motion, steer, force).ravel()
        rate, a_x, a_y = exported["derivatives"](motion, steer, force)
        np.testing.assert_allclose([*rate, a_x, a_y], wanted[:5], rtol=1e-10, atol=1e-10)


def test_states_have_their_names_units_starts_and_rates(truth: sv.Model) -> None:
    model = typical(truth, "drift", "warm")
    found = {s.name: (s.unit, s.start) for s in equations(model).states}
    assert list(found)[3:] == ["drift_wear", "warm_heat"]
    assert found["drift_wear"] == ("1", 0.5)
    assert found["warm_heat"] == ("kJ", 3.0)
    bare, exported = module_of(truth), module_of(model)
    motion, steer, heat = np.array([20.0, 0.3, 0.2]), 0.05, 7.0
    rate = exported["derivatives"]([*motion, 0.5, heat], steer, 1000.0)[0]
    assert rate[3] == 0.01
    moved = rate[2] - bare["derivatives"](motion, steer, 1000.0)[0][2]
    alpha = steer - np.arctan2(motion[1] + truth.vehicle.lf_m * motion[2], motion[0])
    side = -50.0 * heat * np.sin(alpha) * np.cos(steer) * truth.vehicle.lf_m
    assert moved == pytest.approx((50.0 * 0.5 + side) / truth.value("yaw_inertia_kgm2"), rel=1e-9)


def test_names_that_would_be_the_same_differ(truth: sv.Model) -> None:
    def own(name: str) -> Any:
        return sv.state(name, "1", rate=lambda d, p: 0.1 * d.v_x, usual=(0.0, 1.0), initial=0.0)

    def side(name: str) -> Any:
        return lambda d, p: p.cast * getattr(d, name)

    size = gain("cast")
    for id_, state in (("static", "heat"), ("static_heat", "rate")):
        sv.define_effect(
            id_, title="a", parameters=[size], force_y=side(state), states=[own(state)]
        )
    try:
        model = typical(truth, "static", "static_heat")
        found = equations(model)
        assert [s.name for s in found.states[3:]] == ["static_heat", "static_heat_rate_"]
        assert "static_cast_" in [name for name, _, _ in found.constants]
        rate = module_of(model)["derivatives"](np.array([20.0, 0.0, 0.0, 1.0, 3.0]), 0.0, 0.0)[0]
        assert rate[1] == pytest.approx(50.0 * (1.0 + 3.0) / truth.vehicle.mass_kg, rel=1e-9)
        np.testing.assert_array_equal(rate[3:], 2.0)
    finally:
        for id_ in ("static", "static_heat"):
            sv.forget_effect(id_)


def test_a_rate_without_states_goes_with_many_cars(truth: sv.Model) -> None:
    exported = module_of(typical(truth, "drift"))
    state = np.array([[10.0, 20.0], [0.1, 0.2], [0.0, 0.1], [0.5, 0.5]])
    rate, _, _ = exported["derivatives"](state, 0.1, 0.0)
    assert rate.shape == state.shape
    np.testing.assert_array_equal(rate[3], 0.01)


def test_what_only_sensors_show_stays_out(truth: sv.Model) -> None:
    found = equations(typical(truth, "only_read"))
    assert found.left_out == ("only_read",)
    assert found.sections == equations(truth).sections


@pytest.mark.parametrize("effect", ["timed", "of_a_column"])
def test_what_a_driven_car_is_not_told_is_refused(truth: sv.Model, effect: str) -> None:
    model = typical(truth, "warm", effect)
    with pytest.raises(InvalidInput, match=rf"^{effect}: cannot be exported; drop it first"):
        python_text(model)
    python_text(model.drop(effect))


@pytest.mark.skipif(shutil.which("g++") is None, reason="there is no g++")
def test_cpp_compiles(tmp_path: Path, truth: sv.Model) -> None:
    (tmp_path / "car.h").write_text(cpp_text(typical(truth, "every_form", "warm", "drift")))
    source = tmp_path / "a.cpp"
    source.write_text('#include "car.h"\nint main() { return 0; }\n')
    build = ["g++", "-std=c++11", "-fsyntax-only", "-Wall", "-Wextra", "-Werror"]
    subprocess.run([*build, source], check=True)


@pytest.mark.skipif(shutil.which("c++") is None, reason="there is no C++ compiler")
def test_a_unit_says_where_its_states_start(tmp_path: Path, truth: sv.Model) -> None:
    path = tmp_path / "car.fmu"
    path.write_bytes(fmu_bytes(typical(truth, "warm")))
    with zipfile.ZipFile(path) as archive:
        told = archive.read("modelDescription.xml").decode()
    assert '<Unit name="kJ"/>' in told
    assert 'name="warm_heat"' in told
    assert 'unit="kJ" initial="exact" start="3.0"' in told
    validation = pytest.importorskip("fmpy.validation")
    assert validation.validate_fmu(str(path)) == []


def test_casadi(truth: sv.Model, rng: np.random.Generator) -> None:
    pytest.importorskip("casadi")
    model = typical(truth, "every_form", "warm")
    exported, function = module_of(model), sv.casadi_function(model)
    for _ in range(20):
        state = rng.uniform((4, -2, -0.8, 0.0), (50, 2, 0.8, 10.0))
        given = rng.uniform((-0.15, -9000.0), (0.15, 6000.0))
        rate, a_x, a_y = exported["derivatives"](state, *given)
        found = function(state, given)
        np.testing.assert_allclose(found[0].full().ravel(), rate, rtol=1e-10, atol=1e-10)
        np.testing.assert_allclose(found[1].full().ravel(), [a_x, a_y], rtol=1e-10)
