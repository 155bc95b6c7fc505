"""Ctrl-C at whatever moment of a command: one line, status 130, and nothing is written."""

import os
import signal
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest
from side_wind import side_wind

import sysid_vehicle as sv

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="signals of Unix")

PACKAGE = Path(sv.__file__).parents[1]
Started = Callable[..., "subprocess.Popen[str]"]
WAITS = """
import time
print("ready", flush=True)
for _ in range(12000):
    time.sleep(0.01)
"""
# Destructors, and compiled code that cannot raise, swallow the interrupt.
SWALLOWS = """
import signal
class Thing:
    def __del__(self):
        signal.raise_signal(signal.SIGINT)
Thing()
"""
# From within: the process may have the processor to itself or not, the moment is the same.
LATER = """
import signal, threading, os
threading.Timer({seconds}, lambda: os.kill(os.getpid(), signal.SIGINT)).start()
"""
# Shown before it is swallowed, as modules that Cython compiles do: PyErr_PrintEx asks the hook.
SHOWN = f"""
import sys
sys.excepthook(KeyboardInterrupt, KeyboardInterrupt(), None)
{SWALLOWS}"""


def as_module(*argv: str, verbose: bool = False) -> "subprocess.Popen[str]":
    return started(["-m", "sysid_vehicle", *argv], verbose)


def as_script(*argv: str, verbose: bool = False) -> "subprocess.Popen[str]":
    """As pip writes it."""
    named = "import sys; sys.argv[0] = '/usr/bin/sysid-vehicle'"
    code = f"{named}; from sysid_vehicle.cli import main; sys.exit(main())"
    return started(["-c", code, *argv], verbose)


def started(command: list[str], verbose: bool) -> "subprocess.Popen[str]":
    """Tells on the error stream what it imports, if asked; does not ignore Ctrl-C, as jobs do."""
    path = os.pathsep.join([str(PACKAGE), os.environ.get("PYTHONPATH", "")])
    return subprocess.Popen(
        [sys.executable, *(["-v"] if verbose else []), *command],
        env={**os.environ, "PYTHONPATH": path},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.default_int_handler),
    )


def ended(process: "subprocess.Popen[str]") -> tuple[int, str, str]:
    """Status, what was printed, and the last line of the error stream; no traceback is in it."""
    out, err = process.communicate(timeout=120)
    assert "Traceback" not in err
    assert "Exception ignored" not in err
    return process.returncode, out, err.splitlines()[-1]


@pytest.fixture
def waiting(tmp_path: Path) -> list[str]:
    """A command that does not end by itself."""
    (tmp_path / "waits.py").write_text(WAITS)
    return ["effects", "--define", str(tmp_path / "waits.py")]


@pytest.mark.parametrize("start", [as_module, as_script])
@pytest.mark.parametrize("module", ["numpy", "sysid_vehicle.log", "sysid_vehicle.cli"])
def test_while_it_is_loaded(start: Started, module: str, waiting: list[str]) -> None:
    with start(*waiting, verbose=True) as process:
        assert process.stderr is not None
        assert any(f"import '{module}" in line for line in process.stderr)
        process.send_signal(signal.SIGINT)
        status, out, last = ended(process)
    assert (status, out) == (130, "")
    assert last.endswith("sysid-vehicle: interrupted")  # half a line of imports may stand before


@pytest.mark.parametrize("start", [as_module, as_script])
def test_in_a_command(start: Started, waiting: list[str]) -> None:
    with start(*waiting) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == "ready\n"
        process.send_signal(signal.SIGINT)
        assert ended(process) == (130, "", "sysid-vehicle: interrupted")


@pytest.mark.parametrize("swallows", [SWALLOWS, SHOWN])
def test_where_it_is_swallowed(swallows: str, tmp_path: Path) -> None:
    (tmp_path / "e.py").write_text(swallows + WAITS)
    with as_module("effects", "--define", str(tmp_path / "e.py")) as process:
        assert ended(process) == (130, "ready\n", "sysid-vehicle: interrupted")


@pytest.mark.parametrize("seconds", [0.0, pytest.param(0.1, marks=pytest.mark.manual), 0.5])
def test_a_study_says_so_and_writes_nothing(tmp_path: Path, lap: sv.Log, seconds: float) -> None:
    sv.example_vehicle().to_toml(tmp_path / "car.toml")
    lap.to_csv(tmp_path / "lap.csv")
    (tmp_path / "e.py").write_text(side_wind("of_a_file", LATER.format(seconds=seconds)))
    given = ["diagnose", str(tmp_path / "lap.csv"), "--vehicle", str(tmp_path / "car.toml")]
    given += ["--json", str(tmp_path / "out.json"), "--define", str(tmp_path / "e.py")]
    with as_module(*given) as process:
        status, out, last = ended(process)
    assert (status, out) == (130, "")
    assert last.startswith("sysid-vehicle: interrupted")
    assert {p.name for p in tmp_path.iterdir()} == {"car.toml", "lap.csv", "e.py"}
