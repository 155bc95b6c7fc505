"""Exact dynamics of candidates whose score shows little of them."""

import sys
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from sysid_vehicle import (
    Fit,
    Log,
    Model,
    RoadDisturbance,
    Vehicle,
    diagnose,
    drive,
    identify,
    manoeuvres,
    verdicts,
)
from sysid_vehicle.diagnose.candidates.candidate import Candidate
from sysid_vehicle.diagnose.candidates.refits import (
    finished,
    from_typical,
    is_hidden_by_noise,
    refitted,
)
from sysid_vehicle.diagnose.candidates.refitting import Refitting, _hidden_by_tyres
from sysid_vehicle.diagnose.candidates.score import ScoreBoard
from sysid_vehicle.effects import catalogue
from sysid_vehicle.identify import refit, with_exact_inputs
from sysid_vehicle.identify.search.objective import Objective
from sysid_vehicle.model import NUISANCES

RELAXATIONS = ("tyre_relaxation", "front_tyre_relaxation", "rear_tyre_relaxation")


def scored(fit: Fit, name: str) -> Candidate:
    return next(c for c in diagnose(fit, refits=0).ranking if c.id == name)


def test_lags_of_one_parameter_may_hide_in_the_noise() -> None:
    found = {e.id for e in catalogue() if is_hidden_by_noise(e)}
    assert found == {*RELAXATIONS, "steer_lag", "force_lag"}


def test_a_lag_is_found_from_its_typical_size(truth: Model, start: Model) -> None:
    car = truth.add("tyre_relaxation").with_values({"tyre_relaxation.relaxation_length_m": 0.7})
    fit = identify(start, drive(car, manoeuvres.lap(15.0), seed=3, rate_hz=50.0), starts=1)
    found = from_typical(fit, scored(fit, "tyre_relaxation"), 30)
    assert found.finished
    assert found.p_value < 1e-6
    assert abs(found.value[0] - 0.7) < 4.0 * found.std[0]
    assert found.fit is not None
    gained = with_exact_inputs(found.fit) - with_exact_inputs(fit)
    assert found.statistic == pytest.approx(2.0 * gained)


def test_a_lag_that_a_road_hides_is_tried_where_its_score_alone_would_tell(
    truth: Model, start: Model
) -> None:
    name = "tyre_relaxation"
    car = truth.add(name).with_values({f"{name}.relaxation_length_m": 0.55})
    push = RoadDisturbance(150.0, 200.0, 100.0, 0.3)
    fit = identify(start, drive(car, manoeuvres.lap(40.0), seed=5, disturbance=push), starts=1)
    found = diagnose(fit)
    # Beside fifty others its score is no evidence, and less than that of another lag.
    assert found.family[name] > found.alpha
    assert found.family[name] > found.family["steer_lag"]
    assert found.ranking[0].id == name
    assert found.ranking[0].p_value < found.alpha
    told = verdicts(found)[name]
    assert told.finding in ("missing", "one of a group")
    assert abs(told.value[0] - 0.55) < 2.0 * told.std[0]


@pytest.mark.parametrize("hidden", RELAXATIONS)
def test_the_axles_that_relax_are_told_apart(truth: Model, start: Model, hidden: str) -> None:
    car = truth.add(hidden).with_values({f"{hidden}.relaxation_length_m": 0.6})
    found = diagnose(
        identify(start, drive(car, manoeuvres.lap(15.0), seed=3, rate_hz=50.0), starts=1)
    )
    first = found.ranking[0]
    assert first.id == hidden
    assert not {*RELAXATIONS} & {*first.indistinguishable_from}
    assert abs(first.value[0] - 0.6) < 4.0 * first.std[0]


def test_a_lag_that_is_not_there_is_not_found(complete_fits: tuple[Fit, ...]) -> None:
    p = [from_typical(f, scored(f, "tyre_relaxation"), 1).p_value for f in complete_fits[:2]]
    assert min(p) > 0.01
    assert np.isfinite(p).all()


def test_a_refit_is_never_worse_than_the_model_that_it_contains(fine_fit: Fit) -> None:
    """Precise sensors tell a tenth of a typical delay from none by hundreds of nats."""
    fit = fine_fit
    one = replace(scored(fit, "sensor_delay"), value=(0.06, 0.02), p_value=1e-9)
    found = refitted(fit, fit.driving, one)
    assert found.statistic == 0.0
    assert found.p_value == 1.0  # what the score told is refuted
    assert found.fit is not None
    assert found.fit.log_likelihood == pytest.approx(fit.log_likelihood, abs=1e-6)
    assert found.value == (0.0, 0.0)
    assert np.isinf(found.std).all()
    assert finished(fit, found).statistic >= 0.0


