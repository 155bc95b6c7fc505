"""Sensors that drop out to a value that a car may have, and stand there."""

from pathlib import Path

import numpy as np
import pytest

import sysid_vehicle as sv
from sysid_vehicle.errors import SysidWarning
from sysid_vehicle.log import standing
from sysid_vehicle.log.standing import blank_standing

LOST = slice(2000, 2040)


@pytest.fixture(scope="module")
def driven() -> dict[str, np.ndarray]:
    car = sv.Model(sv.example_vehicle())
    log = sv.drive(car, sv.manoeuvres.handling_course(), seed=653451)
    return {name: np.array(log[name]) for name in log.channels}


@pytest.mark.parametrize(
    ("channel", "value"), [("vx_mps", 0.0), ("vx_mps", 120.0), ("yaw_rate_radps", 5.719)]
)
def test_what_stands_between_jumps_is_missing(
    driven: dict[str, np.ndarray], channel: str, value: float
) -> None:
    columns = {**driven, channel: driven[channel].copy()}
    columns[channel][LOST] = value
    with pytest.warns(
        SysidWarning, match=rf"{channel}: jumps to {value:.4g}.*samples 2000 to 2039"
    ):
        log = sv.read_log(columns)
    expected = driven[channel].copy()
    expected[LOST] = np.nan
    np.testing.assert_array_equal(log[channel], expected)


def test_a_speed_that_stops_is_no_dropout(driven: dict[str, np.ndarray]) -> None:
    speed = driven["vx_mps"].copy()
    speed[-600:-400] = np.linspace(speed[-600], 0.0, 200)
    speed[-400:-200] = 0.0
    speed[-200:] = np.linspace(0.0, 8.0, 200)
    assert standing(speed).size == 0


def test_a_speed_sensor_that_reads_zero_at_a_creep_drops_out_nowhere(
    driven: dict[str, np.ndarray],
) -> None:
    """Many read nothing below 3 km/h: the car stops, stands and drives on."""
    time_s = driven["time_s"]
    quiet = np.interp(time_s, time_s[::50], driven["vx_mps"][::50])  # as wheels measure it
    columns = {**driven, "vx_mps": quiet}
    stops = np.concatenate((np.linspace(6.0, 0.0, 150), np.zeros(80), np.linspace(0.0, 6.0, 150)))
    columns["vx_mps"][-stops.size :] = np.where(stops < 0.8, 0.0, stops)
    columns["vx_mps"][-700 : -stops.size] = np.linspace(columns["vx_mps"][-700], 6.0, 700 - 380)
    assert standing(columns["vx_mps"]).size > 0
    told: list[str] = []
    kept = blank_standing(columns, columns["time_s"], told)
    assert told == []
    assert np.isfinite(kept["vx_mps"]).all()


def test_driving_holds_none(driven: dict[str, np.ndarray]) -> None:
    for name in sv.log.MEASURED:
        assert standing(driven[name]).size == 0, name


def test_repeated_values_and_quanta_are_none(driven: dict[str, np.ndarray]) -> None:
    speed = driven["vx_mps"]
    assert standing(np.repeat(speed[::10], 10)).size == 0
    assert standing(np.round(speed, 1)).size == 0
    assert standing(np.zeros(500)).size == 0
    assert standing(np.full(500, np.nan)).size == 0


@pytest.mark.parametrize("lost", [slice(2000, 2001), LOST])
@pytest.mark.parametrize("value", [5753.5, -3276.8])
def test_a_map_is_proposed_beside_dropouts_of_the_steering(
    driven: dict[str, np.ndarray], tmp_path: Path, lost: slice, value: float
) -> None:
    """In whatever unit the column is: no range of the channel tells them yet."""
    columns = {**driven, "steer": np.rad2deg(15.0 * driven["steer_rad"])}
    del columns["steer_rad"]
    right = sv.propose_channels(columns, vehicle=sv.example_vehicle()).channels["steer_rad"]
    columns["steer"] = columns["steer"].copy()
    columns["steer"][lost] = value
    proposal = sv.propose_channels(columns, vehicle=sv.example_vehicle())
    found = proposal.channels["steer_rad"]
    assert found.factor == pytest.approx(right.factor, rel=0.02)
    assert (right.despike, found.despike) == (False, True)
    (tmp_path / "map.toml").write_text(proposal.to_toml())
    with pytest.warns(SysidWarning, match="steer_rad: removed"):
        log = sv.read_log(columns, tmp_path / "map.toml")
    known = np.isfinite(log["steer_rad"])
    near = found.factor * np.rad2deg(15.0 * driven["steer_rad"])
    np.testing.assert_allclose(log["steer_rad"][known], near[known], atol=1e-3)


def test_a_map_is_proposed_beside_dropouts_of_the_speed(driven: dict[str, np.ndarray]) -> None:
    columns = {**driven, "steer": np.rad2deg(15.0 * driven["steer_rad"])}
    del columns["steer_rad"]
    right = sv.propose_channels(columns, vehicle=sv.example_vehicle()).channels["steer_rad"]
    columns["vx_mps"] = driven["vx_mps"].copy()
    columns["vx_mps"][LOST] = 0.0
    found = sv.propose_channels(columns, vehicle=sv.example_vehicle()).channels["steer_rad"]
    assert found.factor == pytest.approx(right.factor, rel=0.02)


def test_a_steering_robot_is_no_dropout() -> None:
    """It turns in a tenth of a second, and stands still but for the quanta of the sensor."""
    time_s = np.arange(3000) * 0.01
    turned = np.interp(time_s, [10.0, 10.1, 11.2, 11.3], [0.0, 40.0, 40.0, 0.0])
    drift = np.where((time_s > 9.0) & (time_s < 12.0), 0.0, 0.2 * np.sin(time_s))
    assert standing(np.round(turned + drift, 1), fewest=1).size == 0
