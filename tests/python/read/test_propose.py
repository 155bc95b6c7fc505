"""Channel maps that are proposed: names, units, signs and swaps are found."""

import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import sysid_vehicle as sv
from sysid_vehicle.cli import main
from sysid_vehicle.errors import InvalidInput

DEG, G = np.pi / 180.0, 9.80665
CHANNELS = ("vx_mps", "yaw_rate_radps", "ax_mps2", "ay_mps2", "steer_rad")

# Names as loggers have them, with what each is multiplied by to get there.
LOGGERS: dict[str, dict[str, tuple[str, float]]] = {
    "MoTeC": {
        "time_s": ("Time", 1.0),
        "vx_mps": ("Corr Speed", 3.6),
        "yaw_rate_radps": ("Gyro Yaw Velocity", 1 / DEG),
        "ax_mps2": ("G Force Long", 1 / G),
        "ay_mps2": ("G Force Lat", -1 / G),
        "steer_rad": ("Steered Angle", -1 / DEG),
    },
    "CAN": {
        "time_s": ("timestamps", 1e3),
        "vx_mps": ("VehicleSpeed", 3.6),
        "yaw_rate_radps": ("ESP_YawRate", 1 / DEG),
        "ax_mps2": ("ESP_LongAcc", 1.0),
        "ay_mps2": ("ESP_LatAcc", 1.0),
        "steer_rad": ("SteeringWheelAngle", 15.0 / DEG),
    },
    "ROS": {
        "time_s": ("t", 1.0),
        "vx_mps": ("/odom/twist/twist/linear/x", 1.0),
        "yaw_rate_radps": ("/imu/angular_velocity/z", 1.0),
        "ax_mps2": ("/imu/linear_acceleration/x", 1.0),
        "ay_mps2": ("/imu/linear_acceleration/y", 1.0),
        "steer_rad": ("/vehicle/steering_angle", 1.0),
    },
    "z down": {
        "time_s": ("time", 1.0),
        "vx_mps": ("speed", 1 / 0.44704),
        "yaw_rate_radps": ("gyro_z", -1.0),
        "ax_mps2": ("acc_x", -1.0),
        "ay_mps2": ("acc_y", 1.0),
        "steer_rad": ("hand_wheel", 15.0),
    },
    "model car": {
        "time_s": ("t", 1.0),
        "vx_mps": ("vx", 1.0),
        "yaw_rate_radps": ("imu_gyro_z", 1.0),
        "ax_mps2": ("imu_acc_x", 1.0),
        "ay_mps2": ("imu_acc_y", 1.0),
        "steer_rad": ("servo_cmd_rad", 1.0),
    },
    "German": {
        "time_s": ("Zeit", 1.0),
        "vx_mps": ("Geschwindigkeit", 3.6),
        "yaw_rate_radps": ("Gierrate", 1 / DEG),
        "ax_mps2": ("Laengsbeschleunigung", 1.0),
        "ay_mps2": ("Querbeschleunigung", 1.0),
        "steer_rad": ("Lenkradwinkel", 15.0 / DEG),
    },
}
_NAMES = {
    "French": "Temps|Vitesse|Vitesse de lacet|Accélération longitudinale|Accélération latérale"
    "|Angle volant",
    "Italian": "Tempo|Velocità|Velocità di imbardata|Accelerazione longitudinale"
    "|Accelerazione laterale|Angolo sterzo",
    "Spanish": "Tiempo|Velocidad|Velocidad de guiñada|Aceleración longitudinal"
    "|Aceleración lateral|Ángulo de volante",
    "Japanese": "時間|車速|ヨーレート|前後加速度|横加速度|操舵角",
    "umlauts": "Zeit|Geschwindigkeit|Gierrate|Längsbeschleunigung|Querbeschleunigung|Lenkradwinkel",
}
LOGGERS |= {
    language: dict(
        zip(
            ("time_s", *CHANNELS),
            zip(names.split("|"), (1.0, 3.6, 1 / DEG, 1.0, 1.0, 15.0 / DEG), strict=True),
            strict=True,
        )
    )
    for language, names in _NAMES.items()
}
LOGGERS["units at the end"] = {
    "time_s": ("epoch_ms", 1e3),
    "vx_mps": ("vx_kmh", 3.6),
    "yaw_rate_radps": ("imu_gyro_z_dps", 1 / DEG),
    "ax_mps2": ("ax_g", 1 / G),
    "ay_mps2": ("ay_g", 1 / G),
    "steer_rad": ("steer_deg", 1 / DEG),
}
LOGGERS["shortened"] = {
    "time_s": ("t", 1.0),
    "vx_mps": ("ABS.VehSpd", 3.6),
    "yaw_rate_radps": ("IMU.YawRate_deg_s", 1 / DEG),
    "ax_mps2": ("IMU.LgtAcc_m_s2", 1.0),
    "ay_mps2": ("IMU.LatAcc_m_s2", 1.0),
    "steer_rad": ("EPS.StrWhlAng", 15.0 / DEG),
}
OTHERS = (
    "WheelSpeed_FL",
    "ABS.WhlSpdFR",
    "ECM.EngSpd",
    "Engine RPM",
    "SteeringTorque",
    "Lap Time",
    "Oil Temp",
    "acc_z",
)


