"""Arrays as their tools save them: packed, compound, indexed, in other versions of the formats."""

import importlib
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from log_formats import FACTORS, FAST, MAP, SLOW, UNITS, check_values, measured, read_told
from scipy.io import savemat

from sysid_vehicle.errors import InvalidInput, SysidWarning
from sysid_vehicle.read import read_log

SI: dict[str, Any] = {c: {"column": n, "factor": FACTORS.get(c, 1.0)} for c, n in MAP.items()}
TIMED = {**SI, "time_s": "Time"}
STAMPS = np.datetime64("2024-05-01T10:00:00", "ns") + np.round(FAST * 1e9).astype("m8[ns]")


def check(log: Any, atol: float = 1e-9) -> None:
    check_values(log, slow=(), atol=atol)


def test_packed_numbers_of_netcdf(tmp_path: Path) -> None:
    """In netCDF 4, which is HDF5, and in netCDF 3: scale, offset, value for missing."""
    h5py: Any = pytest.importorskip("h5py")
    xr: Any = pytest.importorskip("xarray")
    data = xr.Dataset(coords={"time_s": FAST})
    for name in UNITS:
        data[name] = ("time_s", measured(FAST)[name], {"units": UNITS[name]})
    data["YawRate"][50:60] = np.nan
    packed = {"dtype": "i2", "scale_factor": 0.01, "add_offset": 1.0, "_FillValue": -32768}
    data.to_netcdf(tmp_path / "three.nc", engine="scipy", encoding={"YawRate": packed})
    counts = np.round((data["YawRate"].values - 1.0) / 0.01)
    with h5py.File(tmp_path / "four.nc", "w") as file:
        file["time_s"] = FAST
        for name in UNITS:
            file[name] = measured(FAST)[name]
            file[name].attrs["units"] = UNITS[name]
        del file["YawRate"]
        file["YawRate"] = np.where(np.isnan(counts), -32768, counts).astype("i2")
        for key, value in {**packed, "units": "deg/s"}.items():
            if key != "dtype":
                file["YawRate"].attrs[key] = value
    for name in ("three.nc", "four.nc"):
        told = {c: v if c == "yaw_rate_radps" else SI[c] for c, v in MAP.items()}
        yaw_rate = read_told(tmp_path / name, told)["yaw_rate_radps"]
        np.testing.assert_array_equal(np.flatnonzero(np.isnan(yaw_rate)), np.arange(50, 60))
        exact = np.deg2rad(measured(FAST)["YawRate"])
        np.testing.assert_allclose(
            np.delete(yaw_rate, range(50, 60)), np.delete(exact, range(50, 60)), atol=1e-4
        )


def test_compound_data_sets(tmp_path: Path) -> None:
    h5py: Any = pytest.importorskip("h5py")
    rows = np.zeros(FAST.size, dtype=[("Time", "f8"), *((n, "f8") for n in UNITS), ("g", "S2")])
    rows["Time"] = FAST
    for name in UNITS:
        rows[name] = measured(FAST)[name]
    with h5py.File(tmp_path / "run.h5", "w") as file:
        file["log"] = rows
    check(read_log(tmp_path / "run.h5", TIMED, check=False))


def test_matlab_version_4(tmp_path: Path) -> None:
    savemat(tmp_path / "run.mat", {"Time": FAST, **measured(FAST)}, format="4")
    check(read_log(tmp_path / "run.mat", TIMED, check=False))


def test_a_timetable_of_matlab_names_the_remedy(tmp_path: Path) -> None:
    h5py: Any = pytest.importorskip("h5py")
    with h5py.File(tmp_path / "run.mat", "w") as file:
        file["run"] = np.array([[3707764736, 2, 1, 1, 1, 1]], dtype="u4")
        file["run"].attrs["MATLAB_class"] = np.bytes_(b"timetable")
    with pytest.raises(InvalidInput, match=r"run is an object of MATLAB .*save structs of arrays"):
        read_log(tmp_path / "run.mat", TIMED, check=False)


@pytest.mark.parametrize("name", [None, "Time", "time_s"])
def test_the_index_of_pandas_in_parquet(tmp_path: Path, name: str | None) -> None:
    pd: Any = pytest.importorskip("pandas")
    pytest.importorskip("pyarrow")
    frame = pd.DataFrame(measured(FAST), index=pd.Index(STAMPS, name=name))
    frame.to_parquet(tmp_path / "run.parquet")
    for source in (frame, tmp_path / "run.parquet"):
        check(read_log(source, SI, check=False))
        if name == "Time":
            check(read_log(source, TIMED, check=False))


