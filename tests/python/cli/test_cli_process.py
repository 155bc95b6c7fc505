"""The command line as a process of its own."""

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import sysid_vehicle as sv


def run(*argv: str, **keywords: Any) -> "subprocess.CompletedProcess[str]":
    package = Path(sv.__file__).parents[1]
    path = os.pathsep.join([str(package), os.environ.get("PYTHONPATH", "")])
    return subprocess.run(
        [sys.executable, "-m", "sysid_vehicle", *argv],
        env={**os.environ, "PYTHONPATH": path},
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
        **keywords,
    )


def test_python_m_runs_the_same_program(tmp_path: Path) -> None:
    done = run("--version")
    assert (done.returncode, done.stdout.strip()) == (0, sv.__version__)
    done = run("compare", "none.csv", "--vehicle", "none.toml", cwd=tmp_path)
    assert done.returncode == 2
    assert done.stdout == ""
    assert done.stderr.count("\n") == 1
    assert "Traceback" not in done.stderr


@pytest.mark.skipif(not hasattr(os, "fork"), reason="the shell's pipes are those of Unix")
def test_a_closed_pipe_is_no_error() -> None:
    package = Path(sv.__file__).parents[1]
    path = os.pathsep.join([str(package), os.environ.get("PYTHONPATH", "")])
    done = subprocess.run(
        ["sh", "-c", f'"{sys.executable}" -u -m sysid_vehicle effects | head -n 1'],
        env={**os.environ, "PYTHONPATH": path},
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )
    assert done.stdout.count("\n") == 1
    assert done.stderr == ""


@pytest.mark.skipif(not hasattr(os, "fork"), reason="the shell's pipes are those of Unix")
def test_files_are_written_though_nobody_reads_on(tmp_path: Path) -> None:
    rows = "\n".join(f"{0.002 * i},{0.3 * np.sin(0.01 * i):.6f}" for i in range(300))
    (tmp_path / "tyre.csv").write_text("slip,mu\n" + rows + "\n")
    package = Path(sv.__file__).parents[1]
    path = os.pathsep.join([str(package), os.environ.get("PYTHONPATH", "")])
    for both in ("", "2>&1"):
        command = f'"{sys.executable}" -u -m sysid_vehicle mu-slip tyre.csv --json tyre.json {both}'
        subprocess.run(
            ["sh", "-c", f"{command} | true"],
            env={**os.environ, "PYTHONPATH": path},
            cwd=tmp_path,
            timeout=60,
            check=True,
        )
        assert json.loads((tmp_path / "tyre.json").read_text())
        (tmp_path / "tyre.json").unlink()
