"""Effects of users: followed once, then used like those of the catalogue."""

from __future__ import annotations

import copy
import pickle
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import sysid_vehicle as sv
from sysid_vehicle import _core
from sysid_vehicle.cli import main
from sysid_vehicle.diagnose.evidence.evidence import Evidence
from sysid_vehicle.diagnose.evidence.sensitivity import sensitivities
from sysid_vehicle.effects.formula import SIGNALS, TARGETS, trace
from sysid_vehicle.identify import refine
from sysid_vehicle.model import Model

CHANNEL, STATE = (_core.formula_parts()["operations"].index(n) for n in ("channel", "state"))
WIND = [sv.parameter("gain", "N s2/m2", typical=0.6, lower=-5.0, upper=5.0)]

pytestmark = pytest.mark.usefixtures("no_effects_left")


def drag_of_users(**changes: object) -> sv.Effect:
    how: dict[str, object] = {
        "title": "drag once more",
        "parameters": [
            sv.parameter("drag_area_m2", "m2", typical=0.7, lower=-2.0, upper=3.0),
        ],
        "force_x": lambda d, p: -0.5 * 1.2 * p.drag_area_m2 * d.v_x * np.abs(d.v_x),
        **changes,
    }
    return sv.define_effect("my_drag", **how)  # type: ignore[arg-type]


def test_every_operation_gives_the_numbers_of_numpy() -> None:
    def everything(d, p):  # type: ignore[no-untyped-def]
        u = +p.a * d.v_x + d.steer - d.v_y / d.v_x
        v = np.sin(u) * np.cos(d.r) + np.tan(d.r) + np.arctan(u) + np.arctan2(d.v_y, d.v_x)
        w = np.sqrt(d.v_x) + np.exp(-np.abs(u)) + np.log(d.v_x) + np.tanh(u) + np.sign(d.v_y)
        x = np.minimum(u, d.r) * np.maximum(u, 0.1) + np.where(d.v_y > 0.0, u, -u)
        y = np.clip(u, -0.5, 0.5) + d.v_x**3 + d.v_x**-1 + d.v_x**1.5 + np.square(u) + d.v_x**0.5
        return p.a * (np.positive(v) + w + x + y + np.where(d.v_y < d.r, 2.0, 3.0) + 2.0**p.a)

    effect = sv.define_effect(
        "everything",
        title="all at once",
        parameters=[sv.parameter("a", "1", typical=1.3, lower=-3.0, upper=3.0)],
        reads={"ay_mps2": everything},
    )
    car = sv.example_vehicle()
    plain, model = Model(car), Model(car).add(effect).with_values({"everything.a": 1.3})
    drive = sv.simulate.drive_truth(
        model, sv.manoeuvres.sine_sweep(), seed=1, noise=sv.SensorNoise.none()
    )
    d = type("D", (), {})()
    d.v_x, d.v_y, d.r = drive.states.T
    d.steer = drive.inputs[:, 0]
    p = type("P", (), {"a": 1.3})
    without = np.array(
        [
            plain.core().evaluate(plain.vector(), x, u[0], u[1])[0, 4]
            for x, u in zip(drive.states[::50], drive.inputs[::50], strict=True)
        ]
    )
    added = drive.outputs[::50, 4] - without
    np.testing.assert_allclose(added, everything(d, p)[::50], rtol=1e-9, atol=1e-9)


def test_a_copy_of_a_built_in_effect_is_that_effect() -> None:
    mine = drag_of_users()
    car = sv.example_vehicle()
    same = car.air_density_kgpm3 / 1.2
    theirs = Model(car).add("aero_drag").with_values({"aero_drag.drag_area_m2": 0.4})
    ours = Model(car).add(mine).with_values({"my_drag.drag_area_m2": 0.4 * same})
    x = np.array([31.0, 0.4, 0.2])
    np.testing.assert_allclose(
        ours.core().evaluate(ours.vector(), x, 0.02, 500.0),
        theirs.core().evaluate(theirs.vector(), x, 0.02, 500.0),
        rtol=1e-12,
    )


def test_diagnosed_identified_and_improved_like_a_built_in_one() -> None:
    mine = sv.define_effect(
        "roof_box",
        title="a yaw moment that grows with speed and yaw rate",
        parameters=[sv.parameter("gain", "kg m", typical=60.0, lower=-500.0, upper=500.0)],
        moment_z=lambda d, p: -p.gain * d.v_x * d.r,
    )
    assert not mine.parameters[0].mirrored
    assert mine.equation == "moment_z += ((-gain) * v_x) * r"
    car = sv.example_vehicle()
    truth = Model(car).add(mine).with_values({"roof_box.gain": 120.0})
    logs = [
        sv.drive(truth, m, seed=i, rate_hz=50.0)
        for i, m in enumerate((sv.manoeuvres.lap(25.0), sv.manoeuvres.handling_course(20.0)))
    ]
    few = ["roof_box", "aero_drag", "steer_lag", "gyro_bias", "mass"]
    study = sv.improve(Model(car), logs[0], logs[1], candidates=few, starts=1, sensors=False)
    assert [a.id for a in study.added] == ["roof_box"]
    gain = study.fit["roof_box.gain"]
    assert abs(gain.value - 120.0) < 4.0 * gain.std
    assert gain.std < 12.0
    assert study.test[-1].error < 1.05 < study.test[0].error


