"""Sideslip angles in place of the lateral speed, and units in the names of columns."""

from pathlib import Path

import numpy as np
import pytest

import sysid_vehicle as sv
from sysid_vehicle.errors import InvalidInput, SysidWarning

DEG = np.pi / 180.0


@pytest.fixture(scope="module")
def right(truth: sv.Model) -> sv.Log:
    return sv.drive(truth, sv.manoeuvres.handling_course(30.0), seed=11, rate_hz=50.0)


@pytest.fixture(scope="module")
def angle(right: sv.Log) -> np.ndarray:
    return np.arctan2(right["vy_mps"], right["vx_mps"])


def without_vy(log: sv.Log) -> dict[str, np.ndarray]:
    return {c: np.array(log[c]) for c in log.channels if c != "vy_mps"}


@pytest.mark.parametrize(
    ("name", "factor"),
    [
        ("beta", 1.0),
        ("Slip Angle", DEG),
        ("body_slip_angle_deg", DEG),
        ("SideSlip", -DEG),
        ("Schwimmwinkel", -1.0),
        ("Sideslip [mrad]", 1e-3),
    ],
)
def test_a_sideslip_angle_is_proposed_with_unit_and_sign(
    right: sv.Log, angle: np.ndarray, name: str, factor: float
) -> None:
    data = without_vy(right) | {name: angle / factor}
    proposal = sv.propose_channels(data)
    proposed = proposal.channels["vy_mps"]
    assert (proposed.column, proposed.sideslip) == (name, True)
    assert proposed.factor == pytest.approx(factor, rel=1e-12)
    assert ("turned round" in proposed.why) == (factor < 0.0)
    log = sv.read_log(data, proposal.channel_map)
    np.testing.assert_allclose(log["vy_mps"], right["vy_mps"], atol=1e-12)


def test_a_mirrored_lateral_speed_is_turned_round(right: sv.Log) -> None:
    data = without_vy(right) | {"vx_mps": 3.6 * right["vx_mps"], "lat vel": -3.6 * right["vy_mps"]}
    data["Speed"] = data.pop("vx_mps")
    proposal = sv.propose_channels(data)
    assert proposal.channels["vy_mps"].factor == pytest.approx(-1.0 / 3.6)
    assert "unit found by the laws of motion" in proposal.channels["vy_mps"].why
    log = sv.read_log(data, proposal.channel_map)
    np.testing.assert_allclose(log["vy_mps"], right["vy_mps"], atol=1e-12)


@pytest.mark.parametrize("factor", [1.0, 1.0 / 3.6, -1.0])
def test_its_unit_is_that_of_the_speed_or_metres_per_second(factor: float) -> None:
    """On a road that leans, with a body that does, its change follows no other channel."""
    t = np.arange(0.0, 240.0, 0.02)
    noise = np.random.default_rng(5).standard_normal((6, t.size))
    speed = 18.0 + 8.0 * np.sin(0.05 * t)
    yaw = 3.0 * np.sin(0.21 * t) * np.sin(0.033 * t) / speed
    ay = speed * yaw
    lateral = 1.4 * yaw - 0.005 * ay * speed + 0.03 * noise[1]
    bank = 0.4 * np.sin(0.021 * t) ** 2 * np.sign(yaw)
    proposed = sv.propose_channels(
        {
            "t": t,
            "speed_kmh": 3.6 * (speed + 0.03 * noise[0]),
            "vy": lateral / factor,
            "yaw_rate_degps": (yaw + 0.002 * noise[2]) / DEG,
            "ax_g": (np.gradient(speed, t) + 0.06 * noise[3]) / 9.80665,
            "ay_g": (1.12 * ay - bank + 0.06 * noise[4]) / 9.80665,
            "steering_wheel_angle_deg": 15.0 * (2.7 * yaw / speed + 0.002 * ay) / DEG,
        }
    ).channels["vy_mps"]
    assert proposed.factor == pytest.approx(factor)
    assert "unit found by the laws of motion" in proposed.why


@pytest.mark.parametrize(
    "name", ["slip angle FL", "rear slip angle", "slip ratio", "beta_dot", "tyre slip angle"]
)
def test_slip_of_a_tyre_is_no_sideslip(right: sv.Log, angle: np.ndarray, name: str) -> None:
    assert "vy_mps" not in sv.propose_channels(without_vy(right) | {name: angle}).channels


