"""What saves time changes no answer: questions that are asked once, together, or not to the end."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy import signal

from sysid_vehicle import (
    Fit,
    Model,
    NumericalError,
    diagnose,
    drive,
    example_vehicle,
    identify,
    load,
    manoeuvres,
    saved,
)
from sysid_vehicle._common.arrays import mean_of_known, median_of_known, spread_of_known
from sysid_vehicle._common.memo import forget
from sysid_vehicle._common.threads import at_most
from sysid_vehicle.diagnose.unexplained.ceiling import left_out
from sysid_vehicle.estimate import Driving, first_guess
from sysid_vehicle.identify import (
    driving_of,
    maximum,
    offsets,
    predicting_ahead,
    refine,
    refine_above,
    refine_while,
)
from sysid_vehicle.identify.ahead import ahead
from sysid_vehicle.identify.ahead.ahead import _Ahead
from sysid_vehicle.rules import USUAL
from sysid_vehicle.sensors.low_pass.low_pass import _Problem
from sysid_vehicle.sensors.low_pass.spectrum import _bias, _of_windows, spectrum_of
from sysid_vehicle.study import validation
from sysid_vehicle.study.ahead import horizons
from sysid_vehicle.study.ahead.waterfall import all_ahead
from sysid_vehicle.study.ahead.where_models_differ import apart
from sysid_vehicle.study.judge.answers import answers_of
from sysid_vehicle.study.results import failing
from sysid_vehicle.study.results.failing import late
from sysid_vehicle.study.search import steps
from sysid_vehicle.study.search.steps import alternatives, exchanged, without_insignificant
from sysid_vehicle.study.search.together import _none_at_nothing


def test_signals_that_are_regressed_together_have_the_shares_of_each_alone(
    rng: np.random.Generator,
) -> None:
    X = rng.standard_normal((400, 12))
    fold, piece = np.arange(400) // 40 % 5, np.arange(400) // 20
    Y = np.column_stack([X[:, 0], X[:, 1] * 0.2, 0.0 * X[:, 2]]) + rng.standard_normal((400, 3))
    together = left_out(["a", "b", "c"], X, Y, fold, piece)
    alone = [left_out([n], X, Y[:, [k]], fold, piece)[0] for k, n in enumerate("abc")]
    for one, other in zip(together, alone, strict=True):
        assert one.target == other.target
        figures = [(e.share, e.low, e.high, e.rms) for e in (one, other)]
        np.testing.assert_allclose(*figures, rtol=1e-9)
    assert together[0].share > 0.3 > together[2].share
    assert left_out(["a"], X, Y[:, [0]], 0 * fold, piece) == []


def test_medians_that_are_taken_together_are_those_of_each_column(
    rng: np.random.Generator,
) -> None:
    squares = rng.random((2, 4, 13, 3, 5))
    squares[rng.random(squares.shape) < 0.3] = np.nan
    squares[rng.random(squares.shape) < 0.05] = np.inf
    squares[:, :, 0] = 1.0
    np.testing.assert_array_equal(median_of_known(squares, -3), np.nanmedian(squares, axis=-3))
    assert np.isnan(median_of_known(np.full((4, 1), np.nan), 0)).all()


def test_means_and_spreads_of_what_is_known_warn_of_nothing(rng: np.random.Generator) -> None:
    rows = rng.normal(size=(6, 50, 3))
    rows[rng.random(rows.shape) < 0.3] = np.nan
    np.testing.assert_allclose(mean_of_known(rows, 1), np.nanmean(rows, axis=1), rtol=1e-12)
    np.testing.assert_allclose(spread_of_known(rows, 1), np.nanstd(rows, axis=1), rtol=1e-12)
    rows[:, :, 1] = np.nan
    for known in (mean_of_known(rows, 1), spread_of_known(rows, 1)):
        assert np.isnan(known).all(axis=0).tolist() == [False, True, False]


@pytest.mark.parametrize("width", [200, 201])
def test_spectra_of_all_windows_are_those_of_one_after_the_other(
    rng: np.random.Generator, width: int
) -> None:
    values = np.cumsum(rng.standard_normal(3001))
    each = _of_windows(values, 50.0, width)
    how = {"window": "hann", "nperseg": width, "detrend": "linear"}
    _, _, known = signal.spectrogram(values, 50.0, noverlap=width // 2, **how)
    np.testing.assert_allclose(each.T[1:], known[1:], rtol=1e-9)
    _, median = signal.welch(values, 50.0, average="median", **how)
    np.testing.assert_allclose(np.median(each, axis=0)[1:] / _bias(len(each)), median[1:])


@pytest.mark.parametrize("digital", [None, False, True])
def test_spectra_of_one_device_add_up(rng: np.random.Generator, digital: bool | None) -> None:
    """The filter acts on all of them alike; of one with other frequencies too."""
    several = []
    for rate in (100.0, 100.0, 50.0):
        noise = rng.standard_normal(round(60.0 * rate))
        found = spectrum_of(noise, rate, 100.0)
        assert found is not None
        several.append(found)
    whole = _Problem(tuple(several), digital)
    x = whole.begin(14.0)
    x += 0.1 * rng.standard_normal(x.size)
    shared = 0 if digital is None else 3
    state, at = whole.state(x), shared
    for s, power in zip(several, state.powers, strict=True):
        one = _Problem((s,), digital)
        width = one.begin(14.0).size - shared
        own = np.r_[:shared, at : at + width]
        alone = one.state(x[own])
        np.testing.assert_allclose(power, alone.powers[0], rtol=1e-12)
        np.testing.assert_allclose(state.slope[own][shared:], alone.slope[shared:], rtol=1e-8)
        at += width
    ends = [whole.state(x + step * np.eye(x.size)[0]).cost for step in (1e-5, -1e-5)]
    assert state.slope[0] == pytest.approx((ends[0] - ends[1]) / 2e-5, rel=1e-2, abs=0.1)


def test_a_lag_far_below_is_not_followed_and_any_other_to_the_same_end(
    start: Model, truth: Model, monkeypatch: pytest.MonkeyPatch
) -> None:
    car = truth.add("steer_lag").with_values({"steer_lag.time_constant_s": 0.08})
    # So many samples that a thinned problem leads.
    fit = identify(start, drive(car, manoeuvres.lap(32.0), seed=5, rate_hz=50.0), starts=1)
    model = fit.model.add("steer_lag").with_values({"steer_lag.time_constant_s": 0.05})
    found = refine_above(model, fit.driving, fit)
    assert found is not None
    assert found.log_likelihood == refine(model, fit.driving, fit.noise).log_likelihood
    assert found.log_likelihood > fit.log_likelihood + 50.0
    # Beside the lag itself nothing is left for a second one.
    other = found.model.add("tyre_relaxation")
    other = other.with_values({"tyre_relaxation.relaxation_length_m": 1.5})
    with monkeypatch.context() as patch:
        for name in ("_FAR_BELOW_BY_FEW", "FAR_BELOW"):
            patch.setattr(maximum, name, -np.inf)
        assert refine_above(other, found.driving, found) is None
    whole = refine(other, found.driving, found.noise)
    assert whole.log_likelihood < found.log_likelihood + 10.0


def test_a_lag_that_cannot_gain_enough_is_left_before_it_is_climbed(
    start: Model, truth: Model, monkeypatch: pytest.MonkeyPatch
) -> None:
    car = truth.add("steer_lag").with_values({"steer_lag.time_constant_s": 0.08})
    fit = identify(start, drive(car, manoeuvres.lap(20.0), seed=5, rate_hz=50.0), starts=1)
    model = fit.model.add("steer_lag").with_values({"steer_lag.time_constant_s": 0.05})
    there = refine_above(model, fit.driving, fit)
    assert there is not None
    enough = refine_above(model, fit.driving, fit, there.log_likelihood - 1.0)
    assert enough is not None
    assert enough.log_likelihood == there.log_likelihood
    climbed: list[object] = []
    monkeypatch.setattr(maximum, "top", lambda *args: climbed.append(args))
    assert refine_above(model, fit.driving, fit, there.log_likelihood + 20.0) is None
    assert not climbed


def test_where_few_samples_lead_to_no_lag_more_are_not_asked(
    start: Model, truth: Model, settled_on: list[int]
) -> None:
    fit = identify(start, drive(truth, manoeuvres.lap(32.0), seed=5), starts=1)
    model = fit.model.add("force_lag").with_values({"force_lag.time_constant_s": 0.15})
    assert refine_above(model, fit.driving, fit, fit.log_likelihood + 8.0) is None
    assert max(settled_on) < fit.driving.samples
    # Who asks for the maximum, wherever it is, has it.
    found = refine_above(model, fit.driving, fit)
    assert found is not None
    assert max(settled_on) == fit.driving.samples
    assert found.log_likelihood < fit.log_likelihood + 4.0


def test_a_model_without_lags_that_a_study_came_through_is_not_fitted_again(
    fit: Fit, monkeypatch: pytest.MonkeyPatch
) -> None:
    lagging = replace(fit, model=fit.model.add("steer_lag"))
    added = [SimpleNamespace(id="steer_lag")]
    study: Any = SimpleNamespace(model=lagging.model, fit=lagging, fits=(fit, lagging), added=added)
    told = late(study)
    monkeypatch.setattr(failing, "refine", None)
    assert late(study).keys() == told.keys() == set()  # this car answers in time
    with pytest.raises(TypeError):
        late(SimpleNamespace(**{**vars(study), "fits": (lagging,)}))  # type: ignore[arg-type]


def test_the_score_of_the_noise_is_worked_out_once(fit: Fit) -> None:
    problem = fit.driving.problem(fit.model)
    objective = maximum.objective_of(fit.model, problem, fit.driving)
    p, noise = fit.model.vector(), fit.noise.vector()
    first = objective.noise_score(p, noise)
    assert objective.noise_score(p.copy(), noise.copy()) is first
    other = objective.noise_score(p, 1.1 * noise)
    assert other[0] != first[0]
    np.testing.assert_allclose(objective.noise_score(p, noise)[1], first[1], rtol=1e-9)


def test_effects_that_are_fitted_together_are_left_where_one_comes_to_nothing(
    start: Model, truth: Model, monkeypatch: pytest.MonkeyPatch
) -> None:
    car = truth.add("steer_lag").with_values({"steer_lag.time_constant_s": 0.08})
    fit = identify(start, drive(car, manoeuvres.lap(32.0), seed=5, rate_hz=50.0), starts=1)
    lag = fit.model.add("steer_lag").with_values({"steer_lag.time_constant_s": 0.05})
    both = lag.add("tyre_relaxation").with_values({"tyre_relaxation.relaxation_length_m": 0.3})
    whole = refine(lag, fit.driving, fit.noise)
    alone = refine_while(lag, fit.driving, fit.noise, partial(_none_at_nothing, ["steer_lag"]))
    assert alone is not None
    assert alone.log_likelihood == whole.log_likelihood
    # The true lag leaves nothing for another: that would be dropped after the whole refit.
    end = refine(both, fit.driving, fit.noise)
    assert not _none_at_nothing(both.effects, end)
    assert set(without_insignificant(end).model.effects) == {"steer_lag"}
    monkeypatch.setattr(maximum, "likelier_noise", pytest.fail)
    together = partial(_none_at_nothing, both.effects)
    assert refine_while(both, fit.driving, fit.noise, together) is None


def test_what_is_insignificant_is_dropped_once(fit: Fit, monkeypatch: pytest.MonkeyPatch) -> None:
    richer = refine(fit.model.add("gyro_scale"), fit.driving, fit.noise)
    calls: list[int] = []

    def counted(*args: Any, **kwargs: Any) -> Fit:
        calls.append(1)
        return refine(*args, **kwargs)

    monkeypatch.setattr(steps, "refine", counted)
    lean = without_insignificant(richer, USUAL)
    assert lean.model.effects == fit.model.effects
    assert without_insignificant(richer, USUAL) is lean
    assert len(calls) == 1


def test_errors_of_a_final_model_are_worked_out_once(
    fit: Fit, monkeypatch: pytest.MonkeyPatch
) -> None:
    calls: list[Fit] = []

    def counted(one: Fit, *args: Any, **kwargs: Any) -> np.ndarray:
        calls.append(one)
        return all_ahead(one, *args, **kwargs)

    monkeypatch.setattr(horizons, "all_ahead", counted)
    poorer = [replace(fit), replace(fit)]
    for one in poorer:
        apart(one, fit, fit.driving, (1.0,), horizons.LATERAL)
    assert calls == [poorer[0], fit, poorer[1]]
    forget()
    # Of long driving they would fill the memory.
    monkeypatch.setattr(horizons._core, "TOLD_SAMPLES", 100)
    for _ in range(2):
        horizons.errors_ahead(fit, fit.noise, fit.driving, (1.0,))
    assert calls[3:] == [fit, fit]


def test_where_a_search_begins_is_looked_at_once(fit: Fit, monkeypatch: pytest.MonkeyPatch) -> None:
    seen: list[bytes] = []
    looked = _Ahead.looked

    def counted(self: _Ahead, p: np.ndarray) -> Any:
        seen.append(p.tobytes())
        return looked(self, p)

    monkeypatch.setattr(_Ahead, "looked", counted)
    alone = predicting_ahead(fit)
    assert 4 <= len(set(seen)) == len(seen) <= 6
    with at_most(1):
        assert predicting_ahead(fit).model.values == alone.model.values


def test_starts_that_all_fail_are_searched_once_each(
    fit: Fit, monkeypatch: pytest.MonkeyPatch
) -> None:
    calls: list[int] = []

    def failing(*_: Any, **__: Any) -> Any:
        calls.append(1)
        raise NumericalError("the car spins")

    monkeypatch.setattr(ahead, "minimise", failing)
    with pytest.raises(NumericalError, match="the car spins"):
        predicting_ahead(fit)
    assert len(calls) == 2


def test_exchanges_are_the_same_for_any_number_of_threads(
    start: Model, truth: Model, monkeypatch: pytest.MonkeyPatch
) -> None:
    hidden = {"aero_drag.drag_area_m2": 0.6, "rolling_resistance.coefficient": 0.012}
    car = truth.add("aero_drag", "rolling_resistance").with_values(hidden)
    course = manoeuvres.handling_course(30.0, lateral_mps2=7.5)
    train, other = (
        drive(car, manoeuvre, seed=seed, rate_hz=50.0)
        for manoeuvre, seed in ((manoeuvres.lap(30.0), 61), (course, 62))
    )
    baseline, test = identify(start, train, starts=1), Driving.of(other)
    dx = diagnose(baseline, candidates=["aero_drag", "rolling_resistance", "head_wind"])
    (wind,) = (c for c in dx.ranking if c.id == "head_wind")
    assert wind.fit is not None
    near = {"head_wind": alternatives(dx, wind)}
    tried: list[str] = []
    plain = steps.better

    def noted(one: Fit, other: Fit, *rest: Any) -> bool:
        tried.append("+".join(one.model.effects))
        return plain(one, other, *rest)

    monkeypatch.setattr(steps, "better", noted)
    found = []
    for threads in (1, 3):
        with at_most(threads):
            found.append(exchanged(wind.fit, near, test, most_effects=4))
    half = len(tried) // 2
    assert half > 1
    assert tried[:half] == tried[half:]
    one, other = found
    assert set(one.model.effects) == {"aero_drag", "rolling_resistance"}
    assert one.model.effects == other.model.effects
    assert one.log_likelihood == other.log_likelihood


def test_what_a_study_found_out_about_validation_data_comes_with_its_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    model = Model(example_vehicle()).with_nuisances()
    logs = [drive(model, manoeuvres.lap(15.0), seed=i, rate_hz=25.0) for i in (1, 2)]
    fit, test = identify(model, logs[0], starts=1), Driving.of(logs[1])
    best, apart = validation.at_its_best(fit, test), driving_of(fit, test)
    assert apart.offsets
    saved.save([fit, answers_of([fit], test)], tmp_path / "answers.npz")
    forget()

    def asked(*_: Any) -> Any:
        raise AssertionError("asked again")

    monkeypatch.setattr(offsets, "_best", asked)
    monkeypatch.setattr(validation, "predicting_ahead", asked)
    monkeypatch.setattr(validation, "predict", asked)
    again, answers = load(tmp_path / "answers.npz")
    found = validation.at_its_best(again, answers.validation)
    assert found.model == best.model
    assert driving_of(again, answers.validation).offsets == apart.offsets
    ahead = validation.fitted_ahead(again)
    assert ahead is not None
    assert ahead.horizon_s > 0.0
    with pytest.raises(AssertionError, match="asked again"):
        validation.at_its_best(again, again.driving)


def test_a_filter_that_has_run_is_not_run_again(monkeypatch: pytest.MonkeyPatch) -> None:
    model = Model(example_vehicle())
    driving = Driving.of(drive(model, manoeuvres.lap(10.0), seed=1, rate_hz=25.0))
    p, noise = model.vector(), first_guess(driving, model.vehicle).vector()
    gains = driving.problem(model).freeze(p, noise)
    assert driving.problem(model).freeze(p.copy(), noise.copy()) is gains
    inputs = driving.inputs()
    others = (
        driving.problem(model).freeze(1.01 * p, noise),
        driving.problem(model).freeze(p, 1.01 * noise),
        driving.problem(model.add("steer_lag")).freeze(p, noise),
        driving.problem(Model(example_vehicle().replace(mass_kg=900.0))).freeze(p, noise),
        driving.problem(model, other_inputs=0.9 * inputs).freeze(p, noise),
        Driving.of(driving.logs).problem(model).freeze(p, noise),
    )
    assert all(other is not gains for other in others)
    assert driving.problem(model, other_inputs=inputs.copy()).freeze(p, noise) is not gains
    # A lag of nothing and the same logs once more are another question with the same answer.
    assert len({other.log_likelihood for other in (gains, *others)}) == len(others) - 1
    for _ in range(3):  # of so many filters the first ones are let go
        for step in np.linspace(1.0, 1.1, 300):
            driving.problem(model).freeze(step * p, noise)
    kept = driving._filters
    assert kept._samples == driving.samples * len(kept._kept) <= 1 << 16
