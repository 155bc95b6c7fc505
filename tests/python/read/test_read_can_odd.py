"""Logs of CAN frames as programs and cars make them: several buses, other clocks, broken frames."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from log_formats import FACTORS, FAST, MAP, SLOW, check_values, measured, read_told

from sysid_vehicle.errors import InvalidInput, SysidWarning
from sysid_vehicle.read import read_log

pytestmark = pytest.mark.filterwarnings(
    # What the libraries say of themselves and of each other.
    "ignore::DeprecationWarning",
    "ignore::PendingDeprecationWarning",
    "ignore::ResourceWarning",
)
can: Any = pytest.importorskip("can")
cantools: Any = pytest.importorskip("cantools")

DBC = """VERSION ""
NS_ :
BS_:
BU_: ECU
BO_ 256 Motion: 8 ECU
 SG_ YawRate : 0|16@1+ (0.001,-32) [-32|32] "deg/s" ECU
 SG_ LongAcc : 16|16@1- (0.0001,0) [-3|3] "g" ECU
 SG_ LatAcc : 32|16@1- (0.0001,0) [-3|3] "g" ECU
 SG_ Steer : 48|16@1- (0.00001,0) [-0.3|0.3] "rad" ECU
BO_ 2566914302 Wheels: 2 ECU
 SG_ Speed : 0|16@1+ (0.01,0) [0|300] "km/h" ECU
