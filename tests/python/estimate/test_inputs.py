"""The white noise of measured inputs is taken out, their corners stay."""

import numpy as np
import pytest

from sysid_vehicle import Log, Model, drive, example_vehicle, identify, manoeuvres
from sysid_vehicle.estimate import inputs
from sysid_vehicle.estimate.inputs import quiet, white_noise_std, without_stairs

T = np.arange(3000) / 100.0
NOISE = 1e-3


def smooth() -> np.ndarray:
    return 0.05 * np.sin(2.0 * np.pi * 0.3 * T) + 0.02 * np.sin(2.0 * np.pi * 0.7 * T)


def trapezoids(height: float = 0.03) -> np.ndarray:
    """Steps of the steering angle that take 0.2 s."""
    corners = [0.0, 0.0, height, height, 0.0, 0.0]
    return np.interp(T % 6.0, [0.0, 1.0, 1.2, 3.0, 3.2, 6.0], corners)


@pytest.mark.parametrize("scale", [1e-4, 1.0, 1e4])
def test_the_noise_is_estimated(scale: float, rng: np.random.Generator) -> None:
    y = scale * (smooth() + NOISE * rng.standard_normal(T.size))
    assert white_noise_std(y) == pytest.approx(scale * NOISE, rel=0.08)
    y[100:160] = np.nan
    assert white_noise_std(y) == pytest.approx(scale * NOISE, rel=0.08)


def test_too_few_samples_tell_no_noise(rng: np.random.Generator) -> None:
    assert white_noise_std(rng.standard_normal(15)) == 0.0
    assert white_noise_std(np.full(100, np.nan)) == 0.0
    y = rng.standard_normal(15)
    assert np.array_equal(quiet(y), y)


@pytest.mark.parametrize("true", [smooth(), trapezoids()], ids=["smooth", "trapezoids"])
def test_noise_falls_to_less_than_half(true: np.ndarray, rng: np.random.Generator) -> None:
    y = true + NOISE * rng.standard_normal(T.size)
    assert np.sqrt(np.mean((quiet(y) - true) ** 2)) < 0.5 * NOISE


# However steep the corner: a window is taken only if it agrees within 1.8 deviations.
@pytest.mark.parametrize(("height", "most"), [(0.03, 2.0), (0.5, 2.5)])
def test_corners_stay(height: float, most: float, rng: np.random.Generator) -> None:
    true = trapezoids(height)
    errors = [quiet(true + NOISE * rng.standard_normal(T.size)) - true for _ in range(100)]
    # What the smoothing itself does, the noise averaged out.
    assert np.abs(np.mean(errors, axis=0)).max() < most * NOISE


def test_a_plain_moving_average_would_lose_the_corners() -> None:
    true = trapezoids()
    averaged = np.convolve(true, np.full(23, 1.0 / 23.0), "same")
    assert np.abs(averaged - true).max() > 2.5 * NOISE


@pytest.mark.parametrize("value", [0.0, -0.3])
def test_a_constant_stays_as_it_is(value: float) -> None:
    y = np.full(500, value)
    assert np.array_equal(quiet(y), y)


def test_a_signal_without_noise_stays_as_it_is() -> None:
    np.testing.assert_allclose(quiet(smooth()), smooth(), rtol=0.0, atol=1e-6)
    np.testing.assert_allclose(quiet(trapezoids()), trapezoids(), rtol=0.0, atol=1e-12)


def test_the_signal_given_is_not_changed(rng: np.random.Generator) -> None:
    y = smooth() + NOISE * rng.standard_normal(T.size)
    before = y.copy()
    quiet(y)
    assert np.array_equal(y, before)


def test_a_coarse_count_is_hardly_a_lag(monkeypatch: pytest.MonkeyPatch) -> None:
    """Stairs are smoothed by a lag that the car does not have."""
    truth = Model(example_vehicle())
    log = drive(truth, manoeuvres.lap(25.0), seed=102449)
    columns = {name: np.array(log[name]) for name in log.channels}
    columns["steer_rad"] = 0.004 * np.round(columns["steer_rad"] / 0.004)
    # Tyres that are free lead to the same times: they take nothing of a lag.
    known = truth.add("steer_lag").with_fixed(truth.free_names)

    def lag() -> float:
        coarse = Log.from_arrays(columns, check=False)
        fit = identify(known, coarse, starts=1)
        return fit["steer_lag.time_constant_s"].value

    found = lag()
    monkeypatch.setattr(inputs, "without_stairs", lambda y: y)
    assert 0.0 <= found < 0.5 * lag()


def test_stairs_become_slopes_within_half_a_count() -> None:
    t = np.arange(0.0, 20.0, 0.01)
    truth = 0.05 * np.sin(0.9 * t) + 0.02 * np.sin(2.3 * t)
    stairs = 0.004 * np.round(truth / 0.004)
    found = without_stairs(stairs)
    assert np.abs(found - stairs).max() <= 0.002 + 1e-12
    assert np.std(found - truth) < 0.75 * np.std(stairs - truth)
    np.testing.assert_array_equal(without_stairs(truth), truth)
