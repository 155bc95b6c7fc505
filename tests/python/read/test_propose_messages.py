"""Names of messages and matrices, fields that nothing fills, what came late of one message."""

from pathlib import Path

import numpy as np
import pytest

import sysid_vehicle as sv
from sysid_vehicle.errors import SysidWarning

h5py = pytest.importorskip("h5py")
scipy_io = pytest.importorskip("scipy.io")


@pytest.fixture(scope="module")
def log(truth: sv.Model) -> sv.Log:
    return sv.drive(truth, sv.manoeuvres.handling_course(20.0), seed=835252, rate_hz=50.0)


def test_fields_of_a_driving_stack(log: sv.Log) -> None:
    """A state of steering is in its messages; the lateral speed of one of them nothing fills."""
    columns = {
        "time_s": log["time_s"],
        "/vehicle/status/velocity_status/longitudinal_velocity": log["vx_mps"],
        "/vehicle/status/velocity_status/lateral_velocity": np.zeros(log.n),
        "/localization/kinematic_state/twist/twist/linear/x": log["vx_mps"],
        "/localization/kinematic_state/twist/twist/linear/y": log["vy_mps"],
        "/imu/angular_velocity/z": log["yaw_rate_radps"],
        "/imu/linear_acceleration/x": log["ax_mps2"],
        "/imu/linear_acceleration/y": log["ay_mps2"],
        "/vehicle/status/steering_status/steering_tire_angle": log["steer_rad"],
    }
    found = sv.propose_channels(columns).channels
    assert found["steer_rad"].column.endswith("steering_tire_angle")
    assert found["vy_mps"].column.endswith("linear/y")
    assert found["vx_mps"].column.endswith("longitudinal_velocity")


@pytest.mark.parametrize("kind", ["h5", "mat"])
def test_matrices_of_three_axes(tmp_path: Path, log: sv.Log, kind: str) -> None:
    none = np.zeros(log.n)
    sensors = {
        "imu": {
            "gyro": np.column_stack([none, none, log["yaw_rate_radps"]]),
            "acc": np.column_stack([log["ax_mps2"], log["ay_mps2"], none + 9.8]),
        },
        "ins": {"vel_body": np.column_stack([log["vx_mps"], log["vy_mps"], none])},
        # As many as there are wheels: the third is no turning about z.
        "wheels": {"omega": np.column_stack([log["vx_mps"] / 0.3] * 4)},
        "steering": {"angle": log["steer_rad"]},
    }
    path = tmp_path / f"run.{kind}"
    if kind == "mat":
        scipy_io.savemat(path, {"t": log["time_s"], **sensors})
    else:
        with h5py.File(path, "w") as file:
            file["t"] = log["time_s"]
            for group, arrays in sensors.items():
                for name, values in arrays.items():
                    file[f"{group}/{name}"] = values
    found = sv.propose_channels(path)
    assert {c: p.column for c, p in found.channels.items() if c != "time_s"} == {
        "vx_mps": "ins.vel_body(:,1)",
        "vy_mps": "ins.vel_body(:,2)",
        "yaw_rate_radps": "imu.gyro(:,3)",
        "ax_mps2": "imu.acc(:,1)",
        "ay_mps2": "imu.acc(:,2)",
        "steer_rad": "steering.angle",
    }
    read = sv.read_log(path, found.channel_map)
    np.testing.assert_allclose(read["yaw_rate_radps"], log["yaw_rate_radps"])


@pytest.mark.parametrize(
    ("channel", "name", "beside"),
    [
        ("steer_rad", "/tx/steer_rpt/output", "/tx/steer_rpt/enabled"),
        ("steer_rad", "/tx/steer_rpt/output", "/tx/steer_rpt/manual_input"),
        ("vx_mps", "car.speed", "ins.north_velocity"),
        ("heading", "/oem7/inspva/azimuth", "/oem7/inspva/status"),
        ("north", "/oem7/inspva/north_velocity", "/oem7/inspva/east_velocity"),
        ("yaw_rate_radps", "state/r", "state/v"),
    ],
)
def test_what_stands_behind_a_message(log: sv.Log, channel: str, name: str, beside: str) -> None:
    from sysid_vehicle.read.mapping.names import rank

    assert rank(name, "", channel) > rank(beside, "", channel)


def test_fields_of_a_message_that_came_late_are_told_once() -> None:
    t = np.arange(400) * 0.01
    late = np.concatenate([t[:50], t[[51, 50]], t[52:]])
    imu = {
        "yaw_rate_radps": (late, 0.1 * np.sin(late)),
        "ax_mps2": (late, 0.1 * np.cos(late)),
        "ay_mps2": (late, 2.0 * np.sin(late)),
    }
    with pytest.warns(SysidWarning) as said:
        sv.read_log(
            {**imu, "vx_mps": (t, 20.0 + 0.1 * np.sin(t)), "steer_rad": (t, 0.05 * np.sin(t))},
            check=False,
        )
    told = [str(w.message) for w in said if "came late" in str(w.message)]
    assert len(told) == 1
    assert "yaw_rate_radps and 2 more: 1 samples came late" in told[0]


def test_a_specific_force_is_no_force(log: sv.Log) -> None:
    columns = {c: log[c] for c in log.channels if c not in ("ax_mps2", "ay_mps2", "fx_n")}
    columns["/imu/specific_force/x"], columns["/imu/specific_force/y"] = (
        log["ax_mps2"],
        log["ay_mps2"],
    )
    found = sv.propose_channels(columns).channels
    assert found["ax_mps2"].column == "/imu/specific_force/x"
    assert found["ay_mps2"].column == "/imu/specific_force/y"
    assert "fx_n" not in found


def test_the_stamp_of_a_message_is_no_channel() -> None:
    from sysid_vehicle.read.formats.messages import numbers

    stamp = {"seconds": 1_700_000_000, "nanos": 5}
    message = {"timestamp": stamp, "angle_deg": 3.0, "state": {"timestamp": 4.5}}
    assert [path for path, _ in numbers(message)] == ["angle_deg", "state/timestamp"]
