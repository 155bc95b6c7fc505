"""A long log is worked on piece by piece, with the results of the whole."""

from collections.abc import Callable
from dataclasses import replace
from importlib import import_module
from typing import Any

import numpy as np
import pytest

import sysid_vehicle as sv
from sysid_vehicle.effects import effect
from sysid_vehicle.estimate import Driving, first_guess
from sysid_vehicle.estimate.pieces import DrivingProblem, PiecewiseProblem

COLUMNS = [*range(9), *effect("steer_delay").columns]
LONGEST = 700  # samples; the logs below become pieces of whole runs and of parts of runs


@pytest.fixture(scope="module")
def model() -> sv.Model:
    values = {
        "tyre_relaxation.relaxation_length_m": 0.4,
        "tyre_load_sensitivity.sensitivity": 0.2,
        "steer_delay.delay_s": -0.033,  # what a piece needs of the steering lies beyond its end
    }
    model = sv.Model(sv.example_vehicle()).add(*(name.split(".")[0] for name in values))
    return model.with_values(values)


@pytest.fixture(scope="module")
def driving(model: sv.Model) -> Driving:
    """Two runs of other rates, and a long one."""
    drives = ((8.0, 25.0), (20.0, 20.0), (44.0, 25.0))
    return Driving.of(
        [
            sv.drive(model, sv.manoeuvres.lap(s), seed=i, rate_hz=rate)
            for i, (s, rate) in enumerate(drives)
        ]
    )


def off(whole: Any, pieces: Any) -> float:
    """Largest difference, column by column, of the column's largest value."""
    if isinstance(whole, tuple):
        return max(map(off, whole, pieces))
    a, b = (np.reshape(x, (-1, np.shape(x)[-1] if np.ndim(x) else 1)) for x in (whole, pieces))
    assert np.array_equal(np.isnan(a), np.isnan(b))
    a, b = np.nan_to_num(a), np.nan_to_num(b)
    return float(np.max(np.abs(a - b).max(axis=0) / (np.abs(a).max(axis=0) + 1e-12)))


TOLD = ("innovation", "spread", "whitened", "state", "state_std", "log_likelihood")
QUESTIONS: dict[str, Callable[[DrivingProblem, Any, Any, Any], Any]] = {
    "residuals": lambda q, p, g, n: q.residuals(1.01 * p, g),
    "half sum": lambda q, p, g, n: q.half_sum_of_squares(1.01 * p, g),
    "sensitivities": lambda q, p, g, n: q.sensitivities(p, g, COLUMNS),
    "signals": lambda q, p, g, n: q.signal_sensitivities(p, g, np.ones((q.samples, 2)), [1, 9]),
    "log-likelihood": lambda q, p, g, n: [g.log_likelihood, g.observed],
    "log-likelihoods": lambda q, p, g, n: q.log_likelihoods(np.array([p, 1.01 * p]), n),
    "ahead": lambda q, p, g, n: q.look_ahead(p, n, [(25, 5), (50, 10)]),
    "normal equations": lambda q, p, g, n: q.normal_equations(p, g, COLUMNS),
    "noise score": lambda q, p, g, n: q.noise_score(p, n),
    "filtered": lambda q, p, g, n: tuple(q.trace(p, n, False)[name] for name in TOLD),
    "smoothed": lambda q, p, g, n: tuple(q.trace(p, n, True)[name] for name in TOLD),
    "smoothed means": lambda q, p, g, n: q.smoothed_means(p, n),
}


@pytest.fixture(scope="module")
def asked(model: sv.Model, driving: Driving) -> list[tuple[DrivingProblem, Any, Any, Any]]:
    noise = first_guess(driving, model.vehicle).floor().vector()
    problems = driving.problem(model), driving.problem(model, longest=LONGEST)
    assert isinstance(problems[1], PiecewiseProblem)
    ends = [(p.run, p.begin, p.end) for p in problems[1].pieces]
    assert ends[0] == (0, 0, 602)  # two runs as one piece
    assert [run for run, *_ in ends[1:]] == [602] * 2
    return [(q, model.vector(), q.freeze(model.vector(), noise), noise) for q in problems]


@pytest.mark.parametrize("question", QUESTIONS)
def test_pieces_add_up_to_the_whole(
    asked: list[tuple[DrivingProblem, Any, Any, Any]], question: str
) -> None:
    whole, pieces = (QUESTIONS[question](*a) for a in asked)
    assert off(whole, pieces) < 1e-9


