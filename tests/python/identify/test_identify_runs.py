"""Runs of one car between which some parameters differ, and parameters that are tied."""

import json
from dataclasses import replace

import numpy as np
import pytest

from sysid_vehicle import (
    InvalidInput,
    Log,
    Model,
    NoiseModel,
    RunsFit,
    Vehicle,
    compare,
    drive,
    identify_runs,
    manoeuvres,
)
from sysid_vehicle.estimate import Driving
from sysid_vehicle.identify import objective_of
from sysid_vehicle.identify.search.mapped import Copied, Mapped

LOAD, GRIP = "mass.relative_error", "D_front"
LOADS = {"full": 0.08, "empty": -0.03}


@pytest.fixture(scope="module")
def runs(car: Vehicle) -> dict[str, Log]:
    """A lap with much and one with little fuel, on the same tyres."""
    made = {}
    for seed, (name, error) in enumerate(LOADS.items()):
        truth = Model(car).add("mass").with_values({LOAD: error})
        made[name] = drive(truth, manoeuvres.lap(20.0), seed=40 + seed, rate_hz=25.0)
    return made


@pytest.fixture(scope="module")
def found(start: Model, runs: dict[str, Log]) -> RunsFit:
    return identify_runs(start.add("mass"), runs, vary=[LOAD, GRIP], starts=1)


def test_each_run_has_its_own_value(found: RunsFit, car: Vehicle) -> None:
    assert found.converged
    for run, true in LOADS.items():
        own = found[run][LOAD]
        assert abs(own.value - true) < 4.0 * own.std
        assert found[run].model.value(LOAD) == own.value
    load, grip = found.differences
    assert abs(load.most - 0.11) < 4.0 * load.most_std
    assert load.p_value < 1e-6
    # The tyres are the same, and that is what is said of them.
    assert grip.p_value > 0.01
    assert found.gain > 100.0


def test_what_is_common_is_the_same_in_every_run(found: RunsFit) -> None:
    assert {e.name for e in found.shared}.isdisjoint({LOAD, GRIP})
    full, empty = found.fits.values()
    for e in found.shared:
        assert full[e.name] == empty[e.name] == e
    assert full.noise == empty.noise
    assert full.log_likelihood + empty.log_likelihood == pytest.approx(found.log_likelihood)


def test_the_fit_of_a_run_serves_like_any_other(found: RunsFit, runs: dict[str, Log]) -> None:
    for run, log in runs.items():
        assert found[run].covariance.shape == (len(found[run].model.free_names),) * 2
        assert compare(found[run], log).error == pytest.approx(1.0, abs=0.05)
    assert compare(found["full"], runs["empty"]).error > 1.2


def test_it_prints_and_is_json(found: RunsFit, runs: dict[str, Log]) -> None:
    for text in (str(found), found._repr_html_()):
        for word in ("full", "empty", LOAD, "common"):
            assert word in text
    told = json.loads(json.dumps(found.to_dict()))
    assert set(told["runs"]) == set(LOADS)
    assert "differs by 0.1" in str(found.differences[0])
    # No offsets of logs, no line of them.
    assert f"{runs['full'].name}: " not in str(found["full"]).replace(found["full"]._headline(), "")
    with pytest.raises(KeyError, match="there are full, empty"):
        found["half"]


def test_tied_parameters_stay_equal(start: Model, runs: dict[str, Log], found: RunsFit) -> None:
    tie = {f"{x}_rear": f"{x}_front" for x in "BCDE"}
    tied = identify_runs(start.add("mass"), runs, vary=[LOAD], tie=tie, starts=1)
    for fit in tied.fits.values():
        assert fit.model.value("B_rear") == fit.model.value("B_front")
        assert "B_rear" not in fit.model.free_names
    # The car's axles differ: tyres that are held equal explain less.
    assert tied.log_likelihood < found.log_likelihood - 20.0
    assert len(tied.shared) == 4
    assert "B_rear = B_front" in str(tied)


