"""What version 0.1 wrote is read today, and what is written today has all that stood there.

Programs of users read these files. A key may join; none may go or change its kind unnoticed.
"""

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from sysid_vehicle import Model, Vehicle, drive, manoeuvres, read_log
from sysid_vehicle.cli import main
from sysid_vehicle.lab import IdentifiedCar
from sysid_vehicle.read import ChannelMap

# Their keys are names of channels, effects and parameters: what stands under any of them counts.
NAMED = {"channels", "parameters", "effects", "verdicts", "estimates", "noise", "groups"}


# It was measured with the noise of the incomplete model, and so was next to 1 for every effect.
WITHDRAWN = {
    (".ranking[].predicted_error", "number"),
    # It is called `validation` now.
    (".unknown.held_out", "table"),
    (".unknown.held_out.p_value", "number"),
    (".unknown.held_out.strongest", "text"),
}


@pytest.fixture(scope="module")
def artefacts(repo: Path) -> Path:
    return repo / "tests" / "data" / "artefacts_0_1"


def kinds(value: Any, path: str = "") -> Iterator[tuple[str, str]]:
    """Places in a JSON value with the kind of what stands there; empty ones say nothing."""
    if isinstance(value, dict):
        yield path, "table"
        for key, inner in value.items():
            named = path.rsplit(".", 1)[-1] in NAMED
            yield from kinds(inner, f"{path}.{'*' if named else key}")
    elif isinstance(value, list):
        yield path, "list"
        for inner in value:
            yield from kinds(inner, f"{path}[]")
    elif isinstance(value, bool):
        yield path, "yes or no"
    elif isinstance(value, int | float):
        yield path, "number"
    elif isinstance(value, str):
        yield path, "text"


def lost(old: Any, new: Any) -> set[tuple[str, str]]:
    """What stood in the old value and stands nowhere in the new one.

    Where the new one has an empty list or nothing in the place, its content cannot be judged.
    """
    there = set(kinds(new))
    filled = {_list_of(path) for path, _ in there}
    return {
        (path, kind)
        for path, kind in set(kinds(old)) - there
        if "[]" not in path or _list_of(path) in filled
    }


def _list_of(path: str) -> str:
    """The outermost list in which a place lies; empty outside of lists."""
    return path.split("[]")[0] if "[]" in path else ""


def test_a_vehicle_file(artefacts: Path, tmp_path: Path) -> None:
    car = Vehicle.from_toml(artefacts / "car.toml")
    assert (car.mass_kg, car.lf_m, car.lr_m) == (1250.0, 1.25, 1.35)
    assert (car.tyre_front.B, car.tyre_rear.D) == (10.5, 1.08)
    car.to_toml(tmp_path / "again.toml")
    assert Vehicle.from_toml(tmp_path / "again.toml") == car


def test_a_channel_map(artefacts: Path, tmp_path: Path) -> None:
    channels = ChannelMap.from_toml(artefacts / "map.toml")
    t = 0.02 * np.arange(500)
    yaw = 10.0 * np.sin(t)
    table = np.column_stack(
        [t, yaw, 0.3 * np.sin(t), 40.0 * np.sin(t), 72.0 + np.cos(t), np.cos(t)]
    )
    path = tmp_path / "log.csv"
    np.savetxt(path, table, delimiter=",", comments="",
               header="t,gyro_z_degps,acc_lat_g,hand_wheel_deg,speed_kph,ax")  # fmt: skip
    log = read_log(path, channels, check=False)
    np.testing.assert_allclose(log["yaw_rate_radps"], np.deg2rad(yaw), atol=1e-12)
    np.testing.assert_allclose(log["ay_mps2"], -9.80665 * table[:, 2], atol=1e-12)
    np.testing.assert_allclose(log["vx_mps"], table[:, 4] / 3.6 + 0.5, atol=1e-12)


def test_identified_tyres(artefacts: Path) -> None:
    car = IdentifiedCar.from_json(artefacts / "tyres.json")
    assert car.vehicle.mass_kg == 780.0
    assert car.parameters[0] == pytest.approx(22.0, rel=1e-3)
    assert np.isfinite(car.noise).all()
    stored = json.loads((artefacts / "tyres.json").read_text())
    assert stored["estimates"]["B_front"]["unit"] == "1/rad"


@pytest.mark.manual
def test_todays_reports_have_all_that_stood_there(
    artefacts: Path, truth: Model, tmp_path: Path
) -> None:
    # The drives from which the stored ones were made: an effect is found in them.
    car = truth.add("tyre_load_sensitivity").with_values(
        {"tyre_load_sensitivity.sensitivity": 0.25}
    )
    drive(car, manoeuvres.lap(15.0), seed=1).to_csv(tmp_path / "lap.csv")
    drive(car, manoeuvres.handling_course(15.0), seed=2).to_csv(tmp_path / "course.csv")
    common = ["--vehicle", str(artefacts / "car.toml"), "--json"]
    for command, logs in (
        ("compare", ["lap.csv"]),
        ("diagnose", ["lap.csv", "--test", "course.csv"]),
    ):
        files = [name if name.startswith("--") else str(tmp_path / name) for name in logs]
        out = tmp_path / f"{command}.json"
        assert main([command, *files, *common, str(out)]) == 0
        old = json.loads((artefacts / f"{command}.json").read_text())
        assert lost(old, json.loads(out.read_text())) <= WITHDRAWN, command


def test_what_goes_is_noticed() -> None:
    old = {"a": [{"b": 1.0}], "c": "x", "parameters": {"p": {"value": 1.0}}}
    assert lost(old, old) == set()
    assert lost(old, {**old, "more": 1}) == set()
    assert lost(old, {**old, "a": []}) == set()
    assert lost(old, {**old, "c": 2}) == {(".c", "text")}
    assert lost(old, {**old, "a": [{}]}) == {(".a[].b", "number")}
    assert lost(old, {**old, "parameters": {"q": {"value": 2}}}) == set()
    assert lost(old, {**old, "parameters": {"q": {}}}) == {(".parameters.*.value", "number")}
