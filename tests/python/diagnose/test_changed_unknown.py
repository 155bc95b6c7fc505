"""What changed that no effect explains: which of several it is, and what takes it up."""

import time
from collections.abc import Sequence
from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from sysid_vehicle import Fit, Model, drive, manoeuvres
from sysid_vehicle.diagnose.candidates.causes import CredibleSet
from sysid_vehicle.diagnose.candidates.single_effects import Hypothesis, ScoreModel
from sysid_vehicle.diagnose.change.beside_unknown import noise_beside, unknown_beside
from sysid_vehicle.diagnose.change.in_time import InTime
from sysid_vehicle.diagnose.change.saying import Saying
from sysid_vehicle.diagnose.changed import _beside_unknown, _later
from sysid_vehicle.estimate import Driving
from sysid_vehicle.rules import USUAL

RATE_HZ = 50.0  # of the reference, whose noise stays as it is to the last digit
NAMES = ("steer_offset", "unknown F_x", "unknown dv_x/dt", "unknown M_z")
INFORMATION = 1e4


def scores(alike: float, size: Sequence[float], ratios: Sequence[float]) -> ScoreModel:
    """Of one shape each; those along the car are alike, and what is there is a sum of them."""
    information = np.eye(len(NAMES))
    information[1, 2] = information[2, 1] = alike
    information *= INFORMATION
    told = tuple(Hypothesis(n, (i,), (0.0,), 1.0) for i, n in enumerate(NAMES))
    return ScoreModel(told, information @ np.array(size), information, np.array(ratios), 0.9)


def test_which_unknown_it_is_does_not_hang_on_the_colour_of_what_others_leave() -> None:
    """The score of the wrong one varies less; what is there is told by how much each explains."""
    model = scores(0.9, (0.2, 0.5, 0.0, 0.0), (1.0, 8.0, 4.0, 1.0))
    own = model.beside(("steer_offset",))
    assert own["unknown dv_x/dt"] > own["unknown F_x"] > 3.0
    (found,) = unknown_beside(model, ("steer_offset",), USUAL)
    assert found.effects == ("unknown F_x",)


def test_unknowns_that_no_driving_tells_apart_are_one_group() -> None:
    model = scores(0.9999, (0.0, 0.5, 0.0, 0.0), (1.0, 8.0, 4.0, 1.0))
    (found,) = unknown_beside(model, (), USUAL)
    assert set(found.effects) == {"unknown F_x", "unknown dv_x/dt"}


def test_each_unknown_is_likely_beside_those_before_it() -> None:
    two = scores(0.9, (0.2, 0.5, 0.0, 0.3), (1.0, 1.0, 1.0, 1.0))
    found = unknown_beside(two, ("steer_offset",), USUAL)
    assert [s.effects for s in found] == [("unknown F_x",), ("unknown M_z",)]
    assert not unknown_beside(scores(0.9, (0.2, 0.0, 0.0, 0.0), np.ones(4)), NAMES[:1], USUAL)


def test_what_is_unknown_along_the_car_is_taken_up_along_it(before: Fit, truth: Model) -> None:
    """Learned beside what leaves most to it where a part of what was put in stands in for it."""
    drag = truth.add("aero_drag").with_values({"aero_drag.drag_area_m2": 0.6})
    course = manoeuvres.handling_course(10.0, lateral_mps2=6.0)
    later = _later(before, Driving.of(drive(drag, course, seed=42, rate_hz=50.0)), None)
    softer = later.model.with_values({"B_rear": 0.7 * later.model.value("B_rear")})
    parts: Any = [
        SimpleNamespace(put=("tyre_rear",), fit=replace(later, model=softer)),
        SimpleNamespace(put=(), fit=later),
    ]
    along = CredibleSet(("unknown F_x", "unknown dv_x/dt"), (0.6, 0.4))
    found = noise_beside(parts, (along,), before.noise)
    assert found.put == ()
    assert found.noise.disturbance[0] > 50.0
    assert found.noise.disturbance[1:] == before.noise.disturbance[1:]
    assert found.noise.sensor == before.noise.sensor
    assert found.noise.motion == before.noise.motion


def test_without_time_what_was_found_is_told_and_what_was_not_asked(before: Fit) -> None:
    in_time = InTime(time.perf_counter() - 1.0)
    search = SimpleNamespace(in_time=in_time, visited={}, before=before)
    priced = (None, SimpleNamespace(put=("mass",)))
    said = cast(Saying, SimpleNamespace(search=search, priced=priced, unknown=()))
    assert _beside_unknown(said, None) is said
    assert in_time.facts(()) == ("what stands in for what no effect explains was not asked for",)


@pytest.mark.parametrize("alike", [0.0, 0.5, 0.99])
def test_beside_nothing_log_odds_are_those_against_nothing(alike: float) -> None:
    model = scores(alike, (0.2, 0.1, 0.0, 0.3), np.ones(4))
    alone = {s.effects[0]: s.log_odds for s in model.subsets(1)}
    assert model.beside(()) == pytest.approx(alone)
