"""Effects of users that have states, read columns of the log, tables and wheels."""

from __future__ import annotations

import dataclasses
import pickle
import sys
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import sysid_vehicle as sv
from sysid_vehicle import _core, lab, published
from sysid_vehicle.effects.formula import EVERYTHING, evaluate, trace
from sysid_vehicle.effects.slope import decay_of
from sysid_vehicle.estimate.channels import has_channels, logged_channels
from sysid_vehicle.model import Model
from sysid_vehicle.simulate.drive import Drive, drive_truth

QUIET = sv.SensorNoise.none()
GAIN = sv.parameter("gain", "N/K", typical=30.0, lower=-500.0, upper=500.0)
LAG = sv.parameter("time_constant_s", "s", typical=4.0, lower=0.2, upper=50.0, scan="range")
NOISE = sv.NoiseModel(
    (0.03, 0.03, 0.003, 0.06, 0.06), (0.05, 0.05, 0.01), (50.0, 50.0, 30.0), (0.5, 0.5, 0.5)
).vector()
LOADS = "F_zfl", "F_zfr", "F_zrl", "F_zrr"


@pytest.fixture(autouse=True)
def no_effects_left(monkeypatch: pytest.MonkeyPatch) -> None:
    catalogue = sys.modules["sysid_vehicle.effects.catalogue"]
    monkeypatch.setattr(catalogue, "_users", {})
    monkeypatch.setattr(catalogue, "_channels", [])


def heat(**changes: Any) -> sv.Effect:
    """Lateral force that falls with a temperature; sliding heats, the track cools."""
    how: dict[str, Any] = {
        "title": "grip falls with the tread's temperature",
        "parameters": [GAIN, LAG],
        "channels": {"track_degC": (5.0, 60.0)},
        "states": [
            sv.state(
                "T",
                "degC",
                rate=lambda d, p: (
                    (0.02 * np.abs(d.F_yf * d.alpha_f * d.v_x) + d.track_degC - d.T)
                    / p.time_constant_s
                ),
                usual=(10.0, 120.0),
                initial=lambda d, p: d.track_degC + 0.1 * p.time_constant_s,
            )
        ],
        "force_y_front": lambda d, p: -p.gain * (d.T - 20.0) * np.tanh(20.0 * d.alpha_f),
        **changes,
    }
    return sv.define_effect("heat", **how)


def driven(model: Model, seconds: float = 6.0, **how: Any) -> Drive:
    how = {"channels": {"track_degC": lambda t: 20.0 + t}, "noise": QUIET, **how}
    return drive_truth(model, sv.manoeuvres.lap(seconds), seed=1, rate_hz=50.0, **how)


def moved_alone(rate: Any, initial: Any, dt: float = 0.02, **more: Any) -> tuple[Drive, Any]:
    """A state that nothing feels, and the times of its samples."""
    one = sv.define_effect(
        "alone",
        title="",
        parameters=[sv.parameter("gain", "N", typical=1.0, lower=-5.0, upper=5.0)],
        states=[sv.state("s", "1", rate=rate, usual=(0.1, 2.0), initial=initial)],
        force_y=lambda d, p: p.gain * d.s,
        **more,
    )
    ended = drive_truth(
        Model(sv.example_vehicle()).add(one),
        sv.manoeuvres.lap(3.0),
        seed=1,
        noise=QUIET,
        rate_hz=1.0 / dt,
    )
    return ended, ended.log["time_s"]


def test_at_its_null_value_nothing_changes() -> None:
    effect = heat()
    plain = Model(sv.example_vehicle())
    model = plain.add(effect)
    log = driven(plain, noise=None).log
    driving = sv.Driving.of(log)
    p, problem = plain.vector([effect]), driving.problem(model)
    frozen = problem.freeze(p, NOISE)
    without = problem.with_model(plain.core())
    np.testing.assert_array_equal(problem.residuals(p, frozen), without.residuals(p, frozen))
    assert problem.freeze(p, NOISE).log_likelihood == pytest.approx(
        without.freeze(p, NOISE).log_likelihood, rel=1e-12
    )


