"""Standard manoeuvres in a day of driving."""

from __future__ import annotations

import pickle

import numpy as np
import pytest

import sysid_vehicle as sv
from sysid_vehicle import manoeuvres as m
from sysid_vehicle.manoeuvres.manoeuvre import Manoeuvre
from sysid_vehicle.manoeuvres.steady import slip_difference

SHORT = m.double_lane_change(speeds_mps=(12.0,), offset_m=2.8, change_m=20.0, between_m=11.0)
CAR = sv.example_vehicle()
SOFT = CAR.replace(
    name="soft", tyre_front=CAR.tyre_front.replace(B=8.0), tyre_rear=CAR.tyre_rear.replace(B=10.0)
)


def driven(what: Manoeuvre, car: sv.Vehicle = CAR, seed: int = 11) -> sv.Log:
    return sv.drive(sv.Model(car), what, seed=seed, rate_hz=50.0)


@pytest.mark.parametrize("car", [CAR, SOFT], ids=lambda c: c.name)
@pytest.mark.parametrize(
    ("what", "standard", "name", "count"),
    [
        (m.step_steer((22.0,), (4.0,)), "ISO 7401", "step input", 2),
        (m.sine_sweep(30.0), "ISO 7401", "continuous sinusoidal input", 1),
        (m.double_lane_change((20.0,)), "ISO 3888-1", "double lane change", 2),
        (SHORT, "ISO 3888-2", "double lane change", 2),
        (m.constant_radius(duration_s=80.0), "ISO 4138", "steady circle, constant radius", 2),
    ],
    ids=lambda x: x.name if isinstance(x, Manoeuvre) else "",
)
def test_each_is_named(
    car: sv.Vehicle, what: Manoeuvre, standard: str, name: str, count: int
) -> None:
    log = driven(what, car)
    found = m.recognise(log, car)
    assert [(f.standard, f.name) for f in found] == [(standard, name)] * count
    for one in found:
        assert one.part(log).duration_s == pytest.approx(one.stop_s - one.start_s + 2.0, abs=1.0)
        assert pickle.loads(pickle.dumps(one)) == one
        assert standard in str(one)


@pytest.mark.parametrize(
    "what",
    [m.lap(), m.handling_course(), m.slalom(), m.brake_in_turn(), m.straight_acceleration()],
    ids=lambda x: x.name,
)
def test_other_driving_is_not(what: Manoeuvre) -> None:
    assert m.recognise(driven(what), CAR) == ()


def test_they_measure_what_the_standards_ask() -> None:
    circle, _ = m.recognise(driven(m.constant_radius(radius_m=50.0, duration_s=250.0)), CAR)
    assert circle.measures["radius_m"] == pytest.approx(50.0, rel=0.02)
    slope = float(np.diff(slip_difference(CAR, [1.0, 4.0]))[0]) / 3.0
    assert circle.measures["understeer_radps2pm"] == pytest.approx(slope, rel=0.15)
    left, right = m.recognise(driven(SHORT), CAR)
    assert left.measures["offset_m"] == pytest.approx(2.8, abs=0.15)
    assert right.measures["offset_m"] == pytest.approx(-2.8, abs=0.15)
    step, _ = m.recognise(driven(m.step_steer((22.0,), (2.0,))), CAR)
    steady = 22.0 / (CAR.wheelbase_m + m.understeer_gradient(CAR) * 22.0**2)
    assert step.measures["yaw_gain_ps"] == pytest.approx(steady, rel=0.03)
    (sweep,) = m.recognise(driven(m.sine_sweep(30.0, 20.0, 2.0)), CAR)
    assert -30.0 < sweep.measures["phase_at_0.5hz_deg"] < -5.0
    slow = 20.0 / (CAR.wheelbase_m + m.understeer_gradient(CAR) * 20.0**2)
    assert sweep.measures["yaw_gain_at_0.5hz_ps"] == pytest.approx(slow, rel=0.08)


def test_an_angle_that_is_off_and_sideslip_that_is_not_measured_do_no_harm() -> None:
    log = driven(m.constant_radius(duration_s=80.0))
    data = {c: log[c] for c in log.channels if c != "vy_mps"}
    data["steer_rad"] = data["steer_rad"] + 0.02
    moved = sv.Log.from_arrays(data, check=False)
    for a, b in zip(m.recognise(log, CAR), m.recognise(moved, CAR), strict=True):
        assert a.measures == pytest.approx(b.measures, rel=1e-6)
