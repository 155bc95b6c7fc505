"""Filters over a model written in Python, and the checks of their consistency."""

import numpy as np
import pytest

from sysid_vehicle.errors import InvalidInput, NumericalError
from sysid_vehicle.estimate import (
    LateMeasurements,
    StateFilter,
    nees_check,
    nis_check,
    whiteness_check,
)

A = np.array([[1.0, 0.1], [0.0, 0.99]])
H = np.array([[1.0, 0.0], [-0.1, 1.0]])
Q = np.diag([1e-4, 1e-3])
R = np.diag([0.04, 0.09])
MEAN, COVARIANCE = np.array([0.9, 0.4]), np.diag([0.25, 0.25])


class Wagon:
    def predict(self, u, x):
        return A @ x

    def observe(self, u, x):
        return H @ x

    def process_noise(self, u):
        return Q

    def measurement_noise(self, u):
        return R


class Pendulum(Wagon):
    def predict(self, u, x):
        return np.array([x[0] + 0.05 * x[1], x[1] - 0.05 * np.sin(x[0])])


def record(n, seed, missing=0.0):
    rng = np.random.default_rng(seed)
    x, truth, y = MEAN + 0.5 * rng.standard_normal(2), [], []
    for k in range(n):
        if k:
            x = A @ x + np.sqrt(np.diag(Q)) * rng.standard_normal(2)
        truth.append(x)
        y.append(H @ x + np.sqrt(np.diag(R)) * rng.standard_normal(2))
    y = np.array(y)
    y[rng.random(y.shape) < missing] = np.nan
    return np.array(truth), y


def kalman(y):
    """The textbook filter and smoother."""
    x, P = MEAN, COVARIANCE
    means, covariances, predicted = [], [], []
    for k, reading in enumerate(y):
        if k:
            x, P = A @ x, A @ P @ A.T + Q
        predicted.append((x, P))
        there = np.isfinite(reading)
        h, r = H[there], R[np.ix_(there, there)]
        K = P @ h.T @ np.linalg.inv(h @ P @ h.T + r)
        x, P = x + K @ (reading[there] - h @ x), P - K @ h @ P
        means.append(x)
        covariances.append(P)
    return np.array(means), np.array(covariances), predicted


@pytest.mark.parametrize("method", ["ekf", "ukf"])
def test_on_a_linear_model_it_is_the_kalman_filter(method):
    _, y = record(150, 1, missing=0.2)
    run = StateFilter(Wagon(), MEAN, COVARIANCE, method=method).run([None] * len(y), y)
    means, covariances, predicted = kalman(y)
    assert np.abs(run.mean - means).max() < 1e-10
    assert np.abs(run.covariance - covariances).max() < 1e-10
    smooth_mean, smooth_covariance = run.smooth()
    x, P = means[-1], covariances[-1]
    for k in range(len(y) - 2, -1, -1):
        xp, Pp = predicted[k + 1]
        J = covariances[k] @ A.T @ np.linalg.inv(Pp)
        x, P = means[k] + J @ (x - xp), covariances[k] + J @ (P - Pp) @ J.T
        assert np.abs(smooth_mean[k] - x).max() < 1e-9
        assert np.abs(smooth_covariance[k] - P).max() < 1e-9


def test_covariances_are_true_on_matched_simulations():
    errors, covariances, nis, observed, white = [], [], [], [], []
    for seed in range(60):
        truth, y = record(30, seed)
        run = StateFilter(Wagon(), MEAN, COVARIANCE).run([None] * len(y), y)
        errors.append(run.mean[-1] - truth[-1])
        covariances.append(run.covariance[-1])
        nis.append(run.nis)
        observed.append(run.observed)
        white.append(run.whitened)
    assert nees_check(np.array(errors), np.array(covariances)).passed
    assert nis_check(np.concatenate(nis), np.concatenate(observed)).passed
    assert all(check.passed for check in whiteness_check(np.concatenate(white)))


def test_a_filter_that_boasts_is_found_out():
    class Boaster(Wagon):
        def measurement_noise(self, u):
            return 0.3 * R

    _, y = record(300, 3)
    run = StateFilter(Boaster(), MEAN, COVARIANCE).run([None] * len(y), y)
    check = nis_check(run.nis, run.observed)
    assert not check.passed
    assert check.mean > check.high
    assert "too high" in str(check)


def test_steps_and_record_give_the_same_numbers():
    _, y = record(40, 2, missing=0.3)
    whole = StateFilter(Pendulum(), MEAN, COVARIANCE).run([None] * len(y), y)
    step = StateFilter(Pendulum(), MEAN, COVARIANCE)
    for k, reading in enumerate(y):
        assert np.array_equal(step.step(None, reading).mean, whole.mean[k])


