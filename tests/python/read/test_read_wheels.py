"""Logs without another speed than those of the wheels: the mean of several columns."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import sysid_vehicle as sv
from sysid_vehicle.errors import InvalidInput, SysidWarning

Columns = dict[str, np.ndarray]
WHEELS = {"FL": -1.0, "FR": 1.0, "RL": -1.0, "RR": 1.0}


@pytest.fixture(scope="module")
def right(truth: sv.Model) -> sv.Log:
    return sv.drive(truth, sv.manoeuvres.handling_course(30.0), seed=410738)


@pytest.fixture(scope="module")
def rolling(right: sv.Log) -> Columns:
    """Wheels that roll without slip, the front ones 1 % quicker."""
    columns = {c: np.array(right[c]) for c in right.channels if c not in ("vx_mps", "vy_mps")}
    for wheel, side in WHEELS.items():
        speed = right["vx_mps"] + 0.75 * side * right["yaw_rate_radps"]
        columns[f"WhlSpd_{wheel} [km/h]"] = 3.6 * speed * (1.01 if wheel[0] == "F" else 1.0)
    return columns


def test_a_map_takes_the_mean_of_several(right: sv.Log, rolling: Columns) -> None:
    both: dict[str, Any] = {"column": "WhlSpd_RL [km/h]", "mean_with": ["WhlSpd_RR [km/h]"]}
    pairs: dict[str, Any] = {c: (rolling["time_s"], x) for c, x in rolling.items() if c != "time_s"}
    for source in (rolling, pairs):
        with pytest.warns(SysidWarning, match="the file states 'km/h'"):
            log = sv.read_log(source, {"vx_mps": both})
        np.testing.assert_allclose(log["vx_mps"], right["vx_mps"])
    log = sv.read_log(rolling, {"vx_mps": {**both, "factor": 1.0 / 3.6}})
    np.testing.assert_allclose(log["vx_mps"], right["vx_mps"])


@pytest.mark.parametrize(
    ("front_share", "quicker"), [(None, 1.0), (1.0, 1.0), (0.0, 1.01)], ids=["?", "front", "rear"]
)
def test_the_axle_that_is_not_driven_is_proposed(
    tmp_path: Path, right: sv.Log, rolling: Columns, front_share: float | None, quicker: float
) -> None:
    car = None
    if front_share is not None:
        car = sv.example_vehicle().replace(drive_front_share=front_share)
    found = sv.propose_channels(rolling, vehicle=car)
    assert "not driven" in found.channels["vx_mps"].why
    (tmp_path / "map.toml").write_text(found.to_toml())
    log = sv.read_log(rolling, tmp_path / "map.toml")
    np.testing.assert_allclose(log["vx_mps"], quicker * right["vx_mps"])


def test_another_speed_is_taken_before_them(right: sv.Log, rolling: Columns) -> None:
    columns = rolling | {"VehicleSpeed [m/s]": right["vx_mps"]}
    assert sv.propose_channels(columns).channels["vx_mps"].column == "VehicleSpeed [m/s]"


@pytest.mark.parametrize("unit", ["", " [rpm]", " [rad/s]"])
def test_turns_of_the_wheels_are_no_speed(
    tmp_path: Path, right: sv.Log, rolling: Columns, unit: str
) -> None:
    """They look like one in km/h. The user has to say which radius makes one of them."""
    turned = {n.replace(" [km/h]", unit): x / 3.6 / 0.3 for n, x in rolling.items()}
    turned |= {f"Brake pressure {w}": x for w, x in zip(WHEELS, rolling.values(), strict=False)}
    found = sv.propose_channels(turned)
    assert "vx_mps" in found.missing
    text = found.to_toml()
    assert "nothing was found but wheels; take the axle that is not driven" in text
    left = f'# vx_mps = {{ column = "WhlSpd_RL{unit}", factor = 1.0'
    entry = f'{left}, mean_with = ["WhlSpd_RR{unit}"] }}'
    assert entry in text
    both = text.replace(entry, entry[2:].replace("factor = 1.0", "factor = 0.3"))
    (tmp_path / "map.toml").write_text(both)
    log = sv.read_log(turned, tmp_path / "map.toml")
    np.testing.assert_allclose(log["vx_mps"], right["vx_mps"])


def test_a_proposal_says_how_axes_with_z_down_are_mapped(right: sv.Log) -> None:
    """A log of which all lateral channels are turned round is that of a car in a mirror."""
    turned = ("yaw_rate_radps", "ay_mps2", "vy_mps", "steer_rad")
    sae = {c: (-1.0 if c in turned else 1.0) * right[c] for c in right.channels}
    text = sv.propose_channels(sae).to_toml()
    assert f"turn round the factors of {', '.join(turned)} together" in text
    found = {c: {"column": c, "factor": -1.0 if c in turned else 1.0} for c in right.channels}
    np.testing.assert_array_equal(sv.read_log(sae, found)["ay_mps2"], right["ay_mps2"])


def test_pressures_of_wheels_are_no_hint(rolling: Columns) -> None:
    others = {n.replace("WhlSpd", "p_tyre").split(" [")[0]: x for n, x in rolling.items()}
    assert "nothing was found but" not in sv.propose_channels(others).to_toml()


@pytest.mark.parametrize("others", ["RR", 1, [1], ["RL"], ["RR", "RR"]])
def test_what_is_no_list_of_columns_is_refused(rolling: Columns, others: Any) -> None:
    with pytest.raises(InvalidInput, match="give a list of the columns"):
        sv.read_log(rolling, {"vx_mps": {"column": "RL", "mean_with": others}})


def test_columns_of_different_times_have_no_mean(rolling: Columns) -> None:
    pairs: dict[str, Any] = {c: (rolling["time_s"], x) for c, x in rolling.items() if c != "time_s"}
    late = rolling["time_s"] + 0.004
    pairs["WhlSpd_RR [km/h]"] = late, rolling["WhlSpd_RR [km/h]"]
    both = {"column": "WhlSpd_RL [km/h]", "mean_with": ["WhlSpd_RR [km/h]"], "factor": 1.0 / 3.6}
    with pytest.raises(InvalidInput, match="have no sample at the same time"):
        sv.read_log(pairs, {"vx_mps": both})


def test_a_column_of_the_list_that_is_absent_is_named(rolling: Columns) -> None:
    with pytest.raises(InvalidInput, match="names column 'Hinten', which is not in the file"):
        sv.read_log(rolling, {"vx_mps": {"column": "WhlSpd_RL [km/h]", "mean_with": ["Hinten"]}})
