"""Scores of effects a model lacks: fair without one, near the truth with a small one."""

import warnings
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter
from scipy.stats import chi2, kstest

from sysid_vehicle import Driving, Fit, Log, Model, catalogue, drive, effect, identify, manoeuvres
from sysid_vehicle.diagnose import considered
from sysid_vehicle.diagnose.candidates.score import (
    Score,
    ScoreBoard,
    _p_value,
    _smallest_p_values,
    score_board,
    score_board_of,
)
from sysid_vehicle.diagnose.evidence.evidence import Evidence
from sysid_vehicle.diagnose.evidence.sensitivity import sensitivities
from sysid_vehicle.identify import refit

Hidden = Callable[[str, float], Fit]


def board(fit: Fit) -> ScoreBoard:
    return score_board(fit, fit.driving, considered(fit.model, [e.id for e in catalogue()]))


@pytest.fixture(scope="module")
def null_boards(complete_fits: tuple[Fit, ...]) -> list[ScoreBoard]:
    return [board(f) for f in complete_fits]


@pytest.mark.parametrize("name", ["gyro_bias", "steer_lag", "side_wind"])
def test_one_parameter_or_two_have_the_level_they_claim(name: str) -> None:
    """Of either sign, of one sign only, and two of either sign."""
    information = np.array([[4.0, 3.0], [3.0, 9.0]])[: len(effect(name).parameters)]
    information = information[:, : len(information)]
    rng = np.random.default_rng(4)
    scores = rng.multivariate_normal(np.zeros(len(information)), information, size=20000)
    p = _p_value(effect(name), scores, information)
    for level in (0.001, 0.01, 0.05, 0.2):
        assert np.mean(p < level) == pytest.approx(level, abs=4.0 * np.sqrt(level / 20000))


def test_the_smallest_p_value_of_many_is_that_of_each() -> None:
    """Of effects that are tested alike only the largest statistic is looked up."""
    names = ("gyro_bias", "mass", "steer_lag", "force_lag", "side_wind", "body_attitude")
    rng = np.random.default_rng(5)
    cut, at = [], 0
    for name in names:
        n = len(effect(name).parameters)
        cut.append((effect(name), slice(at, at + n)))
        at += n
    root = rng.standard_normal((at, at))
    covariance = root @ root.T + np.eye(at)
    scores = rng.multivariate_normal(np.zeros(at), covariance, size=500)
    each = [_p_value(e, scores[:, own], covariance[own, own]) for e, own in cut]
    np.testing.assert_allclose(
        _smallest_p_values(cut, scores, covariance), np.min(each, axis=0), rtol=1e-9
    )


def test_statistics_of_a_complete_model_are_those_of_noise(null_boards: list[ScoreBoard]) -> None:
    scores = [s for b in null_boards for s in b.scores]
    per_degree = [s.statistic / len(s.effect.parameters) for s in scores]
    # Expected 1, a little less because variance ratios above 1 are taken out and never put in.
    assert 0.5 < np.mean(per_degree) < 1.5
    two_sided = [s.p_value for s in scores if not s.effect.parameters[0].one_sided]
    # Effects are correlated, so the test is a coarse one.
    assert kstest(two_sided, "uniform").statistic < 0.25


def test_a_complete_model_lacks_nothing(null_boards: list[ScoreBoard]) -> None:
    smallest = [min(b.family_p_values().values()) for b in null_boards]
    assert min(smallest) > 0.01
    assert max(smallest) > 0.2


def white_p_value(board: ScoreBoard, score: Score) -> float:
    """What would hold if the residuals were white."""
    raw = score.statistic * max(score.variance_ratio, 1.0)
    return float(chi2.sf(raw, board.directions[score.effect.id].shape[1]))


