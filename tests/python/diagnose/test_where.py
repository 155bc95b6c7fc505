"""Where, when and at which frequencies a model fails."""

import json
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from sysid_vehicle import Driving, Fit, Model, drive, identify, manoeuvres, where
from sysid_vehicle._common.arrays import FloatArray
from sysid_vehicle.diagnose import Where
from sysid_vehicle.diagnose.evidence import evidence as evidence_module
from sysid_vehicle.diagnose.evidence.evidence import Evidence
from sysid_vehicle.diagnose.unexplained import delay as delay_module
from sysid_vehicle.diagnose.unexplained.change_points import change_points
from sysid_vehicle.diagnose.unexplained.coherence import coherence
from sysid_vehicle.identify import refine


@pytest.fixture(scope="module")
def null(complete_fits: tuple[Fit, ...]) -> tuple[Where, ...]:
    return tuple(where(fit) for fit in complete_fits[:2])


@pytest.fixture(scope="module")
def delayed(hidden_fit: Callable[[str, float], Fit]) -> Where:
    return where(hidden_fit("steer_delay.delay_s", 0.04))


@pytest.fixture(scope="module")
def dragged(hidden_fit: Callable[[str, float], Fit]) -> Where:
    return where(hidden_fit("aero_drag.drag_area_m2", 0.45))


@pytest.fixture(scope="module")
def wet(truth: Model, start: Model) -> Where:
    values = {"friction_change.drop": 0.15, "friction_change.at_s": 15.0}
    log = drive(
        truth.add("friction_change").with_values(values), manoeuvres.lap(30.0), seed=3, rate_hz=50.0
    )
    return where(identify(start, log, starts=1))


def test_a_complete_model_fails_nowhere(null: tuple[Where, ...]) -> None:
    assert [w.change_points for w in null] == [(), ()]
    assert max(w.best_map.share for w in null) < 0.02
    for w in null:
        assert not any(c.delay is not None and c.delay.significant for c in w.coherence)
        assert all(c.peak[2] < c.threshold for c in w.coherence)
        assert "no remaining error that depends on the driving" in str(w)
        assert "no coordinate of the motion" in str(replace(w, left=None))


def test_the_errors_of_the_maps_are_those_of_a_complete_model(null: tuple[Where, ...]) -> None:
    z = np.concatenate([(m.force / m.std).ravel() for w in null for m in w.maps])
    z = z[np.isfinite(z)]
    assert len(z) > 250
    assert np.sqrt(np.mean(z**2)) == pytest.approx(1.0, abs=0.2)
    assert np.mean(np.abs(z) > 1.96) < 0.10


@pytest.mark.manual
def test_change_points_are_claimed_at_the_stated_rate(complete_fits: tuple[Fit, ...]) -> None:
    evidence = Evidence(complete_fits[0], complete_fits[0].driving)
    rng = np.random.default_rng(7)
    measured = np.isfinite(evidence.driving.measured).ravel()
    _ = evidence.fitted, evidence.residual
    claims = 0
    for seed in range(14):
        evidence.__dict__["residual"] = measured * rng.standard_normal(measured.size)
        claims += bool(change_points(evidence, alpha=0.3, draws=100, seed=seed))
    # 4.2 expected; beyond 1 to 9 lie 0.8 %.
    assert 1 <= claims <= 9


def test_a_change_of_grip_is_dated(wet: Where) -> None:
    (change,) = wet.change_points
    assert change.what == "grip"
    assert change.from_s <= 15.0 <= change.until_s
    assert change.until_s - change.from_s < 3.0
    # The fitted grip lies between that before and that after.
    assert abs(change.size["grip"] + 0.162) < 4.0 * change.std["grip"]
    assert "grip changes in lap at 15." in str(wet) or "grip changes in lap at 14." in str(wet)


