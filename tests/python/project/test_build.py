"""What the build promises: one version, portable code, nothing that changes arithmetic."""

import importlib.metadata
import platform
import re
import shutil
import subprocess
import sys
import tarfile
from pathlib import Path

import pytest

import sysid_vehicle
from sysid_vehicle import _core

REPO = Path(__file__).resolve().parents[3]
CORE = Path(_core.__file__)

# Each of these changes arithmetic for the whole process, ties the build to one kind of machine, or
# starts threads of its own.
BANNED = re.compile(
    r"-ffast-math|-funsafe-math|-Ofast|-march=|-mavx|-mfma|-fopenmp|OpenMP::|#\s*pragma\s+omp"
    r"|EIGEN_DEFAULT_TO_ROW_MAJOR"
)


def build_files() -> list[Path]:
    single = [REPO / "pyproject.toml", REPO / "CMakePresets.json", REPO / "run-tests"]
    listed = [
        path
        for folder in ("cpp", "tests/cpp")
        for pattern in ("CMakeLists.txt", "*.cmake", "*.cpp", "*.hpp")
        for path in (REPO / folder).rglob(pattern)
    ]
    return [REPO / "CMakeLists.txt", REPO / ".ci" / "run", *single, *listed]


def test_the_version_is_the_same_everywhere() -> None:
    stated = re.search(r'^version = "(.+?)"', (REPO / "pyproject.toml").read_text(), re.MULTILINE)
    assert stated
    assert _core.__version__ == stated[1]
    assert sysid_vehicle.__version__ == stated[1]


# Kernels that are compiled for newer processors too, each a file of its own; cpuid chooses.
LANES = re.compile(r"(src/math/lanes_avx\w+\.cpp)\s+PROPERTIES COMPILE_OPTIONS \"[-\w;]+\"")


def test_no_build_file_asks_for_flags_that_change_results() -> None:
    found = {
        f"{path.relative_to(REPO)}: {match[0]}"
        for path in build_files()
        for match in BANNED.finditer(LANES.sub("", path.read_text(encoding="utf-8")))
    }
    assert found == set()


@pytest.mark.parametrize("flag", ["-O3 -ffast-math", "-march=native", "#pragma omp parallel"])
def test_the_search_sees_banned_flags(flag: str) -> None:
    assert BANNED.search(flag)


def test_subnormal_numbers_survive_the_import() -> None:
    code = (
        "import sys, sysid_vehicle._core, numpy\n"
        "assert sys.float_info.min / 2 > 0\n"
        "assert (numpy.full(64, sys.float_info.min) / 2 > 0).all()\n"
    )
    subprocess.run([sys.executable, "-c", code], check=True)


def test_the_import_leaves_what_is_slow_to_load_until_it_is_used() -> None:
    code = (
        "import sys, sysid_vehicle\n"
        "slow = ('scipy.stats', 'scipy.optimize', 'scipy.interpolate', 'scipy.signal',\n"
        "        'scipy.linalg', 'scipy.special', 'matplotlib', 'nlopt', 'pandas')\n"
        "print(*(name for name in slow if name in sys.modules))\n"
    )
    loaded = subprocess.run(
        [sys.executable, "-c", code], check=True, capture_output=True, text=True
    ).stdout
    assert loaded.split() == []


def test_the_extension_brings_no_thread_runtime() -> None:
    content = CORE.read_bytes()
    assert b"libgomp" not in content
    assert b"libomp" not in content


@pytest.mark.skipif(platform.machine() != "x86_64", reason="looks for x86-64 instructions")
@pytest.mark.skipif(shutil.which("objdump") is None, reason="objdump is not installed")
def test_the_extension_runs_on_any_x86_64_processor() -> None:
    """Newer instructions stand in the kernels alone that cpuid chooses."""
    built = [
        path.parents[2] for path in REPO.glob("build/*/cpp/CMakeFiles/*/src/math/lanes_avx2.cpp.o")
    ]
    built.sort(key=lambda folder: folder.stat().st_mtime)
    if not built:
        pytest.skip("the objects of the library are not here: it was built elsewhere")
    objects = [*built[-1].rglob("*.o"), *built[-1].with_name("_core.dir").rglob("*.o")]
    chosen = [path for path in objects if path.name.startswith("lanes_avx")]
    assert len(chosen) == 2
    others = [path for path in objects if path not in chosen]
    code = _said("objdump", "--disassemble", "--no-show-raw-insn", *others)
    assert "%xmm" in code
    assert not re.search(r"%[yz]mm\d", code), "AVX instructions, which older processors lack"
    # The linker may take a weak function from any object: none may come from these.
    weak = [line for line in _said("nm", *chosen).splitlines() if re.search(r" [VWu] ", line)]
    assert weak == []


def _said(*command: str | Path) -> str:
    return subprocess.run(command, check=True, capture_output=True, text=True).stdout


def test_the_package_says_that_it_is_typed() -> None:
    folder = Path(sysid_vehicle.__file__).parent
    assert (folder / "py.typed").is_file()
    assert (folder / "_core.pyi").is_file()


def test_the_command_is_installed() -> None:
    try:
        distribution = importlib.metadata.distribution("sysid-vehicle")
    except importlib.metadata.PackageNotFoundError:
        pytest.skip("the package is used in place, without being installed")
    (command,) = distribution.entry_points.select(group="console_scripts", name="sysid-vehicle")
    assert callable(command.load())


def _what_is_large(folder: str, names: list[str]) -> list[str]:
    """Of the root: what Git ignores as a whole, and its own folder."""
    return [n for n in names if Path(folder) == REPO and n in (".git", ".venv", "build", "dist")]


def test_the_source_distribution_holds_all_that_the_build_needs(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    backend = pytest.importorskip("scikit_build_core.build", reason="the build back end is absent")
    # The back end looks at each file below: tens of thousands in an environment beside the sources.
    tree = tmp_path / "tree"
    shutil.copytree(REPO, tree, symlinks=True, ignore=_what_is_large)
    built = [".venv/lib/any.py", "build/any.cpp", "python/sysid_vehicle/any.so"]
    for name in built:
        (tree / name).parent.mkdir(parents=True, exist_ok=True)
        (tree / name).write_text("built")
    monkeypatch.chdir(tree)
    archive = tmp_path / backend.build_sdist(str(tmp_path))
    with tarfile.open(archive) as opened:
        inside = {member.name.split("/", 1)[1] for member in opened if member.isfile()}
    needed = {
        str(path.relative_to(REPO))
        for folder, patterns in {
            "cpp": ("CMakeLists.txt", "*.cmake", "*.cpp", "*.hpp", "*.inc"),
            "python": ("*.py", "*.pyi", "py.typed"),
        }.items()
        for pattern in patterns
        for path in (REPO / folder).rglob(pattern)
    }
    assert needed | {"CMakeLists.txt", "pyproject.toml", "README.md"} <= inside
    assert not {path for path in inside if path in built or path.endswith(".so")}