@pytest.fixture(scope="module")
def right(truth: sv.Model) -> sv.Log:
    return sv.drive(truth, sv.manoeuvres.handling_course(30.0), seed=7, rate_hz=50.0)


def renamed(log: sv.Log, names: dict[str, tuple[str, float]]) -> dict[str, np.ndarray]:
    rng = np.random.default_rng(3)
    data = {other: rng.normal(size=log.n) for other in OTHERS}
    data.update({name: log[channel] * factor for channel, (name, factor) in names.items()})
    return data


def found(data: Any, right: sv.Log, channels: tuple[str, ...] = CHANNELS) -> sv.Log:
    """Read with the proposed map, and hold every channel against the right one.

    Left and right may be exchanged in all lateral channels together: nothing in a log tells.
    """
    proposal = sv.propose_channels(data)
    assert proposal.missing == ()
    log = sv.read_log(data, proposal.channel_map, check=False)
    side = np.sign(log["ay_mps2"] @ right["ay_mps2"])
    for channel in channels:
        wanted = 1.0 if channel in ("vx_mps", "ax_mps2") else side
        ratio = float(log[channel] @ right[channel]) / float(right[channel] @ right[channel])
        assert ratio == pytest.approx(wanted, abs=0.02), channel
    return log


@pytest.mark.parametrize("logger", LOGGERS)
def test_names_units_and_signs(right: sv.Log, logger: str) -> None:
    names = LOGGERS[logger]
    gear = abs(names["steer_rad"][1]) in (15.0, 15.0 / DEG)
    data = renamed(right, names)
    proposal = sv.propose_channels(data)
    assert {c: p.column for c, p in proposal.channels.items()} == {
        c: name for c, (name, _) in names.items()
    }
    log = found(data, right, CHANNELS[:-1] if gear else CHANNELS)
    np.testing.assert_allclose(log["time_s"], right["time_s"], atol=1e-9)
    if gear:  # as well as the wheelbase and the understeer are usual
        ratio = np.std(log["steer_rad"]) / np.std(right["steer_rad"])
        assert 0.6 < ratio < 1.6
        assert "steering ratio of about" in proposal.channels["steer_rad"].why
    sv.read_log(data, proposal.channel_map)  # it passes every check of a log


@pytest.mark.parametrize("unit", [1.0, 3.6, 1 / 0.44704])
@pytest.mark.parametrize("speed", [1.0, 3.6])
def test_a_lateral_speed_has_a_unit_of_its_own(right: sv.Log, unit: float, speed: float) -> None:
    names = {**LOGGERS["CAN"], "vx_mps": ("speed", speed), "vy_mps": ("vy", unit)}
    proposal = sv.propose_channels(renamed(right, names))
    assert proposal.channels["vy_mps"].factor == pytest.approx(1.0 / unit, rel=1e-6)


def test_a_unit_in_the_name_is_no_word_of_it(right: sv.Log) -> None:
    why = {c: p.why for c, p in sv.propose_channels(
        renamed(right, LOGGERS["units at the end"])
    ).channels.items()}  # fmt: skip
    assert "in 'g', as its name ends" in why["ay_mps2"]
    assert "in 'deg', as its name ends" in why["steer_rad"]
    assert "in 'ms', as its name ends" in why["time_s"]
    shortened = sv.propose_channels(renamed(right, LOGGERS["shortened"]))
    assert "in 'deg/s', as its name ends" in shortened.channels["yaw_rate_radps"].why
    assert "in 'm/s2', as its name ends" in shortened.channels["ax_mps2"].why


def test_swapped_accelerations_are_found(right: sv.Log) -> None:
    names = dict(LOGGERS["ROS"])
    names["ax_mps2"], names["ay_mps2"] = names["ay_mps2"], names["ax_mps2"]
    proposal = sv.propose_channels(renamed(right, names))
    assert proposal.channels["ay_mps2"].column == "/imu/linear_acceleration/x"
    assert "swapped against its name" in proposal.channels["ay_mps2"].why
    assert "rises" not in proposal.to_toml()
    found(renamed(right, names), right)


