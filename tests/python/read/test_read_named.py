"""Arrays whose names and units stand beside them: structs of MATLAB, matrices in HDF5."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from log_formats import FACTORS, FAST, MAP, SLOW, UNITS, check_values, measured, read_told, table

from sysid_vehicle.errors import InvalidInput, SysidWarning
from sysid_vehicle.read import read_log


def test_a_factor_of_one_says_that_the_stated_unit_is_wrong(tmp_path: Path) -> None:
    """It was converted all the same, and no factor but 1.0000001 could say otherwise."""
    from asammdf import MDF, Signal

    metres = {n: FACTORS.get(c, 1.0) * measured(FAST)[n] for c, n in MAP.items()}
    units = UNITS | {"Speed": "km/h"}
    signals = [
        Signal(x, FAST, name=n, unit=units[n] if n == "Speed" else "") for n, x in metres.items()
    ]
    with MDF() as file:
        file.append(signals)
        file.save(tmp_path / "log.mf4", overwrite=True)
    given = {**MAP, "vx_mps": {"column": "Speed", "factor": 1.0}}
    log = read_log(tmp_path / "log.mf4", given, check=False)
    np.testing.assert_allclose(log["vx_mps"], metres["Speed"])
    (tmp_path / "map.toml").write_text(
        "[channels]\n"
        + "".join(f'{c} = "{n}"\n' for c, n in MAP.items() if c != "vx_mps")
        + 'vx_mps = { column = "Speed", factor = 1.0 }\n'
    )
    log = read_log(tmp_path / "log.mf4", tmp_path / "map.toml", check=False)
    np.testing.assert_allclose(log["vx_mps"], metres["Speed"])
    for said in ({"offset": 0.0}, {"delay_s": 0.0}, {"factor": 1.0, "as_stated": True}):
        given["vx_mps"] = {"column": "Speed", **said}
        with pytest.warns(SysidWarning, match="the file states 'km/h'"):
            log = read_log(tmp_path / "log.mf4", given, check=False)
        np.testing.assert_allclose(log["vx_mps"], metres["Speed"] / 3.6)


def sampled(name: str) -> tuple[np.ndarray, np.ndarray]:
    time_s = SLOW if name == "Speed" else FAST
    return time_s, measured(time_s)[name]


def test_structs_of_matlab_state_their_units(tmp_path: Path) -> None:
    """The unit beside the data was not looked at: 72 km/h were 72 m/s."""
    from scipy.io import savemat

    signals = {}
    for name, unit in UNITS.items():
        time_s, values = sampled(name)
        signals[name] = {"time": time_s, "data": values, "unit": unit}
    savemat(tmp_path / "log.mat", {"run": signals})
    check_values(read_told(tmp_path / "log.mat"))


def test_an_array_of_structs_has_the_names_that_they_hold(tmp_path: Path) -> None:
    """They were called signals(1) to signals(5), and nobody could tell which was which."""
    from scipy.io import savemat

    fields = [(field, object) for field in ("Name", "Unit", "Time", "Data")]
    array = np.zeros(len(UNITS), dtype=fields)
    for k, (name, unit) in enumerate(UNITS.items()):
        array[k] = (name, unit, *sampled(name))
    savemat(tmp_path / "log.mat", {"signals": array})
    check_values(read_told(tmp_path / "log.mat"))


def test_an_attribute_names_the_columns_of_a_matrix(tmp_path: Path) -> None:
    import h5py

    columns = table()
    units: list[Any] = ["s" if name == "time_s" else UNITS[name] for name in columns]
    with h5py.File(tmp_path / "log.h5", "w") as file:
        held = file.create_dataset("data", data=np.column_stack(list(columns.values())))
        held.attrs["columns"] = list(columns)
        held.attrs["units"] = units
    check_values(read_told(tmp_path / "log.h5"))
    with h5py.File(tmp_path / "log.h5", "a") as file:
        del file["data"].attrs["units"]
    told = {c: {"column": name, "factor": FACTORS.get(c, 1.0)} for c, name in MAP.items()}
    check_values(read_log(tmp_path / "log.h5", told, check=False))


def test_a_needed_channel_that_nothing_names_is_refused_with_all_that_is_left() -> None:
    """Channels with times of their own that were not used were not listed, the speed among them."""
    slow, fast = 0.02 * np.arange(500), 0.01 * np.arange(1000)
    recording = {
        "/state/linear/x": (slow, np.full(500, 20.0)),
        "/imu/gyro_z": (fast, np.sin(fast)),
        "/imu/acc_y": (fast, np.sin(fast)),
        "/eps/angle": (fast, np.sin(fast)),
    }
    channels = {
        "yaw_rate_radps": "/imu/gyro_z",
        "ay_mps2": "/imu/acc_y",
        "steer_rad": "/eps/angle",
    }
    with pytest.raises(InvalidInput, match=r"missing column vx_mps; .* yet are /state/linear/x\)"):
        read_log(recording, channels)
