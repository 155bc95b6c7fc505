"""The noise model: its order, its floor, and that it is learned."""

from dataclasses import replace

import numpy as np
import pytest

from sysid_vehicle import (
    Fit,
    Log,
    Model,
    NoiseModel,
    RoadDisturbance,
    SensorNoise,
    drive,
    manoeuvres,
)
from sysid_vehicle.estimate import (
    Driving,
    first_guess,
    learn_noise,
    maximise_noise,
    noise_range,
    promised_by_noise,
)
from sysid_vehicle.vehicle import GRAVITY_MPS2

SOME = NoiseModel(
    (0.1, 0.2, 0.3, 0.4, 0.5), (0.6, 0.7, 0.8), (900.0, 1000.0, 1100.0), (0.25, 0.5, 0.75)
)


def test_the_core_vector_keeps_every_number() -> None:
    v = SOME.vector()
    assert v.tolist()[:11] == [0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 900.0, 1000.0, 1100.0]
    assert v.tolist()[11:17] == [0.25, 0.5, 0.75, 0.0, 0.0, 5.0]
    assert v.tolist()[17:] == [0.0, 0.0, 0.0, 0.05, 0.05, 0.05]
    assert NoiseModel.from_vector(v) == SOME
    sloping = replace(SOME, road=(0.1, 0.2), road_time_s=7.0)
    assert NoiseModel.from_vector(sloping.vector()) == sloping
    assert "deg across" in str(sloping)
    assert "deg across" not in str(SOME)
    coloured = replace(sloping, colour=(0.003, 0.0, 0.1), colour_time_s=(0.1, 0.2, 0.3))
    assert NoiseModel.from_vector(coloured.vector()) == coloured
    assert coloured.floor().colour == coloured.colour
    assert "ay_mps2, coloured 0.1 m/s2, correlation time 0.3 s" in str(coloured)
    assert "ax_mps2, coloured" not in str(coloured)
    assert coloured.reading[4] == pytest.approx(np.hypot(0.5, 0.1))
    assert coloured.reading[:2] == SOME.sensor[:2]


def test_one_correlation_time_stands_for_three() -> None:
    assert NoiseModel(SOME.sensor, SOME.motion, SOME.disturbance, 0.3).correlation_time_s == (
        0.3,
        0.3,
        0.3,
    )


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


def test_noise_is_not_tried_where_its_score_promises_nothing() -> None:
    """The likelihood is a parabola of the logarithms, whose top lies beyond the range of one."""

    class Parabola:
        asked = 0
        top, information = np.log([2.0, 9.0]), np.array([[40.0, 6.0], [6.0, 5.0]])

        def noise_score(
            self, _: np.ndarray, noise: np.ndarray
        ) -> tuple[float, np.ndarray, np.ndarray]:
            self.asked += 1
            slope = self.information @ (self.top - np.log(noise))
            off = self.top - np.log(noise)
            return -0.5 * float(off @ self.information @ off), slope, self.information

    problem, low, high = Parabola(), np.array([0.1, 0.1]), np.array([50.0, 3.0])
    # At the bound of the second one the first gives way.
    best = np.array([np.exp(np.log(2.0) + 6.0 / 40.0 * np.log(3.0)), 3.0])
    at_best = problem.noise_score(best, best)[0]
    for start in (best, np.array([1.0, 3.0])):
        below = at_best - problem.noise_score(start, start)[0]
        promised = promised_by_noise(problem, start, start, low, high)
        assert promised == pytest.approx(below, rel=0.01, abs=1e-9)
    problem.asked = 0
    assert maximise_noise(problem, best, best, low, high, rounds=9)[0] == pytest.approx(best)
    assert problem.asked == 1
    found, value, stands = maximise_noise(
        problem, best, np.array([0.3, 0.5]), low, high, rounds=9, enough=1e-6
    )
    assert stands
    assert found == pytest.approx(best, rel=1e-2)
    assert value > at_best - 1e-3
    # Of the last step the likelihood alone is asked.
    for rounds in (1, 2, 9):
        problem.asked, told = 0, []

        def alone(noise: np.ndarray, told: list[float] = told) -> float:
            told.append(problem.noise_score(best, noise)[0])
            return told[-1]

        start, within = np.array([0.3, 0.5]), (low, high)
        found, value, stands = maximise_noise(
            problem, best, start, *within, rounds=rounds, likelihood=alone
        )
        assert stands == (rounds == 9)
        asked, problem.asked = problem.asked, 0
        expected = maximise_noise(problem, best, start, *within, rounds=rounds)
        assert np.array_equal(found, expected[0])
        assert (value, asked) == (expected[1], problem.asked)
        assert told or rounds == 9
    # So it is of a step that is short and promises little: no other one follows.
    problem.asked, told = 0, []
    near = best * np.array([1.1, 1.0])
    found, value, stands = maximise_noise(
        problem, best, near, *within, rounds=9, likelihood=lambda v: alone(v, told)
    )
    assert stands
    assert (len(told), problem.asked) == (1, 2)
    assert value > at_best - 1e-3


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
    np.testing.assert_allclose(noise.correlation_time_s, road.correlation_time_s, rtol=0.35)