def test_derivatives_by_gain_lag_and_tyre_are_exact() -> None:
    model = Model(sv.example_vehicle()).add(heat())
    model = model.with_values({"heat.gain": 25.0, "heat.time_constant_s": 2.0})
    driving = sv.Driving.of(driven(model, noise=None).log)
    problem, p = driving.problem(model), model.vector()
    frozen = problem.freeze(p, NOISE)
    for name, step in (("heat.gain", 1e-2), ("heat.time_constant_s", 1e-4), ("D_front", 1e-6)):
        column = model.parameters[name].column
        exact = problem.sensitivities(p, frozen, [column])[:, 0]
        up, down = p.copy(), p.copy()
        up[column] += step
        down[column] -= step
        change = (problem.residuals(down, frozen) - problem.residuals(up, frozen)).ravel()
        numeric = change / (2.0 * step)
        assert np.abs(exact).max() > 1e-3
        np.testing.assert_allclose(exact, numeric, atol=2e-7 * np.abs(exact).max())


def test_states_move_as_their_equations_say() -> None:
    ended, t = moved_alone(lambda d, p: (1.5 - d.s) / 0.4, 0.5)
    np.testing.assert_allclose(
        ended.own_states["alone.s"], 1.5 - np.exp(-t / 0.4), rtol=0.0, atol=1e-12
    )
    ended, t = moved_alone(lambda d, p: -2.0 * d.s**3, 1.0)  # decays, but not exponentially
    expected = 1.0 / np.sqrt(1.0 + 4.0 * t)
    np.testing.assert_allclose(ended.own_states["alone.s"], expected, atol=3e-9)
    ended, t = moved_alone(lambda d, p: d.v_x, 3.0)  # distance
    v_x = ended.states[:, 0]
    far = 3.0 + np.concatenate(([0.0], np.cumsum(0.5 * (v_x[1:] + v_x[:-1]) * np.diff(t))))
    np.testing.assert_allclose(ended.own_states["alone.s"], far, atol=1e-3)


def test_a_state_of_any_stiffness_is_stable() -> None:
    for seconds in (1e-7, 1e-4, 1e-2):
        ended, _ = moved_alone(lambda d, p, tau=seconds: (np.tanh(d.v_x) - d.s) / tau, 0.0, 0.05)
        np.testing.assert_allclose(ended.own_states["alone.s"][5:], 1.0, atol=1e-6)
    ended, _ = moved_alone(lambda d, p: 1e5 * (d.steer - d.s**3), 1.0, 0.05)  # stiff and bent
    assert np.isfinite(ended.own_states["alone.s"]).all()


def test_without_a_beginning_a_state_begins_at_rest() -> None:
    ended, _ = moved_alone(lambda d, p: (2.0 + 0.0 * d.v_x - d.s) / 30.0, None)
    np.testing.assert_allclose(ended.own_states["alone.s"], 2.0, rtol=1e-12)
    with pytest.raises(sv.InvalidInput, match="give it an initial value"):
        moved_alone(lambda d, p: d.v_x, None)


def test_the_decay_is_the_derivative_by_the_state() -> None:
    def rate(d: Any, p: Any) -> Any:
        s = d.s
        u = np.sin(s) * np.cos(s) + np.arctan(s) + np.arctan2(s, d.v_x) + np.sqrt(s) + np.exp(-s)
        v = np.log(s) + np.tanh(s) + np.minimum(s, 0.7) * np.maximum(s, 0.9) + np.abs(s - 0.8)
        w = np.where(s > 0.75, s**2, -s) + s / (1.0 + s) + np.interp(s, [0, 0.6, 1], [0, 1, -1])
        return p.a * (u + v + w + np.sign(s)) - d.other * s

    steps = trace(rate, ["a"], EVERYTHING, "x", states=["other", "s"]).steps
    decay = decay_of(steps, 1)
    parts = _core.formula_parts()["operations"]
    assert "state" in {parts[o] for o, _, _ in decay}
    s = np.linspace(0.31, 1.2, 23)
    signals = {"v_x": np.full(23, 20.0), "other": np.full(23, 0.3)}
    slope = np.imag(run(steps, signals | {"s": s + 1e-20j})) / 1e-20
    np.testing.assert_allclose(run(decay, signals | {"s": s}), -slope, rtol=1e-10, atol=1e-10)


