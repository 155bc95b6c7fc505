"""Driving in which nothing happens: what moves in the inputs is their noise, no evidence."""

from __future__ import annotations

import numpy as np
import pytest

import sysid_vehicle as sv


def still(rng: np.random.Generator, *channels: str) -> sv.Log:
    """Straight on at 22 m/s, pulled by what an accelerometer reads; readings are noise."""
    noise = {
        "vx_mps": 0.03,
        "vy_mps": 0.03,
        "yaw_rate_radps": 0.0025,
        "ax_mps2": 0.06,
        "ay_mps2": 0.06,
    }
    log = {name: std * rng.standard_normal(3000) for name, std in noise.items()}
    log["vx_mps"] += 22.0
    log |= {"time_s": np.arange(3000) / 100.0, "steer_rad": np.zeros(3000)}
    return sv.Log.from_arrays({n: v for n, v in log.items() if n not in channels}, name="still")


@pytest.mark.filterwarnings("ignore::sysid_vehicle.SysidWarning")
@pytest.mark.parametrize("lacks", [(), ("vy_mps",)])
@pytest.mark.parametrize("seed", [pytest.param(97313, marks=pytest.mark.manual), 97314])
def test_noise_of_the_pull_is_no_evidence(seed: int, lacks: tuple[str, ...]) -> None:
    """A scale of the accelerometer that takes away what it reads had a p-value of 1e-7."""
    log = still(np.random.default_rng(seed), *lacks)
    found = sv.diagnose(sv.identify(sv.Model(sv.example_vehicle()), log, starts=1))
    assert not found.omnibus.rejects
    assert "steer_lag" not in [c.id for c in found.ranking]  # nobody steers: rounding alone moves
    assert min(c.p_value for c in found.ranking) > 0.01
    assert "no effect of the catalogue is missing" in str(found)
