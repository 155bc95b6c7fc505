"""What else may hold a log: other encodings, comments, units, time stamps, tables in memory."""

import datetime
import time
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import pytest

from sysid_vehicle.errors import InvalidInput, SysidWarning
from sysid_vehicle.log import Log
from sysid_vehicle.read import read_log

HEADER = "time_s,vx_mps,yaw_rate_radps,ax_mps2,ay_mps2,steer_rad"
ROWS = ["0,20,0.1,0,2,0.01", "0.01,21,0.2,0.5,4,0.02", "0.02,22,0.3,1,6,0.03"]
COLUMNS: dict[str, list[float]] = {
    name: [float(row.split(",")[k]) for row in ROWS] for k, name in enumerate(HEADER.split(","))
}


def write(folder: Path, *lines: str, encoding: str = "utf-8") -> Path:
    path = folder / "run.csv"
    path.write_bytes("\n".join(lines).encode(encoding))
    return path


def read(path: Path, channels: Any = None) -> Log:
    return read_log(path, channels, check=False)


@pytest.mark.parametrize("encoding", ["utf-16", "utf-16-le", "utf-16-be", "utf-32"])
def test_other_encodings_of_text(tmp_path: Path, encoding: str) -> None:
    log = read(write(tmp_path, HEADER, *ROWS, encoding=encoding))
    np.testing.assert_array_equal(log["vx_mps"], [20.0, 21.0, 22.0])


@pytest.mark.parametrize(
    ("start", "words"),
    [
        (b"MATLAB 5.0 MAT-file, Platform", ["a MATLAB file, but it is broken", "record"]),
        (b"PK\x03\x04", ["ZIP", "Excel"]),
        (b"\x1f\x8b\x08", ["gzip", "gunzip"]),
        (b'{"vx_mps": 20.1}\n{"vx_mps": 20.2}\n', ["is JSON", "read_json(path, lines=True)"]),
        (b'{\n "vx_mps": [20.1,\n', ["is JSON", "pandas.read_json(path)"]),
        (b'[{"vx_mps": 20.1}', ["is JSON", "pandas.read_json(path)"]),
        (b"\x01\x02\x00\xfe\x03", ["no text (first at byte 2)", "as CSV"]),
    ],
)
def test_files_that_are_no_text_are_named(tmp_path: Path, start: bytes, words: list[str]) -> None:
    path = tmp_path / "run.csv"
    path.write_bytes(start + bytes(range(256)) * 4)
    with pytest.raises(InvalidInput) as caught:
        read(path)
    for word in ["run.csv", *words]:
        assert word in str(caught.value)


@pytest.mark.parametrize(
    "lines",
    [
        ["# recorded on Monday", "#", HEADER, "# begin", *ROWS[:2], "# still going", ROWS[2]],
        ["# recorded on Monday", "# " + HEADER, *ROWS],
    ],
)
def test_comments(tmp_path: Path, lines: list[str]) -> None:
    log = read(write(tmp_path, *lines))
    np.testing.assert_array_equal(log["vx_mps"], [20.0, 21.0, 22.0])
    bad = [line.replace("22,0.3", "fast,0.3") for line in lines]
    with pytest.raises(InvalidInput, match=f"'fast' in line {len(lines)} "):
        read(write(tmp_path, *bad))


@pytest.mark.parametrize("about", [["Logger 7"], ["Logger 7", "Car;a;car", "Date;03.05.2026", ""]])
def test_lines_about_the_log_before_the_names(tmp_path: Path, about: list[str]) -> None:
    """Whatever separates their cells; the line of an error is that of the file."""
    header = HEADER.replace(",", ";")
    rows = [f"{k / 100:.2f};{20 + k};0,1;2,0;0,5;0,01".replace(".", ",") for k in range(60)]
    lines = [*about, header, *rows]
    log = read(write(tmp_path, *lines))
    np.testing.assert_array_equal(log["vx_mps"], 20.0 + np.arange(60.0))
    with pytest.raises(InvalidInput, match=f"'fast' in line {len(about) + 32} "):
        read(write(tmp_path, *(line.replace(";50;", ";fast;") for line in lines)))


@pytest.mark.parametrize(
    "stamp",
    ["05/31/2026 {}", "31.05.2026 {}", "1/2/2026 {}"],
)
def test_dates_with_the_year_last(tmp_path: Path, stamp: str) -> None:
    rows = [f"{stamp.format(f'10:59:59.{k:02d}')},20,0.1,2,0.5,0.01" for k in range(60)]
    log = read(write(tmp_path, HEADER, *rows))
    np.testing.assert_allclose(log["time_s"], np.arange(60) / 100.0)


