"""A speed of wheels that slip as they drive and brake: none comes too early."""

from __future__ import annotations

import importlib
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import sysid_vehicle as sv
from sysid_vehicle.sensors.faults import SensorFault
from sysid_vehicle.sensors.kinematics.estimate import Estimate

DRIVEN, BRAKED = 0.010, 0.004  # s2/m, those of rear wheels that drive alone and brake a little


def wheels(seed: int, driven: float, braked: float, *, late_s: float = 0.0) -> sv.Log:
    truth = sv.Model(sv.example_vehicle())
    log = sv.drive(truth, sv.manoeuvres.lap(16.0, 7.0), seed=seed, rate_hz=50.0)
    force = log["fx_n"] / truth.vehicle.mass_kg
    slip = driven * np.maximum(force, 0.0) + braked * np.minimum(force, 0.0)
    speeds = {"vx_mps": log["vx_mps"] * (1.0 + slip), "vy_mps": log["vy_mps"]}
    if late_s:
        t = log["time_s"]
        speeds = {c: np.interp(t - late_s, t, x) for c, x in speeds.items()}
    return log.corrected(speeds, []).without("fx_n").without("vy_mps")


@pytest.mark.parametrize("seed", [423569, 251247, pytest.param(890200, marks=pytest.mark.manual)])
def test_a_speed_of_wheels_is_not_early(seed: int) -> None:
    log = wheels(seed, DRIVEN, BRAKED)
    check = sv.check(log, sv.example_vehicle())
    assert not check.found
    # Drag is a part of the force: without it the wheels seem to slip more as they brake.
    assert [*check.estimate.slips.values()] == pytest.approx([DRIVEN, BRAKED], rel=0.1)
    assert "speed of wheels that slip by" in str(check)
    clean = sv.drive(
        sv.Model(sv.example_vehicle()),
        sv.manoeuvres.lap(16.0, 7.0),
        seed=seed,
        rate_hz=50.0,
        noise=sv.SensorNoise.none(),
    )["vx_mps"]
    before, after = (float(np.std(x["vx_mps"] - clean)) for x in (log, check.apply(log)))
    assert after < 0.25 * before


@pytest.mark.parametrize("late_s", [0.1, -0.1])
def test_a_speed_that_comes_late_or_early_is(late_s: float) -> None:
    """Slip explains speeds that come early, in proportion to them, and no others."""
    found = sv.check(wheels(115761, 0.0, 0.0, late_s=late_s), sv.example_vehicle())
    assert found["delay_vx_s"].found
    assert found["delay_vx_s"].value == pytest.approx(late_s, abs=0.015)
    assert "slip" not in " ".join(found.remarks)


def test_slip_that_brings_another_fault_takes_no_place(monkeypatch: pytest.MonkeyPatch) -> None:
    module = importlib.import_module("sysid_vehicle.sensors.explaining")
    told: Callable[..., tuple[SensorFault, ...]] = module.faults_of

    def with_another(found: Estimate, *rest: Any, **more: Any) -> tuple[SensorFault, ...]:
        faults = told(found, *rest, **more)
        brings = "imu_left_m" if found.slips else ""
        return tuple(replace(f, found=f.found or f.name == brings) for f in faults)

    monkeypatch.setattr(module, "faults_of", with_another)
    check = sv.check(wheels(423569, DRIVEN, BRAKED), sv.example_vehicle())
    assert not check.estimate.slips
    assert not check["imu_left_m"].found
