"""Raw logs of loggers are read with the channel map that is proposed for them."""

import json
import warnings
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import sysid_vehicle as sv
from sysid_vehicle.cli import main

DEG, G = np.pi / 180.0, 9.80665
# Names and units as loggers have them: unit, and what a canonical channel is multiplied by.
SIGNALS = {
    "vx_mps": ("Speed", "km/h", 3.6),
    "yaw_rate_radps": ("YawRate", "deg/s", 1.0 / DEG),
    "ax_mps2": ("LongAcc", "g", 1.0 / G),
    "ay_mps2": ("LatAcc", "g", 1.0 / G),
    "steer_rad": ("SteeringWheelAngle", "deg", 14.0 / DEG),
}


@pytest.fixture(scope="module")
def log(truth: sv.Model) -> sv.Log:
    return sv.drive(truth, sv.manoeuvres.handling_course(40.0), seed=3)


def mf4(log: sv.Log, path: Path) -> None:
    asammdf = pytest.importorskip("asammdf")
    signals = [
        asammdf.Signal(factor * log[c], log["time_s"], name=name, unit=unit)
        for c, (name, unit, factor) in SIGNALS.items()
    ]
    with asammdf.MDF(version="4.10") as mdf:
        mdf.append(signals)
        mdf.save(path)