@pytest.mark.parametrize(
    "day", [("04/05/2026 ", "05/05/2026 "), ("5/3/2026 ", "5/4/2026 "), ("", "")]
)
def test_midnight_is_one_day_later_whatever_the_order(tmp_path: Path, day: tuple[str, str]) -> None:
    days = [(day[0] + "23:59:59", k) for k in range(50, 100)]
    days += [(day[1] + "00:00:00", k) for k in range(50)]
    rows = [f"{day}.{k:02d},20,0.1,2,0.5,0.01" for day, k in days]
    log = read(write(tmp_path, HEADER, *rows))
    np.testing.assert_allclose(log["time_s"], np.arange(100) / 100.0)


class TestUnits:
    def test_those_of_the_channels_are_taken_silently(self, tmp_path: Path) -> None:
        log = read(write(tmp_path, HEADER, "[s],[m/s],[rad/s],[m/s^2],[m/s²],[rad]", *ROWS))
        np.testing.assert_array_equal(log["vx_mps"], [20.0, 21.0, 22.0])

    def test_others_are_converted_and_told(self, tmp_path: Path) -> None:
        path = write(
            tmp_path,
            HEADER + ",oil",
            "ms,km/h,deg/s,g,m/s2,rad,degC",
            *(f"{10 * k},36,90,0.1,1,0.01,90" for k in range(3)),
        )
        with pytest.warns(SysidWarning) as caught:
            log = read(path)
        told = [str(warning.message) for warning in caught]
        assert len(told) == 4
        assert any("vx_mps: the file states 'km/h'" in text for text in told)
        np.testing.assert_allclose(log["time_s"], [0.0, 0.01, 0.02])
        np.testing.assert_allclose(log["vx_mps"], 10.0)
        np.testing.assert_allclose(log["yaw_rate_radps"], np.pi / 2)
        np.testing.assert_allclose(log["ax_mps2"], 0.980665)
        np.testing.assert_allclose(log["oil"], 90.0)

    def test_the_factor_of_a_map_goes_first(self, tmp_path: Path) -> None:
        path = write(tmp_path, HEADER, "s,km/h,rad/s,m/s2,m/s2,rad", *ROWS)
        log = read(path, {"vx_mps": {"column": "vx_mps", "factor": 0.25}})
        np.testing.assert_allclose(log["vx_mps"], [5.0, 5.25, 5.5])

    @pytest.mark.parametrize(
        ("unit", "what"),
        [("deg/s", "an angular velocity"), ("bar", "a pressure"), ("slug", "a mass")],
    )
    def test_one_of_another_quantity_is_refused(self, tmp_path: Path, unit: str, what: str) -> None:
        path = write(tmp_path, HEADER, f"s,{unit},rad/s,m/s2,m/s2,rad", *ROWS)
        with pytest.raises(InvalidInput, match=rf"vx_mps: the file states '{unit}'.*") as caught:
            read(path)
        assert f"{what}, but the channel is a speed [m/s]" in str(caught.value)
        log = read(path, {"vx_mps": {"column": "vx_mps", "factor": 0.5}})
        np.testing.assert_allclose(log["vx_mps"], [10.0, 10.5, 11.0])

    @pytest.mark.parametrize(
        ("channel", "unit", "factor"),
        [
            ("vx_mps", "mph", 0.44704),
            ("vx_mps", "knots", 0.5144444),
            ("yaw_rate_radps", "°/s", 0.0174532925),
            ("ay_mps2", "[g]", 9.80665),
            ("steer_rad", "deg", 0.0174532925),
            ("fx_n", "kN", 1000.0),
            ("fx_n", "lbf", 4.4482216153),
            ("fx_n", "kgf", 9.80665),
        ],
    )
    def test_table(self, tmp_path: Path, channel: str, unit: str, factor: float) -> None:
        header = f"{HEADER},fx_n"
        units = ",".join(unit if name == channel else "[]" for name in header.split(","))
        path = write(tmp_path, header, units, *(row + ",5" for row in ROWS))
        with pytest.warns(SysidWarning, match=f"{channel}: the file states"):
            log = read(path)
        raw = read(write(tmp_path, header, *(row + ",5" for row in ROWS)))
        np.testing.assert_allclose(log[channel], factor * raw[channel], rtol=1e-6)

    def test_one_that_is_not_known_is_told(self, tmp_path: Path) -> None:
        with pytest.warns(SysidWarning, match=r"vx_mps: .*furlong.*taken as m/s.*channel map"):
            read(write(tmp_path, HEADER, "s,[furlong],rad/s,m/s2,m/s2,rad", *ROWS))


