"""The shape of the source tree: who may import whom, how long a file may be."""

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

REPO = Path(__file__).resolve().parents[3]
PACKAGE = REPO / "python" / "sysid_vehicle"
MAX_LINES = 400

# A module imports from its own layer and from the layers above it in this list, never from below.
PYTHON_LAYERS = [
    {"errors", "_common", "_core", "tyre", "vehicle", "effects", "model", "rules", "saved"},
    {"log"},
    {"read"},
    {"manoeuvres"},
    {"simulate"},
    {"sensors"},
    {"forces"},
    {"estimate"},
    {"identify"},
    {"compare"},
    {"export"},
    {"diagnose"},
    {"study"},
    {"lab"},
    {"online"},
    {"twin"},
    {"published"},
    {"plot"},
    {"report"},
    {"fleet"},
    {"demo"},
    {"cli"},
    {"__main__"},
]
# The same for the folders of `diagnose/`; its own modules stand above them all.
DIAGNOSE_LAYERS = [{"evidence"}, {"unexplained"}, {"candidates"}, {"experiment", "change"}]
CPP_LAYERS = [
    "math",
    "model",
    "effects",
    "dynamics",
    "simulate",
    "estimate",
    "identify",
    "lab",
    "online",
    "twin",
    "published",
]

# `Study.report` writes the report of itself, a convenience; it imports only when it is called.
EXCEPTIONS = {("study/study.py", "report")}
# The same inside a folder: `Excitation.preview` says what it will teach, if it is called.
EXCEPTIONS_INSIDE = {("lab/excitation/excitation.py", "design")}
# Parts of a study take the study itself, whose type they name.
OF_ONE_WHOLE = {"study"}
# What repeats published experiments is out of everybody's way: only commands offer it.
ONLY_FOR = {"published": {"cli"}}

RANK = {module: rank for rank, layer in enumerate(PYTHON_LAYERS) for module in layer}
PYTHON_FILES = sorted(path for path in PACKAGE.rglob("*.py") if path != PACKAGE / "__init__.py")
CPP_HEADERS = REPO / "cpp/include/sysid"
CPP_SOURCES = REPO / "cpp/src"
CPP_FILES = sorted(path for root in (CPP_HEADERS, CPP_SOURCES) for path in root.rglob("*.[ch]pp"))


def name(path: Path) -> str:
    return str(path.relative_to(REPO))


def own_module(path: Path) -> str:
    """Give the module directly under the package that this file belongs to."""
    return path.relative_to(PACKAGE).parts[0].removesuffix(".py")


