"""Effects that installed packages define: found by metadata, run only when asked for."""

from __future__ import annotations

import sys
import warnings
from pathlib import Path

import pytest

import sysid_vehicle as sv
from sysid_vehicle.cli import main

DEFINES = """
import sysid_vehicle as sv

def flag():
    sv.define_effect(
        "{id}", title="a flag", force_y=lambda d, p: p.gain * d.v_x * d.v_y,
        parameters=[sv.parameter("gain", "kg/m", typical=1.0, lower=-9.0, upper=9.0)],
    )
"""


def install(folder: Path, name: str, code: str, entries: str) -> None:
    """Write a package and its metadata where Python finds both."""
    (folder / f"{name}.py").write_text(code)
    info = folder / f"{name}-1.2.dist-info"
    info.mkdir()
    (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: 1.2\n")
    (info / "entry_points.txt").write_text(f"[sysid_vehicle.effects]\n{entries}\n")


@pytest.fixture
def site(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setattr(sys.modules["sysid_vehicle.effects.catalogue"], "_users", {})
    return tmp_path


def test_a_package_brings_an_effect(site: Path, capsys: pytest.CaptureFixture[str]) -> None:
    install(site, "flags_one", DEFINES.format(id="flag"), "flag = flags_one:flag")
    (listed,) = (p for p in sv.installed_effects() if p.id == "flag")
    assert str(listed) == "flag: defined by the package flags_one 1.2"
    assert main(["effects"]) == 0
    assert "flag: defined by the package flags_one 1.2" in capsys.readouterr().out
    assert "flags_one" not in sys.modules  # metadata alone was read
    with pytest.warns(sv.SysidWarning, match=r"running code of the package flags_one 1.2"):
        model = sv.Model(sv.example_vehicle()).add("flag")
    assert model.parts[0].title == "a flag"
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert sv.effect("flag") == sv.load_effects("flag")[0] == model.parts[0]  # it ran once


def test_the_command_line_takes_the_id(site: Path, capsys: pytest.CaptureFixture[str]) -> None:
    install(site, "flags_two", DEFINES.format(id="flag"), "flag = flags_two:flag")
    assert main(["effects", "--define", "flag"]) == 0
    told = capsys.readouterr()
    assert "force_y += (gain * v_x) * v_y" in told.out
    assert "running code of the package flags_two 1.2" in told.err


@pytest.mark.parametrize(
    ("name", "code", "entry", "message"),
    [
        ("bad_one", "1 / 0", "flag = bad_one:flag", "bad_one 1.2: ZeroDivisionError"),
        ("bad_two", "flag = print", "flag = bad_two:flag", "names it .* does not define it"),
        ("bad_three", "", "flag = bad_three:flag", "bad_three 1.2: AttributeError"),
    ],
)
@pytest.mark.filterwarnings("ignore::sysid_vehicle.SysidWarning")
def test_packages_that_do_not_keep_what_they_say(
    site: Path, name: str, code: str, entry: str, message: str
) -> None:
    install(site, name, code, entry)
    with pytest.raises(sv.InvalidInput, match=message):
        sv.effect("flag")


def test_two_packages_of_one_effect_are_told(site: Path) -> None:
    for name in ("flags_three", "flags_four"):
        install(site, name, DEFINES.format(id="flag"), f"flag = {name}:flag")
    with pytest.raises(sv.InvalidInput, match="several packages define it"):
        sv.effect("flag")


def test_a_name_that_nobody_knows_shows_what_is_installed(site: Path) -> None:
    install(site, "flags_five", DEFINES.format(id="flag_pole"), "flag_pole = flags_five:flag")
    with pytest.raises(sv.InvalidInput, match="did you mean 'flag_pole'"):
        sv.effect("flag_pol")
