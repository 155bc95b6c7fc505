"""Errors ahead that drown in the noise of the sensors: what can be named, and what is adequate."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
from contradictions import contradictions

from sysid_vehicle import Model, NoiseModel, drive, example_vehicle, improve, manoeuvres
from sysid_vehicle.identify import Fit
from sysid_vehicle.log import Log
from sysid_vehicle.study.ahead.horizons import AHEAD, PREDICTED, squares_ahead
from sysid_vehicle.study.judge import matters
from sysid_vehicle.study.judge.matters import buried, negligible
from sysid_vehicle.study.study import Study

LENGTH_M = 0.5
USUAL = np.array([0.2, 0.2, 0.1, np.radians(0.5), 0.2])  # of PREDICTED


def driven(**hidden: float) -> list[Log]:
    """A lap and a course of a car with effects: by the name of the effect, its only parameter."""
    car = Model(example_vehicle()).add(*hidden)
    car = car.with_values({n: hidden[n.partition(".")[0]] for n in car.names if "." in n})
    both = (manoeuvres.lap(40.0), manoeuvres.handling_course(40.0))
    return [drive(car, m, seed=seed, rate_hz=25.0) for seed, m in enumerate(both, 1)]


def studied(logs: Sequence[Log], *candidates: str) -> Study:
    start = Model(example_vehicle())
    return improve(start, *logs, candidates=list(candidates), starts=1, sensors=False)


def test_a_name_stands_by_its_likelihood_where_no_error_shows() -> None:
    """Load sensitivity is no candidate: something is left, and below the noise."""
    logs = [
        Log.from_arrays({c: log[c] for c in log.channels if c != "vy_mps"}, name=log.name)
        for log in driven(tyre_relaxation=LENGTH_M, tyre_load_sensitivity=0.02)
    ]
    study = studied(logs, "tyre_relaxation", "steer_lag")
    assert study.omnibus_together is not None
    assert study.omnibus_together.p_value < study.rules.strict
    (added,) = study.added
    assert (added.id, added.grade, added.stands_in) == ("tyre_relaxation", "plausible", "")
    length = study.fit["tyre_relaxation.relaxation_length_m"]
    assert abs(length.value - LENGTH_M) < 3.0 * length.std
    assert study.verdict == "partly_explained"
    assert study.buried
    assert study.meaning.startswith("named: tyre_relaxation; the effects added explain part of it")
    assert "below the noise of the sensors" in study.meaning
    assert contradictions(str(study)) == []
    assert study.explained is not None
    none = replace(study, explained=replace(study.explained, share=-0.3, low=-0.7))
    assert "explain part of the error one step ahead alone" in none.meaning
    assert contradictions(str(none)) == []


def test_a_baseline_whose_errors_drown_is_adequate() -> None:
    study = studied(driven(tyre_relaxation=0.5 * LENGTH_M), "rear_toe")
    assert study.added == ()
    assert study.omnibus_together is not None
    assert study.omnibus_together.p_value < study.rules.strict
    assert study.verdict == "adequate"
    assert "an error remains" in study.meaning
    assert "below the noise of the sensors" in study.meaning
    assert contradictions(str(study)) == []


def test_the_true_car_is_within_the_noise_and_a_wrong_one_is_not(
    complete_fits: Sequence[Fit],
) -> None:
    fit, other = complete_fits[0], complete_fits[1]
    assert buried(fit, other.driving, fit.noise)
    wrong = fit.model.with_values({"D_front": 0.8 * fit.model.value("D_front")})
    assert not buried(Fit(**{**vars(fit), "model": wrong}), other.driving, fit.noise)


def test_a_baseline_that_fails_as_it_was_fitted_is_not_adequate(
    complete_fits: Sequence[Fit], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Though validation data would give it tyres that do."""
    fit, other = complete_fits[0], complete_fits[1]
    slippery = fit.model.with_values({"D_front": 0.7 * fit.model.value("D_front")})
    failing = replace(fit, model=slippery)
    monkeypatch.setattr(matters, "fitted_ahead", lambda _: None)
    assert negligible(fit, fit, other.driving, fit.noise)
    assert not negligible(failing, fit, other.driving, fit.noise)
    assert not negligible(fit, failing, other.driving, fit.noise)
    monkeypatch.setattr(matters, "fitted_ahead", lambda _: fit)
    assert negligible(failing, fit, other.driving, fit.noise)


def drowned(
    fit: Fit, monkeypatch: pytest.MonkeyPatch, ratio: float, *, sensor: float = 0.5, **more: float
) -> bool:
    """Of errors that are everywhere so many times the noise, which is so many usual sizes."""
    noise = sensor * USUAL
    squares = np.full((1, 20, len(AHEAD), len(PREDICTED)), (ratio * noise) ** 2)
    if "corner" in more:
        squares[0, 3] *= more["corner"] ** 2
    squares[0, :, -1, 0] = np.nan  # no stretch is that long
    seen = np.ones(squares.shape[2:], dtype=bool)
    seen[-1, 0] = False
    monkeypatch.setattr(matters, "squares_ahead", lambda *_: (squares, noise, seen))
    return buried(fit, fit.driving, fit.noise)


def test_a_corner_in_which_the_model_fails_counts(
    complete_fits: Sequence[Fit], monkeypatch: pytest.MonkeyPatch
) -> None:
    fit = complete_fits[0]
    assert drowned(fit, monkeypatch, 1.3)
    assert not drowned(fit, monkeypatch, 1.5)
    assert drowned(fit, monkeypatch, 1.0, corner=3.0)
    assert not drowned(fit, monkeypatch, 1.0, corner=6.0)  # one block of twenty


def test_large_noise_hides_no_more_than_usual_sizes(
    complete_fits: Sequence[Fit], monkeypatch: pytest.MonkeyPatch
) -> None:
    """What a model lacks may be taken for noise of its sensors."""
    fit = complete_fits[0]
    assert not drowned(fit, monkeypatch, 1.3, sensor=4.0)
    assert drowned(fit, monkeypatch, 1.01, sensor=4.0)


def test_what_is_too_short_to_predict_tells_nothing(
    complete_fits: Sequence[Fit], monkeypatch: pytest.MonkeyPatch
) -> None:
    nothing = np.full((1, 3, len(AHEAD), len(PREDICTED)), np.nan)
    unseen = np.zeros(nothing.shape[2:], dtype=bool)
    monkeypatch.setattr(matters, "squares_ahead", lambda *_: (nothing, USUAL, unseen))
    assert not buried(complete_fits[0], complete_fits[0].driving, complete_fits[0].noise)


def test_the_noise_of_the_better_model_counts(complete_fits: Sequence[Fit]) -> None:
    fit = complete_fits[0]
    asked: list[NoiseModel] = []
    real = squares_ahead
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(
            matters,
            "squares_ahead",
            lambda fits, *a: asked.append(fits[-1].noise) or real(fits, *a),
        )
        buried(fit, fit.driving, complete_fits[1].noise)
    assert asked == [complete_fits[1].noise]
