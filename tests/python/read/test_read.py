"""CSV files and channel maps: foreign columns, odd formats, and mistakes named by line."""

import os
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from sysid_vehicle.errors import InvalidInput, SysidWarning
from sysid_vehicle.log import Log
from sysid_vehicle.read import ChannelMap, Source, read_log

HEADER = "time_s,vx_mps,yaw_rate_radps,ax_mps2,ay_mps2,steer_rad"
ROWS = ["0,20,0.1,0,2,0.01", "0.01,21,0.2,0.5,4,0.02", "0.02,22,0.3,1,6,0.03"]


def write(folder: Path, *lines: str, encoding: str = "utf-8") -> Path:
    path = folder / "run.csv"
    path.write_bytes("\n".join(lines).encode(encoding))
    return path


def read(path: Path, channels: Any = None) -> Log:
    return read_log(path, channels, check=False)


def test_lines_that_repeat_the_names_are_left_out(tmp_path: Path) -> None:
    path = write(tmp_path, HEADER, *ROWS[:2], HEADER, ROWS[2])
    with pytest.warns(SysidWarning, match="run: line 4 repeats column names or units"):
        log = read(path)
    np.testing.assert_array_equal(log["vx_mps"], [20.0, 21.0, 22.0])


def test_a_database_without_frames_is_not_ignored_in_silence(tmp_path: Path) -> None:
    path = write(tmp_path, HEADER, *ROWS)
    with pytest.warns(SysidWarning, match="run: holds no CAN frames; car.dbc is not used"):
        read_log(path, dbc="car.dbc", check=False)


def test_canonical_file(tmp_path: Path) -> None:
    log = read(write(tmp_path, HEADER, *ROWS))
    assert log.name == "run"
    np.testing.assert_array_equal(log["vx_mps"], [20.0, 21.0, 22.0])
    assert read_log(str(tmp_path / "run.csv"), name="lap 2", check=False).name == "lap 2"


@pytest.mark.parametrize(
    "variant",
    [
        [HEADER, *ROWS, "", ""],
        [HEADER.replace(",", " , "), *ROWS],
        [HEADER.replace(",", ";"), *(row.replace(",", ";").replace(".", ",") for row in ROWS)],
        [HEADER.replace(",", "\t"), *(row.replace(",", "\t") for row in ROWS)],
        ["\ufeff" + HEADER, *ROWS],
        [line + "\r" for line in (HEADER, *ROWS)],
        ["\r".join((HEADER, *ROWS))],
        [
            '"' + HEADER.replace(",", '","') + '"',
            *('"' + r.replace(",", '","') + '"' for r in ROWS),
        ],
        [HEADER + ",note", *(row + ",fine" for row in ROWS)],
    ],
    ids=[
        "blank lines",
        "spaces",
        "decimal comma",
        "tabs",
        "BOM",
        "CRLF",
        "CR",
        "quotes",
        "text column",
    ],
)
def test_other_ways_to_write_the_same(tmp_path: Path, variant: list[str]) -> None:
    plain = read(write(tmp_path, HEADER, *ROWS))
    other = read(write(tmp_path, *variant))
    assert other.channels == plain.channels
    for channel in plain.channels:
        np.testing.assert_array_equal(other[channel], plain[channel])


def test_latin_1_header(tmp_path: Path) -> None:
    log = read(write(tmp_path, HEADER + ",Öl", *(r + ",1" for r in ROWS), encoding="latin-1"))
    assert log.extras == ("Öl",)


@pytest.mark.parametrize("cell", ["", "  ", "nan", "NaN"])
def test_empty_cells_are_missing_measurements(tmp_path: Path, cell: str) -> None:
    log = read(write(tmp_path, HEADER, ROWS[0], f"0.01,21,0.2,0.5,{cell},0.02", ROWS[2]))
    np.testing.assert_array_equal(log["ay_mps2"], [2.0, np.nan, 6.0])
    np.testing.assert_array_equal(log["vx_mps"], [20.0, 21.0, 22.0])


