"""Times in other units, of other names, and stamps as spreadsheets and loggers write them."""

import datetime
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from log_formats import FACTORS, FAST, MAP, SLOW, UNITS, check_values, measured
from scipy.io import savemat

from sysid_vehicle.errors import InvalidInput
from sysid_vehicle.read import propose_channels, read_log

SI: dict[str, Any] = {c: {"column": n, "factor": FACTORS.get(c, 1.0)} for c, n in MAP.items()}
START = datetime.datetime(2024, 3, 31, 0, 59, 58, tzinfo=datetime.UTC)


def two_rates(unit_s: float = 1.0) -> dict[str, Any]:
    fast = {n: v for n, v in measured(FAST).items() if n != "Speed"}
    return {
        "imu": {"t": FAST / unit_s, **fast},
        "gps": {"t": SLOW / unit_s, "Speed": measured(SLOW)["Speed"]},
    }


def test_times_that_state_no_unit_are_refused_with_a_remedy_that_works(tmp_path: Path) -> None:
    savemat(tmp_path / "run.mat", two_rates(1e-3))
    with pytest.raises(InvalidInput, match=r"milliseconds; put factor = 0\.001 in the channel map"):
        read_log(tmp_path / "run.mat", SI, check=False)
    check_values(read_log(tmp_path / "run.mat", {**SI, "time_s": {"factor": 0.001}}, check=False))
    pairs: dict[str, Any] = {n: (1e3 * FAST, v) for n, v in measured(FAST).items()}
    log = read_log(pairs, {**SI, "time_s": {"factor": 0.001}}, check=False)
    check_values(log, slow=())


@pytest.mark.parametrize("unit", ["ms", "milliseconds since 2024-01-01 00:00:00"])
def test_times_that_state_their_unit_are_converted(tmp_path: Path, unit: str) -> None:
    h5py: Any = pytest.importorskip("h5py")
    with h5py.File(tmp_path / "run.h5", "w") as file:
        for group, held in two_rates(1e-3).items():
            for name, values in held.items():
                file[f"{group}/{name}"] = values
            file[f"{group}/t"].attrs["units"] = unit
    check_values(read_log(tmp_path / "run.h5", SI, check=False))


def test_coordinates_of_xarray_state_their_unit() -> None:
    xr: Any = pytest.importorskip("xarray")
    data = xr.Dataset(coords={"t": ("t", 1e3 * FAST, {"units": "ms"})})
    for name in UNITS:
        data[name] = ("t", measured(FAST)[name])
    check_values(read_log(data, SI, check=False), slow=())


def test_a_map_names_the_time_of_arrays(tmp_path: Path) -> None:
    """Of any name, beside arrays of other lengths; or the rate, where there is none."""
    fast = measured(FAST)
    path = tmp_path / "run.mat"
    savemat(path, {"Zeit": 1e3 * FAST, **fast, "cal": np.arange(20.0)})
    clock = {"column": "Zeit", "factor": 0.001}
    check_values(read_log(path, {**SI, "time_s": clock}, check=False), slow=())
    with pytest.raises(InvalidInput, match=r"names 'zeitt', which 0 arrays .*did you mean 'Zeit'"):
        read_log(path, {**SI, "time_s": "zeitt"}, check=False)
    savemat(path, {**fast, "cal": np.arange(20.0)})
    with pytest.raises(InvalidInput, match=r"name the time in the channel map"):
        read_log(path, SI, check=False)
    check_values(read_log(path, {**SI, "time_s": {"rate_hz": 100}}, check=False), slow=())


def csv(folder: Path, stamp: Callable[[float], str]) -> Path:
    rows = [",".join([stamp(t), *(f"{measured(t)[n]:.9f}" for n in UNITS)]) for t in FAST]
    path = folder / "run.csv"
    path.write_text("\n".join([",".join(["Time", *UNITS]), *rows]))
    return path


def at(t: float, offset_h: int) -> str:
    moved = START + datetime.timedelta(seconds=float(t), hours=offset_h)
    return f"{moved:%Y-%m-%d %H:%M:%S.%f}+{offset_h:02d}:00"


@pytest.mark.parametrize(
    "stamp",
    [
        lambda t: f"11:59:{58 + t:06.3f} AM" if t < 2 else f"12:00:{t - 2:06.3f} PM",
        lambda t: f"5/31/2026 11:59:{58 + t} pm" if t < 2 else f"6/1/2026 12:00:{t - 2:06.3f} am",
        lambda t: f"59:{58 + t:06.3f}" if t < 2 else f"00:{t - 2:06.3f}",
        lambda t: at(t, 1 if t < 2 else 2),
        lambda t: f"12:00:0{int(t + 1e-6)}:{round(1e3 * t) % 1000:03d}",
        lambda t: f"31-May-2026 23:59:{58 + t}" if t < 2 else f"01-Jun-2026 00:00:{t - 2:06.3f}",
        lambda t: f"31. Mai 2026 23:59:{58 + t}" if t < 2 else f"1 Juni 2026 0:00:{t - 2:06.3f}",
        lambda t: f"Sat Nov 28 {10 + (t > 2)}:00:{t:06.3f} GMT+{1 + (t > 2):02d}:00 2026",
        lambda t: f"Sat Nov 28 10:00:{t:06.3f} 2026",
        lambda t: f"2026/5/31 23:59:{58 + t}" if t < 2 else f"2026/6/1 00:00:{t - 2:06.3f}",
    ],
    ids=["noon", "midnight", "minutes over the hour", "summer time begins", "colon before ms",
         "named month", "German month", "Java's date", "C's date", "year first"],
)  # fmt: skip
def test_stamps(tmp_path: Path, stamp: Callable[[float], str]) -> None:
    log = read_log(csv(tmp_path, stamp), {**SI, "time_s": "Time"}, check=False)
    np.testing.assert_allclose(log["time_s"], FAST, atol=1e-6)