def test_a_jump_is_refused_and_a_lasting_one_taken_in_the_end():
    _, y = record(100, 4)
    y[50:, 0] += 50.0
    run = StateFilter(Wagon(), MEAN, COVARIANCE, gate_probability=1e-6, gate_patience=10).run(
        [None] * len(y), y
    )
    assert (run.refused[50:60] >= 1).all()
    assert abs(run.mean[59, 0]) < 10.0
    assert run.mean[-1, 0] > 10.0


def test_late_readings_count_as_if_in_time():
    _, y = record(30, 5)
    in_time = StateFilter(Wagon(), MEAN, COVARIANCE)
    late = LateMeasurements(StateFilter(Wagon(), MEAN, COVARIANCE), 3)
    for k, reading in enumerate(y):
        in_time.step(None, reading)
        late.step(None, [reading[0], np.nan])
        if k >= 2:
            late.late(2, 1, y[k - 2, 1])
    late.late(1, 1, y[-2, 1])
    late.late(0, 1, y[-1, 1])
    assert np.abs(late.filter.mean - in_time.mean).max() < 1e-12
    with pytest.raises(InvalidInput, match="is not kept"):
        late.late(4, 1, 0.0)


def test_noise_that_grows_is_followed():
    _, y = record(600, 6)
    y[:, 0] += 0.8 * np.random.default_rng(0).standard_normal(len(y))
    f = StateFilter(Wagon(), MEAN, COVARIANCE, adapt_rate=0.02)
    f.run([None] * len(y), y)
    assert 8.0 < f.noise_scale[0] < 30.0
    assert f.noise_scale[1] < 2.0


@pytest.mark.parametrize(
    ("mean", "covariance", "message"),
    [
        ([np.nan, 0.0], np.eye(2), "mean"),
        ([0.0, 0.0], np.eye(3), "expected \\(2, 2\\)"),
        ([0.0, 0.0], [[1.0, 2.0], [2.0, 1.0]], "negative variance"),
        ([0.0, 0.0], [[1.0, 0.5], [0.0, 1.0]], "not symmetric"),
        ([0.0, 0.0], np.zeros((2, 2)), "singular"),
    ],
)
def test_what_cannot_be_is_refused(mean, covariance, message):
    with pytest.raises(InvalidInput, match=message):
        StateFilter(Wagon(), mean, covariance)


def test_an_impossible_matrix_on_the_way_is_named_with_its_sample():
    class Breaks(Wagon):
        def process_noise(self, u):
            return Q if u < 3 else np.array([[1.0, np.nan], [np.nan, 1.0]])

    f = StateFilter(Breaks(), MEAN, COVARIANCE)
    with pytest.raises(NumericalError, match=r"process noise: holds NaN.* at sample 3"):
        f.run(range(5), np.zeros((5, 2)))
    g = StateFilter(Wagon(), MEAN, COVARIANCE)
    with pytest.raises(NumericalError, match="at sample 0"):
        g.step(None, [np.inf, 0.0])
    with pytest.raises(NumericalError, match="2 values for a measurement of 3 at sample 0"):
        g.step(None, [0.0, 0.0, 0.0])


class Decaying:
    """Three states that decay, of which one is measured, with process noise of a given size."""

    def __init__(self, rng: np.random.Generator, size: float, sensor: float) -> None:
        A = rng.normal(size=(3, 3))
        self.A = 0.98 * A / np.abs(np.linalg.eigvals(A)).max()
        self.size, self.sensor = size, sensor

    def predict(self, u, x):
        return self.A @ x

    def observe(self, u, x):
        return x[:1]

    def process_noise(self, u):
        return self.size * np.eye(3)

    def measurement_noise(self, u):
        return np.array([[self.sensor]])


@pytest.mark.parametrize("sensor", [1e-16, 1e-2])
@pytest.mark.parametrize("size", [0.0, 1e-300, 1e-12, 1.0])
def test_smoothed_covariances_are_covariances_whatever_the_noise(size, sensor):
    for seed in range(12):
        rng = np.random.default_rng(seed)
        f = StateFilter(Decaying(rng, size, sensor), np.zeros(3), np.eye(3), method="ekf")
        run = f.run([None] * 60, np.sqrt(sensor) * rng.normal(size=(60, 1)))
        mean, covariance = run.smooth()
        assert np.isfinite(mean).all()
        variance = np.diagonal(covariance, axis1=1, axis2=2)
        assert (variance >= 0.0).all()
        # Rounding is relative to what is rounded, the prediction of the filter.
        prior = np.sqrt(np.diagonal(run.predicted_covariance, axis1=1, axis2=2))
        correlation = covariance / prior[:, :, None] / prior[:, None, :]
        assert np.linalg.eigvalsh(correlation).min() > -1e-14
        assert (variance <= prior**2 * (1.0 + 1e-6)).all()