def mcap(log: sv.Log, path: Path) -> None:
    writers = pytest.importorskip("mcap.writer")
    with path.open("wb") as file:
        writer = writers.Writer(file)
        writer.start()
        schema = writer.register_schema("Car", "jsonschema", b'{"type": "object"}')
        topic = writer.register_channel("/car", "json", schema)
        for k, t in enumerate(log["time_s"]):
            values = {name: f * float(log[c][k]) for c, (name, _, f) in SIGNALS.items()}
            ns = 10**18 + round(1e9 * float(t))
            stamp = {"sec": ns // 10**9, "nanosec": ns % 10**9}
            message = json.dumps({"header": {"stamp": stamp}, **values}).encode()
            writer.add_message(topic, ns, message, ns)
        writer.finish()


def vbo(log: sv.Log, path: Path) -> None:
    names = " ".join(name for name, _, _ in SIGNALS.values())
    units = "\n".join(unit for _, unit, _ in list(SIGNALS.values())[1:])
    rows = [
        f"009 {90000.0 + t:09.2f} "
        + " ".join(f"{f * log[c][k]:.7E}" for c, (_, _, f) in SIGNALS.items())
        for k, t in enumerate(log["time_s"])
    ]
    head = f"[header]\nsatellites\ntime\nvelocity kmh\n\n[channel units]\n{units}\n\n"
    columns = f"[column names]\nsats time {names.replace('Speed', 'velocity')}\n\n[data]\n"
    path.write_bytes((head + columns + "\n".join(rows) + "\n").replace("\n", "\r\n").encode())


def mat(log: sv.Log, path: Path) -> None:
    from scipy.io import savemat

    columns = {name: factor * log[c] for c, (name, _, factor) in SIGNALS.items()}
    savemat(path, {"Time": log["time_s"], **columns})


@pytest.mark.filterwarnings("ignore::sysid_vehicle.errors.SysidWarning")  # units are converted
@pytest.mark.parametrize("write", [mf4, mcap, vbo, mat], ids=lambda write: write.__name__)
def test_a_raw_log_is_read_with_the_map_that_is_proposed(
    tmp_path: Path, log: sv.Log, truth: sv.Model, write: Callable[[sv.Log, Path], None]
) -> None:
    run, car, channels = (tmp_path / n for n in (f"run.{write.__name__}", "car.toml", "map.toml"))
    write(log, run)
    truth.vehicle.to_toml(car)
    assert main(["map", str(run), "--vehicle", str(car), "-o", str(channels)]) == 0
    found = sv.read_log(run, channels)
    for channel in SIGNALS:
        near = 0.08 if channel == "steer_rad" else 1e-3  # the gear follows from the wheelbase
        scale = float(np.std(found[channel]) / np.std(log[channel]))
        assert scale == pytest.approx(1.0, abs=near), channel


@pytest.mark.parametrize(
    ("channel", "name"),
    [
        ("steer_rad", "SAS_Angle"),
        ("steer_rad", "LWS_ANGLE"),
        ("steer_rad", "LWI_Lenkradwinkel"),
        ("vx_mps", "ESP_v_Signal"),
        ("vx_mps", "Wheel-Based Vehicle Speed"),
        ("vx_mps", "VelForward"),
        ("vx_mps", "Ux_mps"),
        ("yaw_rate_radps", "AngRateDown"),
        ("yaw_rate_radps", "Rate_Body_Z"),
        ("yaw_rate_radps", "/vehicle/status/velocity_status/heading_rate"),
        ("yaw_rate_radps", "r"),
        ("ay_mps2", "Acc_Hor_Y"),
        ("ay_mps2", "aLat"),
        ("ay_mps2", "ayCG_mps2"),
        ("yaw_rate_radps", "dpsi_radps"),
        ("steer_rad", "deltawheel_rad"),
        ("ax_mps2", "AccelForward"),
        ("ax_mps2", "Lon Acc"),
    ],
)
def test_names_of_databases_and_navigation(log: sv.Log, channel: str, name: str) -> None:
    columns = {c: log[c] for c in ("time_s", *SIGNALS) if c != channel} | {name: log[channel]}
    assert sv.propose_channels(columns).channels[channel].column == name


def test_the_only_stamps_are_the_time(log: sv.Log, tmp_path: Path) -> None:
    """Whatever their column is called."""
    begin = np.datetime64("2026-11-27T10:00:00", "ns")
    stamps = begin + np.round(log["time_s"] * 1e9).astype("timedelta64[ns]")
    columns = {"aufgezeichnet": stamps, **{c: log[c] for c in SIGNALS}}
    found = sv.propose_channels(columns)
    assert found.channels["time_s"].column == "aufgezeichnet"
    read = sv.read_log(columns, found.channel_map)
    np.testing.assert_allclose(read["vx_mps"], log["vx_mps"])


@pytest.mark.parametrize("fill", [0.0, np.nan])
@pytest.mark.parametrize("channel", ["vy_mps", "yaw_rate_radps", "ay_mps2", "steer_rad", "vx_mps"])
def test_a_column_that_is_filled_with_one_number(log: sv.Log, channel: str, fill: float) -> None:
    """Loggers write zeros, or nothing, for what is not connected."""
    columns = {c: np.array(log[c]) for c in log.channels} | {channel: np.full(log.n, fill)}
    found = sv.propose_channels(columns)
    assert found.channels[channel].column == channel
    assert found.channels["ax_mps2"].factor == 1.0


def test_a_car_that_stands(log: sv.Log) -> None:
    columns = {c: np.zeros(log.n) for c in log.channels} | {"time_s": log["time_s"]}
    assert set(sv.propose_channels(columns).channels) == set(log.channels)


def test_of_several_clocks_the_one_that_rises_is_taken(tmp_path: Path, log: sv.Log) -> None:
    """As Torque writes them: the clock of the satellites in whole seconds."""
    names = [
        "GPS Time",
        "Device Time",
        "Speed (OBD)(km/h)",
        "Yaw rate(deg/s)",
        "Lateral accel(m/s2)",
    ]
    rows = [
        f"Sat Nov 28 10:00:{int(t):02d} GMT+01:00 2026,28-Nov-2026 10:00:{t:06.3f},"
        f"{3.6 * v},{r / DEG},{a}"
        for t, v, r, a in zip(
            log["time_s"], log["vx_mps"], log["yaw_rate_radps"], log["ay_mps2"], strict=True
        )
    ]
    path = tmp_path / "trackLog.csv"
    path.write_text("\n".join([", ".join(names), *rows]))
    told = sv.propose_channels(path).channels["time_s"]
    assert (told.column, told.others) == ("Device Time", ("GPS Time",))


@pytest.mark.parametrize(
    "names",
    [
        ("velocity", "YawRate", "Longacc", "Latacc", "Steering_Angle"),  # VBOX
        ("FzgGeschw", "GierRate", "LaengsBeschl", "QuerBeschl", "LenkradWinkel"),
        ("VehV_v", "YawRate", "LongAcc", "LatAcc", "StrWhlAng"),
        ("u", "r", "ax", "ay", "delta"),
        ("run(1).vx", "run(1).r", "run(1).ax", "run(1).ay", "run(1).delta"),
        ("Car.vx", "IMU2.yaw_rate", "IMU2.ax", "IMU2.ay", "Column.swa"),
    ],
)
def test_names_of_loggers(log: sv.Log, names: tuple[str, ...]) -> None:
    channels = ("vx_mps", "yaw_rate_radps", "ax_mps2", "ay_mps2", "steer_rad")
    columns = {n: log[c] for n, c in zip(names, channels, strict=True)}
    columns |= {"v": log["vy_mps"]} if "u" in names else {}
    found = sv.propose_channels({"t": log["time_s"], **columns})
    told = {c: found.channels[c].column for c in channels}
    assert told == dict(zip(channels, names, strict=True))
    if "u" in names:
        assert found.channels["vy_mps"].column == "v"


@pytest.mark.parametrize("labelled", [True, False])
def test_what_simulink_leaves_in_the_workspace(tmp_path: Path, log: sv.Log, labelled: bool) -> None:
    """A structure with time for each signal, called like it or without a label."""
    from scipy.io import savemat

    names = {"vx": "vx_mps", "yaw_rate": "yaw_rate_radps", "ay": "ay_mps2", "ax": "ax_mps2",
             "steer": "steer_rad"}  # fmt: skip
    held = {
        n: {"time": log["time_s"], "signals": {"values": log[c], "label": n if labelled else ""}}
        for n, c in names.items()
    }
    savemat(tmp_path / "out.mat", held)
    found = sv.propose_channels(tmp_path / "out.mat")
    assert {p.column: c for c, p in found.channels.items() if c in names.values()} == names
    read = sv.read_log(tmp_path / "out.mat", found.channel_map)
    np.testing.assert_allclose(read["ay_mps2"], log["ay_mps2"])


def test_a_phone_that_logs_as_racechrono_does(tmp_path: Path, log: sv.Log) -> None:
    """Unix time, and rates of rotation."""
    names = ("timestamp", "speed", "x_acc", "y_acc", "z_rate_of_rotation", "steering_angle")
    columns = [
        1.7e9 + log["time_s"],
        log["vx_mps"],
        log["ax_mps2"] / 9.80665,
        log["ay_mps2"] / 9.80665,
        np.degrees(log["yaw_rate_radps"]),
        np.degrees(log["steer_rad"]),
    ]
    rows = [",".join(f"{x:.9f}" for x in row) for row in zip(*columns, strict=True)]
    units = "unix time,m/s,G,G,deg/s,deg"
    path = tmp_path / "session.csv"
    path.write_text("\n".join([",".join(names), units, *rows]))
    found = sv.propose_channels(path)
    assert found.channels["yaw_rate_radps"].column == "z_rate_of_rotation"
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        read = sv.read_log(path, found.channel_map)
    np.testing.assert_allclose(read["yaw_rate_radps"], log["yaw_rate_radps"], atol=1e-8)


@pytest.mark.parametrize(
    "names",
    [
        {"vx_mps": "SOG", "yaw_rate_radps": "imu_gz", "ax_mps2": "imu_ax", "ay_mps2": "imu_ay"},
        {"vx_mps": "Speed", "yaw_rate_radps": "Yaw", "ax_mps2": "LongAcc", "ay_mps2": "LatAcc"},
    ],
)
@pytest.mark.parametrize(
    "units",
    [
        ("knots", "º/s", "m·s⁻²", 1852.0 / 3600.0),
        ("kilometers per hour", "degrees/second", "meters/sec²", 1.0 / 3.6),
        ("m s⁻¹", "degrees per second", "metres per second²", 1.0),
    ],
)
def test_names_and_units_as_loggers_of_satellites_have_them(
    tmp_path: Path, names: dict[str, str], units: tuple[str, str, str, float]
) -> None:
    time_s = 0.02 * np.arange(1500)
    columns = {
        "Time": ("s", time_s),
        names["vx_mps"]: (units[0], (20.0 + np.sin(0.2 * time_s)) / units[3]),
        names["yaw_rate_radps"]: (units[1], np.degrees(0.2 * np.sin(time_s))),
        names["ax_mps2"]: (units[2], 0.2 * np.cos(0.2 * time_s)),
        names["ay_mps2"]: (units[2], 4.0 * np.sin(time_s)),
        "Steering": ("deg", np.degrees(0.03 * np.sin(time_s + 0.1))),
    }
    lines = [",".join(columns), ",".join(f"[{unit}]" for unit, _ in columns.values())]
    lines += [
        ",".join(f"{x:.9f}" for x in row)
        for row in zip(*(v for _, v in columns.values()), strict=True)
    ]
    path = tmp_path / "run.csv"
    path.write_text("\n".join(lines), encoding="utf-8")
    found = sv.propose_channels(path).channels
    assert {c: p.column for c, p in found.items() if c in names} == names
    assert found["vx_mps"].factor == pytest.approx(units[3])
    assert found["yaw_rate_radps"].factor == pytest.approx(np.pi / 180.0)
    assert found["ay_mps2"].factor == 1.0


def test_a_yaw_in_degrees_is_no_yaw_rate() -> None:
    time_s = 0.02 * np.arange(1500)
    columns = {"Time": time_s, "Speed [m/s]": np.full(1500, 20.0), "Yaw [deg]": time_s}
    assert "yaw_rate_radps" in sv.propose_channels(columns).missing