def test_its_derivatives_are_exact() -> None:
    sv.define_effect(
        "my_grip",
        title="lateral force that saturates",
        parameters=[sv.parameter("gain", "N", typical=300.0, lower=-3e3, upper=3e3)],
        force_y_front=lambda d, p: p.gain * np.tanh(30.0 * d.alpha_f) * (d.F_zf / 4000.0) ** 2,
    )
    car = sv.example_vehicle()
    log = sv.drive(Model(car), sv.manoeuvres.sine_sweep(), seed=3, rate_hz=50.0)
    driving = sv.Driving.of(log)
    model = Model(car).add("my_grip").with_values({"my_grip.gain": 200.0})
    problem = driving.problem(model)
    p, noise = model.vector(), sv.identify(Model(car), log, starts=1).noise.vector()
    frozen = problem.freeze(p, noise)
    column = model.parameters["my_grip.gain"].column
    exact = problem.sensitivities(p, frozen, [column])[:, 0]
    up, down = p.copy(), p.copy()
    up[column] += 1.0
    down[column] -= 1.0
    numeric = (problem.residuals(down, frozen) - problem.residuals(up, frozen)).ravel() / 2.0
    np.testing.assert_allclose(exact, numeric, atol=1e-7 * np.abs(exact).max())


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"force_x": lambda d, p: 3.0 * d.v_x}, "must vanish exactly"),
        ({"force_x": lambda d, p: p.drag_area_m2 * d.alpha_f}, "there is no 'alpha_f'.*signals"),
        ({"force_x": lambda d, p: p.area * d.v_x}, "there is no 'area'.*drag_area_m2"),
        ({"force_x": lambda d, p: p.drag_area_m2 * d.vx}, r"no 'vx' here \(did you mean 'v_x'"),
        ({"force_x": lambda d, p: p.drag_area_m2 if d.v_x > 3 else d.v_x}, "numpy.where"),
        ({"force_x": lambda d, p: p.drag_area_m2 * np.cumsum(d.v_x)}, "cannot be followed"),
        ({"force_x": lambda d, p: p.drag_area_m2 * np.sqrt(-d.v_x)}, "not finite"),
        ({"force_x": lambda d, p: 0.0}, "depends on no signal"),
        ({"force_x": None}, "at least one function"),
        ({"reads": {"speed": lambda d, p: d.v_x}}, "there is no 'speed'"),
        ({"parameters": []}, "1 to 4 parameters"),
        (
            {
                "parameters": [
                    *WIND,
                    sv.parameter("b", "1", typical=1.0, lower=0.0, upper=2.0, null_value=0.5),
                ],
                "force_x": lambda d, p: p.gain * np.tanh(p.b * d.v_x),
            },
            "b does nothing by itself",
        ),
    ],
)
def test_what_cannot_work_is_said_at_once(changes: dict[str, object], message: str) -> None:
    with pytest.raises(sv.InvalidInput, match=message):
        drag_of_users(**changes)
    assert all(e.id != "my_drag" for e in sv.catalogue())


def test_parameters_that_contradict_themselves() -> None:
    with pytest.raises(sv.InvalidInput, match="within the bounds"):
        sv.parameter("a", "1", typical=4.0, lower=0.0, upper=2.0)
    with pytest.raises(sv.InvalidInput, match="differ from the null value"):
        sv.parameter("a", "1", typical=0.0, lower=-1.0, upper=2.0)


def test_names_of_the_catalogue_are_taken_and_room_is_finite() -> None:
    with pytest.raises(sv.InvalidInput, match="catalogue has one"):
        sv.define_effect(
            "steer_lag", title="", parameters=WIND, force_y=lambda d, p: p.gain * d.v_x
        )
    for i in range(_core.USER_EFFECTS):
        sv.define_effect(
            f"mine_{i}", title="", parameters=WIND, force_y=lambda d, p: p.gain * d.v_x
        )
    with pytest.raises(sv.InvalidInput, match="forget_effect"):
        sv.define_effect("more", title="", parameters=WIND, force_y=lambda d, p: p.gain * d.v_x)
    columns = [e.parameters[0].column for e in sv.catalogue()]
    assert len(set(columns)) == len(columns)