@pytest.mark.manual
def test_a_late_steering_is_timed(truth: Model) -> None:
    late = truth.add("steer_delay")
    z = []
    for seed, delay in enumerate((0.0, 0.02, 0.04) * 2):
        car = late.with_values({"steer_delay.delay_s": delay}) if delay else truth
        log = drive(car, manoeuvres.lap(20.0), seed=100 + seed, rate_hz=50.0)
        # From the true tyres the search is short, and ends where others do.
        fit = identify(truth, log, starts=1)
        steer = coherence(Evidence(fit, fit.driving))[0].delay
        assert steer is not None
        assert steer.std_s < 0.003
        z.append((steer.delay_s - delay) / steer.std_s)
    # Fewer than four of six 95 % intervals hold the truth twice in a thousand.
    assert np.count_nonzero(np.abs(z) < 1.96) >= 4
    assert np.max(np.abs(z)) < 5.0


def test_a_car_without_delay_has_none_at_any_rate(truth: Model) -> None:
    z = []
    for rate_hz in (10.0, 20.0, 50.0, 100.0):
        log = drive(truth, manoeuvres.lap(30.0), seed=203, rate_hz=rate_hz)
        for c in coherence(Evidence(identify(truth, log, starts=1), Driving.of(log))):
            assert c.delay is not None
            assert not c.delay.significant, (rate_hz, c.input)
            assert c.delay.alone
            z.append(c.delay.delay_s / c.delay.std_s)
    # Fewer than six of eight 95 % intervals hold nothing six times in a thousand.
    assert np.count_nonzero(np.abs(z) < 1.96) >= 6


def test_a_delay_that_something_else_feigns_is_not_claimed(
    hidden_fit: Callable[[str, float], Fit],
) -> None:
    fit = hidden_fit("tyre_load_sensitivity.sensitivity", 0.25)
    steer = coherence(Evidence(fit, fit.driving))[0]
    assert steer.delay is not None
    assert not steer.delay.alone, "with any delay the load sensitivity is left"
    told = str(replace(steer, delay=replace(steer.delay, delay_s=0.1)))
    assert "the car answers it 100" in told
    assert "an error that depends on the driving remains" in told
    assert "later than the model" not in told


def test_a_late_steering_is_told(delayed: Where) -> None:
    steer, force = delayed.coherence
    assert steer.delay is not None
    assert steer.delay.significant
    assert steer.delay.linear
    assert steer.delay.alone
    assert steer.peak[2] > steer.threshold
    assert "later than the model" in str(delayed)
    assert force.delay is not None
    assert not force.delay.significant
    assert delayed.change_points == ()


