"""The EM of the laboratory on random linear systems: the log-likelihood never falls.

At a speed that is known and held the single-track car is linear, and a step of EM is then exact:
no step has to be shortened, whatever the readings and however wrong the start. Where the speed
moves with the car the model is linearised anew in each iteration, and shortening keeps it so.
"""

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from sysid_vehicle.lab import (
    EMResult,
    NoiseStructure,
    Observer,
    ObserverCar,
    ObserverForm,
    ObserverNoise,
    ObserverRecord,
    learn_observer_noise,
)

SAMPLES = 200
RATE_HZ = 100.0
ROUNDING = 1e-12  # of the log-likelihood: its sum over the samples, and the filter's own


def random_observer(rng: np.random.Generator, *, linear: bool) -> tuple[Observer, ObserverRecord]:
    """Draw a car, its speed, and readings that wander and scatter; the noise is of their size."""
    car = ObserverCar(
        mass_kg=rng.uniform(500.0, 3000.0),
        yaw_inertia_kgm2=rng.uniform(500.0, 5000.0),
        lf_m=rng.uniform(0.8, 2.0),
        lr_m=rng.uniform(0.8, 2.0),
        drag_nspm=0.0,
    )
    speed = rng.uniform(5.0, 60.0)
    scatter = 10.0 ** rng.uniform(-4.0, 0.0, 4)
    wander = 10.0 ** rng.uniform(-5.0, -1.0, 4)
    y = np.cumsum(wander * rng.standard_normal((SAMPLES, 4)), axis=0)
    y += scatter * rng.standard_normal((SAMPLES, 4))
    y[:, 0] = speed
    record = ObserverRecord.from_arrays(
        rate_hz=RATE_HZ,
        force_x_n=0.0,
        steer_rad=0.02 * np.sin(np.arange(SAMPLES) * rng.uniform(0.005, 0.2)),
        stiffness_front_nprad=rng.uniform(2e4, 2e5),
        stiffness_rear_nprad=rng.uniform(2e4, 2e5),
        readings=y,
    )
    sensors = np.r_[1e-12, scatter[1:] ** 2]
    process = np.r_[0.0, wander[1:3] ** 2, 0.0, (car.mass_kg * wander[3]) ** 2, 1e4 * wander[2]]
    form = ObserverForm(coupling=not linear)  # without v_y r the speed stays what it is
    return Observer(car, ObserverNoise.from_variances(process, sensors), form), record


def learn(seed: int, ratio: float, *, linear: bool, plain: bool) -> EMResult:
    """Learn from a start whose process noise over sensor noise is off by `ratio`."""
    observer, record = random_observer(np.random.default_rng(seed), linear=linear)
    process, sensors = (np.diag(c).copy() for c in (observer.noise.process, observer.noise.sensors))
    process *= np.sqrt(ratio)
    sensors[1:] /= np.sqrt(ratio)
    return learn_observer_noise(
        observer.with_noise(ObserverNoise.from_variances(process, sensors)),
        record,
        process=NoiseStructure(fixed=("vx_mps", "xi_x_n"), floor=1e-30),
        sensors=NoiseStructure(fixed=("vx_mps",), floor=1e-30),
        most_iterations=25,
        tolerance=0.0,
        never_fall=not plain,
        accelerate=not plain,
    )


def deepest_fall(em: EMResult) -> float:
    """Largest loss of a step, relative to the log-likelihood or to a unit for each reading."""
    size = np.maximum(np.abs(em.log_likelihood[1:]), 4.0 * em.samples)
    return float(np.max(-np.diff(em.log_likelihood) / size, initial=0.0))


@pytest.mark.parametrize(
    ("linear", "plain"),
    [(True, True), (True, False), (False, False)],
    ids=["linear, plain steps", "linear", "linearised"],
)
@given(seed=st.integers(0, 2**32 - 1), decades=st.floats(-6.0, 6.0))
@example(seed=0, decades=-6.0)
@example(seed=0, decades=6.0)
@settings(max_examples=40)
def test_the_log_likelihood_never_falls(
    seed: int, decades: float, linear: bool, plain: bool
) -> None:
    em = learn(seed, 10.0**decades, linear=linear, plain=plain)
    assert em.iterations > 0 or not linear  # no step may gain where the model is linearised
    assert np.isfinite(em.log_likelihood).all()
    assert deepest_fall(em) <= ROUNDING
    assert em.log_likelihood[-1] >= em.log_likelihood[0]