def imported_modules(path: Path, text: str) -> Iterator[tuple[int, str]]:
    """Yield line and module under the package for each import, inside functions too."""
    folder = ("sysid_vehicle", *path.relative_to(PACKAGE).parts[:-1])
    for node in ast.walk(ast.parse(text)):
        targets: list[tuple[str, ...]] = []
        if isinstance(node, ast.Import):
            targets = [tuple(alias.name.split(".")) for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            start = folder[: len(folder) - node.level + 1] if node.level else ()
            base = (*start, *(node.module.split(".") if node.module else ()))
            targets = [(*base, alias.name) for alias in node.names]
        for target in targets:
            if target[0] == "sysid_vehicle":
                yield node.lineno, target[1] if len(target) > 1 else "__init__"


def is_excepted(path: Path, target: str) -> bool:
    return (path.relative_to(PACKAGE).as_posix(), target) in EXCEPTIONS


def python_violations(path: Path, text: str) -> list[str]:
    module = own_module(path)
    found = []
    for line, target in sorted(set(imported_modules(path, text))):
        if target == module or is_excepted(path, target):
            continue
        where = f"{name(path)}:{line}"
        if target not in RANK:
            found.append(f"{where} imports {target}: name the module that defines it")
        elif RANK[target] > RANK[module]:
            found.append(f"{where} {module} imports {target}, which comes after it")
        elif module not in ONLY_FOR.get(target, {module}):
            found.append(f"{where} {module} imports {target}, which is for {ONLY_FOR[target]}")
    return found


def cpp_violations(path: Path, text: str) -> list[str]:
    own = own_cpp_layer(path)
    found = []
    for match in re.finditer(r'^\s*#\s*include\s+["<]sysid/(\w+)/', text, re.MULTILINE):
        target = match[1]
        line = text.count("\n", 0, match.start(1)) + 1
        if target not in CPP_LAYERS:
            found.append(f"{name(path)}:{line} includes the unknown layer {target}")
        elif CPP_LAYERS.index(target) > CPP_LAYERS.index(own):
            found.append(f"{name(path)}:{line} {own} includes {target}, which comes after it")
    return found


def own_cpp_layer(path: Path) -> str:
    """Give the station of a C++ file: the folder under the headers or under the sources."""
    root = CPP_SOURCES if path.is_relative_to(CPP_SOURCES) else CPP_HEADERS
    return path.relative_to(root).parts[0]


def test_there_are_files_to_check() -> None:
    assert len(PYTHON_FILES) > 5
    assert len(CPP_FILES) > 5


def test_every_python_module_has_a_layer() -> None:
    assert {own_module(path) for path in PYTHON_FILES} - set(RANK) == set()


@pytest.mark.parametrize("path", PYTHON_FILES, ids=name)
def test_python_imports_point_forward(path: Path) -> None:
    assert python_violations(path, path.read_text(encoding="utf-8")) == []


def test_python_modules_of_one_layer_form_no_circle() -> None:
    edges: dict[str, set[str]] = {}
    for path in PYTHON_FILES:
        targets = {
            target
            for _, target in imported_modules(path, path.read_text("utf-8"))
            if not is_excepted(path, target)
        }
        edges.setdefault(own_module(path), set()).update(targets - {own_module(path)})
    assert circle(edges) == set()


def circle(edges: dict[str, set[str]]) -> set[str]:
    """Those that import each other in a circle, or import such."""
    left = {module: targets - {module} for module, targets in edges.items()}
    while leaves := {module for module, targets in left.items() if not targets & set(left)}:
        for module in leaves:
            del left[module]
    return set(left)


def imports_inside(folder: Path, path: Path, text: str) -> set[str]:
    """What a file takes from its folder: modules of it, and folders of their own there."""
    package = ("sysid_vehicle", *path.relative_to(PACKAGE).parts[:-1])
    root = ("sysid_vehicle", *folder.relative_to(PACKAGE).parts)
    found: set[str] = set()
    for node in ast.walk(ast.parse(text)):
        if not isinstance(node, ast.ImportFrom) or not node.level:
            continue
        start = package[: len(package) - node.level + 1]
        base = (*start, *(node.module.split(".") if node.module else ()))
        for alias in node.names:
            target = (*base, alias.name)
            if target[: len(root)] == root:
                found.update(target[len(root) : len(root) + 1])
    relative = path.relative_to(PACKAGE).as_posix()
    return {target for target in found if (relative, target) not in EXCEPTIONS_INSIDE}


FOLDERS = sorted({p.parent for p in PACKAGE.glob("*/__init__.py")} - {PACKAGE / "_common"})


@pytest.mark.parametrize("folder", [f for f in FOLDERS if f.name not in OF_ONE_WHOLE], ids=name)
def test_modules_of_one_folder_form_no_circle(folder: Path) -> None:
    """Imports for types and inside functions too; a folder within counts as one module."""
    edges: dict[str, set[str]] = {}
    for path in sorted(folder.rglob("*.py")):
        own = path.relative_to(folder).parts[0].removesuffix(".py")
        if own != "__init__":
            targets = imports_inside(folder, path, path.read_text("utf-8"))
            edges.setdefault(own, set()).update(targets)
    assert edges
    assert circle(edges) == set()


def test_the_check_sees_a_circle_inside_a_folder() -> None:
    folder = PACKAGE / "identify"
    taken = {
        "fit": "if TYPE_CHECKING:\n    from .posterior import Posterior",
        "posterior": "def f():\n    from .maximum import top\nfrom .. import _core",
        "maximum": "from ..identify.fit import Fit",
    }
    edges = {m: imports_inside(folder, folder / f"{m}.py", text) for m, text in taken.items()}
    assert circle(edges) == {"fit", "posterior", "maximum"}
    del edges["maximum"]
    assert circle(edges) == set()
    lab = PACKAGE / "lab"
    text = (
        "from ..design.preview import Preview\nfrom .driven import Driven\nfrom ...log import Log"
    )
    assert imports_inside(lab, lab / "excitation/weaving.py", text) == {"design", "excitation"}
    assert imports_inside(lab, lab / "excitation/excitation.py", text) == {"excitation"}


def test_folders_of_diagnose_import_from_those_above() -> None:
    rank = {folder: k for k, layer in enumerate(DIAGNOSE_LAYERS) for folder in layer}
    back, seen = [], set()
    for path in sorted((PACKAGE / "diagnose").glob("*/*.py")):
        own = path.parent.name
        for node in ast.walk(ast.parse(path.read_text("utf-8"))):
            if isinstance(node, ast.ImportFrom) and node.level == 2:
                target = (node.module or "").split(".")[0]
                seen.add((own, target))
                if rank.get(target, len(rank)) > rank[own]:
                    back.append(f"{name(path)}:{node.lineno} imports {target}")
    assert back == []
    assert ("candidates", "unexplained") in seen


@pytest.mark.parametrize(
    ("module", "text", "expected"),
    [
        ("log/log.py", "from sysid_vehicle.read import read_log", "log imports read"),
        ("log/log.py", "from ..read.csv import rows", "log imports read"),
        ("vehicle.py", "def f():\n    from . import log", "vehicle imports log"),
        ("vehicle.py", "import sysid_vehicle.cli", "vehicle imports cli"),
        ("vehicle.py", "import sysid_vehicle", "imports __init__"),
        ("vehicle.py", "from sysid_vehicle import Log", "imports Log"),
        ("report/html.py", "from ..published import setup", "report imports published, which is"),
    ],
)
def test_the_check_sees_an_import_that_points_back(module: str, text: str, expected: str) -> None:
    violations = python_violations(PACKAGE / module, text)
    assert len(violations) == 1
    assert expected in violations[0]


def test_the_check_lets_forward_imports_pass() -> None:
    text = "from ..log import Log\nfrom .. import _core\nfrom .rows import row\nimport numpy"
    assert python_violations(PACKAGE / "read" / "csv.py", text) == []


def test_one_step_back_is_allowed_and_no_other() -> None:
    assert python_violations(PACKAGE / "study/study.py", "from ..report import write_report") == []
    for path, target in (
        ("study/study.py", "cli"),
        ("study/improve.py", "report"),
        ("diagnose/diagnose.py", "report"),
    ):
        assert len(python_violations(PACKAGE / path, f"from ..{target} import anything")) == 1


@pytest.mark.parametrize("path", CPP_FILES, ids=name)
def test_cpp_includes_point_forward(path: Path) -> None:
    assert own_cpp_layer(path) in CPP_LAYERS
    assert cpp_violations(path, path.read_text(encoding="utf-8")) == []


def test_every_source_stands_in_the_folder_of_its_header() -> None:
    """`src/` mirrors `include/sysid/`: what a source implements is found without a search."""
    headers = {path.relative_to(CPP_HEADERS).with_suffix("") for path in CPP_HEADERS.rglob("*.hpp")}
    lost = []
    for path in sorted(CPP_SOURCES.rglob("*.cpp")):
        place = path.relative_to(CPP_SOURCES).with_suffix("")
        own = re.findall(rf'#include "sysid/({place.parent}/\w+)\.hpp"', path.read_text("utf-8"))
        if place not in headers and not own:
            lost.append(name(path))
    assert lost == []


def test_the_check_sees_an_include_that_points_back() -> None:
    header = CPP_HEADERS / "model/tyre.hpp"
    back = cpp_violations(header, '#include <cmath>\n#include "sysid/estimate/filter.hpp"\n')
    assert back == [
        "cpp/include/sysid/model/tyre.hpp:2 model includes estimate, which comes after it"
    ]
    assert cpp_violations(header, '#include "sysid/math/dual.hpp"\n') == []
    source = CPP_SOURCES / "simulate/simulator.cpp"
    back = cpp_violations(source, '#include "sysid/identify/problem.hpp"\n')
    place = "cpp/src/simulate/simulator.cpp:1"
    assert back == [f"{place} simulate includes identify, which comes after it"]


_OPENED = re.compile(
    r"\bnamespace(?P<space>[\w\s:]*)\{"
    r"|(?<!enum )\b(?:struct|class|union|enum(?: class)?)\s+(?P<type>\w+)(?:\s*final)?"
    r"(?:\s*:[^;{}()]*)?\s*\{"
    r"|(?P<open>\{)|(?P<close>\})"
)


def cpp_types(text: str) -> list[str]:
    """Qualified names of the types that a text defines where other files can see them."""
    text = re.sub(r"//[^\n]*|/\*.*?\*/", "", text, flags=re.DOTALL)
    text = re.sub(r'"(?:\\.|[^"\\\n])*"|\'(?:\\.|[^\'\\\n])+\'', '""', text)
    # `<...>` of a template's head could hold a default of the form `class T`.
    text = re.sub(r"template\s*<[^{};]*?>\s*(?=struct|class|union)", "", text)
    scopes: list[str | None] = []
    found = []
    for match in _OPENED.finditer(text):
        if match["close"]:
            if scopes:
                scopes.pop()
        elif match["space"] is not None:
            # What has no name is seen by no other file.
            scopes.append(match["space"].strip() or None)
        elif match["type"]:
            if None not in scopes:
                found.append("::".join([*(s for s in scopes if s), match["type"]]))
            scopes.append(match["type"])
        else:
            scopes.append(None)
    return found


def test_no_two_files_define_a_type_of_one_name() -> None:
    """Two definitions of one name are one to the linker: either may be taken for both."""
    where: dict[str, list[str]] = {}
    for path in [*CPP_FILES, *sorted((REPO / "cpp/bindings").glob("*.[ch]pp"))]:
        for found in set(cpp_types(path.read_text(encoding="utf-8"))):
            where.setdefault(found, []).append(name(path))
    assert len(where) > 100
    assert "sysid::TwinObserverSettings" in where
    assert {found: files for found, files in where.items() if len(files) > 1} == {}


def test_the_check_sees_types_that_others_see_and_no_others() -> None:
    text = """
    namespace sysid { // struct InAComment {}
    struct Forward;
    template <class T> struct Pair { T a; struct Inner { int x; }; };
    enum class Kind : int { kOne };
    namespace { struct Hidden { int x; }; }
    inline int f(struct Pair<int> p) { struct Local { int x; }; return sizeof(Local); }
    namespace online { class Settings final : public Pair<int> { int b; }; }
    }
    """
    assert cpp_types(text) == [
        "sysid::Pair", "sysid::Pair::Inner", "sysid::Kind", "sysid::online::Settings",
    ]  # fmt: skip


def test_only_what_users_get_is_listed() -> None:
    """In other modules a name without an underscore says as much."""
    listed = {p for p in PYTHON_FILES if re.search(r"^__all__", p.read_text("utf-8"), re.MULTILINE)}
    assert {p for p in listed if p.name != "__init__.py"} == {PACKAGE / "errors.py"}


def test_tests_mirror_the_package() -> None:
    """The tests of a station stand in the folder of its name."""
    tests = REPO / "tests/python"
    assert list(tests.glob("test_*.py")) == []
    folders = {path.parent.name for path in tests.glob("*/test_*.py")}
    assert folders - set(RANK) == {"foundation", "project", "benchmarks"}


def test_no_file_is_too_long_to_read() -> None:
    suffixes = {".py", ".pyi", ".cpp", ".hpp", ".cmake"}
    lines = {
        name(path): len(path.read_text(encoding="utf-8").splitlines())
        for folder in ("cpp", "python", "tests", "benchmarks")
        for path in (REPO / folder).rglob("*")
        if path.suffix in suffixes
    }
    assert lines, "no source file was found"
    assert {path: count for path, count in lines.items() if count > MAX_LINES} == {}


def test_nothing_that_runs_in_threads_changes_the_filters_of_warnings() -> None:
    """They belong to the process: a thread that restores them sets others' filters anew."""
    on_the_main_thread = {"cli/main.py", "fleet/work.py", "twin/calibrate.py", "_common/tables.py"}
    found = {
        str(path.relative_to(PACKAGE))
        for path in PACKAGE.rglob("*.py")
        if "catch_warnings" in path.read_text(encoding="utf-8")
    }
    assert found == on_the_main_thread