@pytest.mark.parametrize(("unit", "factor"), [(1.0, 1.0), (1e-3, 1e3), (-1e-3, -1e3), (-1.0, -1.0)])
def test_a_force_without_unit_is_told_by_the_mass_that_it_moves(
    right: sv.Log, unit: float, factor: float
) -> None:
    data = renamed(right, {c: (c, 1.0) for c in right.channels if c != "fx_n"})
    data["WheelForce"] = unit * right["fx_n"]
    proposed = sv.propose_channels(data).channels["fx_n"]
    assert (proposed.column, proposed.factor) == ("WheelForce", factor)
    assert sv.read_log(data, sv.propose_channels(data).channel_map).has("fx_n")


def test_canonical_names_are_taken_as_they_are(right: sv.Log) -> None:
    proposal = sv.propose_channels(right)
    assert {c: (p.column, p.factor) for c, p in proposal.channels.items()} == {
        c: (c, 1.0) for c in right.channels
    }


def test_a_stated_unit_counts_more_than_a_usual_size(tmp_path: Path, right: sv.Log) -> None:
    slow = {name: right[name] for name in right.channels}
    names, units = list(slow), ["s", "m/s", "m/s", "deg/s", "m/s2", "g", "rad", "kN"]
    slow["yaw_rate_radps"] = slow["yaw_rate_radps"] / DEG
    slow["ay_mps2"], slow["fx_n"] = slow["ay_mps2"] / G, slow["fx_n"] * 1e-3
    assert names == [*("time_s", "vx_mps", "vy_mps", "yaw_rate_radps", "ax_mps2", "ay_mps2"),
                     *("steer_rad", "fx_n")]  # fmt: skip
    rows = [",".join(map(repr, map(float, row))) for row in zip(*slow.values(), strict=True)]
    path = tmp_path / "run.csv"
    path.write_text("\n".join([",".join(names), ",".join(units), *rows]))
    factors = {c: p.factor for c, p in sv.propose_channels(path).channels.items()}
    assert factors["fx_n"] == 1000.0
    assert factors["ay_mps2"] == pytest.approx(G)
    assert factors["yaw_rate_radps"] == pytest.approx(DEG)


@pytest.fixture(scope="module")
def minute(truth: sv.Model) -> sv.Log:
    return sv.drive(truth, sv.manoeuvres.handling_course(60.0), seed=8, rate_hz=50.0)


@pytest.mark.parametrize("gear", [1.0, 11.5, 16.4])
def test_the_wheelbase_of_the_car_tells_its_steering_gear(
    minute: sv.Log, truth: sv.Model, gear: float
) -> None:
    data = {name: minute[name] for name in minute.channels if name != "steer_rad"}
    data["Steered Angle"] = -gear * minute["steer_rad"] / DEG
    proposed = sv.propose_channels(data, vehicle=truth.vehicle).channels["steer_rad"]
    assert proposed.factor == pytest.approx(-DEG / gear, rel=0.08)
    assert f"wheelbase of {truth.vehicle.wheelbase_m:.3g} m" in proposed.why
    assert "turned round" in proposed.why


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_a_lateral_speed_changes_as_the_others_ask(side: float) -> None:
    """At speed the body turns in as much as out: the path of the rear axle tells no sign."""
    model = sv.Model(sv.example_vehicle())
    drive = sv.drive(model, sv.manoeuvres.sine_sweep(), seed=62, rate_hz=50.0)
    data = {name: drive[name] for name in ("time_s", "vx_mps", "ax_mps2", "ay_mps2")}
    data["GyroZ_radps"] = side * drive["yaw_rate_radps"]
    data["SteeringAngle_rad"] = side * drive["steer_rad"]
    data["GpsLateralVelocity_mps"] = drive["vy_mps"]
    proposed = sv.propose_channels(data).channels
    assert proposed["ay_mps2"].factor == side
    assert proposed["vy_mps"].factor == side


def test_the_steering_gear_is_told_with_what_it_may_be_off_by(minute: sv.Log) -> None:
    """At one speed understeer looks like another wheelbase."""
    car = sv.example_vehicle()
    stable = car.replace(tyre_rear=replace(car.tyre_rear, B=1.8 * car.tyre_rear.B))
    fast = sv.manoeuvres.slalom(60.0, 30.0, 4.0, 60.0)
    wide = {}
    for drive in (minute, sv.drive(sv.Model(stable), fast, seed=61, rate_hz=50.0)):
        data = {name: drive[name] for name in drive.channels if name != "steer_rad"}
        data["Steering Wheel Angle"] = 15.0 * drive["steer_rad"] / DEG
        why = sv.propose_channels(data, vehicle=car).channels["steer_rad"].why
        found = re.search(r"about [\d.]+ \(([\d.]+) to ([\d.]+)\) was found", why)
        assert found is not None, why
        low, high = float(found[1]), float(found[2])
        assert low < 15.0 < high
        wide[drive.name] = high / low
    assert min(wide.values()) < 2.0 < 4.0 < max(wide.values())