def test_the_proposed_file_can_be_read(right: sv.Log, angle: np.ndarray, tmp_path: Path) -> None:
    data = without_vy(right) | {"Slip angle (deg)": angle / DEG}
    path = tmp_path / "map.toml"
    path.write_text(sv.propose_channels(data).to_toml())
    assert "sideslip = true" in path.read_text()
    log = sv.read_log(data, path)
    np.testing.assert_allclose(log["vy_mps"], right["vy_mps"], atol=1e-12)


def test_a_column_of_the_standard_name_needs_no_map(right: sv.Log, angle: np.ndarray) -> None:
    log = sv.read_log(without_vy(right) | {"sideslip_rad": angle})
    np.testing.assert_allclose(log["vy_mps"], right["vy_mps"], atol=1e-12)
    measured = sv.read_log({c: right[c] for c in right.channels} | {"sideslip_rad": 0.0 * angle})
    np.testing.assert_array_equal(measured["vy_mps"], right["vy_mps"])
    ignored = sv.read_log(without_vy(right) | {"sideslip_rad": angle}, {"vy_mps": False})
    assert not ignored.has("vy_mps")


def test_each_sensor_keeps_its_own_times(right: sv.Log, angle: np.ndarray) -> None:
    """The angle at every fifth sample, the speed at every other one and never with the angle.

    The noise of the speed, 0.03 m/s, counts by the tangent of the angle.
    """
    data = without_vy(right) | {"beta": angle.copy()}
    n = np.arange(right.n)
    data["beta"][n % 5 != 1] = np.nan
    data["vx_mps"][(n % 2 == 1) | (n % 5 == 1)] = np.nan
    log = sv.read_log(data, {"vy_mps": {"column": "beta", "sideslip": True}})
    known = np.isfinite(log["vy_mps"])
    np.testing.assert_array_equal(known, n % 5 == 1)
    np.testing.assert_allclose(log["vy_mps"][known], right["vy_mps"][known], atol=0.01)


def test_what_a_standing_car_reads_is_no_lateral_speed(right: sv.Log, angle: np.ndarray) -> None:
    data = without_vy(right) | {"sideslip_rad": angle.copy()}
    data["sideslip_rad"][40:43] = [np.pi / 2, -3.0, 1e4]
    vy = sv.read_log(data)["vy_mps"]
    assert np.isnan(vy[40:43]).all()
    assert np.isfinite(np.delete(vy, [40, 41, 42])).all()


def test_a_stated_unit_of_an_angle_is_converted(right: sv.Log, angle: np.ndarray) -> None:
    data = without_vy(right) | {"Slip [deg]": angle / DEG}
    with pytest.warns(SysidWarning, match="vy_mps: the file states 'deg' and it was converted"):
        log = sv.read_log(data, {"vy_mps": {"column": "Slip [deg]", "sideslip": True}})
    np.testing.assert_allclose(log["vy_mps"], right["vy_mps"], atol=1e-12)


def test_mistakes_in_the_map_are_named(right: sv.Log) -> None:
    with pytest.raises(InvalidInput, match=r"ay_mps2: sideslip = true .* give it for vy_mps"):
        sv.ChannelMap.from_dict({"ay_mps2": {"column": "a", "sideslip": True}})
    with pytest.raises(InvalidInput, match="vy_mps: sideslip = 1; give true or false"):
        sv.ChannelMap.from_dict({"vy_mps": {"column": "a", "sideslip": 1}})


@pytest.mark.parametrize(
    ("name", "factor"), [("speed (km/h)", 1 / 3.6), ("Speed [mph]", 0.44704), ("Speed {m/s} ", 1.0)]
)
def test_a_unit_in_the_name_of_a_column_counts(right: sv.Log, name: str, factor: float) -> None:
    data = {c: np.array(right[c]) for c in right.channels}
    data[name] = data.pop("vx_mps") / factor
    proposed = sv.propose_channels(data).channels["vx_mps"]
    assert proposed.factor == pytest.approx(factor)
    assert "the file states" in proposed.why


@pytest.mark.parametrize("name", ["speed (F)", "speed [CG]", "speed (deg)", "speed []"])
def test_what_else_stands_in_brackets_is_no_unit(right: sv.Log, name: str) -> None:
    data = {c: np.array(right[c]) for c in right.channels}
    data[name] = data.pop("vx_mps")
    log = sv.read_log(data, {"vx_mps": name})  # no warning, which is an error here
    np.testing.assert_array_equal(log["vx_mps"], right["vx_mps"])