class TestTimeStamps:
    @pytest.mark.parametrize(
        "stamps",
        [
            ["2024-05-01T10:00:00.00", "2024-05-01T10:00:00.01", "2024-05-01T10:00:00.02"],
            ["2024-05-01 10:00:00.00Z", "2024-05-01 10:00:00.01Z", "2024-05-01 10:00:00.02Z"],
            [f"2024-05-01T10:00:00.0{k}+02:00" for k in range(3)],
            ["9:59:59.99", "10:00:00.00", "10:00:00.01"],
        ],
    )
    def test_in_a_file(self, tmp_path: Path, stamps: list[str]) -> None:
        rows = [",".join((s, *r.split(",")[1:])) for s, r in zip(stamps, ROWS, strict=True)]
        log = read(write(tmp_path, HEADER, *rows))
        np.testing.assert_allclose(log["time_s"], [0.0, 0.01, 0.02], atol=1e-9)
        other = write(tmp_path, HEADER.replace("time_s", "clock"), *rows)
        np.testing.assert_allclose(read(other, {"time_s": "clock"})["time_s"], log["time_s"])

    def test_in_memory(self) -> None:
        data = {name: np.array(column) for name, column in COLUMNS.items()}
        start = datetime.datetime(2024, 5, 1, 10)
        plain = Log.from_arrays(data, check=False)
        for stamps in (
            np.datetime64("2024-05-01T10:00:00") + np.array([0, 10, 20], "timedelta64[ms]"),
            np.array([0, 10_000, 20_000], "timedelta64[us]"),
            [start + datetime.timedelta(milliseconds=10 * k) for k in range(3)],
            [f"2024-05-01T10:00:00.0{k}" for k in range(3)],
        ):
            log = Log.from_arrays({**data, "time_s": stamps}, check=False)
            np.testing.assert_allclose(log["time_s"], plain["time_s"], atol=1e-9)
            assert read_log({**data, "time_s": stamps}, check=False).n == 3

    def test_missing_and_mixed_ones_are_refused(self, tmp_path: Path) -> None:
        rows = [",".join((s, *ROWS[0].split(",")[1:])) for s in ("10:00:00", "", "10:00:02")]
        with pytest.raises(InvalidInput, match="time_s: not a finite number at sample 1"):
            read(write(tmp_path, HEADER, *rows))
        rows = [",".join((s, *ROWS[0].split(",")[1:])) for s in ("10:00:00Z", "10:00:00+02:00")]
        with pytest.raises(InvalidInput, match="time_s: '10:00:00Z' in line 2"):
            read(write(tmp_path, HEADER, *rows))


class TestTables:
    """Tables in memory, under other names than the channels'."""

    MAP: ClassVar = {"vx_mps": {"column": "speed", "factor": 0.5}}

    def check(self, log: Log) -> None:
        np.testing.assert_allclose(log["vx_mps"], [10.0, 10.5, 11.0])
        assert log.name == "log"

    def renamed(self) -> dict[str, list[float]]:
        return {("speed" if k == "vx_mps" else k): v for k, v in COLUMNS.items()}

    def test_dict(self) -> None:
        self.check(read_log(self.renamed(), self.MAP, check=False))

    def test_structured_array(self) -> None:
        data = self.renamed()
        table = np.array(list(zip(*data.values(), strict=True)), [(k, float) for k in data])
        self.check(read_log(table, self.MAP, check=False))  # type: ignore[arg-type]

    def test_names_only_as_a_list(self) -> None:
        """As polars and Arrow have them."""
        data = self.renamed()

        class Frame:
            columns = tuple(data)

            def __getitem__(self, name: str) -> list[float]:
                return data[name]

        self.check(read_log(Frame(), self.MAP, check=False))  # type: ignore[arg-type]

    @pytest.mark.parametrize("library", ["pandas", "polars", "pyarrow"])
    def test_libraries(self, library: str) -> None:
        module = pytest.importorskip(library)
        make = module.table if library == "pyarrow" else module.DataFrame
        self.check(read_log(make(self.renamed()), self.MAP, check=False))
        assert Log.from_arrays(make(COLUMNS), check=False).n == 3

    def test_cell_that_is_no_number(self) -> None:
        data = {**self.renamed(), "speed": [1.0, "fast", 2.0]}
        with pytest.raises(InvalidInput, match="speed: 'fast' at sample 1 is not a number"):
            read_log(data, self.MAP, check=False)

    def test_no_table(self) -> None:
        for thing in (np.zeros((3, 3)), 7):
            with pytest.raises(InvalidInput, match="has no named columns"):
                read_log(thing, check=False)  # type: ignore[arg-type]

    def test_complex_numbers(self) -> None:
        data = {**COLUMNS, "vx_mps": np.array([1 + 0j, 2 + 1j, 3])}
        with pytest.raises(InvalidInput, match="vx_mps: holds complex128"):
            Log.from_arrays(data, check=False)


def test_a_hundred_thousand_columns_are_read_in_seconds(tmp_path: Path) -> None:
    extra = [f"x{k}" for k in range(100_000)]
    path = write(tmp_path, ",".join([HEADER, *extra]), *(r + ",1" * len(extra) for r in ROWS))
    start = time.process_time()
    assert len(read(path).extras) == len(extra)
    with pytest.raises(InvalidInput) as caught:
        read(path, {"steer_rad": "hand wheel"})
    assert len(str(caught.value)) < 1000
    assert time.process_time() - start < 20.0
