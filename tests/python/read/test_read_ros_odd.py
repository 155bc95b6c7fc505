"""Recordings that break off, stamps of other kinds, bags without their description."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from log_formats import FAST, SLOW

from sysid_vehicle.errors import InvalidInput, SysidWarning
from sysid_vehicle.log import Log
from sysid_vehicle.read import read_log

pytestmark = pytest.mark.filterwarnings(
    # What the libraries say of themselves and of each other.
    "ignore::DeprecationWarning",
    "ignore::ResourceWarning",
)
writers: Any = pytest.importorskip("mcap.writer")
pytest.importorskip("mcap_ros2")

MAP = {
    "vx_mps": "/speed/value",
    "yaw_rate_radps": "/imu/z",
    "ax_mps2": "/imu/x",
    "ay_mps2": "/imu/y",
    "steer_rad": "/imu/steer",
}
START_S = 1_700_000_000
LATE_NS = {"/imu": 3_000_000, "/speed": 9_000_000}  # of the recorder
Message = dict[str, Any]


def header(sec: int, nanosec: int) -> Message:
    return {"header": {"stamp": {"sec": sec, "nanosec": nanosec}}}


def messages(stamp: Callable[[int, int], Message] = header) -> list[tuple[str, int, Message]]:
    found = []
    for topic, times in (("/imu", FAST), ("/speed", SLOW)):
        for t in times:
            ns = round(t * 1e9)
            sec, nanosec = START_S + ns // 10**9, ns % 10**9
            values = {"z": 0.1 * np.sin(t), "x": 0.5, "y": 2.0, "steer": 0.05 * np.sin(t)}
            content = values if topic == "/imu" else {"value": 20.0 + t}
            recorded = sec * 10**9 + nanosec + LATE_NS[topic]
            found.append((topic, recorded, {**stamp(sec, nanosec), **content}))
    return sorted(found, key=lambda m: m[1])


def write(path: Path, held: list[tuple[str, int, Message]], **options: Any) -> Path:
    with path.open("wb") as file:
        writer = writers.Writer(file, **options)
        writer.start()
        schema = writer.register_schema("any", "jsonschema", b"{}")
        channels = {t: writer.register_channel(t, "json", schema) for t in LATE_NS}
        for topic, ns, message in held:
            writer.add_message(channels[topic], ns, json.dumps(message).encode(), ns)
        writer.finish()
    return path


def check(log: Log, speeds: int = SLOW.size) -> None:
    known = np.isfinite(log["vx_mps"])
    assert np.count_nonzero(known) == speeds
    t = log["time_s"]
    np.testing.assert_allclose(log["vx_mps"][known], 20.0 + t[known], atol=1e-6)
    np.testing.assert_allclose(log["yaw_rate_radps"], 0.1 * np.sin(t), atol=1e-6)


@pytest.mark.parametrize("share", [0.5, 0.99])
def test_a_recording_that_breaks_off(tmp_path: Path, share: float) -> None:
    path = write(tmp_path / "run.mcap", messages(), chunk_size=2000)
    content = path.read_bytes()
    path.write_bytes(content[: int(share * len(content))])
    with pytest.warns(SysidWarning, match=r"run\.mcap: was not finished; .*mcap recover"):
        log = read_log(path, MAP, check=False)
    assert log.n == 400 if share > 0.9 else 100 < log.n < 400
    check(log, np.count_nonzero(np.isfinite(log["vx_mps"])))


def test_a_recording_without_an_index(tmp_path: Path) -> None:
    none = {"index_types": writers.IndexType.NONE, "use_statistics": False}
    none |= dict.fromkeys(("use_summary_offsets", "repeat_channels", "repeat_schemas"), False)
    check(read_log(write(tmp_path / "run.mcap", messages(), **none), MAP, check=False))


@pytest.mark.parametrize(
    "stamp",
    [
        lambda sec, nanosec: {"stamp": {"sec": sec, "nanosec": nanosec}},  # of Autoware's steering
        lambda sec, nanosec: {"timestamp": {"sec": sec, "nsec": nanosec}},  # of Foxglove's schemas
        lambda sec, nanosec: {"header": {"stamp": {"secs": sec, "nsecs": nanosec}}},  # of ROS 1
    ],
    ids=["message", "foxglove", "ros 1"],
)
def test_other_stamps(tmp_path: Path, stamp: Callable[[int, int], Message]) -> None:
    """The recorder is later by 3 and 9 ms; none of its times is taken."""
    check(read_log(write(tmp_path / "run.mcap", messages(stamp)), MAP, check=False))


def test_messages_without_a_stamp_among_others(tmp_path: Path) -> None:
    held = messages()
    first = next(k for k, message in enumerate(held) if message[0] == "/speed")
    held[first] = (*held[first][:2], {"value": 99.0, **header(0, 0)})
    path = write(tmp_path / "run.mcap", held)
    with pytest.warns(SysidWarning, match=r"/speed: 1 of 80 messages without stamp, first .* 0,"):
        check(read_log(path, MAP, check=False), SLOW.size - 1)


def test_messages_of_other_encodings(tmp_path: Path) -> None:
    with (tmp_path / "run.mcap").open("wb") as file:
        writer = writers.Writer(file)
        writer.start()
        for k, (encoding, by) in enumerate((("cbor", ""), ("cdr", "ros2idl"))):
            schema = writer.register_schema(f"s{k}", by, b"")
            writer.add_message(writer.register_channel(f"/{k}", encoding, schema), 1, b"x", 1)
        writer.finish()
    with pytest.raises(InvalidInput, match=r"left out.*: /0 \(cbor\), /1 \(cdr by ros2idl\);"):
        read_log(tmp_path / "run.mcap", MAP, check=False)


def test_bags_without_their_description(tmp_path: Path) -> None:
    pytest.importorskip("rosbags")
    path = tmp_path / "run.db3"
    path.write_bytes(b"SQLite format 3\0" + bytes(200))
    with pytest.raises(InvalidInput, match=r"no metadata\.yaml beside it.*ros2 bag reindex"):
        read_log(path, MAP)
    other = tmp_path / "fleet.sqlite"
    other.write_bytes(path.read_bytes())
    with pytest.raises(
        InvalidInput, match=r"an SQLite data base, but no ROS bag.*pandas\.read_sql"
    ):
        read_log(other, MAP)
    with pytest.raises(InvalidInput, match=r"a folder without metadata\.yaml, so no ROS 2 bag"):
        read_log(tmp_path, MAP)
    bag = tmp_path / "run.bag"
    bag.write_bytes(b"#ROSBAG V2.0\n" + bytes(200))
    with pytest.raises(InvalidInput, match="mend it with rosbag reindex"):
        read_log(bag, MAP)


@pytest.mark.parametrize("later_ns", [1_000_000, 10**11])
def test_two_publishers_of_a_topic(tmp_path: Path, later_ns: int) -> None:
    """At the same time they are mixed, which is told; one after the other they are one drive."""
    with (tmp_path / "run.mcap").open("wb") as file:
        writer = writers.Writer(file)
        writer.start()
        schema = writer.register_schema("any", "jsonschema", b"{}")
        channels = [
            {t: writer.register_channel(t, "json", schema, {"k": str(k)}) for t in LATE_NS}
            for k in range(2)
        ]
        for k, moved in enumerate((0, later_ns)):
            for topic, ns, message in messages():
                message["header"]["stamp"]["sec"] += (ns + moved) // 10**9 - ns // 10**9
                message["header"]["stamp"]["nanosec"] += k * 5_000_000
                writer.add_message(
                    channels[k][topic], ns + moved, json.dumps(message).encode(), ns + moved
                )
        writer.finish()
    with pytest.warns(SysidWarning) as caught:
        read_log(tmp_path / "run.mcap", MAP, check=False)
    told = " ".join(str(warning.message) for warning in caught)
    assert ("/imu: 2 publishers send it at the same time" in told) is (later_ns < 10**9)


def test_single_messages_that_are_broken(tmp_path: Path) -> None:
    """They are left out, told by topic, and the rest is read; no tool for files mends them."""
    path = tmp_path / "run.mcap"
    held = messages()
    imu = [k for k, (topic, _, _) in enumerate(held) if topic == "/imu"]
    held[imu[200]][2]["y"] = "overload"
    with path.open("wb") as file:
        writer = writers.Writer(file)
        writer.start()
        schema = writer.register_schema("any", "jsonschema", b"{}")
        channels = {t: writer.register_channel(t, "json", schema) for t in LATE_NS}
        for k, (topic, ns, message) in enumerate(held):
            text = json.dumps(message).encode()
            writer.add_message(channels[topic], ns, text[:30] if k in imu[100:103] else text, ns)
        writer.finish()
    with pytest.warns(SysidWarning) as caught:
        log = read_log(path, MAP, check=False)
    told = [str(w.message) for w in caught]
    assert any(
        "/imu: 3 message(s) that cannot be decoded were left out (JSONDec" in t for t in told
    )
    assert any(
        "/imu/y: text in place of a number in 1 message(s), first 'overload'" in t for t in told
    )
    known = np.isfinite(log["ay_mps2"])
    assert np.count_nonzero(known) == FAST.size - 4
    np.testing.assert_array_equal(log["ay_mps2"][known], 2.0)


def test_a_bag_whose_mcap_breaks_off(tmp_path: Path) -> None:
    """The file in it is read as far as it is whole; nothing of bags mends it."""
    rosbag2: Any = pytest.importorskip("rosbags.rosbag2")
    types: Any = pytest.importorskip("rosbags.typesys")
    store, kind = types.get_typestore(types.Stores.LATEST), "geometry_msgs/msg/Vector3"
    folder = tmp_path / "run"
    with rosbag2.Writer(folder, version=9, storage_plugin=rosbag2.StoragePlugin.MCAP) as writer:
        place = writer.add_connection("/car", kind, typestore=store)
        for t in FAST:
            held = store.types[kind](x=20.0 + t, y=2.0, z=0.1)
            writer.write(place, round(t * 1e9), store.serialize_cdr(held, kind))
    part = folder / "run.mcap"
    part.write_bytes(part.read_bytes()[:-200])
    with pytest.raises(
        InvalidInput, match=r"give read_log its file .*run\.mcap, .*mcap recover"
    ) as e:
        read_log(folder, MAP)
    assert "sqlite" not in str(e.value)
    names = {c: f"/car/{a}" for c, a in zip(("vx_mps", "ay_mps2", "steer_rad"), "xyz", strict=True)}
    names |= {"yaw_rate_radps": "/car/z", "ax_mps2": "/car/z"}
    with pytest.warns(SysidWarning) as caught:
        log = read_log(part, names, check=False)
    assert any("run.mcap: was not finished; the mess" in str(w.message) for w in caught)
    np.testing.assert_allclose(log["vx_mps"], 20.0 + log["time_s"], atol=1e-9)
