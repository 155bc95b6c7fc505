"""Files that commands write: a name does not promise another kind of file."""

from pathlib import Path

import pytest

import sysid_vehicle as sv
from sysid_vehicle.cli import main
from sysid_vehicle.report import write_report


@pytest.mark.parametrize(
    ("command", "name", "kinds"),
    [
        ("improve", "report.pdf", ".html or .md or .htm"),
        ("check", "report.pdf", ".html or .htm"),
        ("check", "report.md", ".html or .htm"),
    ],
)
def test_a_report_is_html_or_where_it_can_be_markdown(
    command: str, name: str, kinds: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    sv.example_vehicle().to_toml(tmp_path / "car.toml")
    (tmp_path / "lap.csv").write_text("time_s\n", encoding="utf-8")
    path = tmp_path / name
    arguments = [str(tmp_path / "lap.csv"), "--vehicle", str(tmp_path / "car.toml")]
    assert main([command, *arguments, "--report", str(path)]) == 2
    said = capsys.readouterr().err
    assert f"{path}: the file will be {kinds}; end the name in {kinds}" in said
    assert not path.exists()


def test_in_python_too(tmp_path: Path) -> None:
    """It is said before anything is asked of the study."""
    for name in ("report.pdf", "report.docx"):
        with pytest.raises(sv.InvalidInput, match=r"HTML or Markdown; end the name in \.html"):
            write_report(None, tmp_path / name)  # type: ignore[arg-type]
