"""A car that weaves under power and brakes, in equations that share nothing with the package.

Open loop: two wheels on a line, loads that move with the acceleration along the car, Pacejka's
formula and a friction ellipse; Runge-Kutta of second order in quarters of a sample.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from sysid_vehicle import Log, lab

STEP_S, PARTS, SAMPLES = 0.01, 4, 2500
BEGINS_MPS, SLOWEST_MPS, MOST_SIDEWAYS = 22.0, 8.0, 0.4
SENSORS = {"vx_mps": 0.03, "vy_mps": 0.01, "yaw_rate_radps": 0.002, "ay_mps2": 0.03}
G = 9.80665

Tyre = tuple[float, float, float, float]  # B, C, D, E


class Car(NamedTuple):
    """What is known of it, and the tyres of front and rear axle."""

    known: lab.GreyBoxVehicle
    tyres: Sequence[Tyre]


class Wave(NamedTuple):
    """One sine of the steering, and one of the wheel force."""

    steer_hz: float
    pull_hz: float
    steer_phase: float
    pull_phase: float


State = tuple[float, float, float]  # v_x, v_y, yaw rate


def rates(car: Car, x: State, steer: float, along: float, a_x: float, ellipse: float) -> State:
    """Of the state; `ellipse` is 1 for a friction circle and 0 for none."""
    of, (v_x, v_y, r) = car.known, x
    base, weight = of.lf_m + of.lr_m, of.mass_kg * G
    moved = of.mass_kg * a_x * of.cg_height_m / base
    share = of.brake_front_share if along < 0.0 else of.drive_front_share
    slips = (steer - math.atan2(v_y + of.lf_m * r, v_x), -math.atan2(v_y - of.lr_m * r, v_x))
    pulls = (along * share, along * (1.0 - share))
    loads = (weight * of.lr_m / base - moved, weight * of.lf_m / base + moved)
    front, rear = (
        load
        * d
        * math.sin(c * math.atan(b * s - e * (b * s - math.atan(b * s))))
        * math.sqrt(max(1.0 - ellipse * (pull / (d * load)) ** 2, 0.04))
        for s, pull, load, (b, c, d, e) in zip(slips, pulls, loads, car.tyres, strict=True)
    )
    ahead = pulls[0] * math.cos(steer) - front * math.sin(steer) + pulls[1]
    across = pulls[0] * math.sin(steer) + front * math.cos(steer)
    return (
        ahead / of.mass_kg + v_y * r,
        (across + rear) / of.mass_kg - v_x * r,
        (of.lf_m * across - of.lr_m * rear) / of.yaw_inertia_kgm2,
    )


def moved(x: State, slope: State, h: float) -> State:
    return x[0] + h * slope[0], x[1] + h * slope[1], x[2] + h * slope[2]


def weave(
    car: Car,
    waves: Sequence[Wave],
    rng: np.random.Generator,
    *,
    ellipse: float,
    steered: float,
    pulled_g: float = 0.25,
) -> Log | None:
    """The log with noise of the sensors, or none where the car is lost.

    Each sine of the steering has the amplitude `steered` [rad] at the end, half of that near the
    beginning; the wheel force stays within `pulled_g` of the weight.
    """
    # Plain numbers: arrays of three take longer.
    waves = [Wave(*map(float, wave)) for wave in waves]
    weight, x, a_x = car.known.mass_kg * G, (BEGINS_MPS, 0.0, 0.0), 0.0

    def inputs(t: float, v_x: float) -> tuple[float, float]:
        rise = min(t, 1.0) * (0.5 + 0.5 * t / (SAMPLES * STEP_S))
        turn = 2.0 * math.pi * t
        steer = steered * rise * sum(math.sin(turn * w.steer_hz + w.steer_phase) for w in waves)
        pull = 0.7 * pulled_g * sum(math.sin(turn * w.pull_hz + w.pull_phase) for w in waves)
        pull += 0.1 * (BEGINS_MPS - v_x)
        return steer, weight * min(max(pull, -pulled_g), pulled_g)

    rows, h = np.empty((SAMPLES, 7)), STEP_S / PARTS
    for k in range(SAMPLES):
        for part in range(PARTS):
            steer, along = inputs(k * STEP_S + part * h, x[0])
            slope = rates(car, x, steer, along, a_x, ellipse)
            a_x = slope[0] - x[1] * x[2]
            if part == 0:
                rows[k] = (steer, along, *x, a_x, slope[1] + x[0] * x[2])
            steer, along = inputs(k * STEP_S + (part + 0.5) * h, x[0])
            middle = moved(x, slope, 0.5 * h)
            x = moved(x, rates(car, middle, steer, along, a_x, ellipse), h)
        if x[0] < SLOWEST_MPS or abs(x[1]) > MOST_SIDEWAYS * x[0]:
            return None
    names = ("steer_rad", "fx_n", "vx_mps", "vy_mps", "yaw_rate_radps", "ax_mps2", "ay_mps2")
    columns = dict(zip(names, rows.T.copy(), strict=True))
    for name, std in SENSORS.items():
        columns[name] += std * rng.standard_normal(SAMPLES)
    return Log.from_arrays({"time_s": STEP_S * np.arange(SAMPLES), **columns}, name="weaving")