@pytest.mark.parametrize(
    ("lines", "words"),
    [
        ([HEADER, ROWS[0], "0.01,fast,0,0,0,0"], ["vx_mps", "'fast'", "line 3", "sample 1"]),
        ([HEADER, "", "", ROWS[0], "0.01,20,0,0,x,0"], ["ay_mps2", "'x'", "line 5", "sample 1"]),
        ([HEADER, "s,m/s,fast,x,y,z", *ROWS], ["time_s", "'s'", "line 2", "sample 0"]),
        ([HEADER, ",,,,,", " , , , , , "], ["only empty cells", "record the log again"]),
        ([HEADER, "0,20", *ROWS], ["line 2", "2 cells", "header has 6", "delete the line"]),
        ([HEADER, ROWS[0], '0.01,"' + 140000 * "x"], ["line 3", "not a CSV row", "quotes"]),
        ([HEADER], ["no rows"]),
        ([""], ["the file holds nothing; record or export the log again"]),
        (["# one", " ", "#"], ["holds nothing but comments and empty lines"]),
        (["", "0,20", "1,20"], ["first line is empty", "column names"]),
        (ROWS, ["first line holds numbers", "column names"]),
        ([HEADER + ",vx_mps", *(r + ",1" for r in ROWS)], ["vx_mps: 2 columns", "delete one"]),
        ([HEADER, *ROWS[:1]], ["time_s: only 1 sample"]),
        ([HEADER, ROWS[0], "0.01,inf,0,0,0,0"], ["vx_mps: infinite at sample 1 (t = 0.01 s)"]),
    ],
)
def test_broken_files(tmp_path: Path, lines: list[str], words: list[str]) -> None:
    with pytest.raises(InvalidInput) as caught:
        read(write(tmp_path, *lines))
    assert str(caught.value).startswith(f"{tmp_path}{os.sep}run.csv: ")
    for word in words:
        assert word in str(caught.value)


def test_file_that_is_not_there(tmp_path: Path) -> None:
    with pytest.raises(InvalidInput, match=r"none\.csv: cannot be read.*check the path"):
        read(tmp_path / "none.csv")


class TestChannelMap:
    LINES = (
        "t_ms,Speed,yaw_deg,vy_mps,a_lat,ax_mps2,hand wheel,oil",
        "0,72,10,0.1,1,0,30,90",
        "10,144,20,0.2,2,0,60,91",
    )
    TOML = """
    [channels]
    time_s = { column = "t_ms", factor = 1e-3 }
    vx_mps = { column = "Speed", factor = 0.25, offset = 1.0 }
    vy_mps = false
    yaw_rate_radps = { column = "yaw_deg", factor = 0.0174533 }
    ay_mps2 = "a_lat"
    steer_rad = { column = "hand wheel", factor = 0.001 }
    """

    def check(self, log: Log) -> None:
        np.testing.assert_allclose(log["time_s"], [0.0, 0.01])
        np.testing.assert_allclose(log["vx_mps"], [19.0, 37.0])
        np.testing.assert_allclose(log["yaw_rate_radps"], [0.174533, 0.349066])
        np.testing.assert_allclose(log["ay_mps2"], [1.0, 2.0])
        np.testing.assert_allclose(log["steer_rad"], [0.03, 0.06])
        assert not log.has("vy_mps")
        assert log.has("ax_mps2")
        assert log.extras == ("oil",)

    def test_from_a_file_a_dict_or_itself(self, tmp_path: Path) -> None:
        path = write(tmp_path, *self.LINES)
        toml = tmp_path / "map.toml"
        toml.write_text(self.TOML)
        mapping = ChannelMap.from_toml(toml)
        assert mapping.sources["vx_mps"] == Source("Speed", 0.25, 1.0)
        self.check(read(path, toml))
        self.check(read(path, str(toml)))
        self.check(read(path, mapping))
        table = {name: vars(source) for name, source in mapping.sources.items()}
        self.check(read(path, {**table, "vy_mps": False}))
        self.check(read(path, {"channels": {**table, "vy_mps": False}}))

    def test_rate_instead_of_a_time_column(self, tmp_path: Path) -> None:
        bare = [line.partition(",")[2] for line in (HEADER, *ROWS)]
        log = read(write(tmp_path, *bare), {"time_s": {"rate_hz": 50}})
        np.testing.assert_allclose(log["time_s"], [0.0, 0.02, 0.04])

    def test_despike_through_the_map(self, tmp_path: Path) -> None:
        rows = [f"{k / 100},20,0.1,0,2,{0.4 if k == 30 else 0.01 + k * 1e-4}" for k in range(60)]
        path = write(tmp_path, HEADER, *rows)
        with pytest.warns(SysidWarning, match="steer_rad: removed 1 one-sample spike") as caught:
            log = read(path, {"steer_rad": {"despike": True}})
        assert caught[0].filename == __file__
        assert log["steer_rad"][30] == pytest.approx(0.013)

    @pytest.mark.parametrize(
        ("entry", "words"),
        [
            ({"vx": "Speed"}, ["unknown key 'vx'", "did you mean 'vx_mps'"]),
            ({"vx_mps": "speeed"}, ["vx_mps", "'speeed'", "did you mean 'Speed'", "t_ms, Speed"]),
            ({"vx_mps": {"colum": "Speed"}}, ["vx_mps", "'colum'", "did you mean 'column'"]),
            ({"vx_mps": {"column": "Speed", "factor": "2"}}, ["factor = '2'", "plain number"]),
            ({"vx_mps": {"column": "Speed", "factor": 0}}, ["factor = 0", "unit factor"]),
            ({"vx_mps": {"column": "Speed", "despike": 1}}, ["despike = 1", "true or false"]),
            ({"vx_mps": {"column": 3}}, ["column = 3", "name of the source column"]),
            ({"vx_mps": 3.6}, ["vx_mps = 3.6", "column name or a table"]),
            ({"vx_mps": False}, ["vx_mps = false", "every log needs it"]),
            ({"time_s": {"rate_hz": 0}}, ["rate_hz = 0", "positive"]),
            ({"time_s": {"rate_hz": 100, "factor": 2}}, ["time_s", "'factor'"]),
            ({"vx_mps": {"rate_hz": 100}}, ["vx_mps", "'rate_hz'"]),
        ],
    )
    def test_mistakes(self, tmp_path: Path, entry: dict[str, Any], words: list[str]) -> None:
        path = write(tmp_path, *self.LINES)
        with pytest.raises(InvalidInput) as caught:
            read(path, {"time_s": "t_ms", "yaw_rate_radps": "yaw_deg", **entry})
        for word in words:
            assert word in str(caught.value)

    @pytest.mark.parametrize(
        ("text", "words"),
        [
            ("[chanels]\n", ["map.toml", "'chanels'", "did you mean 'channels'"]),
            ("", ["map.toml", "[channels] is missing"]),
            ("[channels]\nvx_mps Speed", ["map.toml", "not a TOML file", "line 2"]),
        ],
    )
    def test_broken_map_files(self, tmp_path: Path, text: str, words: list[str]) -> None:
        (tmp_path / "map.toml").write_text(text)
        with pytest.raises(InvalidInput) as caught:
            read(write(tmp_path, *self.LINES), tmp_path / "map.toml")
        for word in words:
            assert word in str(caught.value)