def test_a_second_definition_replaces_the_first() -> None:
    first = drag_of_users()
    second = drag_of_users(title="better")
    assert second.columns == first.columns
    assert sv.effect("my_drag").title == "better"


def test_no_slope_at_null_is_noticed() -> None:
    made = drag_of_users(force_x=lambda d, p: -(p.drag_area_m2**2) * d.v_x)
    assert made.scored_at_typical
    assert not drag_of_users().scored_at_typical


def test_a_file_of_effects(tmp_path: Path) -> None:
    path = tmp_path / "mine.py"
    path.write_text(
        "import sysid_vehicle as sv\n"
        "sv.define_effect('gust', title='gust', parameters=[sv.parameter('gain', 'N', "
        "typical=50.0, lower=-500.0, upper=500.0)], force_y=lambda d, p: p.gain * d.v_x / 20.0)\n"
    )
    assert [e.id for e in sv.load_effects(path)] == ["gust"]
    assert [e.id for e in sv.load_effects(path)] == ["gust"]
    path.write_text("x = 1\n")
    with pytest.raises(sv.InvalidInput, match="defines no effect"):
        sv.load_effects(path)
    path.write_text("1 / 0\n")
    with pytest.raises(sv.InvalidInput, match=r"mine.py: ZeroDivisionError"):
        sv.load_effects(path)


def test_the_core_refuses_formulas_that_read_what_is_not_there() -> None:
    data = sv.vehicle.vehicle_data(sv.example_vehicle())
    for steps in (
        [],
        [(0, (0, 0, 0), 1.0)] * 257,
        [(3, (0, 0, 0), 0.0)],
        [(1, (len(SIGNALS), 0, 0), 0.0)],
        [(2, (4, 0, 0), 0.0)],
        [(99, (0, 0, 0), 0.0)],
        [(CHANNEL, (1, 0, 0), 0.0)],
        [(STATE, (0, 0, 0), 0.0)],
    ):
        with pytest.raises(ValueError, match="formula"):
            _core.SingleTrack(data, 0, True, [(0, [3], [(0, steps)], [])])
    one = [(0, (0, 0, 0), 1.0)]
    with pytest.raises(ValueError, match="formula"):
        _core.SingleTrack(data, 0, True, [(0, [99], [(0, [(CHANNEL, (0, 0, 0), 0.0)])], [])])
    with pytest.raises(ValueError, match="more states"):
        _core.SingleTrack(data, 0, True, [(0, [], [], [(one, one, None)] * 5)])
    with pytest.raises(ValueError, match="no such target"):
        _core.SingleTrack(data, 0, True, [(0, [], [(len(TARGETS), one)], [])])
    with pytest.raises(ValueError, match="no such place"):
        _core.SingleTrack(data, 0, True, [(8, [], [], [])])


def test_steps_that_nothing_needs_are_left_out() -> None:
    formula = trace(lambda d, p: p.a * d.r, ["a"], "moment_z", "x")
    assert len(formula.steps) == 3
    assert formula.text == "a * r"


