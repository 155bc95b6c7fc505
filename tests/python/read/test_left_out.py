"""What files hold and nothing here reads is told once, by name, with its remedy."""

import json
import sqlite3
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from log_formats import DBC, FAST, SLOW, UNITS, check_values, measured, read_told

from sysid_vehicle import example_vehicle
from sysid_vehicle.cli import main
from sysid_vehicle.errors import InvalidInput, SysidWarning
from sysid_vehicle.read import propose_channels, read_log

pytestmark = pytest.mark.filterwarnings(
    # What the libraries say of themselves and of each other.
    "ignore::DeprecationWarning",
    "ignore::FutureWarning",
    "ignore::PendingDeprecationWarning",
    "ignore::ResourceWarning",
)
START = 1_700_000_000 * 10**9
TOPICS = {
    "vx_mps": "/speed/value",
    "yaw_rate_radps": "/imu/turn/z",
    "ax_mps2": "/imu/ax",
    "ay_mps2": "/imu/ay",
    "steer_rad": "/imu/steer",
}


def imu_type() -> Any:
    """A message of Protocol Buffers with a stamp, a message inside and a field that may lack."""
    pb = pytest.importorskip("google.protobuf.descriptor_pb2")
    pool = pytest.importorskip("google.protobuf.descriptor_pool").DescriptorPool()
    made = pytest.importorskip("google.protobuf.message_factory")
    stamp = pytest.importorskip("google.protobuf.timestamp_pb2")
    field = pb.FieldDescriptorProto
    file = pb.FileDescriptorProto(name="car.proto", package="car", syntax="proto3")
    file.dependency.append(stamp.DESCRIPTOR.name)
    vector = file.message_type.add(name="Vector")
    for k, name in enumerate("xyz", 1):
        vector.field.add(name=name, number=k, type=field.TYPE_DOUBLE, label=field.LABEL_OPTIONAL)
    imu = file.message_type.add(name="Imu")
    inner = {"timestamp": ".google.protobuf.Timestamp", "turn": ".car.Vector"}
    for k, (name, of) in enumerate(inner.items(), 1):
        imu.field.add(
            name=name, number=k, type=field.TYPE_MESSAGE, type_name=of, label=field.LABEL_OPTIONAL
        )
    for k, name in enumerate(("ax", "ay", "steer"), 3):
        imu.field.add(name=name, number=k, type=field.TYPE_DOUBLE, label=field.LABEL_OPTIONAL)
    imu.field.add(name="wheel", number=6, type=field.TYPE_FLOAT, label=field.LABEL_REPEATED)
    imu.oneof_decl.add(name="_slip")
    imu.field.add(
        name="slip", number=7, type=field.TYPE_DOUBLE, label=field.LABEL_OPTIONAL,
        proto3_optional=True, oneof_index=0,
    )  # fmt: skip
    imu.field.add(name="note", number=8, type=field.TYPE_STRING, label=field.LABEL_OPTIONAL)
    pool.AddSerializedFile(stamp.DESCRIPTOR.serialized_pb)
    pool.Add(file)
    return made.GetMessageClass(pool.FindMessageTypeByName("car.Imu"))


def files_of(message: Any) -> bytes:
    pb = pytest.importorskip("google.protobuf.descriptor_pb2")
    files = pb.FileDescriptorSet()
    for file in (*message.DESCRIPTOR.file.dependencies, message.DESCRIPTOR.file):
        file.CopyToProto(files.file.add())
    return bytes(files.SerializeToString())


