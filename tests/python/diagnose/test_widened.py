"""How sure parameters are where the model lacks something."""

from collections.abc import Callable
from dataclasses import replace
from importlib import import_module

import numpy as np
import pytest

from sysid_vehicle import Fit, Model
from sysid_vehicle.diagnose import widened
from sysid_vehicle.diagnose.candidates.widened import _within
from sysid_vehicle.identify.intervals.estimates import spread_of
from sysid_vehicle.identify.search.box import free_box
from sysid_vehicle.study.results.widened import estimates_of, times_wider

STIFFNESS = ("cornering stiffness front", "cornering stiffness rear")


def off(fit: Fit, truth: Model, covariance: np.ndarray | None) -> list[float]:
    """How many standard errors cornering stiffness of both axles is from the truth."""
    true, told = fit.values_of(truth), {e.name: e for e in estimates_of(fit, covariance)}
    return [abs(told[n].value - true[n]) / told[n].std for n in STIFFNESS]


def test_a_complete_model_is_hardly_less_sure(complete_fits: tuple[Fit, ...]) -> None:
    for fit in complete_fits:
        covariance = widened(fit, fit.driving)
        more = np.linalg.eigvalsh(covariance - fit.covariance)
        assert more.min() > -1e-9 * more.max()
        assert times_wider(estimates_of(fit, covariance), fit) < 2.0


@pytest.mark.parametrize(
    ("missing", "value"),
    [
        ("cg_position.shift_rearward_m", 0.1),
        ("gyro_bias.bias_radps", 0.02),
    ],
)
def test_what_is_missing_widens_intervals_until_they_hold_the_truth(
    hidden_fit: Callable[..., Fit], truth: Model, missing: str, value: float
) -> None:
    fit = hidden_fit(missing, value, 100.0)
    assert max(off(fit, truth, None)) > 2.5
    assert max(off(fit, truth, widened(fit, fit.driving))) < 2.0


def test_what_is_open_stays_within_its_bounds(hidden_fit: Callable[[str, float], Fit]) -> None:
    """Nobody is less sure of a coefficient than somebody who knows its bounds alone."""
    fit = hidden_fit("steer_lag.time_constant_s", 0.05)
    extra = np.diag(widened(fit, fit.driving) - fit.covariance)
    width = [np.diff(fit.model.bounds(n))[0] for n in fit.model.free_names]
    assert np.all(np.sqrt(extra) < width)


def test_bounds_count_as_a_reading_of_each_parameter(fit: Fit) -> None:
    """Of the uniform over the box: what is far more open than that is no more open than that."""
    spread = spread_of(free_box(fit.model), np.array([e.value for e in fit.estimates]))
    rng = np.random.default_rng(6)
    root = rng.standard_normal((len(spread),) * 2)
    open_ = root @ root.T * np.outer(spread, spread)
    found = _within(fit, open_)
    expected = np.linalg.inv(np.linalg.inv(open_) + np.diag(1.0 / spread**2))
    np.testing.assert_allclose(found, expected, rtol=1e-6, atol=1e-9 * spread.max() ** 2)
    np.testing.assert_allclose(np.diag(_within(fit, 1e6 * open_)), spread**2, rtol=0.05)


def test_long_driving_is_worked_on_in_sections(
    monkeypatch: pytest.MonkeyPatch, hidden_fit: Callable[[str, float], Fit]
) -> None:
    fit = hidden_fit("steer_lag.time_constant_s", 0.05)
    whole = widened(fit, fit.driving)
    evidence = import_module("sysid_vehicle.diagnose.evidence.evidence")
    monkeypatch.setattr(evidence, "HELD", fit.driving.samples // 4 + 1)
    assert len(list(evidence.Evidence(fit, fit.driving).sections())) >= 4
    np.testing.assert_allclose(
        np.sqrt(np.diag(widened(fit, fit.driving))), np.sqrt(np.diag(whole)), rtol=1e-4
    )


def test_nothing_is_free(fit: Fit) -> None:
    model = fit.model.with_fixed(fit.model.free_names)
    bare = replace(fit, model=model, estimates=(), covariance=np.zeros((0, 0)))
    assert widened(bare, fit.driving).shape == (0, 0)
