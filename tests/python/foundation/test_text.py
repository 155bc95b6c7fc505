"""What is printed fits the terminal, and is left as it is elsewhere."""

import io
import sys

import pytest

from sysid_vehicle._common.text import columns, few, text_table, wrapped
from sysid_vehicle.cli import main

HEAD = ("effect", "p", "in words")
ROWS = [
    ["tyre_load_sensitivity", "1e-5", "missing, and its size is known well enough to be of use"],
    ["mass", "0.3", "absent"],
]


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


def test_a_table_that_fits_is_no_narrower_than_its_cells() -> None:
    lines = text_table(HEAD, ROWS).splitlines()
    assert len(lines) == 4
    assert lines[2].endswith("  missing, and its size is known well enough to be of use")
    assert lines[3].endswith("  0.3" + " " * (len(ROWS[0][2]) - 4) + "absent")


@pytest.mark.parametrize("width", [80, 60, 50])
def test_a_table_is_as_wide_as_the_line(width: int) -> None:
    lines = text_table(HEAD, ROWS, width).splitlines()
    assert max(map(len, lines)) <= width
    words = " ".join(line[31:].strip() for line in lines[2:-1]).split()
    assert words == ROWS[0][2].split(), "whole words, in their order"
    assert lines[-1].split() == ROWS[1]


def test_words_longer_than_a_line_stay_whole() -> None:
    assert "tyre_load_sensitivity" in text_table(HEAD, ROWS, 20)


def test_long_lines_are_broken_between_words_and_indented() -> None:
    text = "Short.\n  " + "word " * 30
    lines = wrapped(text, 40).splitlines()
    assert lines[0] == "Short."
    assert all(len(line) <= 40 for line in lines)
    assert all(line.startswith("      word") for line in lines[2:])
    assert sum(line.count("word") for line in lines) == 30


@pytest.mark.parametrize("width", [80, 100])
def test_commands_fit_the_terminal(monkeypatch: pytest.MonkeyPatch, width: int) -> None:
    screen = Terminal()
    monkeypatch.setattr(sys, "stdout", screen)
    monkeypatch.setenv("COLUMNS", str(width))
    assert columns() == width
    assert main(["effects"]) == 0
    lines = screen.getvalue().splitlines()
    assert len(lines) > 100
    assert max(map(len, lines)) <= width


def test_a_pipe_gets_lines_as_they_are(capsys: pytest.CaptureFixture[str]) -> None:
    assert columns() is None
    assert main(["effects"]) == 0
    assert max(map(len, capsys.readouterr().out.splitlines())) > 120


def test_of_many_names_the_first_are_printed() -> None:
    assert few([]) == ""
    assert few(["a", "b", "c", "d", "e"]) == "a, b, c, d, e"
    assert few(["a", "b", "c", "d", "e", "f"]) == "a, b, c, d and 2 more"