def write_mcap(path: Path) -> Path:
    """Inertial unit in protobuf, the recorder 4 ms late; speed in JSON."""
    writers, imu = pytest.importorskip("mcap.writer"), imu_type()
    with path.open("wb") as file:
        writer = writers.Writer(file)
        writer.start()
        proto = writer.register_schema("car.Imu", "protobuf", files_of(imu))
        any_ = writer.register_schema("any", "jsonschema", b"{}")
        of_imu = writer.register_channel("/imu", "protobuf", proto)
        of_speed = writer.register_channel("/speed", "json", any_)
        for k, t in enumerate(FAST):
            ns = START + round(t * 1e9)
            message = imu(ax=0.5, ay=2.0 + t, steer=0.05 * np.sin(t), wheel=[1.0, 2.0], note="x")
            message.timestamp.seconds, message.timestamp.nanos = ns // 10**9, ns % 10**9
            if k:  # not in the first message
                message.turn.z = 0.1 * np.sin(t)
            if k % 2:
                message.slip = 0.01 * t
            writer.add_message(of_imu, ns + 4_000_000, message.SerializeToString(), ns)
        for t in SLOW:
            ns = START + round(t * 1e9)
            stamp = {"sec": ns // 10**9, "nanosec": ns % 10**9}
            held = {"header": {"stamp": stamp}, "value": 20.0 + t}
            writer.add_message(of_speed, ns + 9_000_000, json.dumps(held).encode(), ns)
        writer.finish()
    return path


def test_protobuf_beside_json(tmp_path: Path) -> None:
    pytest.importorskip("mcap_protobuf")
    log = read_log(write_mcap(tmp_path / "run.mcap"), TOPICS, check=False)
    time_s = log["time_s"]
    assert log.rate_hz == pytest.approx(100.0, rel=1e-6)
    np.testing.assert_allclose(log["ay_mps2"], 2.0 + time_s, atol=1e-9)
    known = np.isfinite(log["vx_mps"])
    np.testing.assert_allclose(log["vx_mps"][known], 20.0 + time_s[known], atol=1e-9)
    # What a message leaves unset is missing, no zero; and found though the first one lacks it.
    np.testing.assert_allclose(log["yaw_rate_radps"][1:], 0.1 * np.sin(time_s[1:]), atol=1e-9)
    assert np.isnan(log["yaw_rate_radps"][0])
    np.testing.assert_array_equal(np.isfinite(log["/imu/slip"]), np.arange(log.n) % 2 == 1)
    assert (log["/imu/wheel[1]"] == 2.0).all()
    assert not any("note" in name for name in log)


def test_protobuf_without_its_library(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    pytest.importorskip("mcap_ros2")
    path = write_mcap(tmp_path / "run.mcap")
    monkeypatch.setitem(sys.modules, "mcap_protobuf", None)
    told = r"run: 1 topic is left out, as nothing here decodes the messages: /imu \(protobuf\); pip"
    with pytest.warns(SysidWarning, match=told):
        found = propose_channels(path)
    assert found.channels["vx_mps"].column == "/speed/value"
    with pytest.raises(
        InvalidInput, match=r"'/imu/turn/z', which cannot be read; 1 topic .*pip in"
    ):
        read_log(path, TOPICS)
    vehicle = tmp_path / "car.toml"
    example_vehicle().to_toml(vehicle)
    arguments = ("check", str(path), "--vehicle", str(vehicle), "--map", str(tmp_path / "map.toml"))
    assert main(arguments) != 0
    assert capsys.readouterr().err.count("1 topic is left out") == 1


def test_one_topic_that_its_decoder_refuses(tmp_path: Path) -> None:
    writers = pytest.importorskip("mcap.writer")
    pytest.importorskip("mcap_ros2")
    path = tmp_path / "run.mcap"
    with path.open("wb") as file:
        writer = writers.Writer(file)
        writer.start()
        schema = writer.register_schema("any", "jsonschema", b"{}")
        good, bad = (writer.register_channel(t, "json", schema) for t in ("/car", "/broken"))
        for t in FAST:
            ns = START + round(t * 1e9)
            held = {"stamp": {"sec": ns // 10**9, "nanosec": ns % 10**9}, "ax": 0.5, "ay": 2.0}
            held |= {"vx": 20.0 + t, "yaw": 0.1 * np.sin(t), "steer": 0.05 * np.sin(t)}
            writer.add_message(good, ns, json.dumps(held).encode(), ns)
            writer.add_message(bad, ns, b"{no json", ns)
        writer.finish()
    names = {"vx_mps": "vx", "yaw_rate_radps": "yaw", "ax_mps2": "ax", "ay_mps2": "ay"}
    with pytest.warns(SysidWarning, match=r"1 topic is left out.*: /broken \(JSONDecodeError: "):
        log = read_log(path, {**names, "steer_rad": "steer"}, check=False)
    np.testing.assert_allclose(log["vx_mps"], 20.0 + log["time_s"], atol=1e-9)


def test_types_that_a_bag_does_not_define(tmp_path: Path) -> None:
    types: Any = pytest.importorskip("rosbags.typesys")
    rosbag2: Any = pytest.importorskip("rosbags.rosbag2")
    store = types.get_typestore(types.Stores.LATEST)
    definition = types.get_types_from_msg("float64 angle\n", "car_msgs/msg/Steer")
    store.register(definition)
    make, path = store.types, tmp_path / "run"
    kinds = {"/imu": "geometry_msgs/msg/Vector3", "/steer": "car_msgs/msg/Steer"}
    with rosbag2.Writer(path, version=9) as writer:
        places = {t: writer.add_connection(t, k, typestore=store) for t, k in kinds.items()}
        for t in FAST:
            ns = START + round(t * 1e9)
            imu = make[kinds["/imu"]](x=0.5, y=2.0, z=0.1 * np.sin(t))
            for topic, held in (("/imu", imu), ("/steer", make[kinds["/steer"]](angle=0.01))):
                writer.write(places[topic], ns, store.serialize_cdr(held, kinds[topic]))
    with sqlite3.connect(path / "run.db3") as base:  # as bags were before ROS 2 Iron
        base.execute("DELETE FROM message_definitions")
    base.close()
    with pytest.raises(
        InvalidInput, match=r"'/steer/angle', which cannot be read; 1 topic is left"
    ):
        read_log(path, {"yaw_rate_radps": "/imu/z", "steer_rad": "/steer/angle"}, check=False)
    with pytest.warns(SysidWarning, match=r": /steer \(car_msgs/msg/Steer\); record with the def"):
        propose_channels(path)


OWN_DBC = f"""{DBC}BO_ 512 Wheels: 2 ECU
 SG_ Speed : 0|16@1+ (0.01,0) [0|300] "km/h" ECU
"""


def write_frames(folder: Path, suffix: str, without: tuple[str, ...] = ()) -> tuple[Path, Path]:
    can, cantools = pytest.importorskip("can"), pytest.importorskip("cantools")
    dbc, path = folder / "car.dbc", folder / f"run.{suffix}"
    dbc.write_text(OWN_DBC)
    database = cantools.database.load_file(dbc)
    sent: list[tuple[float, int, bytes]] = [(t, 0x7A1, b"\x01") for t in FAST]
    sent += [(t, 0x18FEF100, b"\x01") for t in SLOW]
    for name, times in (("Motion", FAST), ("Wheels", SLOW)):
        message = database.get_message_by_name(name)
        for t in times if name not in without else ():
            values = {s.name: float(measured(t)[s.name]) for s in message.signals}
            sent.append((t, message.frame_id, message.encode(values)))
    frames = [
        can.Message(timestamp=1.7e9 + t, arbitration_id=i, is_extended_id=i > 0x7FF, data=data)
        for t, i, data in sent
    ]
    with can.Logger(str(path)) as logger:
        for frame in sorted(frames, key=lambda f: f.timestamp):
            logger.on_message_received(frame)
    return path, dbc


@pytest.mark.parametrize("suffix", ["blf", "log", "mf4"])
def test_frames_that_the_database_lacks(tmp_path: Path, suffix: str) -> None:
    if suffix == "mf4":
        pytest.importorskip("asammdf")
    path, dbc = write_frames(tmp_path, suffix)
    told = r"2 CAN identifiers are left out, not in car\.dbc: 0x7A1, 0x18FEF100; if a channel"
    with pytest.warns(SysidWarning, match=told) as heard:
        log = read_told(path, dbc=dbc)
    assert sum("left out" in str(w.message) for w in heard) == 1
    check_values(log, atol=0.01)


def test_channels_beside_frames_in_one_file(tmp_path: Path) -> None:
    """What a logger sampled itself stands beside what the database decodes."""
    asammdf: Any = pytest.importorskip("asammdf")
    path, dbc = write_frames(tmp_path, "mf4", without=("Wheels",))
    mdf = asammdf.MDF(path)
    begin = float(mdf.get_master(0)[0])
    speed = asammdf.Signal(measured(SLOW)["Speed"], begin + SLOW, name="Speed", unit=UNITS["Speed"])
    mdf.append([speed])
    both = Path(mdf.save(tmp_path / "both.mf4"))
    mdf.close()
    with pytest.warns(SysidWarning, match="2 CAN identifiers are left out"):
        check_values(read_told(both, dbc=dbc), atol=0.01)
    with pytest.warns(SysidWarning, match=r"1 group is left out, as only a database tells .*--dbc"):
        propose_channels(both)
