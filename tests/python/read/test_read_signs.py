"""Signals whose size and sign a bus sends apart."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import sysid_vehicle as sv
from sysid_vehicle.errors import InvalidInput

DEG = np.pi / 180.0
RATIO = 15.0


@pytest.fixture(scope="module")
def right(truth: sv.Model) -> sv.Log:
    return sv.drive(truth, sv.manoeuvres.handling_course(40.0), seed=140114)


@pytest.fixture(scope="module")
def sent(right: sv.Log) -> dict[str, np.ndarray]:
    """As the databases of Volkswagen have it: VZ, the sign, is 1 where the value is negative."""
    yaw, steer = right["yaw_rate_radps"] / DEG, RATIO * right["steer_rad"] / DEG
    kept = {c: np.array(right[c]) for c in ("time_s", "vx_mps", "ax_mps2", "ay_mps2")}
    return kept | {
        "ESP_VZ_Gierrate": (yaw < 0.0).astype(float),
        "ESP_Gierrate": np.abs(yaw),
        "LWI_Lenkradwinkel": np.abs(steer),
        "LWI_VZ_Lenkradwinkel": (steer < 0.0).astype(float),
    }


def check(log: sv.Log, right: sv.Log, ratio: float = 1.0) -> None:
    np.testing.assert_allclose(log["yaw_rate_radps"], right["yaw_rate_radps"], atol=1e-9)
    np.testing.assert_allclose(log["steer_rad"], ratio * right["steer_rad"], atol=1e-6)


def test_a_map_names_the_column_of_the_sign(
    tmp_path: Path, right: sv.Log, sent: dict[str, np.ndarray]
) -> None:
    (tmp_path / "map.toml").write_text(
        "[channels]\n"
        f'yaw_rate_radps = {{ column = "ESP_Gierrate", factor = {DEG}, '
        'sign = "ESP_VZ_Gierrate" }\n'
        f'steer_rad = {{ column = "LWI_Lenkradwinkel", factor = {DEG / RATIO}, '
        'sign = "LWI_VZ_Lenkradwinkel" }\n'
    )
    check(sv.read_log(sent, tmp_path / "map.toml"), right)


def test_the_sign_is_proposed(tmp_path: Path, right: sv.Log, sent: dict[str, np.ndarray]) -> None:
    found = sv.propose_channels(sent, vehicle=sv.example_vehicle())
    (tmp_path / "map.toml").write_text(found.to_toml())
    assert found.channels["yaw_rate_radps"].sign == "ESP_VZ_Gierrate"
    ratio = found.channels["steer_rad"].factor * RATIO / DEG
    assert ratio == pytest.approx(1.0, rel=0.15)
    check(sv.read_log(sent, tmp_path / "map.toml"), right, ratio)


def test_a_value_with_a_sign_of_its_own_needs_none(
    right: sv.Log, sent: dict[str, np.ndarray]
) -> None:
    columns = sent | {"ESP_Gierrate": right["yaw_rate_radps"] / DEG}
    assert sv.propose_channels(columns).channels["yaw_rate_radps"].sign == ""


def test_a_sign_that_is_sent_more_seldom_holds(right: sv.Log, sent: dict[str, np.ndarray]) -> None:
    """In a message of its own: until the next one; what comes before the first is unknown."""
    time_s = sent["time_s"]
    beat = slice(3, None, 5)
    negative = (np.arange(time_s.size) // 5 % 2).astype(float)
    pairs: dict[str, Any] = {c: (time_s, x) for c, x in sent.items() if c != "time_s"}
    pairs["steer_rad"] = time_s, right["steer_rad"]
    pairs["size"] = time_s, np.abs(right["yaw_rate_radps"])
    pairs["negative"] = time_s[beat], negative[beat]
    mapping = {"yaw_rate_radps": {"column": "size", "sign": "negative"}}
    log = sv.read_log(pairs, mapping, check=False)
    last = np.maximum((np.arange(time_s.size) - 3) // 5 * 5 + 3, 3)
    expected = np.where(negative[last] > 0.0, -1.0, 1.0) * np.abs(right["yaw_rate_radps"])
    expected[:3] = np.nan
    np.testing.assert_allclose(log["yaw_rate_radps"], expected)


@pytest.mark.parametrize(
    ("sign", "words"),
    [("ESP_VZ_Gier", "names column 'ESP_VZ_Gier', which is not in the file"), (1, "sign = 1")],
)
def test_what_is_no_column_is_named(sent: dict[str, np.ndarray], sign: Any, words: str) -> None:
    with pytest.raises(InvalidInput, match=words):
        sv.read_log(sent, {"yaw_rate_radps": {"column": "ESP_Gierrate", "sign": sign}})


def test_a_size_without_its_sign_is_refused_with_the_remedy(
    right: sv.Log, sent: dict[str, np.ndarray]
) -> None:
    columns = sent | {"steer_rad": right["steer_rad"]}
    with pytest.raises(InvalidInput, match=r"yaw_rate_radps: is never negative.*sign = "):
        sv.read_log(columns, {"yaw_rate_radps": {"column": "ESP_Gierrate", "factor": DEG}})


def test_a_sign_that_is_called_after_the_device_is_proposed(
    right: sv.Log, sent: dict[str, np.ndarray]
) -> None:
    """Without it a steering angle that is never negative was read, with another gear."""
    names = {"LWI_Lenkradwinkel": "SAS1.SAS_Angle", "LWI_VZ_Lenkradwinkel": "SAS1.SAS_Sign"}
    sent = {names.get(name, name): values for name, values in sent.items()}
    found = sv.propose_channels(sent, vehicle=sv.example_vehicle())
    assert found.channels["steer_rad"].sign == "SAS1.SAS_Sign"
    # Of two signals of that device nothing says which one it belongs to.
    both = sent | {"SAS1.SAS_Torque": np.abs(right["yaw_rate_radps"])}
    assert sv.propose_channels(both).channels["steer_rad"].sign == ""


@pytest.mark.parametrize("channel", ["steer_rad", "yaw_rate_radps", "ay_mps2"])
def test_a_size_is_refused_on_a_road_that_turns_one_way_more(channel: str) -> None:
    """Where two thirds of the turns are to the left a size follows the others well enough."""
    t = np.arange(0.0, 120.0, 0.02)
    rng = np.random.default_rng(930511)
    curvature = np.interp(t, np.arange(0.0, 121.0, 4.0), rng.normal(0.015, 0.02, 31))
    speed = 12.0 + 3.0 * np.sin(0.2 * t)
    columns = {
        "time_s": t,
        "vx_mps": speed + 0.02 * rng.standard_normal(t.size),
        "yaw_rate_radps": curvature * speed + 0.002 * rng.standard_normal(t.size),
        "ax_mps2": 0.6 * np.cos(0.2 * t) + 0.05 * rng.standard_normal(t.size),
        "ay_mps2": curvature * speed**2 + 0.05 * rng.standard_normal(t.size),
        "steer_rad": curvature * (2.6 + 0.002 * speed**2) + 1e-4 * rng.standard_normal(t.size),
    }
    sv.read_log(columns)
    with pytest.raises(InvalidInput, match=rf"{channel}: is never negative.*sign = "):
        sv.read_log(columns | {channel: np.abs(columns[channel])})


@pytest.mark.parametrize("name", ["acc_lon", "acc_lon_g"])
def test_a_short_name_of_the_longitudinal_acceleration_is_known(name: str, right: sv.Log) -> None:
    columns = {n: np.array(right[n]) for n in right.channels if n not in ("ax_mps2", "fx_n")}
    columns[name] = right["ax_mps2"] / 9.80665
    assert sv.propose_channels(columns).channels["ax_mps2"].column == name