def test_bumps_do_not_become_noise_of_the_sensors(truth: Model) -> None:
    road = RoadDisturbance(fx_n=150.0, fy_n=200.0, mz_nm=100.0, correlation_time_s=0.03)
    driving = Driving.of(drive(truth, manoeuvres.lap(30.0), seed=5, disturbance=road))
    guess = first_guess(driving, truth.vehicle)
    noise, _ = learn_noise(driving.problem(truth), truth.vector(), guess, truth.vehicle, rounds=20)
    assert noise.sensor[3] == pytest.approx(SensorNoise().ax_mps2, rel=0.15)
    np.testing.assert_allclose(noise.correlation_time_s[:2], 0.03, rtol=0.35)


def test_a_road_that_wanders_is_learned_and_a_level_one_is_not_there(truth: Model) -> None:
    slope = 0.25
    road = RoadDisturbance(slope_rad=slope / GRAVITY_MPS2)
    driving = Driving.of(drive(truth, manoeuvres.lap(40.0), seed=6, disturbance=road))
    problem, p = driving.problem(truth), truth.vector()
    level, below = learn_noise(
        problem, p, first_guess(driving, truth.vehicle), truth.vehicle, rounds=8
    )
    assert level.road == (0.0, 0.0)
    noise, value = learn_noise(
        problem, p, replace(level, road=(0.1, 0.1)), truth.vehicle, rounds=20
    )
    assert value > below + 100.0
    # 40 s hold eight independent values of each.
    np.testing.assert_allclose(noise.road, slope, rtol=0.5)
    assert noise.floor().road == noise.road
    # Seen from one second before, the slope is known.
    ahead = {
        name: np.nanstd(problem.look_ahead(p, n.floor().vector(), [(100, 10)])[0, :, 0])
        for name, n in (("level", level), ("sloping", noise))
    }
    assert ahead["sloping"] < 0.7 * ahead["level"]


def test_without_the_wheel_force_none_is_learned_along_the_car(truth: Model) -> None:
    log = drive(truth, manoeuvres.lap(20.0), seed=7)
    blind = Driving.of(Log.from_arrays({c: log[c] for c in log.channels if c != "fx_n"}))
    most = noise_range(truth.vehicle, blind)[1][8]
    assert most < 1e-3 * truth.vehicle.mass_kg * 9.80665
    assert noise_range(truth.vehicle, Driving.of(log))[1][8] > 1e3


def test_no_sensor_is_surer_than_its_quanta(truth: Model) -> None:
    log = drive(truth, manoeuvres.lap(20.0), seed=8, noise=SensorNoise.none())
    coarse = log.corrected({"vx_mps": 0.1 * np.round(log["vx_mps"] / 0.1)}, [])
    low = noise_range(truth.vehicle, Driving.of(coarse))[0]
    assert low[0] == pytest.approx(0.1 / np.sqrt(12.0))
    assert low[1] == noise_range(truth.vehicle)[0][1]


def test_elsewhere_no_model_is_sure_to_less_than_a_thousandth_of_the_weight(truth: Model) -> None:
    weight = truth.vehicle.mass_kg * 9.80665
    quiet = NoiseModel(SOME.sensor, SOME.motion, (0.1, 2.0 * weight, 0.1), 0.25)
    x, y, moment = quiet.elsewhere(truth.vehicle).disturbance
    assert x == pytest.approx(1e-3 * weight)
    assert y == 2.0 * weight
    assert moment == pytest.approx(1e-3 * weight * truth.vehicle.wheelbase_m / 4.0)
    assert quiet.elsewhere(truth.vehicle).sensor == SOME.sensor


def test_noise_that_ends_at_the_least_that_is_tried_is_no_finding() -> None:
    """Of a kart that lacked relaxation 0.005 m/s2 were told, a tenth of its sensor's."""
    noise = NoiseModel(
        (0.03, 0.03, 0.0025, 0.06, 5e-3 * (1.0 + 1e-9)), (0.0,) * 3, (9.0,) * 3, (0.5,) * 3
    )
    told = {line.split()[0]: line for line in noise.text().splitlines()}
    assert told["ay_mps2"].endswith(
        "the least that is tried: what the model leaves unexplained stands for the rest"
    )
    assert "least" not in told["ax_mps2"]
