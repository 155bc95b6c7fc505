"""On a road that leans this way and that the driver steers against it: vy hardly moves."""

from dataclasses import replace

import numpy as np
import pytest

import sysid_vehicle as sv
from sysid_vehicle.compare import incoherent
from sysid_vehicle.estimate import Driving
from sysid_vehicle.log.laws.plausibility import check_coherence
from sysid_vehicle.manoeuvres import Knots, Manoeuvre

MODEL = sv.Model(sv.example_vehicle())
LEVEL = sv.NoiseModel(
    sensor=(0.05, 0.1, 0.002, 0.06, 0.06),
    motion=(0.05, 0.05, 0.02),
    disturbance=(100.0, 100.0, 50.0),
    correlation_time_s=(0.3, 0.3, 0.3),
)


def motorway(slope_rad: float, seed: int, *, weaving_mps2: float = 0.0) -> dict[str, np.ndarray]:
    course = Manoeuvre(
        name="motorway",
        purpose="slow bends",
        duration_s=90.0,
        speed_mps=lambda t: 22.0 + 3.0 * np.sin(0.1 * t),
        lateral_mps2=lambda t: weaving_mps2 * np.sin(1.5 * t) + 0.8 * np.sin(0.07 * t),
    )
    road = sv.RoadDisturbance(fy_n=100.0, correlation_time_s=0.3, slope_rad=slope_rad)
    log = sv.drive(MODEL, course, seed=seed, disturbance=road)
    table = {name: log[name] for name in log.channels}
    coarse = 0.1 * np.random.default_rng(seed).standard_normal(log.n)
    return {**table, "vy_mps": table["vy_mps"] + coarse}


@pytest.mark.parametrize("seed", range(3))
def test_it_is_read_with_a_note_that_tells_the_bank(seed: int) -> None:
    with pytest.warns(sv.SysidWarning, match=r"leans by up to [123]\.?\d? deg to either side"):
        log = sv.Log.from_arrays(motorway(0.02, seed))
    (told,) = (c for c in log.contradictions if c.channel == "vy_mps")
    assert told.on_the_level


def test_noise_with_a_road_that_varies_is_not_contradicted() -> None:
    with pytest.warns(sv.SysidWarning, match="leans by up to"):
        driving = Driving.of(sv.Log.from_arrays(motorway(0.02, 0)))
    assert "vy_mps" in incoherent(driving, MODEL, LEVEL)
    assert incoherent(driving, MODEL, replace(LEVEL, road=(0.1, 0.2))) == {}


def test_a_level_road_has_no_bank() -> None:
    table = motorway(0.0, 1)
    assert not check_coherence(table, 100.0)


def test_rows_in_disorder_are_refused_as_before() -> None:
    table = motorway(0.0, 1, weaving_mps2=4.0)
    order = np.random.default_rng(1).permutation(table["vy_mps"].size)
    with pytest.raises(sv.InvalidInput, match="vy_mps: does not change as"):
        sv.Log.from_arrays({**table, "vy_mps": table["vy_mps"][order]})


def town(seed: int) -> dict[str, np.ndarray]:
    """Slow turns on roads that lean, by a driver who answers."""
    rng = np.random.default_rng(seed)
    at = np.arange(6.0, 145.0, 8.5)
    speeds = Knots((0.0, *at), tuple(rng.uniform(6.0, 14.0, at.size + 1)), smooth=True)
    sizes = rng.choice([-1.0, 1.0], at.size) * rng.uniform(1.5, 4.5, at.size)
    turns = [
        (t + s, a * on)
        for t, a in zip(at, sizes, strict=True)
        for s, on in ((0.0, 0.0), (1.2, 1.0), (3.5, 1.0), (4.7, 0.0))
    ]
    bends = Knots(*(tuple(column) for column in zip((0.0, 0.0), *turns, strict=True)), smooth=True)
    course = Manoeuvre("town", "slow turns", 150.0, speeds, bends, True)
    log = sv.drive(
        MODEL, course, seed=seed, disturbance=sv.RoadDisturbance(slope_rad=0.015), rate_hz=50.0
    )
    return {name: log[name] for name in log.channels}


def lags(table: dict[str, np.ndarray]) -> dict[str, float]:
    return {c.channel: c.late_s for c in check_coherence(table, 50.0) if c.late_s}


@pytest.mark.parametrize("seed", [14, 15, 30, 36])
def test_a_bank_that_the_driver_answers_is_no_lag(seed: int) -> None:
    assert lags(town(seed)) == {}
