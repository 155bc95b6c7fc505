"""Commands under faults: killed, interrupted, without room, without the right to write."""

import json
import os
import signal
import stat
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from side_wind import side_wind

import sysid_vehicle as sv
from sysid_vehicle.cli import main

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="signals, devices and limits")

RAN = 'import pathlib\npathlib.Path(__file__).with_suffix(".ran").touch()'


@pytest.fixture
def data(tmp_path: Path) -> Path:
    """What `mu-slip`, a quick command, reads."""
    slip = np.linspace(0.0, 0.3, 60)
    rows = "\n".join(f"{s:.4f},{m:.4f}" for s, m in zip(slip, np.tanh(30.0 * slip), strict=True))
    (tmp_path / "data.csv").write_text(f"slip,mu\n{rows}\n")
    return tmp_path / "data.csv"


@pytest.fixture
def effect_file(tmp_path: Path) -> Iterator[Path]:
    (tmp_path / "e.py").write_text(side_wind("of_a_file", RAN))
    yield tmp_path / "e.py"
    if any(e.id == "of_a_file" for e in sv.catalogue()):
        sv.forget_effect("of_a_file")


@pytest.fixture(params=["full", "read-only"])
def small_disk(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[tuple[Path, str]]:
    """A disk on which nothing can be written, and what the system says of it."""
    disk = tmp_path / "disk"
    disk.mkdir()
    made = subprocess.run(
        ["mount", "-t", "tmpfs", "-o", "size=32k", "tmpfs", str(disk)], capture_output=True
    )
    if made.returncode:
        pytest.skip("only the superuser may mount a disk")
    try:
        (disk / "old.json").write_text("old")
        if request.param == "full":
            with pytest.raises(OSError, match="No space"):
                (disk / "filler").write_bytes(b"x" * 65536)
        else:
            subprocess.run(["mount", "-o", "remount,ro", str(disk)], check=True)
        yield disk, "No space left" if request.param == "full" else "Read-only file system"
    finally:
        subprocess.run(["umount", str(disk)], check=True)


def error_of(capsys: pytest.CaptureFixture[str], *argv: str) -> str:
    assert main(list(argv)) == 2
    err = capsys.readouterr().err.splitlines()
    assert len(err) == 1
    assert err[0].startswith("sysid-vehicle: error: ")
    return err[0]


@pytest.mark.parametrize(
    ("command", "asked", "more"),
    [
        ("compare", "commands.identify", ()),
        ("diagnose", "commands.improve", ()),
        ("improve", "commands.improve", ("--nuisances",)),
        ("changed", "changed.identify", ("--after", "LOG")),
        ("next-drive", "next_drive.identify", ("--between", "mass,steer_lag")),
    ],
)
def test_each_study_of_a_log_begins_with_effects_of_the_users_own(
    command: str,
    asked: str,
    more: tuple[str, ...],
    effect_file: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    car = sv.Model(sv.example_vehicle())
    car.vehicle.to_toml(tmp_path / "car.toml")
    log = str(tmp_path / "lap.csv")
    sv.drive(car, sv.manoeuvres.lap(10.0), seed=1, rate_hz=50.0).to_csv(log)
    models: list[sv.Model] = []

    def kept(model: sv.Model, *_: object, **__: object) -> None:
        models.append(model)
        raise sv.SysidError("asked")

    monkeypatch.setattr(f"sysid_vehicle.cli.{asked}", kept)
    argv = [command, log, "--vehicle", str(tmp_path / "car.toml"), "--define", str(effect_file)]
    argv += ["--effects", "of_a_file,steer_lag", *(log if m == "LOG" else m for m in more)]
    assert main(argv) == 2
    (model,) = models
    assert model.effects[-2:] == ("of_a_file", "steer_lag")


def test_effects_of_a_file_are_run_with_a_word(
    effect_file: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["effects", "--define", str(effect_file)]) == 0
    out, err = capsys.readouterr()
    assert "of_a_file: side wind" in out
    assert err == (f"sysid-vehicle: runs {effect_file} as a Python program, with all your rights\n")
    with pytest.raises(SystemExit):
        main(["compare", "--help"])
    assert "give only what you trust" in " ".join(capsys.readouterr().out.split())


@pytest.mark.parametrize("command", ["compare", "diagnose", "improve"])
def test_the_users_source_is_no_output(
    command: str, effect_file: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = effect_file.parent
    for name in ("x.csv", "car.toml"):
        (folder / name).touch()
    more = ["--report", str(folder / "r.html")] if command == "improve" else []
    log, car = str(folder / "x.csv"), str(folder / "car.toml")
    source = str(effect_file)
    told = error_of(
        capsys, command, log, "--vehicle", car, "--define", source, "--json", source, *more
    )
    assert f"{source}: is also an input of this command" in told
    assert effect_file.read_text() == side_wind("of_a_file", RAN)
    assert not effect_file.with_suffix(".ran").exists()  # refused before it was run


def test_a_device_stays_a_device(data: Path) -> None:
    before = os.stat("/dev/null")
    assert main(["mu-slip", str(data), "--json", "/dev/null"]) == 0
    after = os.stat("/dev/null")
    assert stat.S_ISCHR(after.st_mode)
    assert (before.st_ino, before.st_rdev) == (after.st_ino, after.st_rdev)


def test_a_link_stays_a_link(data: Path) -> None:
    link = data.parent / "link.json"
    link.symlink_to("real.json")
    assert main(["mu-slip", str(data), "--json", str(link)]) == 0
    assert link.is_symlink()
    assert json.loads((data.parent / "real.json").read_text())["recommended"]


def test_a_name_that_is_too_long_is_told_before_the_work(
    data: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    told = error_of(capsys, "mu-slip", str(data), "--json", str(data.parent / ("x" * 260)))
    assert "choose a shorter name" in told


def test_a_disk_without_room_is_told(
    data: Path, small_disk: tuple[Path, str], capsys: pytest.CaptureFixture[str]
) -> None:
    disk, says = small_disk
    before = {p.name: p.read_bytes() for p in disk.iterdir()}
    for name in ("old.json", "new.json"):
        assert main(["mu-slip", str(data), "--json", str(disk / name)]) == 2
        assert f"{disk / name}: cannot be written ({says}" in capsys.readouterr().err
        assert {p.name: p.read_bytes() for p in disk.iterdir()} == before


_AGAIN = """
import sys
from sysid_vehicle.cli import main
print("ready", flush=True)
sys.stdout = sys.stderr
while main(sys.argv[1:]) == 0:
    pass
"""


@pytest.mark.manual
def test_killed_commands_leave_whole_files(data: Path) -> None:
    folder = data.parent
    out, picture = folder / "out.json", folder / "out.svg"
    given = ["mu-slip", str(data), "--json", str(out), "--plot", str(picture)]
    rng = np.random.default_rng(0)
    for _ in range(4):
        with subprocess.Popen(
            [sys.executable, "-c", _AGAIN, *given],
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
        ) as process:
            assert process.stdout is not None
            process.stdout.readline()
            while not out.exists():
                time.sleep(0.01)
            time.sleep(rng.uniform(0.0, 0.7))
            process.send_signal(signal.SIGKILL)
        assert json.loads(out.read_text())["recommended"]
        assert picture.read_text().rstrip().endswith("</svg>")
        left = {p.name for p in folder.iterdir()} - {"data.csv", "out.json", "out.svg"}
        assert all(name.startswith(".sysid-") for name in left)
    assert main(given) == 0
    assert {p.name for p in folder.iterdir()} == {"data.csv", "out.json", "out.svg"}