class TestRealLogs:
    """Logs of others; those that need mending say so, the rest must be read without a word."""

    @pytest.mark.parametrize(
        ("file", "car", "n", "rate_hz"),
        [
            ("carsim_like_handling/handling_course.csv", "carsim_like_handling", 11477, 100.0),
            ("tum_devbot_sim/data_to_train_2.csv", "tum_devbot_sim", 25065, 125.0),
            ("tum_devbot_sim/data_to_train_12.csv", "tum_devbot_sim", 24855, 125.0),
            ("tum_devbot_sim/data_to_run.csv", "tum_devbot_sim", 14380, 125.0),
        ],
    )
    def test_simulated(
        self, repo: Path, shared_data: Path, file: str, car: str, n: int, rate_hz: float
    ) -> None:
        channels = repo / "benchmarks" / "real_driving" / f"{car}.channels.toml"
        log = read_log(shared_data / file, channels)
        assert (log.n, log.uniform) == (n, True)
        assert log.rate_hz == pytest.approx(rate_hz, rel=1e-6)
        assert log.stretches() == [slice(0, n)]

    def test_real_car(self, repo: Path, shared_data: Path) -> None:
        channels = repo / "benchmarks" / "real_driving" / "revs_250lm.channels.toml"
        path = shared_data / "revs_250lm" / "revs_250lm_20140222_run1.csv"
        with pytest.warns(
            SysidWarning, match=r"t = 207\.27, 503\.49, 524\.85, 671\.67 s"
        ) as caught:
            log = read_log(path, channels)
        assert len(caught) == 1
        assert log.n == 55001
        assert np.abs(log["steer_rad"]).max() < 0.15
        assert set(log.missing()) == {"fx_n"}

    def test_file_without_time(self, shared_data: Path) -> None:
        log = read_log(
            shared_data / "carsim_like_handling" / "lowspeed_30kph.csv",
            {
                "time_s": {"rate_hz": 100},
                "yaw_rate_radps": "yawrate_radps",
                "steer_rad": "delta_f_rad",
            },
        )
        assert log.duration_s == pytest.approx(265.0)

    def test_jittered_log_that_begins_before_zero(self, shared_data: Path) -> None:
        """Its steering is in another file, so a column scaled to nearly zero stands in for it."""
        path = shared_data / "bmw_m8_roadview" / "m8_braking_car_100Hz.csv"
        channels = {
            "time_s": "car_time",
            "vx_mps": "Velocity_X",
            "yaw_rate_radps": "Yaw_Velocity",
            "ax_mps2": "Acceleration_X",
            "ay_mps2": "Acceleration_Y",
            "steer_rad": {"column": "Velocity_Z", "factor": 1e-9},
        }
        with pytest.warns(SysidWarning, match="resampled at 100 Hz; it also has 2 gaps") as caught:
            log = read_log(path, channels, check=False)
        assert len(caught) == 1
        assert log["time_s"][0] == -6.028965
        assert not log.uniform


def test_a_channel_map_of_names_is_told_how_to_be_made() -> None:
    with pytest.raises(InvalidInput, match=r"vx_mps = 'speed' is no Source; .*from_dict"):
        ChannelMap({"vx_mps": "speed"})  # type: ignore[dict-item]
