"""What the documentation names exists: files, options of commands, public names."""

import ast
import builtins
import importlib
import re
import shlex
from collections.abc import Iterator
from pathlib import Path

import pytest

from sysid_vehicle.cli.parser import parse

REPO = Path(__file__).resolve().parents[3]
README = REPO / "README.md"
PAGES = [
    README,
    *(REPO / name for name in ("ARCHITECTURE.md", "CONTRIBUTING.md")),
    *sorted((REPO / "docs").rglob("*.md")),
    *sorted((REPO / "benchmarks").rglob("*.md")),
]
MODULES = {"sv": "sysid_vehicle"} | {
    name: f"sysid_vehicle.{name}" for name in ("lab", "online", "twin", "published")
}


def name(path: Path) -> str:
    return str(path.relative_to(REPO))


def blocks(path: Path, language: str) -> list[str]:
    text = path.read_text("utf-8")
    return re.findall(rf"^```{language}\n(.*?)^```", text, re.MULTILINE | re.DOTALL)


def commands(path: Path) -> Iterator[list[str]]:
    """Arguments of each `sysid-vehicle ...` in blocks and in the running text."""
    for block in blocks(path, "sh"):
        for line in block.splitlines():
            words = shlex.split(line, comments=True)
            for at, word in enumerate(words):
                if word.rpartition("/")[2] == "sysid-vehicle":
                    yield words[at + 1 :]


def unknown_names(code: str) -> list[str]:
    """Attributes of the package's modules that code uses and that do not exist."""
    unknown = []
    for node in ast.walk(ast.parse(code)):
        if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name):
            module = MODULES.get(node.value.id)
            if module and not hasattr(importlib.import_module(module), node.attr):
                unknown.append(f"{node.value.id}.{node.attr}")
    return unknown


def undefined(code: str) -> list[str]:
    """Names that code reads and nothing in it makes."""
    made, read = set(vars(builtins)), set()
    for node in ast.walk(ast.parse(code)):
        if isinstance(node, ast.Name):
            (read if isinstance(node.ctx, ast.Load) else made).add(node.id)
        elif isinstance(node, ast.alias):
            made.add((node.asname or node.name).partition(".")[0])
        elif isinstance(node, ast.FunctionDef | ast.ClassDef):
            made.add(node.name)
        elif isinstance(node, ast.arg):
            made.add(node.arg)
    return sorted(read - made)


@pytest.mark.parametrize("path", PAGES, ids=name)
def test_links_lead_to_files(path: Path) -> None:
    links = re.findall(r"\]\(([^)#:\s]+)(?:#[^)]*)?\)", path.read_text("utf-8"))
    pages = {link: link.replace(".md", ".ipynb") for link in links}
    places = [
        (path.parent / link, REPO / "notebooks" / Path(other).name)
        for link, other in pages.items()
        # Made of the notebooks, of benchmarks and of the changelog when the site is built.
        if not (path.is_relative_to(REPO / "docs") and link == "changelog.md")
    ]
    assert [str(a) for a, b in places if not a.exists() and not b.exists()] == []


@pytest.mark.parametrize("path", PAGES, ids=name)
def test_commands_are_understood(path: Path) -> None:
    for arguments in commands(path):
        parse([a for a in arguments if a != "LOG..."] + (["a"] if "LOG..." in arguments else []))


@pytest.mark.parametrize("path", PAGES, ids=name)
def test_python_blocks_use_what_exists(path: Path) -> None:
    for block in blocks(path, "python"):
        assert unknown_names(block) == []


@pytest.mark.parametrize("path", PAGES, ids=name)
def test_python_blocks_of_a_page_run_one_after_the_other(path: Path) -> None:
    assert undefined("".join(blocks(path, "python"))) == []


def test_the_checks_see_what_is_missing() -> None:
    assert unknown_names("sv.Log\nsv.nothing()\nonline.KINDS") == ["sv.nothing"]
    assert undefined("import a\nb = [c for c in a.d(e)]\nf = lambda g: print(g)") == ["e"]
    with pytest.raises(SystemExit):
        parse(["compare", "a.csv", "--vehicle", "car.toml", "--nothing"])


def test_the_readme_is_short_and_names_the_test_command() -> None:
    text = README.read_text("utf-8")
    assert len(text.splitlines()) <= 130
    assert any("./run-tests\n" in block for block in blocks(README, "sh"))
    pictures = re.findall(r"!\[[^\]]*\]\(([^)]+)\)", text)
    assert pictures
    assert all((REPO / picture).stat().st_size < 150_000 for picture in pictures)


@pytest.mark.manual
def test_the_readme_prints_what_it_says(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    names: dict[str, object] = {}
    for block in blocks(README, "python"):
        exec(block, names)
    printed = capsys.readouterr().out
    (stated,) = blocks(README, "text")
    words = [re.sub(r"[\d.]+", "0", text).split() for text in (stated, printed)]
    assert words[0] == words[1]
    assert (tmp_path / "report.html").is_file()


QUESTIONS = re.findall(
    r"^\| (Where [^|]+\?) \| ([^|]+) \|$",
    (REPO / "CONTRIBUTING.md").read_text("utf-8"),
    re.MULTILINE,
)


def test_ten_questions_are_answered() -> None:
    assert len(QUESTIONS) >= 10
    assert len({question for question, _ in QUESTIONS}) == len(QUESTIONS)


@pytest.mark.parametrize(("question", "answer"), QUESTIONS, ids=[q for q, _ in QUESTIONS])
def test_answers_are_in_the_tree(question: str, answer: str) -> None:
    """Each names a file, and what to look for in it, which stands there."""
    path, symbol = re.match(r"`([\w./-]+)`(?:, `(\w+)`)?", answer).groups()  # type: ignore[union-attr]
    assert (REPO / path).is_file(), path
    assert symbol, "what to look for in the file?"
    assert re.search(rf"\b{symbol}\b", (REPO / path).read_text("utf-8"))


def test_every_figure_of_a_study_has_its_line() -> None:
    source = (REPO / "python/sysid_vehicle/study/results/record.py").read_text("utf-8")
    (whole,) = (
        node.value
        for part in ast.parse(source).body
        if isinstance(part, ast.FunctionDef) and part.name == "record"
        for node in part.body
        if isinstance(node, ast.Return) and isinstance(node.value, ast.Dict)
    )
    keys = {ast.literal_eval(key) for key in whole.keys if key is not None}
    text = (REPO / "docs/howto/improve.md").read_text("utf-8")
    lines = text[text.index("| key | content |") :].splitlines()[2:]
    told = {name for line in lines for name in re.findall(r"`(\w+)`", line.split("|")[1])}
    assert told == keys


def test_binder_brings_extras_that_exist() -> None:
    script = REPO / ".binder" / "postBuild"
    assert script.stat().st_mode & 0o100  # it is run as a program
    (extras,) = re.findall(r"'\.\[(.+)\]'", script.read_text("utf-8"))
    known = re.findall(r"^(\w+) = \[", (REPO / "pyproject.toml").read_text("utf-8"), re.MULTILINE)
    assert set(extras.split(",")) <= set(known)