def test_steering_that_is_not_of_this_car_is_told(minute: sv.Log, truth: sv.Model) -> None:
    """Its name says that it is the angle of the road wheels."""
    data = {name: minute[name] for name in minute.channels}
    data["steer_rad"] = 1.7 * data["steer_rad"]
    proposed = sv.propose_channels(data, vehicle=truth.vehicle).channels["steer_rad"]
    assert proposed.factor == 1.0
    assert "times what a wheelbase of 2.6 m asks for: check both" in proposed.why


@pytest.mark.parametrize("name", ["stamp", "header.stamp", "elapsed [s]", "Seconds", "n"])
def test_a_clock_of_any_name(right: sv.Log, name: str) -> None:
    data = {name: right["time_s"] + 1.7e9, "speed": right["vx_mps"], "count": np.ones(right.n)}
    found = sv.propose_channels(data).channels["time_s"]
    assert (found.column, found.factor) == (name, 1.0)
    assert ("the only column that always rises" in found.why) == (name == "n")
    data["other"] = 2.0 * right["time_s"]
    assert ("time_s" in sv.propose_channels(data).channels) == (name != "n")


@pytest.mark.parametrize("finer", [1e3, 1e6, 1e9])
def test_a_clock_that_is_called_seconds_and_counts_finer(right: sv.Log, finer: float) -> None:
    columns = {c: right[c] for c in right}
    columns["time_s"] = 1.7e9 * finer + np.round(finer * right["time_s"])
    found = sv.propose_channels(columns)
    assert found.channels["time_s"].factor == pytest.approx(1.0 / finer)
    assert "steps of" in found.channels["time_s"].why
    assert found.channels["vx_mps"].factor == pytest.approx(1.0)


def test_what_is_not_found_is_left_to_fill_in() -> None:
    data = {"time": np.arange(200) * 0.01, "speed": np.full(200, 20.0), "x1": np.zeros(200)}
    proposal = sv.propose_channels(data)
    assert proposal.missing == ("yaw_rate_radps", "ay_mps2", "steer_rad")
    assert '# steer_rad = { column = "", factor = 1.0 }' in proposal.to_toml()


def test_on_the_command_line(
    tmp_path: Path, right: sv.Log, capsys: pytest.CaptureFixture[str]
) -> None:
    data = renamed(right, LOGGERS["MoTeC"])
    rows = [",".join(map(repr, map(float, row))) for row in zip(*data.values(), strict=True)]
    (tmp_path / "run.csv").write_text("\n".join([",".join(data), *rows]))
    target = tmp_path / "map.toml"
    assert main(["map", str(tmp_path / "run.csv"), "-o", str(target)]) == 0
    assert capsys.readouterr().out == target.read_text("utf-8")
    log = sv.read_log(tmp_path / "run.csv", target)
    np.testing.assert_allclose(abs(log["ay_mps2"]), abs(right["ay_mps2"]), atol=1e-9)
    car, again = tmp_path / "car.toml", tmp_path / "checked.toml"
    sv.example_vehicle().to_toml(car)
    run = ["check", str(tmp_path / "run.csv"), "--vehicle", str(car), "--map", str(again)]
    assert main(run) == 0
    assert "vy_mps" in capsys.readouterr().out
    assert set(sv.ChannelMap.from_toml(again).sources) == set(
        sv.ChannelMap.from_toml(target).sources
    )
    assert main([*run, "--channels", str(target)]) == 2
    assert "--map, --channels: give one" in capsys.readouterr().err
    assert main(run) == 0  # what is written is what is there
    edited = again.read_text("utf-8") + "# by hand\n"
    again.write_text(edited, "utf-8")
    capsys.readouterr()
    assert main(run) == 2
    assert "read it with --channels" in capsys.readouterr().err
    assert again.read_text("utf-8") == edited
    assert main(["map", str(tmp_path / "run.csv"), "-o", str(tmp_path / "run.csv")]) == 2
    assert "is also an input" in capsys.readouterr().err


def test_names_that_toml_cannot_hold() -> None:
    data = {"time\n": np.arange(9.0), "speed": np.arange(9.0)}
    proposal = sv.propose_channels({'speed "x" \\': np.arange(9.0), "time": np.arange(9.0)})
    import sysid_vehicle._common.files as files

    text = files.tomllib.loads(proposal.to_toml())["channels"]["vx_mps"]["column"]
    assert text == 'speed "x" \\'
    with pytest.raises(InvalidInput, match="control character"):
        sv.propose_channels(data).to_toml()


def test_what_is_wrong_with_a_file_is_said_with_its_name(tmp_path: Path) -> None:
    (tmp_path / "nothing.csv").write_text("")
    with pytest.raises(InvalidInput, match=r"nothing\.csv: the file holds nothing"):
        sv.propose_channels(tmp_path / "nothing.csv")
