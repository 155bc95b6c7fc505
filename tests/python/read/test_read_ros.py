"""MCAP files and bags of ROS, written by their libraries."""

import importlib
import json
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from log_formats import FAST, SLOW

from sysid_vehicle.errors import InvalidInput, SysidWarning
from sysid_vehicle.log import Log
from sysid_vehicle.read import propose_channels, read_log

pytestmark = pytest.mark.filterwarnings(
    # What the libraries say of themselves and of each other.
    "ignore::DeprecationWarning",
    "ignore::FutureWarning",
    "ignore::PendingDeprecationWarning",
    "ignore::ResourceWarning",
)


class TestRos:
    """Inertial unit at 100 Hz with stamps, odometry at 20 Hz; the recorder is late."""

    MAP = {  # noqa: RUF012
        "vx_mps": "/odom/twist/twist/linear/x",
        "yaw_rate_radps": "/imu/angular_velocity/z",
        "ax_mps2": "/imu/linear_acceleration/x",
        "ay_mps2": "/imu/linear_acceleration/y",
        "steer_rad": "/steer/data",
    }
    START = 1_700_000_000 * 10**9

    def check(self, log: Log) -> None:
        assert log.rate_hz == pytest.approx(100.0, rel=1e-5)
        known = np.isfinite(log["vx_mps"])
        assert np.count_nonzero(known) == SLOW.size
        time_s = log["time_s"]
        np.testing.assert_allclose(log["vx_mps"][known], 20.0 + time_s[known], atol=1e-6)
        np.testing.assert_allclose(log["yaw_rate_radps"], 0.1 * np.sin(time_s), atol=1e-6)
        np.testing.assert_allclose(log["steer_rad"], 0.05 * np.sin(time_s), atol=1e-6)

    IMU = (
        "std_msgs/Header header\ngeometry_msgs/Vector3 angular_velocity\n"
        "geometry_msgs/Vector3 linear_acceleration\n"
    )
    TWIST = "std_msgs/Header header\nnav/TwistWith twist\n"
    PARTS = {  # noqa: RUF012
        "std_msgs/Header": "builtin_interfaces/Time stamp\nstring frame_id\n",
        "builtin_interfaces/Time": "int32 sec\nuint32 nanosec\n",
        "geometry_msgs/Vector3": "float64 x\nfloat64 y\nfloat64 z\n",
        "nav/TwistWith": "nav/Twist twist\nfloat64[36] covariance\n",
        "nav/Twist": "geometry_msgs/Vector3 linear\n",
    }

    def definition(self, own: str) -> str:
        parts = [f"{'=' * 80}\nMSG: {name}\n{text}" for name, text in self.PARTS.items()]
        return "\n".join([own, *parts])

    def messages(self, stamped: int = 0) -> list[tuple[str, int, dict[str, Any]]]:
        found: list[tuple[str, int, dict[str, Any]]] = []
        for t in FAST:
            ns = self.START + round(t * 1e9)
            header = {"stamp": {"sec": ns // 10**9, "nanosec": ns % 10**9}, "frame_id": "car"}
            yaw, acc = {"x": 0.0, "y": 0.0, "z": 0.1 * np.sin(t)}, {"x": 0.5, "y": 2.0, "z": 9.8}
            imu = {"header": header, "angular_velocity": yaw, "linear_acceleration": acc}
            found.append(("/imu", ns + 3_000_000, imu))
            found.append(("/steer", ns, {"data": float(0.05 * np.sin(t))}))
        for t in SLOW:
            ns = self.START + round(t * 1e9) + stamped * 10**9
            header = {"stamp": {"sec": ns // 10**9, "nanosec": ns % 10**9}, "frame_id": "map"}
            speed = {"twist": {"linear": {"x": 20.0 + t, "y": 0.0, "z": 0.0}}}
            twist = {"header": header, "twist": {**speed, "covariance": [0.0] * 36}}
            found.append(("/odom", self.START + round(t * 1e9) + 9_000_000, twist))
        return sorted(found, key=lambda m: m[1])

    def write_mcap(self, path: Path, stamped: int = 0) -> Path:
        writers = pytest.importorskip("mcap_ros2.writer")
        with path.open("wb") as file:
            writer = writers.Writer(file)
            schemas = {
                "/imu": writer.register_msgdef("nav/Imu", self.definition(self.IMU)),
                "/odom": writer.register_msgdef("nav/Odometry", self.definition(self.TWIST)),
                "/steer": writer.register_msgdef("std_msgs/Float64", "float64 data"),
            }
            for topic, recorded_ns, message in self.messages(stamped):
                writer.write_message(topic, schemas[topic], message, log_time=recorded_ns)
            writer.finish()
        return path

    def test_mcap(self, tmp_path: Path) -> None:
        path = self.write_mcap(tmp_path / "run.mcap")
        with pytest.warns(SysidWarning, match=r"/steer: its messages have no stamps"):
            self.check(read_log(path, self.MAP, check=False))

    def test_stamps_of_another_clock(self, tmp_path: Path) -> None:
        path = self.write_mcap(tmp_path / "run.mcap", stamped=-500)
        with pytest.raises(InvalidInput, match=r"/odom and /steer: .*different clocks"):
            read_log(path, self.MAP, check=False)

    def test_mcap_with_json(self, tmp_path: Path) -> None:
        writers = pytest.importorskip("mcap.writer")
        path = tmp_path / "run.mcap"
        with path.open("wb") as file:
            writer = writers.Writer(file)
            writer.start()
            schema = writer.register_schema("any", "jsonschema", b'{"type": "object"}')
            channels = {
                topic: writer.register_channel(topic, "json", schema)
                for topic in ("/imu", "/odom", "/steer")
            }
            for topic, ns, message in self.messages():
                writer.add_message(channels[topic], ns, json.dumps(message).encode(), ns)
            writer.finish()
        pytest.importorskip("mcap_ros2")
        with pytest.warns(SysidWarning, match=r"/steer: its messages have no stamps"):
            self.check(read_log(path, self.MAP, check=False))

    @pytest.mark.parametrize("ros", [1, 2])
    def test_bags(self, tmp_path: Path, ros: int) -> None:
        pytest.importorskip("rosbags")
        path = write_bag(tmp_path / ("run.bag" if ros == 1 else "run"), ros, self.messages())
        with pytest.warns(SysidWarning, match=r"/steer: its messages have no stamps"):
            log = read_log(path, self.MAP, check=False)
        self.check(log)
        if ros == 2:
            with pytest.warns(SysidWarning, match="/steer"):
                self.check(read_log(path / "run.db3", self.MAP, check=False))


def write_bag(path: Path, ros: int, messages: list[tuple[str, int, dict[str, Any]]]) -> Path:
    types = importlib.import_module("rosbags.typesys")
    store = types.get_typestore(types.Stores.ROS1_NOETIC if ros == 1 else types.Stores.LATEST)
    module = importlib.import_module(f"rosbags.rosbag{ros}")
    make = store.types

    vector, zero = make["geometry_msgs/msg/Vector3"], {"x": 0.0, "y": 0.0, "z": 0.0}
    with module.Writer(path) if ros == 1 else module.Writer(path, version=9) as writer:
        kinds = {
            "/imu": "sensor_msgs/msg/Imu",
            "/odom": "nav_msgs/msg/Odometry",
            "/steer": "std_msgs/msg/Float64",
        }
        connections = {t: writer.add_connection(t, k, typestore=store) for t, k in kinds.items()}
        for topic, ns, message in messages:
            if topic == "/steer":
                content = make[kinds[topic]](data=message["data"])
            else:
                stamp = make["builtin_interfaces/msg/Time"](**message["header"]["stamp"])
                head: dict[str, Any] = {"stamp": stamp, "frame_id": "car"}
                if ros == 1:
                    head["seq"] = 0
                header = make["std_msgs/msg/Header"](**head)
                turn = make["geometry_msgs/msg/Quaternion"](x=0.0, y=0.0, z=0.0, w=1.0)
                if topic == "/imu":
                    content = make[kinds[topic]](
                        header,
                        turn,
                        np.zeros(9),
                        vector(**message["angular_velocity"]),
                        np.zeros(9),
                        vector(**message["linear_acceleration"]),
                        np.zeros(9),
                    )
                else:
                    linear = vector(**message["twist"]["twist"]["linear"])
                    twist = make["geometry_msgs/msg/Twist"](linear, vector(**zero))
                    pose = make["geometry_msgs/msg/Pose"](
                        make["geometry_msgs/msg/Point"](**zero), turn
                    )
                    content = make[kinds[topic]](
                        header,
                        "car",
                        make["geometry_msgs/msg/PoseWithCovariance"](pose, np.zeros(36)),
                        make["geometry_msgs/msg/TwistWithCovariance"](twist, np.zeros(36)),
                    )
            serialize = store.serialize_ros1 if ros == 1 else store.serialize_cdr
            writer.write(connections[topic], ns, serialize(content, kinds[topic]))
    return path


_BROKEN = {
    "no text of its own": "x: [",
    "a file that is not there": (
        "rosbag2_bagfile_information: {relative_file_paths: [a.mcap], storage_identifier: mcap, "
        "version: 5}"
    ),
}


@pytest.mark.parametrize("metadata", [*_BROKEN.values(), None], ids=[*_BROKEN, "none"])
@pytest.mark.parametrize("read", [read_log, propose_channels])
def test_a_folder_that_is_no_bag_is_named_once(
    tmp_path: Path, metadata: str | None, read: Callable[[str], object]
) -> None:
    pytest.importorskip("rosbags")
    if metadata is not None:
        (tmp_path / "metadata.yaml").write_text(metadata)
    with pytest.raises(InvalidInput) as told:
        read(f"{tmp_path}{os.sep}")
    assert f"{tmp_path}: is a " in str(told.value)
    assert str(told.value).count(str(tmp_path)) == 1