def test_slopes_that_predictions_know_are_those_of_the_whole(
    model: sv.Model, driving: Driving
) -> None:
    noise = replace(first_guess(driving, model.vehicle).floor(), road=(0.2, 0.1)).vector()
    level = replace(first_guess(driving, model.vehicle).floor(), road=(0.0, 0.0)).vector()
    problems = driving.problem(model), driving.problem(model, longest=LONGEST)
    p, asked = model.vector(), [(25, 5), (50, 10)]
    whole, pieces = (q.look_ahead(p, noise, asked) for q in problems)
    assert off(whole, pieces) < 1e-6
    assert off(problems[0].look_ahead(p, level, asked), whole) > 0.1
    road = np.outer(np.linspace(-1.0, 1.0, problems[0].samples), [0.3, -0.5])
    on_one, in_pieces = (q.look_ahead(p, noise, asked, road=road) for q in problems)
    assert off(on_one, in_pieces) < 1e-6
    assert off(on_one, whole) > 0.1


def test_a_slow_state_has_a_longer_lead(
    model: sv.Model, driving: Driving, asked: list[tuple[DrivingProblem, Any, Any, Any]]
) -> None:
    """The heat of a tyre is remembered for much longer than a filter remembers."""
    heat = model.add("tyre_temperature").with_values(
        {"tyre_temperature.loss_pkw": 0.03, "tyre_temperature.time_constant_s": 1.0}
    )
    moved = [q.with_model(heat.core()).residuals(heat.vector(), g) for q, _, g, _ in asked]
    assert off(*moved) < 1e-9
    pieces, _, gains, _ = asked[1]
    assert isinstance(pieces, PiecewiseProblem)
    part = list(pieces.parts(gains))[2]
    short = pieces.build(heat.core(), *part.where.indices(pieces.samples)[:2])
    cold = short.residuals(heat.vector(), part.filtered[1])[part.lead :]
    assert off(moved[0][part.piece.begin : part.piece.end], cold) > 1e-6


def test_user_channels_and_other_inputs_are_those_of_the_samples(driving: Driving) -> None:
    model, inputs = sv.Model(sv.example_vehicle()), 0.9 * driving.inputs()
    noise = first_guess(driving, model.vehicle).vector()
    found = []
    for longest in (None, LONGEST):
        problem = driving.problem(model, other_inputs=inputs, longest=longest)
        found.append(problem.residuals(model.vector(), problem.freeze(model.vector(), noise)))
    assert off(*found) < 1e-9


def test_a_comparison_in_pieces_is_the_same(
    monkeypatch: pytest.MonkeyPatch, fit: sv.Fit, course: sv.Log
) -> None:
    whole = sv.compare(fit, course)
    monkeypatch.setattr(import_module("sysid_vehicle.compare.compare"), "TRACED", LONGEST)
    found = sv.compare(fit, course)
    assert off(whole.residual, found.residual) < 1e-9
    assert off(whole.failure_map.error, found.failure_map.error) < 1e-9
    for a, b in ((whole, found), *((whole.channels[c], found.channels[c]) for c in found.channels)):
        told = {k: v for k, v in vars(a).items() if isinstance(v, float)}
        assert {k: vars(b)[k] for k in told} == pytest.approx(told, rel=1e-9)


def test_a_diagnosis_in_sections_is_the_same(monkeypatch: pytest.MonkeyPatch, fit: sv.Fit) -> None:
    """Scores, colour of the residuals, what is left, causes; with slow states and delays."""
    effects = ("mass", "tyre_temperature", "friction_change", "steer_lag", "tyre_load_sensitivity")
    whole = sv.diagnose(fit, candidates=effects, refits=0)
    evidence = import_module("sysid_vehicle.diagnose.evidence.evidence")
    monkeypatch.setattr(evidence, "HELD", fit.driving.samples // 4 + 1)
    found = sv.diagnose(fit, candidates=effects, refits=0)
    assert len(list(evidence.Evidence(fit, fit.driving).sections())) >= 4
    assert found.omnibus.strongest == whole.omnibus.strongest
    assert found.omnibus.statistic == pytest.approx(whole.omnibus.statistic, rel=1e-9)
    assert list(found.proposed.sizes) == list(whole.proposed.sizes)
    for a, b in zip(whole.scores, found.scores, strict=True):
        assert a.effect.id == b.effect.id
        for name in ("statistic", "p_value", "value", "std", "retained", "variance_ratio"):
            assert getattr(b, name) == pytest.approx(getattr(a, name), rel=1e-7, abs=1e-9), name
    assert found.family == pytest.approx(whole.family, rel=1e-7, abs=1e-12)
    assert found.proposed.inclusion == pytest.approx(whole.proposed.inclusion, rel=1e-7)
