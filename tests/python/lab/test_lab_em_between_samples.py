"""Learning the observer's noise where inputs are held between samples, and where they move."""

import dataclasses

import numpy as np
import pytest

from sysid_vehicle import Log
from sysid_vehicle.lab import (
    EMResult,
    Observer,
    ObserverCar,
    ObserverNoise,
    ObserverRecord,
    learn_observer_noise,
)

CAR = ObserverCar(mass_kg=1400.0, yaw_inertia_kgm2=2200.0, lf_m=1.2, lr_m=1.5)
FRONT, REAR = 80e3, 100e3  # N/rad
SENSOR_STD = np.array([0.02, 0.005, 0.001, 0.02])
STEP_S, PARTS = 0.02, 40
State = tuple[float, float, float]


def rates(v_x: float, v_y: float, r: float, turn: float, push: float) -> State:
    front = FRONT * (turn - (v_y + CAR.lf_m * r) / v_x)
    rear = -REAR * (v_y - CAR.lr_m * r) / v_x
    return (
        push / CAR.mass_kg + v_y * r,
        (front + rear) / CAR.mass_kg - v_x * r,
        (CAR.lf_m * front - CAR.lr_m * rear) / CAR.yaw_inertia_kgm2,
    )


def moved(x: State, slope: State, h: float) -> State:
    return x[0] + h * slope[0], x[1] + h * slope[1], x[2] + h * slope[2]


def driven(seed: int, *, held: bool, samples: int = 3000) -> Log:
    """A linear car in short steps, by nothing of the package; all it does is explained."""
    rng = np.random.default_rng(seed)
    at = np.arange(0.0, samples * STEP_S + 1.0, 0.25)
    turned = 0.03 * rng.standard_normal(at.size)
    pushed = 1500.0 * rng.standard_normal(at.size)
    now = STEP_S * np.arange(samples + 1)
    steer, force = (np.interp(now, at, by).tolist() for by in (turned, pushed))
    v_x, v_y, r = 20.0, 0.0, 0.0
    truth = np.empty((samples, 4))
    h = STEP_S / PARTS
    for k in range(samples):
        for part in range(PARTS):
            share = 0.0 if held else (part + 0.5) / PARTS
            if part == 0:
                side = FRONT * (steer[k] - (v_y + CAR.lf_m * r) / v_x)
                side -= REAR * (v_y - CAR.lr_m * r) / v_x
                truth[k] = v_x, v_y, r, side / CAR.mass_kg
            turn = steer[k] + share * (steer[k + 1] - steer[k])
            push = force[k] + share * (force[k + 1] - force[k])

            u, v, w = moved((v_x, v_y, r), rates(v_x, v_y, r, turn, push), 0.5 * h)
            v_x, v_y, r = moved((v_x, v_y, r), rates(u, v, w, turn, push), h)
    y = truth + SENSOR_STD * rng.standard_normal(truth.shape)
    names = ("vx_mps", "vy_mps", "yaw_rate_radps", "ay_mps2")
    columns = dict(zip(names, y.T, strict=True))
    inputs = {"steer_rad": steer[:samples], "fx_n": force[:samples]}
    return Log.from_arrays({"time_s": now[:samples], **columns, **inputs}, name="drive")


def record_of(log: Log, inputs_held: bool | None) -> ObserverRecord:
    stiffness = tuple(c / load for c, load in zip((FRONT, REAR), CAR.static_loads_n(), strict=True))
    return ObserverRecord.from_log(log, CAR, stiffness, inputs_held=inputs_held)


def learned(record: ObserverRecord) -> EMResult:
    begin = ObserverNoise.first_guess(record, CAR)
    return learn_observer_noise(Observer(CAR, begin), record, most_iterations=300)


@pytest.mark.parametrize("held", [True, False])
def test_noise_is_learned_as_the_inputs_went(held: bool) -> None:
    log = driven(31, held=held)
    found = learned(record_of(log, None))
    assert found.inputs_held == (held,)
    assert found.to_dict()["inputs_held"] == [held]
    assert ("held until the next" if held else "straight to the next") in str(found)
    std = np.sqrt(np.diag(found.noise.sensors))
    assert std == pytest.approx(SENSOR_STD, rel=0.06)
    # Nothing disturbed the car: of a second's motion less is left than a reading's noise.
    left = np.sqrt(np.diag(found.noise.process)[:3] / STEP_S)
    assert (left < 0.5 * SENSOR_STD[:3]).all()
    wrong = learned(record_of(log, not held))
    assert wrong.log_likelihood[-1] < found.log_likelihood[-1] - 100.0


def test_smoothing_obeys_the_same() -> None:
    log = driven(32, held=False)
    told = record_of(log, None)
    observer = Observer(CAR, learned(told).noise)
    assert observer.told(told).inputs_held is False
    moving = observer.smoothed(dataclasses.replace(told, inputs_held=False))
    assert np.array_equal(observer.smoothed(told).state, moving.state)
    assert observer.log_likelihood(told) == pytest.approx(moving.log_likelihood, abs=1e-6)
    other = dataclasses.replace(told, inputs_held=True)
    held = Observer(CAR, learned(other).noise).smoothed(other)
    moment = [np.sqrt(np.mean(one.state[100:-100, 5] ** 2)) for one in (moving, held)]
    assert moment[0] < 0.2 * moment[1]


def test_records_may_differ() -> None:
    one, two = record_of(driven(33, held=True), True), record_of(driven(34, held=False), None)
    begin = ObserverNoise.first_guess(one, CAR)
    found = learn_observer_noise(Observer(CAR, begin), [one, two], most_iterations=100)
    assert found.inputs_held == (True, False)
