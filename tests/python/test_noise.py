"""The noise model: its order, its floor, and that it is learned."""

import numpy as np
import pytest

from sysid_vehicle import Fit, Model, NoiseModel, RoadDisturbance, SensorNoise, drive, manoeuvres
from sysid_vehicle.estimate import Driving, first_guess, learn_noise

SOME = NoiseModel((0.1, 0.2, 0.3, 0.4, 0.5), (0.6, 0.7, 0.8), (900.0, 1000.0, 1100.0), 0.25)


def test_the_core_vector_keeps_every_number() -> None:
    v = SOME.vector()
    assert v.tolist() == [0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 900.0, 1000.0, 1100.0, 0.25]
    assert NoiseModel.from_vector(v) == SOME


def test_the_floor_has_no_disturbances() -> None:
    floor = SOME.floor()
    assert floor.disturbance == (0.0, 0.0, 0.0)
    assert (floor.sensor, floor.motion) == (SOME.sensor, SOME.motion)


def test_it_prints_with_units() -> None:
    text = str(SOME)
    assert "yaw_rate_radps" in text
    assert "rad/s" in text
    assert "1.1e+03 N m" in text
    assert SOME._repr_html_().startswith("<pre>")


def test_learning_raises_the_likelihood(fit: Fit) -> None:
    model, driving = fit.model, fit.driving
    problem, p = driving.problem(model), model.vector()
    guess = first_guess(driving, model.vehicle)
    before = problem.freeze(p, guess.vector()).log_likelihood
    values = [before]
    noise = guess
    for _ in range(3):
        noise, value = learn_noise(problem, p, noise, model.vehicle, rounds=2)
        assert value == pytest.approx(problem.freeze(p, noise.vector()).log_likelihood, abs=1e-6)
        values.append(value)
    assert values == sorted(values)
    assert values[-1] > before + 100.0


def test_twice_the_sensor_noise_is_learned(truth: Model) -> None:
    sensors = SensorNoise().scaled(2.0)
    driving = Driving.of(drive(truth, manoeuvres.lap(30.0), seed=4, noise=sensors))
    guess = first_guess(driving, truth.vehicle)
    noise, _ = learn_noise(driving.problem(truth), truth.vector(), guess, truth.vehicle, rounds=20)
    true = [sensors.vx_mps, sensors.vy_mps, sensors.yaw_rate_radps, sensors.ax_mps2]
    np.testing.assert_allclose(noise.sensor[:4], true, rtol=0.1)
    np.testing.assert_allclose(noise.sensor[4], sensors.ay_mps2, rtol=0.15)


def test_a_restless_road_is_learned(truth: Model) -> None:
    road = RoadDisturbance(fx_n=300.0, fy_n=500.0, mz_nm=400.0, correlation_time_s=0.3)
    driving = Driving.of(drive(truth, manoeuvres.lap(40.0), seed=3, disturbance=road))
    guess = first_guess(driving, truth.vehicle)
    noise, _ = learn_noise(driving.problem(truth), truth.vector(), guess, truth.vehicle, rounds=20)
    # 40 s hold about 65 independent values of each: 9 % of standard error.
    np.testing.assert_allclose(noise.disturbance, [road.fx_n, road.fy_n, road.mz_nm], rtol=0.3)
    assert noise.correlation_time_s == pytest.approx(road.correlation_time_s, rel=0.3)


def test_elsewhere_no_model_is_sure_to_less_than_a_thousandth_of_the_weight(truth: Model) -> None:
    weight = truth.vehicle.mass_kg * 9.81
    quiet = NoiseModel(SOME.sensor, SOME.motion, (0.1, 2.0 * weight, 0.1), 0.25)
    x, y, moment = quiet.elsewhere(truth.vehicle).disturbance
    assert x == pytest.approx(1e-3 * weight)
    assert y == 2.0 * weight
    assert moment == pytest.approx(1e-3 * weight * truth.vehicle.wheelbase_m / 4.0)
    assert quiet.elsewhere(truth.vehicle).sensor == SOME.sensor
