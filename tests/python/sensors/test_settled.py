"""What kinematics tells of a sensor is in no doubt where a model with tyres finds the same."""

from dataclasses import dataclass

import sysid_vehicle as sv
from sysid_vehicle.sensors import SensorFault, backed
from sysid_vehicle.sensors.settled import narrowed


@dataclass(frozen=True)
class Size:
    name: str
    value: float
    std: float


def _fault(name: str, value: float, *, found: bool) -> SensorFault:
    return SensorFault(name, "ay_mps2", "IMU ahead", value, 0.02, "m", True, found)


AHEAD = (_fault("imu_forward_m", 0.41, found=True), _fault("imu_left_m", 0.01, found=False))


def _arm(forward_m: float) -> list[Size]:
    return [
        Size("imu_lever_arm.forward_m", forward_m, 0.01),
        Size("imu_lever_arm.left_m", 0.0, 0.01),
    ]


def test_the_same_size_is_backed_and_no_other() -> None:
    told = backed(_arm(0.39), AHEAD)
    assert list(told) == ["imu_lever_arm"]
    assert "0.41 m" in told["imu_lever_arm"]
    assert backed(_arm(0.7), AHEAD) == {}
    assert backed(_arm(-0.41), AHEAD) == {}
    assert backed(_arm(0.39)[:1], AHEAD) == {}
    assert backed(_arm(0.39), [_fault(f.name, f.value, found=False) for f in AHEAD]) == {}
    assert backed(_arm(0.39), ()) == {}


def test_what_was_put_right_leaves_no_room_for_the_same_again() -> None:
    (arm,) = narrowed([sv.effect("imu_lever_arm")], AHEAD)
    forward = arm.named["imu_lever_arm.forward_m"]
    assert -0.15 < forward.lower < 0.0 < forward.upper < 0.15
