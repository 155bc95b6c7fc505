"""On hills a car slows where the road climbs, which reads as faults along the car do."""

import numpy as np
import pytest

import sysid_vehicle as sv
from sysid_vehicle.manoeuvres import Knots, Manoeuvre

CAR = sv.example_vehicle()


def road(seed: int, slope_rad: float, duration_s: float = 60.0) -> sv.Log:
    """A usual drive along a road with few bends, at a speed that the driver seldom changes."""
    rng = np.random.default_rng(seed)
    at = np.arange(0.0, duration_s, 15.0)
    speeds = Knots(tuple(at), tuple(rng.uniform(20.0, 26.0, at.size)), smooth=True)
    bends = Knots(
        tuple(np.concatenate([[t, t + 2.0, t + 5.0, t + 7.0] for t in at[1:]])),
        tuple(np.concatenate([[0.0, a, a, 0.0] for a in rng.uniform(-3.0, 3.0, at.size - 1)])),
        smooth=True,
    )
    drive = Manoeuvre("road", "few bends", duration_s, speeds, bends, True)
    hills = sv.RoadDisturbance(slope_rad=slope_rad)
    return sv.drive(sv.Model(CAR), drive, seed=seed, disturbance=hills)


@pytest.mark.parametrize("seed", range(4))
def test_hills_are_no_fault(seed: int) -> None:
    found = sv.check(road(seed, 0.015), CAR)
    assert not found.found
    assert not found.estimate.slips
    along = found["gain_ax"]
    assert not along.told
    assert "slows where it climbs" in along.why_not
    assert "level ground" in along.why_not


def test_a_calm_road_has_no_fault() -> None:
    """Hardly anything is felt along it: the scale of a_x must not go to nothing."""
    rng = np.random.default_rng(3)
    t = np.arange(0.0, 150.0, 0.02)
    noise = rng.standard_normal((5, t.size))
    speed = 31.0 + 2.0 * np.sin(0.035 * t)
    yaw_rate = 1.5 * np.sin(0.31 * t) * np.sin(0.047 * t) / speed
    side = (1.2 - 0.0045 * speed**2) * yaw_rate
    log = sv.read_log(
        {
            "time_s": t,
            "vx_mps": speed + 0.03 * noise[0],
            "vy_mps": side + 0.03 * noise[1],
            "yaw_rate_radps": yaw_rate + 0.0025 * noise[2],
            "ax_mps2": np.gradient(speed, t) - side * yaw_rate + 0.06 * noise[3],
            "ay_mps2": np.gradient(side, t) + speed * yaw_rate + 0.06 * noise[4],
            "steer_rad": 2.7 * yaw_rate / speed + 0.002 * speed * yaw_rate,
        }
    )
    found = sv.check(log)
    assert not found.found
    assert not found.estimate.slips
    assert found.estimate.settled
    assert abs(found["gain_ax"].value) < 0.1


def test_braking_tells_a_scale_among_hills() -> None:
    """Firm braking and acceleration are no hills."""
    rng = np.random.default_rng(8)
    at = np.arange(0.0, 61.0, 6.0)
    speeds = Knots(tuple(at), tuple(15.0 + 12.0 * (np.arange(at.size) % 2)), smooth=True)
    drive = Manoeuvre("stops", "braking", 60.0, speeds, lambda t: 3.0 * np.sin(0.6 * t), True)
    slopes = sv.RoadDisturbance(slope_rad=0.005)
    clean = sv.drive(sv.Model(CAR), drive, seed=int(rng.integers(2**31)), disturbance=slopes)
    table = {name: clean[name] for name in clean.channels}
    fault = sv.check(sv.read_log({**table, "ax_mps2": 1.15 * table["ax_mps2"]}), CAR)["gain_ax"]
    assert fault.found
    assert fault.value == pytest.approx(0.15, abs=0.02)
