"""Velocity over ground in fields that are called as those of the body, and quaternions."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import sysid_vehicle as sv
from sysid_vehicle.errors import InvalidInput

pytestmark = pytest.mark.filterwarnings(
    "ignore::DeprecationWarning",
    "ignore::ResourceWarning",
    "ignore::sysid_vehicle.errors.SysidWarning",
)
writers: Any = pytest.importorskip("mcap.writer")
pytest.importorskip("mcap_ros2")

DEG = np.pi / 180.0
# Of the course; begins so that the drive as a whole goes about to the east.
BEGINS = {"east": 0.7, "all round": -2.3}


@pytest.fixture(scope="module")
def right(truth: sv.Model) -> sv.Log:
    return sv.drive(truth, sv.manoeuvres.handling_course(30.0), seed=716249, rate_hz=50.0)


def over_ground(log: sv.Log, begin: float) -> dict[str, np.ndarray]:
    """Columns of the drive, of which `vx` and `vy` are those to east and north."""
    yaw, t = log["yaw_rate_radps"], log["time_s"]
    turned = np.concatenate(([0.0], np.cumsum(0.5 * (yaw[1:] + yaw[:-1]) * np.diff(t))))
    psi = begin + turned
    v_x, v_y = log["vx_mps"], log["vy_mps"]
    kept = {c: np.array(log[c]) for c in log.channels if c not in ("vx_mps", "vy_mps")}
    return kept | {
        "vx": v_x * np.cos(psi) - v_y * np.sin(psi),
        "vy": v_x * np.sin(psi) + v_y * np.cos(psi),
        "psi": psi,
    }


@pytest.mark.parametrize("begin", BEGINS.values(), ids=BEGINS)
@pytest.mark.parametrize("yaw", [("yaw_rate_radps", 1.0), ("YawRate", 1.0 / DEG)])
@pytest.mark.parametrize("finer", [1.0, 1e9])
def test_what_turns_with_the_car_is_over_ground(
    right: sv.Log, begin: float, yaw: tuple[str, float], finer: float
) -> None:
    columns = over_ground(right, begin)
    columns[yaw[0]] = yaw[1] * columns.pop("yaw_rate_radps")
    columns["t"] = finer * columns.pop("time_s")
    found = sv.propose_channels(columns)
    assert {part: p.column for part, p in found.ground.items()} == {
        "east": "vx",
        "north": "vy",
        "heading": "psi",
    }
    log = sv.read_log(columns, found.channel_map)
    for channel in ("vx_mps", "vy_mps"):
        np.testing.assert_allclose(log[channel], right[channel], atol=1e-6)


@pytest.mark.parametrize("begin", [*BEGINS.values(), 0.0, 1.5, 3.0])
def test_without_a_heading_they_are_refused(right: sv.Log, begin: float) -> None:
    columns = over_ground(right, begin)
    del columns["psi"]
    with pytest.raises(
        InvalidInput, match=r"vx_mps and vy_mps: are speeds over ground.*\[ground\]"
    ):
        sv.read_log(columns, {"vx_mps": "vx", "vy_mps": "vy"})


@pytest.mark.parametrize("sideways", [0.0, 2.0])
def test_speeds_of_the_body_stay_such(right: sv.Log, sideways: float) -> None:
    """Also where the car slides: the direction of motion does not turn as the car does."""
    columns = {c: np.array(right[c]) for c in right.channels} | {"psi": np.zeros(len(right))}
    columns["vy_mps"] = columns["vy_mps"] - sideways * columns["yaw_rate_radps"]
    found = sv.propose_channels(columns)
    assert not found.ground
    assert found.channels["vx_mps"].column == "vx_mps"


def recorded(path: Path, log: sv.Log, *topics: str) -> Path:
    """An IMU with a quaternion, and twists: `/gps` over ground, `/odom` in the body."""
    columns = over_ground(log, BEGINS["east"])
    with path.open("wb") as file:
        writer = writers.Writer(file)
        writer.start()
        schema = writer.register_schema("any", "jsonschema", b"{}")
        channels = {t: writer.register_channel(t, "json", schema) for t in ("/imu", *topics)}
        for k, t in enumerate(log["time_s"]):
            ns = 1_700_000_000_000_000_000 + round(t * 1e9)
            stamp = {"header": {"stamp": {"sec": ns // 10**9, "nanosec": ns % 10**9}}}
            half = 0.5 * columns["psi"][k]
            twist = {
                "/gps": (columns["vx"][k], columns["vy"][k]),
                "/odom": (log["vx_mps"][k], log["vy_mps"][k]),
            }
            content: dict[str, Any] = {
                "/imu": {
                    "orientation": {"x": 0.0, "y": 0.0, "z": np.sin(half), "w": np.cos(half)},
                    "angular_velocity": {"z": log["yaw_rate_radps"][k]},
                    "linear_acceleration": {"x": log["ax_mps2"][k], "y": log["ay_mps2"][k]},
                    "steering_angle": log["steer_rad"][k],
                }
            }
            for topic in topics:
                along, across = twist[topic]
                content[topic] = {"twist": {"linear": {"x": along, "y": across}}}
            for topic, fields in content.items():
                message = json.dumps({**stamp, **fields}).encode()
                writer.add_message(channels[topic], ns, message, ns)
        writer.finish()
    return path


def test_the_yaw_of_a_quaternion_is_the_heading(tmp_path: Path, right: sv.Log) -> None:
    path = recorded(tmp_path / "run.mcap", right, "/gps")
    found = sv.propose_channels(path)
    assert found.ground["heading"].column == "/imu/orientation/quaternion_yaw"
    assert (found.ground["heading"].unit, found.counted_from) == ("rad", "east")
    log = sv.read_log(path, found.channel_map)
    for channel in ("vx_mps", "vy_mps"):
        np.testing.assert_allclose(log[channel], right[channel], atol=1e-6)


def test_of_several_twists_that_of_the_body_is_taken(tmp_path: Path, right: sv.Log) -> None:
    found = sv.propose_channels(recorded(tmp_path / "run.mcap", right, "/gps", "/odom"))
    assert not found.ground
    assert found.channels["vx_mps"].column == "/odom/twist/linear/x"
    assert found.channels["vy_mps"].column == "/odom/twist/linear/y"