def run(steps: Any, signals: dict[str, Any]) -> Any:
    """What the core does, in NumPy and with complex numbers; parameters are 1.3."""
    parts = _core.formula_parts()
    values: list[Any] = []
    for operation, (a, b, c), constant in steps:
        name = parts["operations"][operation]
        if name == "constant":
            values.append(constant)
        elif name == "parameter":
            values.append(1.3)
        elif name in ("signal", "state"):
            read = parts["signals"] if name == "signal" else ("other", "s")
            values.append(signals[read[a]])
        else:
            x, y, z = values[a], values[b], values[c]
            values.append(_apply(name, x, y, z))
    return values[-1]


def _apply(name: str, x: Any, y: Any, z: Any) -> Any:
    first, second = np.real(x), np.real(y)
    if name == "where":
        return np.where(first != 0.0, y, z)
    if name == "greater":
        return np.where(first > second, 1.0, 0.0)
    if name in ("minimum", "maximum"):
        return np.where((first < second) == (name == "minimum"), x, y)
    if name == "absolute":
        return np.where(first < 0.0, -x, x)
    if name == "sign":
        return np.sign(first)
    if name == "arctan2":
        return np.arctan(x / y)
    return getattr(np, name)(
        *(x, y)[: 2 if name in ("add", "subtract", "multiply", "divide") else 1]
    )


def test_tables_and_wheels_are_those_of_numpy() -> None:
    def table(d: Any, p: Any) -> Any:
        fixed = np.interp(d.v_x, [5.0, 22.0, 24.0, 26.0], [0.5, 1.0, -2.0, 3.0])
        return p.gain * (fixed + np.interp(d.r, [-0.1, 0.0, 0.2], [0.0, p.gain, 1.0]))

    one = sv.define_effect(
        "table",
        title="",
        parameters=[sv.parameter("gain", "1", typical=2.0, lower=-9.0, upper=9.0)],
        reads={"ay_mps2": table, "vy_mps": lambda d, p: p.gain * (d.F_zfl - d.F_zfr + d.alpha_rl)},
    )
    assert "interp(v_x, [5, 22, 24, 26], [0.5, 1, -2, 3])" in one.equation
    car = sv.example_vehicle()
    model = Model(car).add(one).with_values({"table.gain": 2.0})
    drive = driven(model, channels={})
    v_x, v_y, r = drive.states.T
    plain = driven(Model(car), channels={})
    added = drive.outputs[:, 4] - plain.outputs[:, 4]
    d, p = SimpleNamespace(v_x=v_x, r=r), SimpleNamespace(gain=2.0)
    np.testing.assert_allclose(added, table(d, p), atol=1e-9)
    assert v_x.max() > 26.0  # the table is held there
    core = model.core()
    at = [
        core.evaluate(model.vector(), x, u[0], u[1])[0]
        for x, u in zip(drive.states, drive.inputs, strict=True)
    ]
    front = np.array(at)[:, 9]
    loads = -2.0 * car.cg_height_m * front / car.track_front_m
    slips = -np.arctan2(v_y - car.lr_m * r, v_x - 0.5 * car.track_rear_m * r)
    np.testing.assert_allclose(drive.outputs[:, 1] - v_y, 2.0 * (loads + slips), rtol=1e-9)
    assert loads[np.argmax(front)] < 0.0  # in a left turn the left wheel is the lighter one


