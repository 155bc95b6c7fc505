"""Raw logs of loggers are read with the channel map that is proposed for them."""

import json
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
