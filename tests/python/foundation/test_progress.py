"""Long calls tell where they are, where somebody watches."""

import io
import re
import sys
import threading
import time
import types

import pytest

import sysid_vehicle as sv
from sysid_vehicle._common.progress import doing, teller, watched, with_progress


class Terminal(io.StringIO):
    """An error stream that somebody looks at."""

    def isatty(self) -> bool:
        return True


def terminal(monkeypatch: pytest.MonkeyPatch) -> Terminal:
    """Look at the error stream; in the test itself, as pytest sets it anew after fixtures."""
    stream = Terminal()
    monkeypatch.setattr(sys, "stderr", stream)
    return stream


def test_nobody_watches_a_pipe(capsys: pytest.CaptureFixture[str]) -> None:
    assert not watched()
    assert list(with_progress(range(3), "things", shown=None)) == [0, 1, 2]
    teller(None)("said")
    assert capsys.readouterr().err == ""


def test_a_terminal_sees_a_bar_that_was_asked_for(monkeypatch: pytest.MonkeyPatch) -> None:
    stream = terminal(monkeypatch)
    assert list(with_progress(range(3), "things", shown=True)) == [0, 1, 2]
    assert "things" in stream.getvalue()
    assert "3/3" in stream.getvalue()


def test_short_work_is_silent(monkeypatch: pytest.MonkeyPatch) -> None:
    stream = terminal(monkeypatch)
    assert list(with_progress(range(3), "things", shown=None)) == [0, 1, 2]
    assert stream.getvalue() == ""


def test_long_work_is_shown_unasked(monkeypatch: pytest.MonkeyPatch) -> None:
    stream = terminal(monkeypatch)
    monkeypatch.setattr("sysid_vehicle._common.progress._SILENT_S", 0.05)
    monkeypatch.setattr("sysid_vehicle._common.progress._REFRESH_S", 0.02)
    for _ in with_progress(range(3), "things", shown=None):
        time.sleep(0.15)  # a step of its own is shown too
    lines = [line.strip() for line in stream.getvalue().split("\r")]
    assert lines[-1] == "", "it is taken away in the end"
    assert any(line.startswith("things 0/3 (") for line in lines)
    assert any(re.match(r"things 1/3, about \d s left \(\d s\)$", line) for line in lines)


def test_the_line_tells_the_outermost_and_the_innermost(monkeypatch: pytest.MonkeyPatch) -> None:
    stream = terminal(monkeypatch)
    monkeypatch.setattr("sysid_vehicle._common.progress._SILENT_S", 0.0)
    monkeypatch.setattr("sysid_vehicle._common.progress._REFRESH_S", 0.02)
    monkeypatch.setenv("COLUMNS", "40")
    with doing("study"), doing("fit"), doing("starts", total=8) as task:
        task.advance(8)
        time.sleep(0.1)
        teller(None)("said")
        time.sleep(0.1)
    lines = stream.getvalue().split("\r")
    assert "study: starts 8/8 (0 s)" in lines
    at = lines.index("said\n")
    assert lines[at - 1].strip() == "", "a sentence has a line of its own"
    assert lines[at + 1] == lines[at - 2] == "study: starts 8/8 (0 s)"
    assert max(map(len, stream.getvalue().replace("\n", "\r").split("\r"))) < 40
    assert not [t for t in threading.enumerate() if t.name == "progress" and t.is_alive()][1:]


def test_other_threads_tell_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    stream = terminal(monkeypatch)
    work = threading.Thread(target=lambda: list(with_progress(range(3), "things", shown=True)))
    work.start()
    work.join()
    assert stream.getvalue() == ""


def test_a_notebook_watches(monkeypatch: pytest.MonkeyPatch) -> None:
    kernel = types.ModuleType("ipykernel.kernelapp")
    kernel.IPKernelApp = types.SimpleNamespace(initialized=lambda: True)  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, "ipykernel.kernelapp", kernel)
    assert watched()


class Impatient(Terminal):
    """Its reader presses Ctrl-C as soon as the baseline is fitted."""

    def write(self, text: str) -> int:
        super().write(text)
        if "Fitted the baseline to lap" in text:
            raise KeyboardInterrupt
        return len(text)


def test_a_study_tells_its_steps_and_after_ctrl_c_what_is_known(
    monkeypatch: pytest.MonkeyPatch, truth: sv.Model
) -> None:
    logs = [sv.drive(truth, sv.manoeuvres.lap(20.0), seed=s, rate_hz=25.0) for s in (1, 2)]
    monkeypatch.setattr(sys, "stderr", Impatient())
    with pytest.raises(sv.Interrupted, match=r"after 0 step.*no effect was added yet") as caught:
        sv.improve(truth, *logs, candidates=["steer_offset"], starts=1)
    (fit,) = caught.value.fits
    assert fit.model.effects == ()
    assert isinstance(caught.value, KeyboardInterrupt), "a loop over studies ends, too"


def test_who_asks_for_silence_gets_it(monkeypatch: pytest.MonkeyPatch) -> None:
    stream = terminal(monkeypatch)
    teller(False)("said")
    assert list(with_progress(range(3), "things", shown=False)) == [0, 1, 2]
    assert stream.getvalue() == ""
    teller(None)("said")
    assert stream.getvalue() == "said\n"
