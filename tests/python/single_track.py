"""A linear single-track model on a winding road, as a log to be spoilt."""

from collections.abc import Callable
from functools import cache

import numpy as np

Columns = dict[str, np.ndarray]
Change = Callable[[Columns], None]


def drive(*of: float, **named: float) -> Columns:
    """What `driven` gives, to be spoilt."""
    return {name: x.copy() for name, x in driven(*of, **named).items()}


@cache
def driven(steer_scale: float = 1.0, duration_s: float = 40.0, rate_hz: float = 100.0) -> Columns:
    """Drive a linear single-track model (1500 kg, 2.7 m) through curves at varying speed."""
    mass, inertia, lf, lr, front, rear = 1500.0, 2500.0, 1.2, 1.5, 1.0e5, 1.2e5
    dt = 1.0 / rate_hz
    time_s = np.arange(round(duration_s * rate_hz)) * dt
    vx = 20.0 + 6.0 * np.sin(0.25 * time_s)
    steer = steer_scale * (0.03 * np.sin(0.7 * time_s) + 0.01 * np.sin(2.9 * time_s + 1.0))
    vy, yaw_rate, ay = (np.zeros_like(time_s) for _ in range(3))
    for k in range(time_s.size):
        force_front = front * (steer[k] - (vy[k] + lf * yaw_rate[k]) / vx[k])
        force_rear = -rear * (vy[k] - lr * yaw_rate[k]) / vx[k]
        ay[k] = (force_front + force_rear) / mass
        if k + 1 < time_s.size:
            vy[k + 1] = vy[k] + dt * (ay[k] - vx[k] * yaw_rate[k])
            yaw_rate[k + 1] = yaw_rate[k] + dt * (lf * force_front - lr * force_rear) / inertia
    ax = np.gradient(vx, dt) - vy * yaw_rate
    noise = np.random.default_rng(3).normal(size=(6, time_s.size))
    return {
        "time_s": time_s,
        "vx_mps": vx + 0.02 * noise[0],
        "vy_mps": vy + 0.02 * noise[1],
        "yaw_rate_radps": yaw_rate + 0.003 * noise[2],
        "ax_mps2": ax + 0.1 * noise[3],
        "ay_mps2": ay + 0.1 * noise[4],
        "steer_rad": steer + 1e-4 * noise[5],
        "fx_n": mass * ax + 300.0,
    }


def times(**factors: float) -> Change:
    def change(data: Columns) -> None:
        for channel, factor in factors.items():
            data[channel] = data[channel] * factor

    return change