def test_a_refit_ends_with_a_round_that_gains_next_to_nothing(
    truth: Model, start: Model, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The maximum with frozen gains and that of the likelihood are not quite the same place."""
    car = truth.add("mass").with_values({"mass.relative_error": 0.1})
    fit = identify(start, drive(car, manoeuvres.lap(15.0), seed=3, rate_hz=50.0), starts=1)
    module, reached = sys.modules["sysid_vehicle.identify.search.scanned"], []

    def seen(objective: Objective, *rest: Any, **options: Any) -> tuple[np.ndarray, Any]:
        found, gains = moved(objective, *rest, **options)
        reached.append(objective.reached(found, gains))
        return found, gains

    moved = module.moved
    monkeypatch.setattr(module, "moved", seen)
    refit(fit.model.add("mass"), fit.driving, fit.noise, rounds=9)
    gains = np.diff([fit.log_likelihood, *reached])
    assert gains[0] > 1.0
    assert (gains[:-1] > 0.05).all()
    assert 0.0 <= gains[-1] < 0.05


def test_the_best_of_either_motion_is_refitted(truth: Model, start: Model) -> None:
    """Lateral effects lead by far, and say nothing of what moves the car along."""
    hidden = {"steer_lag.time_constant_s": 0.1, "aero_drag.drag_area_m2": 0.12}
    car = truth.add("steer_lag", "aero_drag").with_values(hidden)
    fit = identify(start, drive(car, manoeuvres.lap(15.0), seed=3, rate_hz=50.0), starts=1)
    found = diagnose(fit, refits=1).ranking
    along = [c for c in found if c.effect.along_alone]
    lateral = [c for c in found if not c.effect.along_alone]
    assert along[0].statistic < 0.25 * lateral[0].statistic
    assert along[0].id == "aero_drag"
    assert along[0].finished
    assert along[0].fit is not None
    assert lateral[0].finished


def test_of_the_other_motion_what_the_best_explains_is_not_refitted(
    truth: Model, monkeypatch: pytest.MonkeyPatch
) -> None:
    car = truth.add("tyre_load_sensitivity")
    car = car.with_values({"tyre_load_sensitivity.sensitivity": 0.25})
    fit = identify(truth, drive(car, manoeuvres.lap(40.0), seed=1, rate_hz=25.0), starts=1)
    some = ["tyre_load_sensitivity", *(e.id for e in catalogue() if e.along_alone)]

    def along() -> set[str]:
        ranking = diagnose(fit, candidates=some, refits=1).ranking
        assert ranking[0].id == "tyre_load_sensitivity"
        return {c.id for c in ranking if c.effect.along_alone and c.fit is not None}

    found = along()
    module = sys.modules["sysid_vehicle.diagnose.candidates.refitting"]
    monkeypatch.setattr(module, "hopeless", lambda *_: ())
    assert found < along()


def test_what_acts_like_the_best_along_the_car_is_refitted_whatever_it_scores(fit: Fit) -> None:
    """Beside wrong tyres the score of a mass may be nothing, as it divides side forces too."""
    ranked = diagnose(fit, refits=0).ranking
    gain, lag = (next(c for c in ranked if c.id == name) for name in ("force_gain", "steer_lag"))
    asked = {c.id for c in _hidden_by_tyres(ranked, [lag, gain])}
    assert asked == {"mass", "aero_drag", "head_wind", "road_grade", "wheel_inertia"}
    mass = next(c for c in ranked if c.id == "mass")
    assert "mass" not in {c.id for c in _hidden_by_tyres(ranked, [gain, mass])}
    assert _hidden_by_tyres(ranked, [lag]) == []


def test_of_two_delays_one_may_not_be_there(truth: Model, start: Model) -> None:
    car = truth.add("sensor_delay").with_values({"sensor_delay.speeds_s": 0.0})
    car = car.with_values({"sensor_delay.inertial_s": 0.03})
    fit = identify(start, drive(car, manoeuvres.lap(15.0), seed=3, rate_hz=50.0), starts=1)
    found = refitted(fit, fit.driving, scored(fit, "sensor_delay"))
    assert found.statistic > 100.0
    speeds, inertial = found.value
    assert speeds < 0.002  # below a tenth of what is typical
    assert abs(inertial - 0.03) < 0.003


@pytest.mark.filterwarnings("ignore::sysid_vehicle.SysidWarning")  # too short for many effects
def test_what_the_disturbance_took_over_is_found_in_a_measured_log(
    double_lane_change: tuple[Vehicle, Log],
) -> None:
    """The score of the relaxation is small, and so is the gain of a refit under learned noise."""
    car, log = double_lane_change
    fit = identify(Model(car).with_nuisances((*NUISANCES, "ins_lever_arm")), log, starts=1)
    assert scored(fit, "tyre_relaxation").p_value > 0.05
    assert scored(fit, "rear_tyre_relaxation").p_value > 0.05
    both = diagnose(fit).ranking[:2]
    assert {c.id for c in both} == {"tyre_relaxation", "rear_tyre_relaxation"}
    assert all(c.finished and c.p_value < 0.01 for c in both)


def test_what_refines_an_effect_of_the_model_is_refitted_whatever_leads(
    hidden_fit: Callable[[str, float], Fit], monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: list[set[str]] = []

    class Noted(Refitting):
        def leading(
            self, significant: Sequence[Candidate], refits: int
        ) -> tuple[list[Candidate], list[Candidate]]:
            asked.append({*self.again})
            return [], []

    monkeypatch.setattr(sys.modules["sysid_vehicle.diagnose.diagnose"], "Refitting", Noted)
    level = hidden_fit("body_attitude.roll_per_g_rad", 0.06)
    lean = refit(level.model.add("body_attitude"), level.driving, level.noise)
    for fit in (level, lean):
        diagnose(fit, candidates=["aero_drag", "body_roll"], again=["aero_drag"], refits=1)
    diagnose(lean, refits=1)
    diagnose(lean, candidates=["aero_drag"], refits=1)
    assert asked == [{"aero_drag"}, {"aero_drag", "body_roll"}, {"body_roll"}, set()]


def test_a_score_that_the_refit_refutes_is_no_evidence(
    fine_fit: Fit, monkeypatch: pytest.MonkeyPatch
) -> None:
    name = "sensor_delay"
    monkeypatch.setattr(ScoreBoard, "family_p_values", lambda _, **__: {name: 1e-6})
    dx = diagnose(fine_fit, candidates=[name])
    assert dx.family[name] == 1.0
    assert not dx.significant
