"""Long tables: a row for each reading, as data bases of time series export them."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from log_formats import FACTORS, FAST, MAP, SLOW, UNITS, check_values, measured, read_told

from sysid_vehicle.errors import InvalidInput, SysidWarning
from sysid_vehicle.read import propose_channels, read_log

SI: dict[str, Any] = {c: {"column": n, "factor": FACTORS.get(c, 1.0)} for c, n in MAP.items()}
Reading = tuple[float, str, float]


def readings(*, by_time: bool = True) -> list[Reading]:
    found = [
        (float(t), name, float(value))
        for name in UNITS
        for times in (SLOW if name == "Speed" else FAST,)
        for t, value in zip(times, measured(times)[name], strict=True)
    ]
    return sorted(found) if by_time else found


def influx(rows: list[Reading]) -> str:
    """As InfluxDB annotates it: a table for each field, names above each again."""
    head = ",result,table,_start,_stop,_time,_value,_field,_measurement,car"
    kinds = "string,long,dateTime:RFC3339,dateTime:RFC3339,dateTime:RFC3339,double,string,string"
    lines = [f"#datatype,{kinds},string", "#group,false,false,true,true,false,false,true,true,true",
             "#default,_result,,,,,,,,"]  # fmt: skip
    begin = np.datetime64("2026-05-31T23:59:58", "ms")
    for k, field in enumerate(UNITS):
        lines += [head] if k == 0 else ["", head]
        for t, name, value in rows:
            if name == field:
                stamp = begin + np.timedelta64(round(1e3 * t), "ms")
                lines.append(f",,{k},2026-05-31T00:00:00Z,2026-06-01T00:00:00Z,{stamp}Z,{value!r},"
                             f"{name},imu,saloon")  # fmt: skip
    return "\n".join(lines) + "\n"


def semicolons(rows: list[Reading]) -> str:
    cells = (f"{1e3 * t:.0f};{n};{v:.9f}".replace(".", ",") for t, n, v in rows)
    return "\n".join(["Time [ms];Series;Value", *cells]) + "\n"


def with_units(rows: list[Reading]) -> str:
    cells = (f"{t:.2f},{n},{v:.9f},{UNITS[n]}" for t, n, v in rows)
    return "\n".join(["timestamp_s,signal_name,value,unit", *cells]) + "\n"


@pytest.mark.parametrize("write", [influx, semicolons])
@pytest.mark.parametrize("by_time", [True, False])
def test_files(tmp_path: Path, write: Callable[[list[Reading]], str], by_time: bool) -> None:
    path = tmp_path / "run.csv"
    path.write_text(write(readings(by_time=by_time)), encoding="utf-8")
    check_values(read_log(path, SI, check=False), atol=1e-8)


def test_units_in_a_column_of_their_own(tmp_path: Path) -> None:
    path = tmp_path / "run.csv"
    path.write_text(with_units(readings()), encoding="utf-8")
    check_values(read_told(path), atol=1e-8)
    found = propose_channels(path)
    assert {c: p.column for c, p in found.channels.items() if c in MAP} == MAP
    assert found.channels["vx_mps"].unit == "km/h"


@pytest.mark.parametrize("library", ["pandas", "polars", "pyarrow"])
def test_tables_in_memory(library: str) -> None:
    module = pytest.importorskip(library)
    time, name, value = zip(*readings(), strict=True)
    columns = {"time": time, "variable": name, "value": value}
    if library == "pandas":
        table = module.DataFrame(columns)
        table["variable"] = table["variable"].astype("category")
    else:
        table = module.DataFrame(columns) if library == "polars" else module.table(columns)
    check_values(read_log(table, SI, check=False))


def test_devices_that_have_fields_of_one_name() -> None:
    time, name, value = (np.array(x) for x in zip(*readings(), strict=True))
    told = {"LongAcc": "x", "LatAcc": "y"}
    both = {
        "time": np.concatenate((time, time)),
        "field": np.array([told.get(n, n) for n in name] * 2),
        "value": np.concatenate((value, 0.5 * value)),
        "device": np.repeat(["imu", "spare"], time.size),
        "quality": np.where(np.arange(2 * time.size) % 3 == 0, "good", "fair"),
    }
    names = {c: f"imu.{told.get(n, n)}" for c, n in MAP.items()}
    log = read_log(both, {c: {**SI[c], "column": n} for c, n in names.items()}, check=False)
    check_values(log)
    np.testing.assert_allclose(log["spare.y"], 0.5 * measured(FAST)["LatAcc"])


@pytest.mark.parametrize("called", ["signal_id", "id", "Series", "metricId"])
@pytest.mark.parametrize("kind", ["file", "memory"])
def test_numbers_in_place_of_names(tmp_path: Path, called: str, kind: str) -> None:
    """The keys of series in a data base; a device may be a number as well."""
    key = {name: k for k, name in enumerate(UNITS, start=17)}
    time, name, value = zip(*readings(), strict=True)
    columns: dict[str, Any] = {"time": time, called: [key[n] for n in name], "value": value}
    source: Any = {n: np.array(cells) for n, cells in columns.items()}
    if kind == "file":
        source = tmp_path / "run.csv"
        rows = zip(*columns.values(), strict=True)
        lines = [",".join(columns), *(f"{t:.2f},{k},{v!r}" for t, k, v in rows)]
        source.write_text("\n".join(lines) + "\n", encoding="utf-8")
    told = {c: {**SI[c], "column": str(key[n])} for c, n in MAP.items()}
    check_values(read_log(source, told, check=False), atol=1e-8)
    with pytest.raises(InvalidInput, match=r"'99', which is not in the file.* 17, 18, "):
        read_log(source, {**told, "vx_mps": "99"}, check=False)


def test_devices_that_are_numbers() -> None:
    time, name, value = (np.array(x * 2) for x in zip(*readings(), strict=True))
    device = np.repeat([4, 7], time.size // 2)
    both = {"time": time, "field": name, "value": np.where(device == 4, value, 0.5 * value),
            "device_id": device}  # fmt: skip
    names = {c: {**SI[c], "column": f"4.{n}"} for c, n in MAP.items()}
    log = read_log(both, names, check=False)
    check_values(log)
    np.testing.assert_allclose(log["7.LatAcc"], 0.5 * measured(FAST)["LatAcc"])


def test_text_among_the_readings(tmp_path: Path) -> None:
    rows = "\n".join(f"{t:.2f},Gear,{'D' if t < 2.0 else 'N'},-" for t in FAST)
    path = tmp_path / "run.csv"
    path.write_text(with_units(readings()) + rows + "\n", encoding="utf-8")
    with pytest.warns(SysidWarning, match=r"1 channel is left out, with no numbers: Gear \(text\)"):
        check_values(read_log(path, SI, check=False), atol=1e-8)
    with pytest.raises(InvalidInput, match=r"'Gear', which cannot be read"):
        read_log(path, {**SI, "ax_mps2": "Gear"}, check=False)


def test_wide_tables_with_text_are_wide() -> None:
    wide = {"time_s": FAST, "note": np.array(["go"] * 399 + ["end"]), **measured(FAST)}
    np.testing.assert_array_equal(read_log({**wide, "value": FAST}, SI, check=False)["value"], FAST)
    with pytest.raises(InvalidInput, match="missing column"):
        read_log({"time": FAST, "driver": np.array(["A", "B"] * 200), "speed": FAST, "x": FAST})
