"""Nuisances that differ from log to log: each log has its own, whatever it is read for."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from sysid_vehicle import Fit, Log, Model, compare, diagnose, drive, identify, identify_runs, load
from sysid_vehicle import manoeuvres as drives
from sysid_vehicle.compare import one_step_error
from sysid_vehicle.diagnose.evidence.evidence import Evidence
from sysid_vehicle.estimate import Driving
from sysid_vehicle.estimate.driving import Stretch
from sysid_vehicle.estimate.pieces import PiecewiseProblem
from sysid_vehicle.identify import driving_beside, driving_of, offsets, predicting_ahead, refine
from sysid_vehicle.identify.offsets import marginal_information

STEER, GYRO = "steer_offset.offset_rad", "gyro_bias.bias_radps"
NUISANCES = ("steer_offset", "gyro_bias")


@pytest.fixture(scope="module")
def several(lap: Log, course: Log, altered: Callable[..., Log]) -> tuple[Log, ...]:
    """Three logs of one car whose steering sensor and gyro were set to zero anew for each."""

    def moved(log: Log, steer: float, gyro: float) -> Log:
        steer_rad, yaw_rate = log["steer_rad"] + steer, log["yaw_rate_radps"] + gyro
        return altered(log, steer_rad=steer_rad, yaw_rate_radps=yaw_rate)

    first, second = lap.between(0.0, 14.0), lap.between(14.0, 28.0)
    return (
        moved(first, 0.004, 0.003),
        moved(second, -0.006, 0.0),
        moved(course.between(0.0, 15.0), 0.01, -0.003),
    )


@pytest.fixture(scope="module")
def found(start: Model, several: tuple[Log, ...]) -> Fit:
    return identify(start.with_nuisances(NUISANCES), several[:2], starts=1)


def test_each_log_of_a_fit_has_its_own(found: Fit, several: tuple[Log, ...], truth: Model) -> None:
    first, second = (found.offsets[log.name] for log in several[:2])
    assert first[STEER] == pytest.approx(-0.004, abs=2e-4)
    assert second[STEER] == pytest.approx(0.006, abs=2e-4)
    assert first[GYRO] == pytest.approx(0.003, abs=6e-4)
    assert second[GYRO] == pytest.approx(0.0, abs=6e-4)
    # What the table has is the mean, and the car is the true one in spite of them.
    assert found[STEER].value == pytest.approx(0.5 * (first[STEER] + second[STEER]))
    assert f"{several[0].name}: steer_offset.offset_rad" in str(found)
    assert several[1].name in found._repr_html_()
    for axle in ("front", "rear"):
        load_n = truth.vehicle.mass_kg * 9.80665 / truth.vehicle.wheelbase_m
        load_n *= truth.vehicle.lr_m if axle == "front" else truth.vehicle.lf_m
        stiffness = load_n * np.prod([truth.value(f"{x}_{axle}") for x in "BCD"])
        e = found[f"cornering stiffness {axle}"]
        assert abs(e.value - stiffness) < 4.0 * e.std


def test_a_part_of_driving_keeps_to_itself(found: Fit, several: tuple[Log, ...]) -> None:
    part = Driving.of(several).only(Stretch(1, slice(100, 400)))
    assert part.samples == 300
    assert [log.name for log in part.logs] == [several[1].name]
    own = driving_of(found, part)
    assert own.offsets
    assert own.samples == 300
    assert own.only(own.stretches[0]).offsets == own.offsets


def test_logs_of_the_same_offsets_need_none(start: Model, lap: Log) -> None:
    plain = start.with_nuisances(NUISANCES)
    halves = [lap.between(0.0, 10.0), lap.between(10.0, 20.0)]
    fit = identify(plain, halves, starts=1)
    assert all(abs(own[STEER]) < 4e-4 for own in fit.offsets.values())
    alone = replace(fit, driving=Driving.of(lap))
    assert not alone.driving.offsets
    assert alone.offsets == {lap.name: {n: alone.model.value(n) for n in (STEER, GYRO)}}
    assert replace(alone, model=start).offsets == {lap.name: {}}
    twice = Driving((lap, lap), True, ({STEER: 0.1}, {}))
    assert [*replace(alone, driving=twice).offsets] == [f"{lap.name} (1)", f"{lap.name} (2)"]


def test_other_logs_have_their_own_too(found: Fit, several: tuple[Log, ...]) -> None:
    other = several[2]
    own = driving_of(found, other).offsets[0]
    assert own[STEER] + found.model.value(STEER) == pytest.approx(-0.01, abs=3e-4)
    assert compare(found, other).error < 1.05
    # Taken as offsets of the first logs they are an error of the model.
    rigid = Driving((other,), True, ({STEER: 0.0},))
    assert compare(found, rigid).error > 1.3
    assert driving_of(found, found.driving) is found.driving
    assert driving_of(found, rigid) is rigid


def test_offsets_beside_a_known_fit_are_those_found_anew(
    found: Fit, several: tuple[Log, ...], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of a model with an effect more they stand within the standard error that they have."""
    driving = Driving.of(several[2])
    richer = refine(found.model.add("steer_lag", "mass"), found.driving, found.noise)
    anew = driving_of(richer, driving)
    driving_of(found, driving)

    def learned(*_: object, **__: object) -> None:
        pytest.fail("noise is learned once")

    with monkeypatch.context() as patch:
        patch.setattr(offsets.Objective, "learn_noise", learned)
        near = driving_beside(richer, found, driving)
    moved = False
    for name in (STEER, GYRO):
        one, other = (d.offsets[0][name] for d in (anew, near))
        assert one == pytest.approx(other, abs=0.5 * richer[name].std)
        moved |= other + richer.model.value(name) != found.model.value(name)
    assert moved
    errors = [one_step_error(richer, d, found.noise) for d in (anew, near)]
    assert errors[1] == pytest.approx(errors[0], rel=2e-3)
    assert one_step_error(richer, driving, found.noise, near=found) == errors[1]
    # Where the other fit has other nuisances, or the driving its own offsets, nothing is saved.
    plain = refine(found.model.drop("gyro_bias"), found.driving, found.noise)
    assert driving_beside(richer, plain, driving) is driving_of(richer, driving)
    assert driving_beside(richer, found, richer.driving) is richer.driving


