"""Roads of every day's driving, drawn at random."""

from __future__ import annotations

from typing import get_args

import numpy as np
import pytest

import sysid_vehicle as sv
from sysid_vehicle.manoeuvres import RoadKind, usual_road

FASTEST = {"motorway": 36.0, "country": 27.0, "town": 14.0}
LATERAL = {"motorway": 2.0, "country": 5.5, "town": 4.5}


@pytest.mark.parametrize("kind", get_args(RoadKind))
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_a_road_stays_within_what_is_usual(kind: RoadKind, seed: int) -> None:
    road = usual_road(kind, 100.0, seed)
    time_s = np.arange(0.0, 100.0, 0.05)
    speed, lateral = road.speed_mps(time_s), road.lateral_mps2(time_s)
    assert speed.max() <= FASTEST[kind]
    assert np.abs(lateral).max() <= LATERAL[kind]
    assert np.abs(lateral).max() > 0.2  # it bends
    assert (lateral == 0.0).any()  # it goes straight
    assert road.name == kind


def test_the_seed_draws_the_road() -> None:
    assert usual_road(seed=5) == usual_road(seed=np.random.default_rng(5))
    assert usual_road(seed=5) != usual_road(seed=6)


@pytest.mark.parametrize("kind", get_args(RoadKind))
def test_a_road_is_driven_for_as_long_as_is_asked(kind: RoadKind) -> None:
    log = sv.drive(sv.Model(sv.example_vehicle()), usual_road(kind, 12.0, 7), seed=1, rate_hz=50.0)
    assert log.duration_s == pytest.approx(12.0)
