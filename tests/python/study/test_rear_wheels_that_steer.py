"""Rear wheels that steer along look like a steering ratio and a place of the instruments."""

from types import SimpleNamespace

import numpy as np
import pytest

import sysid_vehicle as sv
from sysid_vehicle.study.results.next_steps import _of_rear_wheels

SHARE = 0.15


def test_a_study_asks_whether_they_do() -> None:
    car = sv.example_vehicle()
    sv.define_effect(
        "all_wheels",
        title="rear wheels that steer along",
        parameters=[
            sv.parameter("instead", "1", typical=1.0, lower=0.0, upper=1.0),
            sv.parameter("front", "1/rad", typical=10.0, lower=0.0, upper=60.0),
            sv.parameter("rear", "1/rad", typical=10.0, lower=0.0, upper=60.0),
        ],
        force_y_front=lambda d, p: d.F_zf * np.tanh(p.front * d.alpha_f) - p.instead * d.F_yf,
        force_y_rear=lambda d, p: (
            d.F_zr * np.tanh(p.rear * (d.alpha_r + SHARE * d.steer)) - p.instead * d.F_yr
        ),
    )
    values = {"instead": 1.0, "front": 14.9, "rear": 15.6}
    try:
        truth = sv.Model(car).add("all_wheels")
        truth = truth.with_values({f"all_wheels.{name}": x for name, x in values.items()})
        lap = sv.manoeuvres.lap(40.0, lateral_mps2=6.0)
        logs = [sv.drive(truth, lap, seed=s, rate_hz=25.0) for s in (930581, 930582)]
    finally:
        sv.forget_effect("all_wheels")
    some = ["ins_lever_arm", "steer_ratio"]
    study = sv.improve(sv.Model(car), *logs, candidates=some, starts=1, sensors=False)
    assert {a.id for a in study.added} == {*some}
    (asked,) = [step for step in study.next_steps if "whether the rear wheels steer" in step]
    assert "steer by 15 % of the angle of the front ones, the same way" in asked
    assert "forward_m would be 0.4" in asked


@pytest.mark.parametrize(
    ("ratio", "place", "asks"),
    [
        (-0.15, 0.46, "15 % of the angle of the front ones, the same way"),
        (0.1, -0.24, "10 % of the angle of the front ones, the other way"),
        (-0.15, 0.9, ""),  # another place
        (-0.15, -0.46, ""),
        (0.0, 0.46, ""),  # a place alone
        (-0.15, 0.0, ""),  # a ratio alone
    ],
)
def test_only_where_both_belong_together(ratio: float, place: float, asks: str) -> None:
    def estimate(name: str, value: float, std: float) -> SimpleNamespace:
        return SimpleNamespace(name=name, value=value, std=std)

    model = SimpleNamespace(vehicle=SimpleNamespace(wheelbase_m=2.6))
    study = SimpleNamespace(
        estimates=(
            estimate("steer_ratio.ratio_error", ratio, 0.003),
            estimate("imu_lever_arm.forward_m", place, 0.02),
        ),
        rules=sv.Rules(),
        fit=SimpleNamespace(model=model),
    )
    found = _of_rear_wheels(study)  # type: ignore[arg-type]
    assert bool(found) == bool(asks)
    assert all(asks in text for text in found)