def test_a_prior_holds_what_a_log_does_not_tell(found: Fit, several: tuple[Log, ...]) -> None:
    loose, tight = (
        driving_of(_with_prior(found, std), several[2]).offsets[0][STEER] + found.model.value(STEER)
        for std in (0.02, 1e-7)
    )
    assert loose == pytest.approx(-0.01, abs=3e-4)
    assert tight == pytest.approx(0.0, abs=1e-5)


def _with_prior(fit: Fit, std: float) -> Fit:
    return replace(fit, model=fit.model.with_priors({STEER: (0.0, std)}))


def test_a_shifted_problem_is_that_of_shifted_parameters(
    found: Fit, several: tuple[Log, ...]
) -> None:
    driving = found.driving
    problem, noise, p = driving.problem(found.model), found.noise.vector(), found.model.vector()
    columns = [found.model.parameters[n].column for n in ("B_front", STEER, GYRO)]
    gains = problem.freeze(p, noise)
    whole = problem.normal_equations(p, gains, columns)
    horizons = [(1, 1), (50, 10)]
    signals = np.ones((driving.samples, 2))
    at, sums = 0, [0.0, np.zeros(3), np.zeros((3, 3)), 0.0, 0.0]
    for one, own in zip(driving.each_log(), driving.offsets, strict=True):
        moved = found.model.with_values({n: found.model.value(n) + v for n, v in own.items()})
        q, alone = moved.vector(), Driving(one.logs, True).problem(moved)
        kept = alone.freeze(q, noise)
        here = slice(at, at + alone.samples)
        rows = slice(5 * here.start, 5 * here.stop)
        same = {
            "residuals": (problem.residuals(p, gains)[here], alone.residuals(q, kept)),
            "sensitivities": (
                problem.sensitivities(p, gains, columns)[rows],
                alone.sensitivities(q, kept, columns),
            ),
            "signals": (
                problem.signal_sensitivities(p, gains, signals, [1, 7])[rows],
                alone.signal_sensitivities(q, kept, signals[here], [1, 7]),
            ),
            "state": (
                problem.trace(p, noise, True)["state"][here],
                alone.trace(q, noise, True)["state"],
            ),
            "means": (problem.smoothed_means(p, noise)[here], alone.smoothed_means(q, noise)),
            "ahead": (
                problem.look_ahead(p, noise, horizons)[:, here],
                alone.look_ahead(q, noise, horizons),
            ),
            "free": (problem.free_run(p)[here], alone.free_run(q)),
        }
        for name, (got, expected) in same.items():
            np.testing.assert_allclose(got, expected, rtol=1e-9, atol=1e-9, err_msg=name)
        told = alone.normal_equations(q, kept, columns)
        score = alone.noise_score(q, noise)[0]
        more = (*told, kept.log_likelihood, score)
        sums = [a + b for a, b in zip(sums, more, strict=True)]
        at = here.stop
    for got, expected in zip(whole, sums, strict=False):
        np.testing.assert_allclose(got, expected, rtol=1e-9)
    assert gains.log_likelihood == pytest.approx(sums[3], rel=1e-12)
    assert problem.noise_score(p, noise)[0] == pytest.approx(sums[4], rel=1e-9)
    assert problem.half_sum_of_squares(p, gains) == pytest.approx(whole[0], rel=1e-12)
    sets = np.stack([p] * 5)
    np.testing.assert_allclose(problem.log_likelihoods(sets, noise), gains.log_likelihood)
    pieces = driving.problem(found.model, longest=1000)
    assert isinstance(pieces, PiecewiseProblem)
    assert pieces.freeze(p, noise).log_likelihood == pytest.approx(sums[3], rel=1e-9)