def test_coloured_residuals_are_not_taken_for_an_effect(complete_fits: tuple[Fit, ...]) -> None:
    """Noise that lasts for some samples has four times the variance in slow directions."""
    fit = complete_fits[0]
    candidates = fit.model.candidates
    claimed = naive = 0
    draws = 12
    for seed in range(draws):
        evidence = Evidence(fit, fit.driving)
        white = np.random.default_rng(seed).standard_normal((len(evidence.residual) // 5, 5))
        coloured = lfilter([0.8], [1.0, -0.6], white, axis=0)  # of variance 1
        vars(evidence)["left"] = evidence.project(coloured.ravel())
        b = score_board_of(evidence, candidates)
        claimed += min(b.family_p_values().values()) < 0.05
        naive += min(white_p_value(b, s) for s in b.scores) * len(b.scores) < 0.05
    assert naive > 0.8 * draws
    assert claimed <= 3  # at 5 % each, more would be seen by chance in one of 400 choices of seeds


def test_family_p_values_are_never_smaller_than_single_ones(
    null_boards: list[ScoreBoard], hidden_fit: Hidden
) -> None:
    weak = board(hidden_fit("aero_drag.drag_area_m2", 0.1))
    for b in (*null_boards, weak):
        family = b.family_p_values()
        assert set(family) == {s.effect.id for s in b.scores}
        # Simulated from 4000 draws: 2 % of standard error at the p-values that matter little.
        assert all(family[s.effect.id] >= s.p_value - 0.03 for s in b.scores)
        small = [s for s in b.scores if s.p_value < 1e-3]
        assert all(family[s.effect.id] >= s.p_value for s in small)
        assert all(0.0 <= p <= 1.0 for p in family.values())
    assert family["aero_drag"] < 1e-3


def test_family_p_values_come_from_their_seed(null_boards: list[ScoreBoard]) -> None:
    one = null_boards[0]
    assert one.family_p_values(seed=1) == one.family_p_values(seed=1)
    assert one.family_p_values(seed=1) != one.family_p_values(seed=2)


@pytest.mark.parametrize(
    ("name", "value"),
    [
        pytest.param("aero_drag.drag_area_m2", 0.1, marks=pytest.mark.manual),
        ("steer_offset.offset_rad", 0.002),
        ("yaw_inertia.relative_error", 0.05),
        pytest.param("tyre_relaxation.relaxation_length_m", 0.3, marks=pytest.mark.manual),
        pytest.param("front_tyre_relaxation.relaxation_length_m", 0.3, marks=pytest.mark.manual),
        ("rear_tyre_relaxation.relaxation_length_m", 0.3),
        ("force_lag.time_constant_s", 0.1),
        pytest.param("wheel_inertia.mass_share", 0.03, marks=pytest.mark.manual),
        ("body_roll.roll_per_g_rad", 0.02),
    ],
)
def test_a_small_effect_is_first_and_its_size_predicted(
    name: str, value: float, hidden_fit: Hidden
) -> None:
    scores = board(hidden_fit(name, value)).scores
    first = scores[0]
    assert first.effect.id == name.split(".")[0]
    assert first.p_value < 1e-6
    assert first.std[0] > 0.0
    assert abs(first.value[0] - value) < 4.0 * first.std[0]


def test_the_statistic_is_the_gain_of_a_refit(hidden_fit: Hidden) -> None:
    fit = hidden_fit("aero_drag.drag_area_m2", 0.1)
    score = next(s for s in board(fit).scores if s.effect.id == "aero_drag")
    base = refit(fit.model, fit.driving, fit.noise)
    richer = refit(fit.model.add("aero_drag"), fit.driving, fit.noise)
    gain = 2.0 * (richer.log_likelihood - base.log_likelihood)
    assert score.statistic * max(score.variance_ratio, 1.0) == pytest.approx(gain, rel=0.1)
    refitted = richer["aero_drag.drag_area_m2"]
    assert score.value[0] == pytest.approx(refitted.value, rel=0.1)
    assert score.std[0] == pytest.approx(refitted.std, rel=0.15)


def test_a_one_sided_effect_of_the_wrong_sign_is_no_evidence(
    truth: Model, start: Model, hidden_fit: Hidden
) -> None:
    one_sided = {e.id for e in catalogue() if len(e.parameters) == 1 and e.parameters[0].one_sided}
    assert {"steer_lag", "tyre_relaxation"} <= one_sided
    # An early steering signal would need a negative lag.
    log = drive(truth, manoeuvres.lap(30.0), seed=7, rate_hz=50.0)
    data = {c: log[c] for c in log.channels}
    late = {c: np.roll(v, 3) if c == "steer_rad" else v for c, v in data.items()}
    cut = Log.from_arrays({c: v[10:] for c, v in late.items()}, check=False)
    fit = identify(start, cut, starts=1)
    found = {s.effect.id: s for s in board(fit).scores}
    lag = found["steer_lag"]
    assert lag.value[0] < -4.0 * lag.std[0]
    assert lag.p_value == 1.0
    for b in (found.values(), board(hidden_fit("aero_drag.drag_area_m2", 0.1)).scores):
        for s in b:
            if s.effect.id in one_sided and s.value[0] < 0.0:
                assert s.p_value == 1.0


def test_effects_together_tell_at_least_as_much_as_each(null_boards: list[ScoreBoard]) -> None:
    b = null_boards[0]
    both = b.joint_statistic("aero_drag", "mass")
    assert both >= b.joint_statistic("aero_drag") - 1e-9
    assert both >= b.joint_statistic("mass") - 1e-9
    twice = b.joint_statistic("mass", "mass")
    assert twice == pytest.approx(b.joint_statistic("mass"), rel=1e-6)


def test_directions_are_free_of_what_the_fit_can_do(fit: Fit) -> None:
    b = board(fit)
    driving, model = fit.driving, fit.model
    problem, p = driving.problem(model), model.vector()
    frozen = problem.freeze(p, fit.noise.vector())
    columns = [model.parameters[n].column for n in model.free_names]
    G = problem.sensitivities(p, frozen, columns)
    for name, R in b.directions.items():
        cosine = (G.T @ R) / np.outer(np.linalg.norm(G, axis=0), np.linalg.norm(R, axis=0))
        assert np.abs(cosine).max() < 1e-3, name
    raw = sensitivities(Evidence(fit, fit.driving), tuple(s.effect for s in b.scores))
    for s in b.scores:
        left, whole = b.directions[s.effect.id], raw.columns[:, raw.places[s.effect.id]]
        assert s.retained == pytest.approx(np.linalg.norm(left) / np.linalg.norm(whole), rel=1e-6)
        assert s.retained <= 1.0 + 1e-9


def test_an_effect_the_log_cannot_show_has_no_score(
    fit: Fit, altered: Callable[..., Log], lap: Log
) -> None:
    blind = Driving.of(altered(lap, without=["fx_n"]))
    scored = {s.effect.id for s in score_board(fit, blind, fit.model.candidates).scores}
    needing = {e.id for e in catalogue() if e.needs_force}
    assert needing
    assert not scored & needing
    assert "steer_lag" in scored


def test_a_score_of_few_effects_is_theirs_in_the_score_of_all(fit: Fit) -> None:
    few = score_board(fit, fit.driving, (effect("mass"), effect("steer_lag")))
    everything = {s.effect.id: s for s in board(fit).scores}
    assert {s.effect.id for s in few.scores} == {"mass", "steer_lag"}
    for s in few.scores:
        assert s.statistic == pytest.approx(everything[s.effect.id].statistic, rel=1e-9, abs=1e-9)
    assert score_board(fit, fit.driving, ()).family_p_values() == {}


def test_a_delay_that_a_fast_filter_cannot_follow_is_tried_shorter(fit: Fit, truth: Model) -> None:
    """Gains that trust the sensors wholly oscillate with readings that come late, ever more."""
    sure = replace(
        fit.noise,
        sensor=(1e-3, 1e-3, 1e-4, 5e-3, 5e-3),
        motion=(1.0, 1.0, 1.0),
        disturbance=(5e3, 5e3, 5e3),
    )
    late = [effect("sensor_delay")]
    fine = Driving.of(drive(truth, manoeuvres.lap(20.0), seed=1))
    evidence = Evidence(replace(fit, noise=sure), fine)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        found = sensitivities(evidence, late).columns
    assert np.all(np.isfinite(found))
    assert np.all(np.abs(found).max(axis=0) > 0.0)