def test_derivatives_by_common_parameters_add_up(start: Model, runs: dict[str, Log]) -> None:
    model = start.add("mass")
    size = len(model.vector())
    load, front, rear = (model.parameters[n].column for n in (LOAD, "D_front", "D_rear"))
    parts = []
    for i, log in enumerate(runs.values()):
        source = np.arange(size)
        source[rear] = front
        source[load] = load if i == 0 else size
        parts.append(Copied(Driving.of(log).problem(model), source))
    both = objective_of(model, Mapped(tuple(parts)), Driving.of(list(runs.values())))
    q = np.append(model.vector(), -0.02)
    sensors, forces = (0.03, 0.03, 0.0025, 0.06, 0.06), (50.0, 50.0, 50.0)
    noise = NoiseModel(sensors, (0.01, 0.01, 0.01), forces, (0.3, 0.3, 0.3)).vector()
    gains = both.freeze(q, noise)
    columns = [front, load, size]
    cost, descent, information = both.normal_equations(q, gains, columns)
    assert cost == pytest.approx(both.half_sum_of_squares(q, gains))
    e, g = both.residuals(q, gains), both.sensitivities(q, gains, columns)
    assert g.T @ e == pytest.approx(descent, rel=1e-9)
    assert g.T @ g == pytest.approx(information, rel=1e-9)
    for k, c in enumerate(columns):
        h = 1e-5
        up, down = q.copy(), q.copy()
        up[c] += h
        down[c] -= h
        slope = (both.residuals(down, gains) - both.residuals(up, gains)) / (2.0 * h)
        assert g[:, k] == pytest.approx(slope, abs=1e-4 * np.abs(slope).max())
    # Each run moves by its own load only.
    assert information[1, 2] == 0.0


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"vary": ["mass.relative_eror"]}, "no free parameter.*mass.relative_error"),
        ({"vary": ["B_front"], "tie": {"B_front": "B_rear"}}, "cannot vary; vary B_rear"),
        ({"tie": {"B_front": "B_rear", "B_rear": "D_rear"}}, "which is tied itself"),
        ({"runs": {}}, "give a mapping"),
        ({"runs": "full", "vary": ["D_front"]}, "two or more"),
    ],
)
def test_mistakes_are_told(
    start: Model, runs: dict[str, Log], change: dict[str, object], message: str
) -> None:
    given = {"runs": runs, **change}
    if given["runs"] == "full":
        given["runs"] = {"full": runs["full"]}
    with pytest.raises(InvalidInput, match=message):
        identify_runs(start.add("mass"), **given)  # type: ignore[arg-type]


def test_a_difference_without_evidence_is_called_that(found: RunsFit) -> None:
    grip = found.differences[1]
    assert grip.most < 4.0 * grip.most_std
    assert str(replace(grip, p_value=0.0)).endswith("(p < 1e-300)")


def test_a_prior_about_nothing_hides_no_difference(start: Model, runs: dict[str, Log]) -> None:
    """Such an effect counts as a nuisance, of which every log else has its own."""
    roughly = start.add("mass").with_priors({LOAD: (0.0, 0.1)})
    found = identify_runs(roughly, runs, vary=LOAD, starts=1)
    for run, true in LOADS.items():
        own = found[run][LOAD]
        assert abs(own.value - true) < 4.0 * own.std
        assert own.std < 0.01
        assert not found[run].driving.offsets or LOAD not in found[run].driving.offsets[0]
    assert found.differences[0].p_value < 1e-6


def test_a_bias_may_differ_between_runs_beside_those_of_logs(
    start: Model, runs: dict[str, Log]
) -> None:
    biases = {"full": 0.004, "empty": -0.002}
    name = "gyro_bias.bias_radps"
    moved = {
        run: Log.from_arrays(
            {**{c: log[c] for c in log}, "yaw_rate_radps": log["yaw_rate_radps"] + biases[run]}
        )
        for run, log in runs.items()
    }
    model = start.add("mass").with_nuisances()
    found = identify_runs(model, moved, vary=[LOAD, name], starts=1)
    for run, true in biases.items():
        own = found[run][name]
        assert abs(own.value - true) < 4.0 * own.std
        assert own.std < 0.001
    (told,) = (d for d in found.differences if d.name == name)
    assert abs(told.most - 0.006) < 4.0 * told.most_std


def test_nuisances_of_logs_stand_beside_what_differs_between_runs(
    start: Model, runs: dict[str, Log]
) -> None:
    """One run of two logs, another of one: means of each, and intervals that count all of it."""
    full = runs["full"]
    offset, steer = "steer_offset.offset_rad", {"a": 0.004, "b": -0.002, "empty": 0.001}
    first, second, other = (
        Log.from_arrays({**{c: log[c] for c in log}, "steer_rad": log["steer_rad"] + of}, name=name)
        for (name, of), log in zip(
            steer.items(), (full.between(0, 10), full.between(10, 20), runs["empty"]), strict=True
        )
    )
    model = start.add("mass").with_nuisances(["steer_offset"])
    given = {"full": [first, second], "empty": other}
    found = identify_runs(model, given, vary=[LOAD], starts=1)
    (told,) = found.nuisances
    assert told.name == offset
    for run, mean in (("full", -0.001), ("empty", -0.001)):
        assert found[run][offset].value == pytest.approx(mean, abs=4.0 * found[run][offset].std)
        assert found[run][offset].std < 2e-4
    assert told.values == tuple(found[run][offset].value for run in given)
    for log, of in steer.items():
        run = "empty" if log == "empty" else "full"
        assert found[run].offsets[log][offset] == pytest.approx(-of, abs=2e-4)
    for run, true in LOADS.items():
        assert abs(found[run][LOAD].value - true) < 4.0 * found[run][LOAD].std
    assert offset not in {e.name for e in found.shared}
    assert offset in str(found)
    size = len(found.shared) + 2 + 3
    assert found.covariance.shape == (size, size)
