"""Text as loggers, spreadsheets and scripts write it: other marks, cut ends, words for missing."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from log_formats import (
    FAST,
    MAP,
    NAMES,
    SI,
    TIMED,
    UNITS,
    cells,
    check_values,
    measured,
    read_told,
    write,
)

from sysid_vehicle.errors import InvalidInput, SysidWarning
from sysid_vehicle.read import read_log


@pytest.mark.parametrize("mark", ["|", " ", "   "])
def test_other_marks_between_cells(tmp_path: Path, mark: str) -> None:
    path = write(tmp_path, *(mark.join(row) for row in (NAMES, *cells())))
    check_values(read_log(path, TIMED, check=False), slow=(), atol=1e-8)


def test_what_numpy_saves(tmp_path: Path) -> None:
    held = np.stack([FAST, *measured(FAST).values()], axis=1)
    np.savetxt(tmp_path / "run.txt", held, header=" ".join(["Time", *measured(FAST)]))
    check_values(read_log(tmp_path / "run.txt", TIMED, check=False), slow=())


@pytest.mark.parametrize("ends", [("", ","), (",", ""), (",", ",")])
def test_a_mark_behind_the_last_cell(tmp_path: Path, ends: tuple[str, str]) -> None:
    rows = [",".join(row) + ends[1] for row in cells()]
    log = read_log(write(tmp_path, ",".join(NAMES) + ends[0], *rows), TIMED, check=False)
    check_values(log, slow=(), atol=1e-8)


@pytest.mark.parametrize("word", ["NA", "N/A", "null", "None", "-", "--", "#NV", "1.#QNAN"])
def test_words_for_a_missing_measurement(tmp_path: Path, word: str) -> None:
    path = write(tmp_path, *(",".join(row) for row in (NAMES, *cells(word))))
    check_values(read_log(path, TIMED, check=False), atol=1e-8)


def test_a_column_of_words_is_none_of_numbers(tmp_path: Path) -> None:
    rows = [",".join([*row, "none"]) for row in cells()]
    log = read_log(write(tmp_path, ",".join([*NAMES, "fault"]), *rows), TIMED, check=False)
    assert log.extras == ()


@pytest.mark.parametrize(("decimal", "thousand"), [(",", "."), (".", ",")])
def test_thousands_are_never_decimals(tmp_path: Path, decimal: str, thousand: str) -> None:
    """``72.000`` is 72 thousand beside ``0,01``, and was 72."""
    rows = cells()
    for row in rows:
        row[:-1] = [cell.replace(".", decimal) for cell in row[:-1]]
        row[-1] = f"{float(row[-1]) * 1e3:,.0f}".replace(",", thousand)
    path = write(tmp_path, *(";".join(row) for row in (NAMES, *rows)))
    with pytest.raises(InvalidInput, match=r"line 2 holds .*without separators of thousands"):
        read_log(path, TIMED, check=False)


def test_a_comma_in_text_is_no_decimal_one(tmp_path: Path) -> None:
    rows = [";".join([*row, "Sat, 5"]) for row in cells()]
    path = write(tmp_path, ";".join([*NAMES, "day"]), *rows)
    check_values(read_log(path, TIMED, check=False), slow=(), atol=1e-8)


def test_numbers_that_are_none_to_a_computer_have_a_remedy(tmp_path: Path) -> None:
    rows = [",".join(f'"{cell}"' for cell in row).replace(".", ",") for row in cells()]
    with pytest.raises(InvalidInput, match=r"'72,0*' in line 2 .*export it with decimal points"):
        read_log(write(tmp_path, ",".join(NAMES), *rows), {**TIMED, "time_s": {"rate_hz": 100}})


@pytest.mark.parametrize(
    ("name", "content", "words"),
    [
        ("run.ld", b"\x40\0\0\0" + bytes(500), "is a log of MoTeC.*export it as CSV from i2"),
        ("run.ibt", b"\2\0\0\0" + bytes(500), "is telemetry of iRacing.*export it as CSV"),
        ("run.xrk", b"<hCNF" + bytes(500), "is a log of AiM.*from Race Studio"),
        ("run.dat", bytes(500), "holds bytes that are no text"),
        ("run.gpx", b"<?xml version='1.0'?><gpx></gpx>", "is an XML document, such as GPX"),
        ("run.txt", b"$GPRMC,103100.00,A,4800.0,N\n", "is a record of NMEA sentences"),
    ],
)
def test_files_of_loggers_that_are_no_text(
    tmp_path: Path, name: str, content: bytes, words: str
) -> None:
    """Zeros are no UTF-16 text."""
    (tmp_path / name).write_bytes(content)
    with pytest.raises(InvalidInput, match=words):
        read_log(tmp_path / name)


def test_a_last_line_that_was_cut_off(tmp_path: Path) -> None:
    lines = [",".join(row) for row in (NAMES, *cells())]
    path = write(tmp_path, *lines, "4.00,0.1")
    with pytest.warns(SysidWarning, match=r"line 402, the last, has only 2 cells and was left out"):
        check_values(read_log(path, TIMED, check=False), slow=(), atol=1e-8)


def test_lines_about_the_log_that_are_filled_up_with_empty_cells(tmp_path: Path) -> None:
    about = ['"Logger","X100",,,,', '"Car","a",,,,']
    path = write(tmp_path, *about, ",".join(NAMES), *(",".join(row) for row in cells()))
    check_values(read_log(path, TIMED, check=False), slow=(), atol=1e-8)


@pytest.mark.parametrize(("mark", "decimal"), [(";", ","), ("\t", "."), (",", ".")])
@pytest.mark.parametrize("kind", ["MoTeC CSV File", "AIM CSV File"])
def test_exports_for_spreadsheets(tmp_path: Path, mark: str, decimal: str, kind: str) -> None:
    units = ["s", *UNITS.values()]
    head = [["Format", kind], ["Vehicle", "red"], ["Time", "15:51:12"], [""], NAMES, units, [""]]
    rows = [[cell.replace(".", decimal) for cell in row] for row in cells("")]
    path = write(tmp_path, *(mark.join(row) for row in (*head, *rows)))
    check_values(read_told(path), atol=1e-7)


def vbo(folder: Path, *, decimal: str = ".", titles: tuple[str, ...] = (), end: str = "") -> Path:
    header = ["time", "velocity kmh", "Longitudinal acceleration g", "Lateral acceleration g",
              "YawRate", "Steer", *titles]  # fmt: skip
    rows = []
    for t in FAST:
        v = measured(t)
        order = [v[n] for n in ("Speed", "LongAcc", "LatAcc", "YawRate", "Steer")]
        rows.append(" ".join([f"{120000 + t:.2f}", *(f"{x:+.9f}" for x in order)]))
    lines = ["File created on 31/07/2026", "[header]", *header, "[channel units]", "deg/s", "rad",
             "[column names]", "time velocity LongAcc LatAcc YawRate Steer", "[data]",
             *(row.replace(".", decimal) for row in rows)]  # fmt: skip
    path = folder / "run.vbo"
    path.write_text("\r\n".join([*lines, end]), newline="")
    return path


def check_vbo(log: Any) -> None:
    moved = {c: log[c] - (log["time_s"][0] if c == "time_s" else 0.0) for c in log.channels}
    check_values(read_log(moved, check=False), slow=(), atol=1e-6)


VBO = {**MAP, "vx_mps": "velocity"}


def test_vbox_with_decimal_commas(tmp_path: Path) -> None:
    check_vbo(read_told(vbo(tmp_path, decimal=","), VBO))


def test_vbox_that_was_cut_off(tmp_path: Path) -> None:
    known = {**SI, "vx_mps": {"column": "velocity", "factor": 1 / 3.6}}
    with pytest.warns(SysidWarning, match="the last, has only 2 cells and was left out"):
        check_vbo(read_log(vbo(tmp_path, end="120004.00 +72"), known, check=False))


def test_vbox_whose_titles_are_not_its_columns(tmp_path: Path) -> None:
    """The speed was taken as m/s in silence."""
    known = {**SI, "vx_mps": "velocity"}
    with pytest.warns(SysidWarning) as caught:
        log = read_log(vbo(tmp_path, titles=("lap",)), known, check=False)
    told = " ".join(str(warning.message) for warning in caught)
    assert "[header] has 7 titles for 6 columns, so units are known only of velocity" in told
    assert "vx_mps: the file states 'kmh'" in told
    check_vbo(log)
