"""The sideslip observer on random cars that had no part in choosing its defaults."""

import numpy as np
import pytest

BENCHMARK = ("online", "multibody", "fleet")
SEED = 77  # of the draw to judge on; nothing was chosen on it
CARS = 2


@pytest.fixture(scope="module")
def bench(program):
    return program


@pytest.fixture(scope="module")
def results(bench):
    simulators = ("single track", "14 degrees")
    return [bench.fleet.judged(c) for c in bench.fleet.fleet("judge", CARS, SEED, simulators)]


def test_the_band_holds_on_cars_never_seen(results):
    assert len(results) >= 4 * CARS
    for simulator in ("single track", "14 degrees"):
        covered = [r.covered for r in results if r.simulator == simulator]
        assert np.mean(covered) > 0.95, simulator


def test_the_band_allows_for_little_that_these_cars_do_not_have(results):
    """They have no offsets and no wind: filters that expect neither have 0.163 and 0.207 deg."""
    for simulator, most_deg in (("single track", 0.19), ("14 degrees", 0.23)):
        width = [r.width_deg for r in results if r.simulator == simulator]
        assert np.mean(width) < most_deg, simulator


def test_the_error_is_below_that_of_linear_tyres(results):
    ratio = np.array([r.ratio for r in results])
    assert np.median(ratio) < 0.7
    assert np.mean(ratio <= 1.0) >= 0.8
    assert ratio.max() < 2.0


def test_stiffness_comes_near_the_regression(results):
    assert np.mean([r.stiffness_held for r in results]) >= 0.9


def test_a_draw_repeats_and_the_other_is_another(bench):
    one, again = (bench.fleet.fleet("judge", 1, SEED, ("single track",)) for _ in range(2))
    other = bench.fleet.fleet("choose", 1, SEED, ("single track",))
    assert np.array_equal(one[0].log["ay_mps2"], again[0].log["ay_mps2"])
    assert one[0].vehicle.mass_kg != other[0].vehicle.mass_kg


@pytest.mark.manual
def test_a_simulation_of_many_bodies_drives_a_circle(bench):
    if not bench.multibody.AVAILABLE:
        pytest.skip("commonroad-vehicle-models is not installed: pip install '.[benchmark]'")
    cars = [bench.multibody.base_car(number) for number in (2, 2)]
    n = 400
    speed = np.full((n, 2), 20.0)
    curvature = np.outer(np.minimum(np.arange(n) / 100.0, 1.0), [4.0 / 400.0, -4.0 / 400.0])
    driven = bench.multibody.drive(cars, speed, curvature, np.zeros(2))
    left, right = driven["yaw_rate_radps"][-1]
    assert left == pytest.approx(-right, rel=1e-3)  # the tyres have shifts that do not change sides
    turn = driven["vx_mps"][-1] * driven["yaw_rate_radps"][-1]
    assert turn[0] == pytest.approx(4.0, rel=0.1)
    # The body leans outwards, and its accelerometer feels gravity besides.
    assert 1.02 < driven["ay_mps2"][-1, 0] / turn[0] < 1.25