def test_wheels_of_an_axle_carry_what_it_carries() -> None:
    for axle, (left, right) in (("F_zf", LOADS[:2]), ("F_zr", LOADS[2:])):
        one = sv.define_effect(
            "sums",
            title="",
            parameters=[sv.parameter("gain", "1", typical=1.0, lower=-9.0, upper=9.0)],
            reads={
                "ay_mps2": lambda d, p, n=(axle, left, right): (
                    p.gain * ((getattr(d, n[1]) + getattr(d, n[2])) / getattr(d, n[0]) - 1.0 + 1.0)
                )
            },
        )
        model = Model(sv.example_vehicle()).add(one)
        there, none = (
            driven(model.with_values({"sums.gain": g}), channels={}).outputs[:, 4] for g in (1, 0)
        )
        np.testing.assert_allclose(there - none, 1.0, rtol=1e-12)


@pytest.mark.parametrize(
    ("knots", "values"), [([0.0, 0.0], [1.0, 2.0]), ([1.0], [2.0]), ([0.0, 1.0], [1.0])]
)
def test_tables_that_are_none(knots: list[float], values: list[float]) -> None:
    with pytest.raises(sv.InvalidInput, match="knots that increase, and a value for each"):
        trace(lambda d, p: p.a * np.interp(d.v_x, knots, values), ["a"], "force_x", "x")


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"channels": {"vy_mps": (-1.0, 1.0)}}, "read d.v_y in its place"),
        ({"channels": {"v_x": (0.0, 1.0)}}, "'v_x' is taken"),
        ({"channels": {"track degC": (0.0, 1.0)}}, "rename the column"),
        ({"channels": {"track_degC": (3.0, 1.0)}}, "give \\(lowest, highest\\)"),
        ({"channels": {}}, "there is no 'track_degC'"),
        ({"states": []}, "there is no 'T'"),
        ({"force_x": lambda d, p: p.gain * d.a_y}, "there is no 'a_y'"),
    ],
)
def test_definitions_that_cannot_work(changes: dict[str, Any], message: str) -> None:
    with pytest.raises(sv.InvalidInput, match=message):
        heat(**changes)


def test_a_column_that_is_not_there_is_named() -> None:
    car = sv.example_vehicle()
    model = Model(car).add(heat())
    with pytest.raises(sv.InvalidInput, match=r"track_degC; give channels=\{'track_degC'"):
        driven(model, channels={})
    with pytest.raises(sv.InvalidInput, match="vx_mps is what the drive makes"):
        driven(Model(car), channels={"vx_mps": 3.0})
    log = driven(Model(car), channels={"track_deg": 20.0}).log
    with pytest.raises(sv.InvalidInput, match=r"heat reads the column track_degC.*'track_deg'"):
        sv.Driving.of(log).problem(model)
    assert not sv.Driving.of(log).shows(sv.effect("heat"))


def test_the_laboratory_has_no_log_to_read_from() -> None:
    setup = lab.Setup.default()
    reads = dataclasses.replace(setup, plant=setup.plant.add(heat()))
    with pytest.raises(sv.InvalidInput, match="heat reads the column track_degC; drop"):
        lab.run_closed_loop(published.Identification(duration_s=2.0), reads, seed=1)


def test_a_slow_column_is_linear_between_its_samples_and_a_hole_is_named() -> None:
    effect = heat()
    log = driven(Model(sv.example_vehicle()), channels={"track_degC": lambda t: 3.0 * t + 7.0}).log
    data = {c: log[c].copy() for c in log.channels}
    every = np.arange(log.n) % 40 == 5
    data["track_degC"][~every] = np.nan
    slow = sv.Log.from_arrays(data, check=False)
    whole = slice(0, log.n)
    expected = 3.0 * np.clip(log["time_s"], 0.1, log["time_s"][every][-1]) + 7.0
    np.testing.assert_allclose(logged_channels(slow, whole)[:, 0], expected, atol=1e-9)
    data = {c: log[c].copy() for c in log.channels}
    data["track_degC"][100:200] = np.nan
    holed = sv.Log.from_arrays(data, check=False)
    assert not has_channels(holed, whole, effect)
    assert has_channels(holed, slice(0, 90), effect)
    with pytest.raises(sv.InvalidInput, match=r"holds no value from t = 2 to 3.98 s"):
        sv.Driving.of(holed).problem(Model(sv.example_vehicle()).add(effect))