@pytest.mark.parametrize("cell", ["31-Foo-2026 10:00:00", "31-May-26 10:00", "May 2026"])
def test_what_is_no_date_stays_text(tmp_path: Path, cell: str) -> None:
    path = csv(tmp_path, lambda t: cell)
    with pytest.raises(InvalidInput, match=f"first cell is '{cell}'|'{cell}' in line 2"):
        read_log(path, {**SI, "time_s": "Time"}, check=False)


def test_days_of_a_spreadsheet(tmp_path: Path) -> None:
    path = csv(tmp_path, lambda t: f"{45382.5 + t / 86400:.12f}")
    with pytest.raises(InvalidInput, match=r"look like days.*put factor = 86400"):
        read_log(path, {**SI, "time_s": "Time"}, check=False)
    log = read_log(path, {**SI, "time_s": {"column": "Time", "factor": 86400}}, check=False)
    np.testing.assert_allclose(log["time_s"], FAST, atol=1e-4)


def test_days_are_proposed(tmp_path: Path) -> None:
    found = propose_channels(csv(tmp_path, lambda t: f"{45382.5 + t / 86400:.12f}"))
    assert found.channels["time_s"].factor == 86400.0


@pytest.mark.parametrize(("period_s", "name"), [(604800.0, "gps_sow"), (86400.0, "utc_seconds")])
def test_seconds_of_the_week_and_of_the_day_begin_again(
    tmp_path: Path, period_s: float, name: str
) -> None:
    path = csv(tmp_path, lambda t: f"{(period_s - 2.0 + t) % period_s:.3f}")
    path.write_text(path.read_text().replace("Time", name))
    log = read_log(path, {**SI, "time_s": name}, check=False)
    np.testing.assert_allclose(log["time_s"] - log["time_s"][0], FAST, atol=1e-6)
    pairs = {n: ((period_s - 2.0 + FAST) % period_s, v) for n, v in measured(FAST).items()}
    check_values(read_log(pairs, SI, check=False), slow=())
    with pytest.raises(InvalidInput, match="goes back"):
        read_log({"time_s": (100.0 + FAST) % 102.0, **measured(FAST)}, SI, check=False)


@pytest.mark.parametrize("name", ["gps_sow", "iTOW", "GPS TOW", "Seconds of Week"])
def test_names_of_the_time_of_satellites(name: str) -> None:
    data = {"gps_week": np.full(FAST.size, 2345.0), name: 3000.0 + FAST, **measured(FAST)}
    data["Odometer"] = FAST
    assert propose_channels(data).channels["time_s"].column == name


def test_times_that_are_rounded(tmp_path: Path) -> None:
    path = csv(tmp_path, lambda t: f"{t:.1f}")
    with pytest.raises(InvalidInput, match=r"\(359 such samples\).*time_s = { rate_hz = 100 }"):
        read_log(path, {**SI, "time_s": "Time"}, check=False)
    log = read_log(path, {**SI, "time_s": {"rate_hz": 100}}, check=False)
    check_values(log, slow=(), atol=1e-8)


@pytest.mark.parametrize("clock_s", [39_582.0, 100_000.0])
def test_times_of_32_bits_are_even(clock_s: float) -> None:
    """Of the day they come in steps of 4 ms and more, so that no two of 100 Hz are alike."""
    time_s = (clock_s + FAST).astype(np.float32).astype(float)
    assert np.ptp(np.diff(time_s)) > 0.003
    columns: dict[str, Any] = {"time_s": time_s, **measured(FAST)}
    log = read_log(columns, SI, check=False)
    assert log.rate_hz == pytest.approx(100.0, rel=2e-3)
    for channel, name in MAP.items():
        np.testing.assert_allclose(log[channel], SI[channel]["factor"] * columns[name])


@pytest.mark.parametrize("delay_s", [0.0035, 0.015, -0.0123])
def test_a_delay_in_the_map_leaves_white_noise_white(
    delay_s: float, rng: np.random.Generator
) -> None:
    """A straight line between samples would look like a low-pass of the sensor."""
    time_s = 0.01 * np.arange(6000)
    noise = rng.normal(0.0, 0.03, time_s.size)
    data = {
        "time_s": time_s,
        "vx_mps": np.full(time_s.size, 20.0),
        "yaw_rate_radps": 0.1 * np.sin(time_s),
        "ax_mps2": np.zeros(time_s.size),
        "ay_mps2": 2.0 * np.sin(time_s - delay_s) + noise,
        "steer_rad": 0.01 * np.sin(time_s),
    }
    log = read_log(data, {"ay_mps2": {"delay_s": delay_s}}, check=False)
    left = (log["ay_mps2"] - 2.0 * np.sin(time_s))[20:-20]
    assert np.std(left) == pytest.approx(0.03, rel=0.08)
    assert abs(np.corrcoef(left[1:], left[:-1])[0, 1]) < 0.15


def test_a_delayed_input_is_read_off_a_line() -> None:
    """It may step, beside which a sharper interpolation would swing."""
    time_s = 0.01 * np.arange(1000)
    step = np.where(time_s < 5.0, 0.0, -3000.0)
    data = {c: 20.0 + np.sin(time_s) for c in ("vx_mps", "yaw_rate_radps", "ay_mps2", "steer_rad")}
    log = read_log(
        {"time_s": time_s, **data, "fx_n": step}, {"fx_n": {"delay_s": 0.003}}, check=False
    )
    assert np.nanmin(log["fx_n"]) == -3000.0
    assert np.nanmax(log["fx_n"]) == 0.0