BA_DEF_ BO_ "VFrameFormat" ENUM "StandardCAN","ExtendedCAN","reserved","J1939PG";
BA_DEF_DEF_ "VFrameFormat" "StandardCAN";
BA_ "VFrameFormat" BO_ 2566914302 3;
VAL_ 256 YawRate 65535 "SNA" ;
"""
START = 1.7e9
SI = {c: {"column": n, "factor": FACTORS.get(c, 1.0)} for c, n in MAP.items()}
Frames = list[Any]


@pytest.fixture
def dbc(tmp_path: Path) -> Path:
    path = tmp_path / "car.dbc"
    path.write_text(DBC)
    return path


@pytest.fixture
def frames(dbc: Path) -> Frames:
    database = cantools.database.load_file(dbc)
    found = []
    for name, times in (("Motion", FAST), ("Wheels", SLOW)):
        message = database.get_message_by_name(name)
        for t in times:
            values = {s.name: float(measured(t)[s.name]) for s in message.signals}
            found.append(
                can.Message(
                    timestamp=START + float(t),
                    arbitration_id=message.frame_id,
                    is_extended_id=message.is_extended_frame,
                    data=message.encode(values),
                    channel=0,
                )
            )
    return sorted(found, key=lambda f: f.timestamp)


def written(path: Path, frames: Frames) -> Path:
    with can.Logger(str(path)) as logger:
        for frame in sorted(frames, key=lambda f: f.timestamp):
            logger.on_message_received(frame)
    return path


def lines(frames: Frames, line: Callable[[Any, str, str], str]) -> str:
    """One line for each frame: of the frame, its identifier and its bytes."""
    return "".join(
        line(f, f"{f.arbitration_id:0{8 if f.is_extended_id else 3}X}", f.data.hex(" ").upper())
        + "\n"
        for f in frames
    )


@pytest.mark.parametrize("suffix", ["asc", "log", "trc"])
def test_the_name_of_the_file_tells_nothing(
    tmp_path: Path, dbc: Path, frames: Frames, suffix: str
) -> None:
    path = written(tmp_path / f"run.{suffix}", frames).rename(tmp_path / "run.txt")
    check_values(read_told(path, dbc=dbc), atol=0.01)


def test_asc_with_relative_times(tmp_path: Path, dbc: Path, frames: Frames) -> None:
    """Each time is that since the event before, whether or not that is a frame of data."""
    text = [
        "date Sam M\u00e4r 30 10:06:13.191 2024",
        "base dec  timestamps relative",
        "internal events logged",
        "Begin Triggerblock Sam M\u00e4r 30 10:06:13.191 2024",
        "   0.000000 Start of measurement",
    ]
    last = START
    for k, frame in enumerate(frames):
        step, last = frame.timestamp - last, frame.timestamp
        if k % 7 == 0:
            text.append(f"{0.5 * step:11.7f} 1  ErrorFrame")
            step *= 0.5
        mark = "x" if frame.is_extended_id else ""
        data = " ".join(map(str, frame.data))
        text.append(
            f"{step:11.7f} 1  {frame.arbitration_id}{mark}  Rx   d {len(frame.data)} {data}"
        )
    path = tmp_path / "run.asc"
    path.write_text("\n".join(text) + "\n", encoding="latin-1")
    check_values(read_told(path, dbc=dbc), atol=0.01)


@pytest.mark.parametrize(
    "stamp",
    [
        lambda f: f"({f.timestamp:.6f})",
        lambda f: f"({f.timestamp - START:010.6f})",
        lambda f: f"(2023-11-14 23:13:{20 + f.timestamp - START:09.6f})",
    ],
    ids=["absolute", "zero", "date"],
)
def test_what_candump_prints(
    tmp_path: Path, dbc: Path, frames: Frames, stamp: Callable[[Any], str]
) -> None:
    path = tmp_path / "run.txt"
    path.write_text(lines(frames, lambda f, i, d: f" {stamp(f)}  can0  {i}   [{len(f.data)}]  {d}"))
    check_values(read_told(path, dbc=dbc), atol=0.01)


@pytest.mark.parametrize(
    ("stamp", "words"),
    [("(000.001000)  ", "times of its frames are differences"), ("", "frames have no times")],
)
def test_candump_without_a_clock_is_refused(
    tmp_path: Path, dbc: Path, frames: Frames, stamp: str, words: str
) -> None:
    path = tmp_path / "run.txt"
    path.write_text(lines(frames, lambda f, i, d: f"  {stamp}can0  {i}   [{len(f.data)}]  {d}"))
    with pytest.raises(InvalidInput, match=f"{words}.*candump -L"):
        read_log(path, MAP, dbc=dbc, check=False)


@pytest.mark.parametrize("suffix", ["asc", "csv", "log", "trc"])
def test_a_recording_that_was_cut_off(
    tmp_path: Path,
    dbc: Path,
    frames: Frames,
    suffix: str,
    capfd: pytest.CaptureFixture[str],
) -> None:
    """At whatever byte of its last line, all before it is read; half a frame gives no value."""
    path = written(tmp_path / f"run.{suffix}", frames)
    raw = path.read_bytes()
    whole = raw[: raw.index(b"\n", len(raw) // 2) + 1]
    number = whole.count(b"\n") + 1
    cut = raw[len(whole) : raw.index(b"\n", len(whole))].rstrip()
    path.write_bytes(whole)
    before = read_log(path, SI, dbc=dbc, check=False)
    first = next(k for k, byte in enumerate(cut) if chr(byte).isdigit()) + 1
    for length in range(first, len(cut) + 1, 3):
        path.write_bytes(whole + cut[:length])
        told = rf"run\.{suffix} breaks off in line {number}, which was left out"
        with pytest.warns(SysidWarning, match=told) as caught:
            log = read_log(path, SI, dbc=dbc, check=False)
        assert not any("database" in str(w.message) for w in caught)
        for channel in before.channels:
            np.testing.assert_array_equal(log[channel], before[channel])
    assert capfd.readouterr().err == ""  # python-can has words of its own for half a line


@pytest.mark.parametrize("suffix", ["asc", "blf", "csv"])
def test_a_log_without_frames(tmp_path: Path, dbc: Path, suffix: str) -> None:
    """No other database would help."""
    path = written(tmp_path / f"run.{suffix}", [])
    with pytest.raises(InvalidInput, match=r"holds no frame of data; check that it was recorded"):
        read_log(path, MAP, dbc=dbc)


def test_a_database_that_is_not_there(tmp_path: Path, frames: Frames) -> None:
    path = written(tmp_path / "run.blf", frames)
    with pytest.raises(InvalidInput, match=r"cra\.dbc: cannot be read \(No such file.*the path"):
        read_log(path, MAP, dbc=tmp_path / "cra.dbc")


@pytest.mark.parametrize(
    ("suffix", "bus"), [("blf", "bus 1"), ("asc", "bus 1"), ("trc", "bus 1"), ("log", "can0")]
)
def test_the_same_message_on_two_buses(
    tmp_path: Path, dbc: Path, frames: Frames, suffix: str, bus: str
) -> None:
    """Another controller uses the identifier for something else: never mixed into one signal."""
    foreign = [
        can.Message(
            timestamp=f.timestamp + 0.004, arbitration_id=f.arbitration_id, is_extended_id=False,
            data=bytes(8), channel=1,
        )
        for f in frames if not f.is_extended_id
    ]  # fmt: skip
    path = written(tmp_path / f"run.{suffix}", frames + foreign)
    with pytest.raises(InvalidInput, match=rf"last part of 2 channels; .*{bus}\.Motion\.YawRate"):
        read_log(path, MAP, dbc=dbc, check=False)
    whole = {c: n if n == "Speed" else f"{bus}.Motion.{n}" for c, n in MAP.items()}
    check_values(read_told(path, whole, dbc=dbc), atol=0.01)


def test_j1939_has_the_sender_in_the_identifier(tmp_path: Path, dbc: Path, frames: Frames) -> None:
    for frame in frames:
        if frame.is_extended_id:
            frame.arbitration_id = (frame.arbitration_id & ~0xFF) | 0x0B
    check_values(read_told(written(tmp_path / "a.blf", frames), dbc=dbc), atol=0.01)
    second = [
        can.Message(
            timestamp=f.timestamp + 0.001, arbitration_id=f.arbitration_id + 1, data=bytes(2)
        )
        for f in frames if f.is_extended_id
    ]  # fmt: skip
    path = written(tmp_path / "b.blf", frames + second)
    with pytest.raises(InvalidInput, match=r"last part of 2 channels; .*0x1900000B\.Wheels\.Speed"):
        read_log(path, MAP, dbc=dbc, check=False)


@pytest.mark.parametrize("suffix", ["blf", "mf4"])
def test_a_reading_with_a_name_is_no_measurement(
    tmp_path: Path, dbc: Path, frames: Frames, suffix: str
) -> None:
    if suffix == "mf4":
        pytest.importorskip("asammdf")
    for frame in [f for f in frames if not f.is_extended_id][50:60]:
        frame.data[0:2] = b"\xff\xff"
    path = written(tmp_path / f"run.{suffix}", frames)
    with pytest.warns(SysidWarning, match=r"YawRate: 10 samples are 'SNA' .*first sample 50"):
        log = read_log(path, SI, dbc=dbc, check=False)
    missing = np.flatnonzero(np.isnan(log["yaw_rate_radps"]))
    np.testing.assert_array_equal(missing, np.arange(50, 60))
    assert np.nanmax(np.abs(log["yaw_rate_radps"])) < 0.2


def test_frames_that_are_too_short_are_left_out(tmp_path: Path, dbc: Path, frames: Frames) -> None:
    for frame in [f for f in frames if not f.is_extended_id][-3:]:
        frame.data, frame.dlc = frame.data[:6], 6
    path = written(tmp_path / "run.blf", frames)
    with pytest.warns(SysidWarning, match=r"3 frames are shorter than car\.dbc says"):
        log = read_log(path, SI, dbc=dbc, check=False)
    assert np.isfinite(log["vx_mps"]).sum() == SLOW.size


def test_frames_in_mdf_without_a_database(tmp_path: Path, frames: Frames) -> None:
    pytest.importorskip("asammdf")
    path = written(tmp_path / "run.mf4", frames)
    with pytest.raises(InvalidInput, match=r"if it holds CAN frames, .*--dbc car\.dbc"):
        read_log(path, MAP, check=False)


@pytest.mark.parametrize("unit", ["°/s", "Unit_DegreOfArcPerSecon", "Grad/s"])
def test_units_of_databases(tmp_path: Path, dbc: Path, frames: Frames, unit: str) -> None:
    """In UTF-8, which the format does not know; Volkswagen's; German."""
    path = written(tmp_path / "run.blf", frames)
    dbc.write_text(DBC.replace("deg/s", unit), encoding="utf-8")
    check_values(read_told(path, dbc=dbc), atol=0.01)


def test_a_blf_that_was_cut_off(tmp_path: Path, dbc: Path, frames: Frames) -> None:
    """It was read to there without a word."""
    path = tmp_path / "run.blf"
    with can.BLFWriter(path, max_container_size=2048) as writer:
        for frame in frames:
            writer.on_message_received(frame)
    whole = path.read_bytes()
    path.write_bytes(whole[: len(whole) // 2])
    stated = rf"run\.blf breaks off: it holds {len(whole) // 2} of the {len(whole)} bytes"
    with pytest.warns(SysidWarning, match=stated):
        log = read_log(path, SI, dbc=dbc, check=False)
    assert 100 < log.n < 300