def test_copies_and_files_hold_states_and_columns(tmp_path: Path) -> None:
    effect = heat()
    model = Model(sv.example_vehicle()).add(effect).with_values({"heat.gain": 25.0})
    before = driven(model).outputs
    model.save(tmp_path / "model.npz")
    kept = pickle.dumps(model)
    sv.forget_effect("heat")
    for again in (pickle.loads(kept), sv.load(tmp_path / "model.npz")):
        assert again == model
        assert again.channels == ("track_degC",)
        np.testing.assert_array_equal(driven(again).outputs, before)


def test_room_for_states_and_columns_is_finite() -> None:
    model = Model(sv.example_vehicle())
    lag = [sv.state("s", "1", rate=lambda d, p: d.r - d.s, usual=(-1.0, 1.0))]
    gain = [sv.parameter("gain", "N", typical=9.0, lower=-99.0, upper=99.0)]
    for i in range(_core.USER_STATES + 1):
        model = model.add(
            sv.define_effect(
                f"e{i}", title="", parameters=gain, states=lag, force_y=lambda d, p: p.gain * d.s
            )
        )
    with pytest.raises(sv.InvalidInput, match="together they have more than the 4 states"):
        model.core()
    names = [f"c{i}" for i in range(_core.USER_CHANNELS + 1)]
    with pytest.raises(sv.InvalidInput, match="channel 'c8': there is room for 8"):
        sv.define_effect(
            "many",
            title="",
            parameters=gain,
            channels=dict.fromkeys(names, (0.0, 1.0)),
            force_y=lambda d, p: p.gain * sum(getattr(d, n) for n in names),
        )


def test_a_mirror_turns_states_that_lag_lateral_motion() -> None:
    gain = [sv.parameter("gain", "N", typical=9.0, lower=-99.0, upper=99.0)]

    def follows(of: Any) -> bool:
        s = sv.state("s", "1", rate=lambda d, p: of(d) - d.s, usual=(-1.0, 1.0))
        made = sv.define_effect(
            "e", title="", parameters=gain, states=[s], force_y=lambda d, p: p.gain * d.s
        )
        return made.parameters[0].mirrored

    assert not follows(lambda d: d.a_y)
    assert not follows(lambda d: d.F_zfr - d.F_zfl)
    assert follows(lambda d: d.v_x)
    assert follows(lambda d: d.F_zfl + d.F_zfr)


@pytest.mark.manual
def test_a_hidden_effect_with_a_state_is_found(tmp_path: Path) -> None:
    effect = heat()
    car = sv.example_vehicle()
    truth = Model(car).add(effect)
    truth = truth.with_values({"heat.gain": 30.0, "heat.time_constant_s": 5.0})
    manoeuvres = sv.manoeuvres.lap(40.0), sv.manoeuvres.handling_course(40.0)
    logs = [
        sv.drive(truth, m, seed=i, rate_hz=25.0, channels={"track_degC": lambda t: 20.0 + 0.2 * t})
        for i, m in enumerate(manoeuvres)
    ]
    few = ["heat", "steer_lag", "gyro_bias", "mass", "aero_drag"]
    study = sv.improve(Model(car), logs[0], logs[1], candidates=few, starts=1, sensors=False)
    assert [a.id for a in study.added] == ["heat"]
    for name, value in (("heat.gain", 30.0), ("heat.time_constant_s", 5.0)):
        found = study.fit[name]
        assert abs(found.value - value) < 3.0 * found.std
    study.save(tmp_path / "study.npz")
    assert sv.load(tmp_path / "study.npz").fit["heat.gain"] == study.fit["heat.gain"]


def test_evaluated_formulas_know_what_their_place_knows() -> None:
    signals = {"v_x": np.ones(3), "a_y": np.ones(3), "T": np.full(3, 2.0)}
    with pytest.raises(AttributeError, match="a_y"):
        evaluate(lambda d, p: d.a_y, "force_y", signals, {})
    np.testing.assert_array_equal(evaluate(lambda d, p: d.T, "force_x", signals, {}), 2.0)