def test_the_command_line_takes_a_file(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "mine.py"
    path.write_text(
        "import sysid_vehicle as sv\n"
        "sv.define_effect('gust', title='gust', parameters=[sv.parameter('gain', 'N', "
        "typical=50.0, lower=-500.0, upper=500.0)], force_y=lambda d, p: p.gain * d.v_x / 20.0)\n"
    )
    assert main(["effects", "--define", str(path)]) == 0
    assert "force_y += (gain * v_x) / 20" in capsys.readouterr().out
    path.write_text("import nothing_like_it\n")
    assert main(["effects", "--define", str(path)]) == 2
    assert "mine.py: ModuleNotFoundError" in capsys.readouterr().err


def answer(model: Model) -> np.ndarray:
    """What a model that is driven in the open reads."""
    drive = sv.simulate.drive_truth(
        model, sv.manoeuvres.sine_sweep(), seed=1, noise=sv.SensorNoise.none()
    )
    return np.column_stack([drive.log[c] for c in ("vx_mps", "yaw_rate_radps", "ay_mps2")])


def side_wind(id_: str, power: int) -> sv.Effect:
    return sv.define_effect(
        id_, title=f"wind {power}", parameters=WIND, force_y=lambda d, p: p.gain * d.v_x**power
    )


def test_a_model_keeps_its_effects_whatever_is_defined_or_forgotten_later() -> None:
    car = sv.example_vehicle()
    old = Model(car).add(side_wind("wind", 2)).with_values({"wind.gain": 0.8})
    before = answer(old)
    new = Model(car).add(side_wind("wind", 1)).with_values({"wind.gain": 0.8})
    assert old != new
    np.testing.assert_array_equal(answer(old.with_values({})), before)
    assert not np.allclose(answer(new), before)
    sv.forget_effect("wind")
    np.testing.assert_array_equal(answer(old), before)
    assert old.parts[0].title == "wind 2"
    assert old.drop("wind") == Model(car)
    side_wind("other", 1)
    assert old == Model(car).add(side_wind("wind", 2)).with_values({"wind.gain": 0.8})


def test_a_fit_keeps_its_effects(fit: sv.Fit, lap: sv.Log) -> None:
    model = fit.model.add(side_wind("wind", 2)).with_values({"wind.gain": 0.1})
    mine = refine(model, fit.driving, fit.noise)
    before, text = sv.compare(mine, lap).error, str(mine)
    side_wind("wind", 1)
    assert (sv.compare(mine, lap).error, str(mine)) == (before, text)
    sv.forget_effect("wind")
    assert (sv.compare(mine, lap).error, str(mine)) == (before, text)


def test_effects_at_one_place_move_apart() -> None:
    car = sv.example_vehicle()
    first = Model(car).add(side_wind("first", 2)).with_values({"first.gain": 0.8})
    sv.forget_effect("first")
    second = side_wind("second", 1)
    assert second.index == first.parts[0].index
    (candidate,) = (e for e in first.candidates if e.id == "second")
    assert candidate == second
    assert candidate.index != first.parts[0].index
    both = first.add("second").with_values({"second.gain": 0.5})
    side_wind("first", 2)
    again = Model(car).add("second", "first").with_values({"first.gain": 0.8, "second.gain": 0.5})
    np.testing.assert_allclose(answer(both), answer(again), rtol=1e-12)


def test_candidates_are_scored_apart_from_what_the_model_keeps(fit: sv.Fit) -> None:
    def columns(model: Model, effect: sv.Effect) -> np.ndarray:
        evidence = Evidence(sv.Fit(**{**vars(fit), "model": model}), fit.driving)
        return sensitivities(evidence, [effect]).columns

    first, second = side_wind("first", 2), side_wind("second", 1)
    with_first = fit.model.add(first).with_values({"first.gain": 0.3})
    expected = columns(with_first, second)
    sv.forget_effect("first")
    sv.forget_effect("second")
    np.testing.assert_array_equal(columns(with_first, side_wind("second", 1)), expected)


_ELSEWHERE = """
import pickle, sys
import numpy as np
import sysid_vehicle as sv
if sys.argv[3] == "another":
    sv.define_effect("wind", title="another", force_x=lambda d, p: p.force + 0.0 * d.v_x,
                     parameters=[sv.parameter("force", "N", typical=9.0, lower=0, upper=10)])
model, before = pickle.load(open(sys.argv[1], "rb"))
drive = sv.simulate.drive_truth(
    model, sv.manoeuvres.sine_sweep(), seed=1, noise=sv.SensorNoise.none()
)
now = np.column_stack([drive.log[c] for c in ("vx_mps", "yaw_rate_radps", "ay_mps2")])
np.testing.assert_array_equal(now, before)
assert model.parts[0].title == "wind 2"
print(model, file=open(sys.argv[2], "w"))
"""


@pytest.mark.parametrize("defined", ["nothing", "another"])
def test_a_model_means_the_same_in_another_process(tmp_path: Path, defined: str) -> None:
    model = Model(sv.example_vehicle()).add(side_wind("wind", 2)).with_values({"wind.gain": 0.8})
    (tmp_path / "model").write_bytes(pickle.dumps((model, answer(model))))
    given = [str(tmp_path / "model"), str(tmp_path / "text"), defined]
    subprocess.run([sys.executable, "-c", _ELSEWHERE, *given], check=True)
    assert (tmp_path / "text").read_text() == f"{model}\n"


def test_effects_are_copied_by_what_they_are() -> None:
    mine, known = side_wind("wind", 2), sv.effect("mass")
    for copied in (copy.deepcopy(mine), pickle.loads(pickle.dumps(mine))):
        assert copied == mine
        assert copied.columns == mine.columns
    assert copy.deepcopy(known) is pickle.loads(pickle.dumps(known)) is known
    assert b"equation" not in pickle.dumps(known)


@pytest.mark.parametrize("command", ["compare", "diagnose", "improve"])
def test_a_file_of_definitions_runs_once_before_anything_is_read(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], command: str
) -> None:
    (tmp_path / "mine.py").write_text("print('defined')\n")
    rest = [str(tmp_path / "none.csv"), "--vehicle", str(tmp_path / "none.toml")]
    more = ["--report", str(tmp_path / "out.html")] if command == "improve" else []
    assert main([command, *rest, *more, "--define", str(tmp_path / "mine.py")]) == 2
    assert capsys.readouterr().out == "defined\n"
