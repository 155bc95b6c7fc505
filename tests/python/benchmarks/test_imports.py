"""Benchmarks are run by hand: what they take from the package has to be there all the same."""

import ast
from importlib import import_module, util
from pathlib import Path

import pytest

BENCHMARKS = Path(__file__).resolve().parents[3] / "benchmarks"


@pytest.mark.parametrize(
    "path", sorted(BENCHMARKS.rglob("*.py")), ids=lambda p: str(p.relative_to(BENCHMARKS))
)
def test_what_a_benchmark_takes_from_the_package_is_there(path: Path) -> None:
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if not isinstance(node, ast.ImportFrom) or node.level or not node.module:
            continue
        if node.module.split(".")[0] != "sysid_vehicle":
            continue
        module = import_module(node.module)
        for name in node.names:
            there = hasattr(module, name.name) or util.find_spec(f"{node.module}.{name.name}")
            assert there, f"{node.module} has no {name.name}"
