"""Noise of sensors that is correlated in time is told from forces, and from white noise."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import sysid_vehicle as sv
from sysid_vehicle.identify import refine

CAR = sv.example_vehicle()
RATE_HZ, TIME_S = 50.0, 0.05
WANDERS = {"yaw_rate_radps": 0.003, "ay_mps2": 0.12}


def log_of(with_vy: bool, wanders: dict[str, float], slope_rad: float = 0.0) -> list[sv.Log]:
    """Drives on usual roads; some channels wander beside their white noise."""
    logs = []
    for i, kind in ((1, "country"), (2, "town")):
        road = sv.manoeuvres.usual_road(kind, 50.0, seed=20 + i)
        ground = sv.RoadDisturbance(slope_rad=slope_rad)
        log = sv.drive(sv.Model(CAR), road, seed=i, disturbance=ground, rate_hz=RATE_HZ)
        columns = {c: log[c] for c in log.channels if with_vy or c != "vy_mps"}
        rng = np.random.default_rng(i)
        for channel, std in wanders.items():
            colour = sv.RoadDisturbance(fx_n=std, correlation_time_s=TIME_S)
            columns[channel] = columns[channel] + colour.sample(log.n, RATE_HZ, rng)[:, 0]
        logs.append(sv.Log.from_arrays(columns, name=kind, check=False))
    return logs


def fitted(logs: list[sv.Log]) -> sv.Fit:
    return sv.identify(sv.Model(CAR), logs, starts=1, seed=0, progress=False)


@pytest.mark.filterwarnings("ignore::sysid_vehicle.SysidWarning")
@pytest.mark.parametrize(("with_vy", "slope_rad"), [(True, 0.015), (False, 0.0)])
def test_coloured_sensors_are_told_with_size_and_time(with_vy: bool, slope_rad: float) -> None:
    fit = fitted(log_of(with_vy, WANDERS, slope_rad))
    yaw, along, across = fit.noise.colour
    assert yaw == pytest.approx(0.003, rel=0.2)
    assert across == pytest.approx(0.12, rel=0.2)
    assert along < 0.02
    assert fit.noise.colour_time_s[0] == pytest.approx(TIME_S, rel=0.3)
    assert fit.noise.colour_time_s[2] == pytest.approx(TIME_S, rel=0.3)
    assert fit.noise.sensor[2] == pytest.approx(0.0025, rel=0.1)
    # White sensors leave it to a force from the side, of twice the size and more.
    white = refine(fit.model, fit.driving, replace(fit.noise, colour=(0.0, 0.0, 0.0)))
    assert white.noise.disturbance[1] > 2.0 * fit.noise.disturbance[1]
    assert white.log_likelihood < fit.log_likelihood - 100.0


@pytest.mark.filterwarnings("ignore::sysid_vehicle.SysidWarning")
@pytest.mark.parametrize("slope_rad", [0.0, 0.015])
def test_white_sensors_have_no_colour(slope_rad: float) -> None:
    fit = fitted(log_of(True, {}, slope_rad))
    assert not fit.noise.coloured


@pytest.mark.filterwarnings("ignore::sysid_vehicle.SysidWarning")
def test_pushes_of_the_road_are_no_colour() -> None:
    """Forces over 0.3 s move the car, and all sensors with it."""
    ground = sv.RoadDisturbance(fx_n=120.0, fy_n=150.0, mz_nm=150.0)
    road = sv.manoeuvres.usual_road("country", 60.0, seed=31)
    log = sv.drive(sv.Model(CAR), road, seed=3, disturbance=ground, rate_hz=RATE_HZ)
    assert not fitted([log]).noise.coloured