def test_standard_errors_count_the_offsets_as_unknown(found: Fit) -> None:
    """Marginal information is that of the joint fit of shared parameters and each log's own."""
    model, driving, noise = found.model, found.driving, found.noise
    p, names = model.vector(), model.free_names
    columns = [model.parameters[n].column for n in names]
    own = [names.index(n) for n in (STEER, GYRO)]
    shared = [i for i in range(len(names)) if i not in own]
    n, m = len(shared), len(own)
    joint, mean = np.zeros((n + 2 * m, n + 2 * m)), np.zeros((n + m, n + 2 * m))
    mean[:n, :n] = np.eye(n)
    for i, log in enumerate(driving.each_log()):
        problem = log.problem(model)
        told = problem.normal_equations(p, problem.freeze(p, noise.vector()), columns)[2]
        told[own, own] += [model.priors[name][1] ** -2.0 for name in (STEER, GYRO)]
        at = [*range(n), *range(n + m * i, n + m * (i + 1))]
        joint[np.ix_(at, at)] += told[np.ix_([*shared, *own], [*shared, *own])]
        mean[n:, n + m * i : n + m * (i + 1)] = 0.5 * np.eye(m)
    # What the driving does not tell of the tyres has no inverse without some more knowledge.
    more = np.diag(1e-2 * np.diag(joint)[:n])
    joint[:n, :n] += more
    marginal = marginal_information(model, driving, p, noise)[
        np.ix_([*shared, *own], [*shared, *own])
    ]
    marginal[:n, :n] += more
    expected = mean @ np.linalg.inv(joint) @ mean.T
    scale = np.sqrt(np.diag(expected))
    got = np.linalg.inv(marginal) / np.outer(scale, scale)
    np.testing.assert_allclose(got, expected / np.outer(scale, scale), atol=1e-6)