def test_times_of_day_of_arrow(tmp_path: Path) -> None:
    pa: Any = pytest.importorskip("pyarrow")
    parquet = importlib.import_module("pyarrow.parquet")
    data = pa.table(
        {"Time": [s.time() for s in STAMPS.astype("M8[us]").tolist()], **measured(FAST)}
    )
    parquet.write_table(data, tmp_path / "run.parquet")
    check(read_log(tmp_path / "run.parquet", TIMED, check=False))


def test_a_stream_of_arrow(tmp_path: Path) -> None:
    pa: Any = pytest.importorskip("pyarrow")
    data = pa.table({"Time": FAST, **measured(FAST)})
    path = tmp_path / "run.arrows"
    with path.open("wb") as file, pa.ipc.new_stream(file, data.schema) as writer:
        writer.write_table(data)
    check(read_log(path, TIMED, check=False))


@pytest.mark.parametrize("shape", [(-1, 1), (1, -1)])
def test_arrays_of_one_column_or_row(shape: tuple[int, int]) -> None:
    """As scipy.io.loadmat gives them."""
    data = {"Time": FAST, **measured(FAST)}
    check(read_log({n: v.reshape(shape) for n, v in data.items()}, TIMED, check=False))


@pytest.mark.parametrize("called", ["t_{}", "time_{}", "{}_t", "{}_Time"])
def test_a_time_beside_each_channel(tmp_path: Path, called: str) -> None:
    """Of its own rate, or as long as others and at other times."""
    held: dict[str, np.ndarray] = {}
    for name in UNITS:
        time_s = SLOW if name == "Speed" else FAST
        held[name], held[called.format(name)] = measured(time_s)[name], time_s
    late = FAST + 0.003
    held["LatAcc"], held[called.format("LatAcc")] = measured(late)["LatAcc"], late
    savemat(tmp_path / "run.mat", held)
    with pytest.warns(SysidWarning, match="resampled at 100 Hz"):
        log = read_log(tmp_path / "run.mat", SI, check=False)
    known = np.isfinite(log["vx_mps"])
    assert np.count_nonzero(known) == SLOW.size
    for channel, name in MAP.items():
        rows = known if name == "Speed" else np.arange(2, 390)
        exact = FACTORS.get(channel, 1.0) * measured(log["time_s"][rows])[name]
        np.testing.assert_allclose(
            log[channel][rows], exact, atol=2e-4 if name == "LatAcc" else 1e-9
        )


def test_a_name_that_ends_like_a_time_is_a_channel(tmp_path: Path) -> None:
    held = {"Time": FAST, **measured(FAST), "Steer_t": np.cos(FAST)}
    savemat(tmp_path / "run.mat", held)
    log = read_log(tmp_path / "run.mat", TIMED, check=False)
    check(log)
    np.testing.assert_allclose(log["Steer_t"], np.cos(FAST))


@pytest.mark.parametrize("inside", [False, True])
def test_names_of_the_columns_of_a_matrix(tmp_path: Path, inside: bool) -> None:
    """In a list beside it, as importdata of MATLAB gives them."""
    matrix = np.stack([FAST, *measured(FAST).values()], axis=1)
    names = np.array(["Time", *measured(FAST)], dtype=object)
    held = {"data": matrix, "colheaders": names, "textdata": "a log"}
    savemat(tmp_path / "run.mat", {"log": held} if inside else held)
    check(read_log(tmp_path / "run.mat", TIMED, check=False))


def test_names_of_another_number_name_nothing(tmp_path: Path) -> None:
    matrix = np.stack([FAST, *measured(FAST).values()], axis=1)
    savemat(tmp_path / "run.mat", {"data": matrix, "names": np.array(["a", "b"], dtype=object)})
    with pytest.raises(InvalidInput, match=r"data\(:,1\)"):
        read_log(tmp_path / "run.mat", TIMED, check=False)


def test_channels_that_were_never_recorded_together_are_named() -> None:
    pairs: dict[str, Any] = {n: (FAST, measured(FAST)[n]) for n in UNITS}
    pairs["Speed"] = FAST + 3600.0, measured(FAST)["Speed"]
    with pytest.raises(
        InvalidInput, match=r"and Speed: were never recorded .*ends at 3\.99 s.*3600"
    ):
        read_log(pairs, SI, check=False)