def test_long_driving_is_told_as_short_driving_is(
    delayed: Where, hidden_fit: Callable[[str, float], Fit], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Beyond the samples of which all is held at once the evidence is worked on in pieces."""
    monkeypatch.setattr(evidence_module, "HELD", 700)
    pieces = where(hidden_fit("steer_delay.delay_s", 0.04))
    for a, b in zip(delayed.coherence, pieces.coherence, strict=True):
        assert (a.delay is None) == (b.delay is None)
        if a.delay is not None and b.delay is not None:
            assert b.delay.delay_s == pytest.approx(a.delay.delay_s, abs=0.3 * a.delay.std_s)
            # Noise of the inputs is drawn once in place of twice.
            assert b.delay.std_s == pytest.approx(a.delay.std_s, rel=0.3)
    assert len(pieces.change_points) == len(delayed.change_points)


def test_noise_learned_with_the_delay_put_in_needs_no_climb(
    hidden_fit: Callable[[str, float], Fit], monkeypatch: pytest.MonkeyPatch
) -> None:
    """What a climb to the maximum would move, the free parameters do to first order."""
    fit = hidden_fit("steer_delay.delay_s", 0.04)
    found = [coherence(Evidence(fit, fit.driving))[0].delay]
    monkeypatch.setattr(delay_module, "relearn", refine)
    found.append(coherence(Evidence(fit, fit.driving))[0].delay)
    near, best = found
    assert near is not None
    assert best is not None
    assert near.delay_s == pytest.approx(best.delay_s, abs=0.2 * best.std_s)
    assert near.std_s == pytest.approx(best.std_s, rel=0.05)
    assert (near.linear, near.alone) == (best.linear, best.alone)


def test_where_a_delay_is_not_found_to_its_end_it_is_climbed(
    hidden_fit: Callable[[str, float], Fit], monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: list[str] = []

    def far(evidence: Evidence, inputs: FloatArray, which: int) -> tuple[FloatArray, float, float]:
        direction, _, std = later(evidence, inputs, which)
        return direction, 3.0 * std, std

    def noted(name: str) -> Callable[..., Fit]:
        def learned(*args: Any, **options: Any) -> Fit:
            asked.append(name)
            return refine(*args, **options)

        return learned

    later = delay_module._later
    fit = hidden_fit("steer_delay.delay_s", 0.04)
    for name in ("relearn", "refine"):
        monkeypatch.setattr(delay_module, name, noted(name))

    def sought() -> list[str]:
        asked.clear()
        evidence, rng = Evidence(fit, fit.driving), np.random.default_rng(0)
        delay_module.delay(evidence, fit.driving.inputs(), 0, rng, lambda: True)
        return list(asked)

    assert sought() == ["relearn"]
    monkeypatch.setattr(delay_module, "_later", far)
    assert sought() == ["refine"]


def test_the_interval_of_a_delay_holds_how_far_the_search_would_still_go(
    truth: Model, start: Model
) -> None:
    """Beside a misfit disturbances take up a part of what a delay does, and steps fall short."""
    late = truth.add("force_lag", "tyre_load_sensitivity").with_values(
        {"force_lag.time_constant_s": 0.1, "tyre_load_sensitivity.sensitivity": 0.3}
    )
    fit = identify(start, drive(late, manoeuvres.lap(40.0), seed=2), starts=1)
    evidence, rng = Evidence(fit, fit.driving), np.random.default_rng(0)
    found = delay_module.delay(evidence, fit.driving.inputs(), 1, rng, lambda: True)
    assert found is not None
    assert abs(found.delay_s - 0.1) < 2.5 * found.std_s
    assert found.std_s < 0.04


def test_a_steady_force_is_seen(dragged: Where, truth: Model) -> None:
    mean, std = dragged.steady["F_x"]
    drag = -0.5 * truth.vehicle.air_density_kgpm3 * 0.45 * 26.0**2  # at the mean speed of the lap
    assert mean == pytest.approx(drag, rel=0.3)
    assert abs(mean) > 3.0 * std
    assert "a steady F_x is missing" in str(dragged)
    assert dragged.change_points == ()
    # Drag depends on speed: a map with it predicts, one of slip angles does not.
    by_name = {m.coordinates: m for m in dragged.maps}
    assert by_name["vx_mps", "ay_mps2"].shares["F_x"] > 0.5


def test_it_is_drawn_and_written(wet: Where, delayed: Where) -> None:
    assert "missing F_y" in wet.over_time.plot(target="F_y").get_ylabel()
    for ax in (wet.plot(), wet.plot_time(), wet.coherence[0].plot(), delayed.coherence[0].plot()):
        assert ax.has_data()
    assert delayed.coherence[0].plot_phase().get_xlabel() == "frequency [Hz]"
    told = json.loads(json.dumps(wet.to_dict()))
    assert told["change_points"][0]["what"] == "grip"
    assert told["best_pair"]["coordinates"] == list(wet.best_map.coordinates)
    assert set(told["delays"]) == {"steer", "force"}
    assert wet._repr_html_().count("<li>") == len(wet.lines)


def test_nobody_drove_there(wet: Where) -> None:
    best = wet.best_map
    assert np.isnan(best.force).any()
    assert np.array_equal(np.isnan(best.force[0]), best.samples < 20)