def test_what_logs_differ_by_is_projected_out(found: Fit) -> None:
    evidence = Evidence(found, found.driving)
    first = np.repeat(found.driving.log_number == 0, 5)
    own = np.where(first, evidence.of_parameters(STEER)[:, 0], 0.0)
    assert np.linalg.norm(evidence.project(own[:, None])) < 1e-6 * np.linalg.norm(own)


def test_fits_to_predictions_and_files_keep_them(
    found: Fit, several: tuple[Log, ...], tmp_path: Path
) -> None:
    ahead = predicting_ahead(found, 1.0)
    other = driving_of(ahead, several[2]).offsets[0][STEER] + ahead.model.value(STEER)
    assert other == pytest.approx(-0.01, abs=2e-3)
    assert ahead.driving.offsets == found.driving.offsets
    assert ahead[STEER].value == pytest.approx(found[STEER].value, abs=2e-3)
    found.save(tmp_path / "fit.npz")
    back = load(tmp_path / "fit.npz")
    assert isinstance(back, Fit)
    assert back.offsets == found.offsets
    assert compare(back, back.driving).error == compare(found, found.driving).error


def test_runs_that_are_told_apart_keep_them(start: Model, several: tuple[Log, ...]) -> None:
    runs = {"one": several[0], "two": several[1]}
    model = start.with_nuisances(NUISANCES)
    told = identify_runs(model, runs, vary=["D_front"], starts=1)
    assert told["one"].offsets[several[0].name][STEER] == pytest.approx(-0.004, abs=3e-4)
    assert told["two"].offsets[several[1].name][STEER] == pytest.approx(0.006, abs=3e-4)
    assert told.differences[0].p_value > 1e-3


def test_joined_driving_keeps_the_offsets_of_its_parts(
    found: Fit, several: tuple[Log, ...]
) -> None:
    other = driving_of(found, several[2])
    both = Driving.joined((found.driving, other))
    assert both.offsets == (*found.driving.offsets, *other.offsets)
    plain = Driving.joined((Driving.of(several[0]), other))
    assert plain.offsets == ({}, *other.offsets)
    # Driving without any is not taken for driving whose logs have none.
    none = Driving.joined((Driving.of(several[0]), Driving.of(several[1])))
    assert [d.offsets for d in (none, *none.each_log())] == [(), (), ()]
    assert [d.logs for d in both.each_log()] == [(log,) for log in several]


def test_states_of_effects_begin_with_the_motion_and_not_with_its_reading(
    start: Model, truth: Model, altered: Callable[..., Log]
) -> None:
    """An offset that the fit knows, and noise of the first reading, are no kick to them."""
    length_m = 0.45
    slow = truth.add("tyre_relaxation").with_values(
        {"tyre_relaxation.relaxation_length_m": length_m}
    )
    logs = [drive(slow, drives.lap(15.0), seed=s, rate_hz=50.0) for s in (31, 32)]
    moved = [
        altered(
            log, steer_rad=log["steer_rad"] + steer, yaw_rate_radps=log["yaw_rate_radps"] + 0.01
        )
        for log, steer in zip(logs, (0.006, -0.004), strict=True)
    ]
    model = start.with_nuisances(NUISANCES)
    late = ["steer_lag", "steer_delay", "tyre_relaxation", "yaw_inertia", "sensor_delay"]
    found, plain = (
        diagnose(identify(model, some, starts=1), candidates=late, refits=0).ranking[0]
        for some in (moved, logs)
    )
    assert found.id == plain.id == "tyre_relaxation"
    assert abs(found.value[0] - length_m) < 3.0 * found.std[0]
    assert found.std[0] < 0.08
    assert found.statistic == pytest.approx(plain.statistic, rel=0.2)
