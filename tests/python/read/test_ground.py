"""Velocity over ground and heading in place of the speeds of the body."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import sysid_vehicle as sv
from sysid_vehicle.errors import InvalidInput, SysidWarning

DEG = np.pi / 180.0


@pytest.fixture(scope="module")
def right(truth: sv.Model) -> sv.Log:
    return sv.drive(truth, sv.manoeuvres.handling_course(30.0), seed=11, rate_hz=50.0)


@pytest.fixture(scope="module")
def driven(right: sv.Log) -> dict[str, np.ndarray]:
    """The drive as navigation has it; it begins to the south-east."""
    yaw, t = right["yaw_rate_radps"], right["time_s"]
    turned = np.concatenate(([0.0], np.cumsum(0.5 * (yaw[1:] + yaw[:-1]) * np.diff(t))))
    psi = -0.8 + turned
    v_x, v_y = right["vx_mps"], right["vy_mps"]
    kept = {c: np.array(right[c]) for c in right.channels if c not in ("vx_mps", "vy_mps")}
    return kept | {
        "VelEast": v_x * np.cos(psi) - v_y * np.sin(psi),
        "VelNorth": v_x * np.sin(psi) + v_y * np.cos(psi),
        "Heading": (np.degrees(0.5 * np.pi - psi)) % 360.0,
        "Yaw": np.mod(psi + np.pi, 2.0 * np.pi) - np.pi,
        "Speed 2D": np.hypot(v_x, v_y),
        "Track": np.degrees(0.5 * np.pi - psi - np.arctan2(v_y, v_x)) % 360.0,
    }


COMPASS = {"column": "Heading", "factor": DEG}
UNITS = {
    "time_s": "s",
    "yaw_rate_radps": "rad/s",
    "ax_mps2": "m/s2",
    "ay_mps2": "m/s2",
    "steer_rad": "rad",
    "fx_n": "N",
    "VelEast": "km/h",
    "VelNorth": "km/h",
    "Heading": "deg",
    "Yaw": "rad",
    "Speed 2D": "m/s",
    "Track": "deg",
}
VELOCITIES = {"east": "VelEast", "north": "VelNorth"}
MAPS: dict[str, dict[str, Any]] = {
    "compass": {**VELOCITIES, "heading": COMPASS},
    "from east": {**VELOCITIES, "heading": {"column": "Yaw", "from": "east"}},
    "course": {
        "speed": "Speed 2D",
        "course": {"column": "Track", "factor": DEG},
        "heading": COMPASS,
    },
}


@pytest.mark.parametrize("ground", MAPS.values(), ids=MAPS)
def test_the_speeds_of_the_body_come_out(
    right: sv.Log, driven: dict[str, np.ndarray], ground: dict[str, Any]
) -> None:
    log = sv.read_log(driven, {"ground": ground})
    for channel in ("vx_mps", "vy_mps"):
        np.testing.assert_allclose(log[channel], right[channel], atol=1e-9)


def test_it_stands_in_a_file_beside_the_channels(
    tmp_path: Path, right: sv.Log, driven: dict[str, np.ndarray]
) -> None:
    path = tmp_path / "map.toml"
    path.write_text(
        "[channels]\n"
        'steer_rad = { column = "wheel", factor = 0.0625 }\n'
        "[ground]\n"
        'east = "VelEast"\nnorth = { column = "v_n", factor = 0.2777777777777778 }\n'
        f'heading = {{ column = "Heading", factor = {DEG!r}, from = "north" }}\n'
    )
    steer = {"wheel": 16.0 * driven["steer_rad"], "v_n": 3.6 * driven["VelNorth"]}
    data = {c: x for c, x in driven.items() if c not in ("steer_rad", "VelNorth")} | steer
    log = sv.read_log(data, path)
    np.testing.assert_allclose(log["vy_mps"], right["vy_mps"], atol=1e-9)
    np.testing.assert_allclose(log["steer_rad"], right["steer_rad"], atol=1e-12)


def test_each_may_have_times_of_its_own(right: sv.Log, driven: dict[str, np.ndarray]) -> None:
    """Velocities at 10 Hz, the heading at 12.5 Hz between them, late by a tenth of a second."""
    t = right["time_s"]
    data: dict[str, Any] = {
        c: (t, driven[c]) for c in ("yaw_rate_radps", "ax_mps2", "ay_mps2", "steer_rad")
    }
    data |= {c: (t[::5], driven[c][::5]) for c in VELOCITIES.values()}
    data["Heading"] = (t[2:-9:4] + 0.1, driven["Heading"][2:-9:4])
    heading = {"column": "Heading", "factor": DEG, "delay_s": 0.1}
    log = sv.read_log(data, {"ground": {**VELOCITIES, "heading": heading}})
    known = np.isfinite(log["vy_mps"])
    assert 0.8 * len(t) / 5 < np.count_nonzero(known) < 1.05 * len(t) / 5
    expected = np.interp(log["time_s"][known], t, right["vy_mps"])
    assert np.sqrt(np.mean((log["vy_mps"][known] - expected) ** 2)) < 0.06


def test_a_gap_of_the_heading_is_a_gap(driven: dict[str, np.ndarray]) -> None:
    heading = driven["Heading"].copy()
    heading[400:500] = np.nan
    with pytest.warns(SysidWarning, match="no values at samples 400 to 499"):
        log = sv.read_log(driven | {"Heading": heading}, {"ground": MAPS["compass"]})
    assert np.isnan(log["vx_mps"][400:500]).all()
    assert np.isfinite(log["vx_mps"][:399]).all()


def test_units_that_the_file_states_are_converted(
    tmp_path: Path, right: sv.Log, driven: dict[str, np.ndarray]
) -> None:
    factor = {"VelEast": 3.6, "VelNorth": 3.6}
    lines = [",".join(driven), ",".join(UNITS[c] for c in driven)]
    rows = np.column_stack([factor.get(c, 1.0) * x for c, x in driven.items()])
    lines += [",".join(f"{x:.12g}" for x in row) for row in rows]
    path = tmp_path / "log.csv"
    path.write_text("\n".join(lines) + "\n")
    ground = {**VELOCITIES, "heading": "Heading"}
    with pytest.warns(SysidWarning, match="the file states .* and it was converted") as caught:
        log = sv.read_log(path, {"ground": ground})
    assert [str(w.message).split(": ")[1] for w in caught] == ["east", "north", "heading"]
    np.testing.assert_allclose(log["vy_mps"], right["vy_mps"], atol=1e-6)


WRONG: dict[str, tuple[dict[str, Any], str]] = {
    "degrees": (
        {"heading": "Heading"},
        "it turns .* times as yaw_rate_radps; put factor = 0.01745",
    ),
    "another beginning": (
        {"heading": {**COMPASS, "from": "east"}},
        'heading: it turns -1 times as yaw_rate_radps; put from = "north"',
    ),
    "turned aerials": (
        {"heading": {**COMPASS, "offset": 0.5 * np.pi}},
        "the car would move 90 deg to the left of its nose; put offset = .* for it",
    ),
    "the course": (
        {"heading": {"column": "Track", "factor": DEG}},
        "heading: it is the direction of motion, which knows no sideslip",
    ),
    "another column": ({"heading": "ay_mps2"}, "check the columns and the units of both"),
}


@pytest.mark.parametrize(("changed", "message"), WRONG.values(), ids=WRONG)
def test_a_heading_that_cannot_be_right_is_refused(
    driven: dict[str, np.ndarray], changed: dict[str, Any], message: str
) -> None:
    with pytest.raises(InvalidInput, match=message):
        sv.read_log(driven, {"ground": MAPS["compass"] | changed})


def test_the_remedy_of_turned_aerials_helps(right: sv.Log, driven: dict[str, np.ndarray]) -> None:
    turned = driven | {"Heading": driven["Heading"] + 90.0}
    with pytest.raises(InvalidInput, match=r"put offset = (\S+) for it") as caught:
        sv.read_log(turned, {"ground": MAPS["compass"]})
    offset = float(str(caught.value).split("offset = ")[1].split()[0])
    heading = {**COMPASS, "offset": offset}
    log = sv.read_log(turned, {"ground": MAPS["compass"] | {"heading": heading}})
    assert np.max(np.abs(log["vx_mps"] - right["vx_mps"])) < 0.2


def test_a_yaw_rate_to_the_right_is_told_from_the_heading(driven: dict[str, np.ndarray]) -> None:
    mirrored = driven | {"yaw_rate_radps": -driven["yaw_rate_radps"]}
    with pytest.raises(InvalidInput, match="turn the sign of yaw_rate_radps round"):
        sv.read_log(mirrored, {"ground": MAPS["compass"]})


@pytest.mark.parametrize(
    ("ground", "message"),
    [
        ({"east": "VelEast", "heading": "Yaw"}, "it takes heading with east and north"),
        ({**VELOCITIES, "heading": {"column": "Yaw", "from": "south"}}, 'give "north"'),
        ({**VELOCITIES, "head": "Yaw"}, "unknown key 'head'"),
        ({**VELOCITIES, "heading": {"column": "Yaw", "despike": True}}, "unknown key 'despike'"),
        ({**VELOCITIES, "heading": 3.0}, "give a column name or a table"),
    ],
)
def test_a_map_that_says_too_little_is_refused(ground: dict[str, Any], message: str) -> None:
    with pytest.raises(InvalidInput, match=message):
        sv.ChannelMap.from_dict({"ground": ground})


def test_one_speed_comes_from_one_place() -> None:
    channels = {"vx_mps": "Speed 2D"}
    with pytest.raises(InvalidInput, match=r"vx_mps is mapped, and \[ground\] gives it too"):
        sv.ChannelMap.from_dict({"channels": channels, "ground": MAPS["compass"]})


PROPOSED = {
    "compass": (("VelEast", "VelNorth", "Heading"), "north", DEG),
    "yaw from east": (("VelEast", "VelNorth", "Yaw"), "east", 1.0),
    "course": (("Speed 2D", "Track", "Heading"), "north", DEG),
}


@pytest.mark.parametrize(("columns", "start", "factor"), PROPOSED.values(), ids=PROPOSED)
@pytest.mark.parametrize("to_the_right", [False, True])
def test_it_is_proposed_with_units_and_beginning(
    right: sv.Log,
    driven: dict[str, np.ndarray],
    columns: tuple[str, ...],
    start: str,
    factor: float,
    to_the_right: bool,
) -> None:
    channels = ("time_s", "yaw_rate_radps", "ax_mps2", "ay_mps2", "steer_rad", "fx_n")
    data = {c: driven[c] for c in (*channels, *columns)}
    names = {"yaw_rate_radps": "gyro_z", "ay_mps2": "acc_y", "steer_rad": "steer"}
    sign = -1.0 if to_the_right else 1.0
    data = {names.get(c, c): (sign if c in names else 1.0) * x for c, x in data.items()}
    if "VelEast" in columns:
        data |= {c: 3.6 * data[c] for c in ("VelEast", "VelNorth")}
    proposal = sv.propose_channels(data)
    heading = proposal.ground["heading"]
    assert proposal.counted_from == start
    assert heading.factor == pytest.approx(factor)
    assert proposal.missing == ()
    assert "vx_mps" not in proposal.channels
    log = sv.read_log(data, proposal.channel_map)
    np.testing.assert_allclose(log["vy_mps"], right["vy_mps"], atol=1e-9)
    np.testing.assert_allclose(log["yaw_rate_radps"], right["yaw_rate_radps"], atol=1e-9)


def test_the_proposed_file_reads_the_log(
    tmp_path: Path, right: sv.Log, driven: dict[str, np.ndarray]
) -> None:
    channels = ("time_s", "yaw_rate_radps", "ax_mps2", "ay_mps2", "steer_rad")
    data = {c: driven[c] for c in (*channels, "VelEast", "VelNorth", "Heading")}
    path = tmp_path / "map.toml"
    path.write_text(sv.propose_channels(data).to_toml())
    log = sv.read_log(data, path)
    np.testing.assert_allclose(log["vy_mps"], right["vy_mps"], atol=1e-9)


def test_a_lateral_speed_is_taken_before_it(right: sv.Log, driven: dict[str, np.ndarray]) -> None:
    data = driven | {"vx_mps": right["vx_mps"], "vy_mps": right["vy_mps"]}
    assert sv.propose_channels(data).ground == {}


def test_a_course_alone_makes_none(driven: dict[str, np.ndarray]) -> None:
    """Of one aerial the heading is the course: no lateral speed comes of it."""
    channels = ("time_s", "yaw_rate_radps", "ax_mps2", "ay_mps2", "steer_rad")
    proposal = sv.propose_channels({c: driven[c] for c in (*channels, "Speed 2D", "Track")})
    assert proposal.ground == {}
    assert proposal.channels["vx_mps"].column == "Speed 2D"
