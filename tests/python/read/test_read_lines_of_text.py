"""Several lines of text above the numbers: sensors above signals, descriptions, types, units."""

from pathlib import Path

import pytest
from log_formats import NAMES, SI, TIMED, UNITS, cells, check_values, write

from sysid_vehicle.errors import InvalidInput, SysidWarning
from sysid_vehicle.read import read_log

UNIT_LINE = ["s", *UNITS.values()]
SENSORS = ["Logger", "IMU", "IMU", "IMU", "Column", "GPS"]


def written(folder: Path, *lines: list[str], mark: str = ",") -> Path:
    return write(folder, *(mark.join(cell for cell in row) for row in lines))


def test_sensors_above_their_signals(tmp_path: Path) -> None:
    """The line with the names is the one whose cells differ; decimal commas are no text."""
    numbers = [[cell.replace(".", ",") for cell in row] for row in cells()]
    path = written(tmp_path, ["sep=;"], SENSORS, NAMES, UNIT_LINE, *numbers, mark=";")
    with pytest.warns(SysidWarning) as told:
        log = read_log(path, TIMED, check=False)
    check_values(log, slow=(), atol=1e-8)
    assert any("'Logger;IMU;" in str(w.message) for w in told)


@pytest.mark.parametrize(
    "below",
    [
        [["f8"] * len(NAMES)],
        [["of the clock", "gyro", "front", "side", "rack", "wheels"], UNIT_LINE],
        [UNIT_LINE, ["double"] * len(NAMES)],
    ],
)
def test_descriptions_and_types_below_the_names(tmp_path: Path, below: list[list[str]]) -> None:
    path = written(tmp_path, NAMES, *below, *cells())
    with pytest.warns(SysidWarning, match="above the numbers"):
        log = read_log(path, TIMED, check=False)
    check_values(log, slow=(), atol=1e-8)


@pytest.mark.parametrize("below", [["End of data"], ["--- end ---", "saved by the logger"]])
def test_text_below_the_numbers(tmp_path: Path, below: list[str]) -> None:
    """What a logger writes when it ends, in a row of as many cells."""
    ends = [[text] + [""] * (len(NAMES) - 1) for text in below]
    path = written(tmp_path, NAMES, *cells(), *ends)
    with pytest.warns(SysidWarning, match="at the end holds text and no reading, and was left out"):
        log = read_log(path, TIMED, check=False)
    check_values(log, slow=(), atol=1e-8)


@pytest.mark.parametrize("about", [[], [["Logger 7"], ["Road", "dry"]]], ids=["bare", "about"])
@pytest.mark.parametrize("mark", [",", ";", "\t", "  "])
@pytest.mark.parametrize("ends", ["0.05", "0.05{mark}1", "End of data\n"])
def test_what_is_below_the_numbers_hides_no_names(
    tmp_path: Path, about: list[list[str]], mark: str, ends: str
) -> None:
    """Neither a row that breaks off nor text there: the names were sought in the first line."""
    path = written(tmp_path, *about, NAMES, *cells(), mark=mark)
    path.write_text(path.read_text() + ends.format(mark=mark))
    with pytest.warns(SysidWarning, match=r"line \d+, the last, has only [1-3] cells and was left"):
        log = read_log(path, TIMED, check=False)
    check_values(log, slow=(), atol=1e-8)


def test_signals_of_one_name_are_told_by_their_sensors(tmp_path: Path) -> None:
    """As tables with two levels of names are written; an empty cell repeats the one before."""
    names = ["Time", "z", "x", "y", "Steer", "Speed", "x"]
    sensors = ["", "gyro", "imu", "", "", "", "dash"]
    path = written(tmp_path, sensors, names, *([*row, "0"] for row in cells()))
    mapping = {**TIMED, "ax_mps2": {**SI["ax_mps2"], "column": "imu.x"}}
    mapping["ay_mps2"] = {**SI["ay_mps2"], "column": "y"}
    mapping["yaw_rate_radps"] = {**SI["yaw_rate_radps"], "column": "z"}
    check_values(read_log(path, mapping, check=False), slow=(), atol=1e-8)


def test_units_that_are_mostly_unknown_are_not_passed_over(tmp_path: Path) -> None:
    path = written(tmp_path, NAMES, ["s", "smoots/s", "foo", "bar", "baz", "km/h"], *cells())
    with pytest.raises(InvalidInput, match="Speed: 'km/h' in line 2"):
        read_log(path, TIMED, check=False)


def test_aim_with_the_names_twice(tmp_path: Path) -> None:
    about = [["Format", "AiM CSV File"], ["Sample Rate", "100"], [""]]
    quoted = [[f'"{cell}"' for cell in row] for row in (NAMES, NAMES, UNIT_LINE, *cells())]
    path = written(tmp_path, *about, *quoted)
    with pytest.warns(SysidWarning, match="the file states"):
        log = read_log(path, {c: s["column"] for c, s in SI.items()}, check=False)
    check_values(log, slow=(), atol=1e-8)


def test_columns_without_numbers_are_named(tmp_path: Path) -> None:
    rows = [[row[0].replace(".", "D"), f"{row[1]} deg/s", *row[2:]] for row in cells()]
    with pytest.raises(InvalidInput) as caught:
        read_log(written(tmp_path, NAMES, *rows), check=False)
    for word in ("missing columns", "vx_mps", "YawRate", "Time", "'0D00' in line 2", "LatAcc"):
        assert word in str(caught.value)
