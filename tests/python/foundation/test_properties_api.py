"""Whatever log and car they are given, the public calls refuse it in their own words or give finite
numbers. `python benchmarks/fuzz` does the same for as long as one likes; what it once found stands
in `corpus/` and is tried again here."""

import json
import os
import sys
from collections.abc import Iterator
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from oracle import CALLS, judge, not_finite
from strategies import clean_logs, logs, vehicles

from sysid_vehicle import InvalidInput, Vehicle

CORPUS = sorted((Path(__file__).parents[1] / "corpus").glob("*.json"))

LOGS = logs(clean_logs(lengths=st.one_of(st.integers(0, 60), st.integers(100, 800))))
SLOW_TO_DRAW = [HealthCheck.too_slow, HealthCheck.data_too_large]
EXAMPLES = {"read": 150, "identify": 25, "compare": 20, "diagnose": 10}


@pytest.mark.skipif(
    "SYSID_ATTACK" not in os.environ, reason="minutes of attacks; SYSID_ATTACK=1 runs them"
)
@pytest.mark.parametrize("name", CALLS)
def test_a_call_refuses_or_gives_finite_numbers(name: str) -> None:
    @settings(max_examples=EXAMPLES.get(name, 40), suppress_health_check=SLOW_TO_DRAW)
    @given(columns=LOGS, vehicle=vehicles())
    def attack(columns: dict[str, np.ndarray], vehicle: Vehicle) -> None:
        verdict = judge(lambda: CALLS[name](columns, vehicle))
        assert verdict.state != "wrong", verdict.words

    attack()


@pytest.fixture(scope="module")
def fuzz(repo: Path) -> Iterator[ModuleType]:
    """The fuzzer, which is a program and no package."""
    folder = str(repo / "benchmarks" / "fuzz")
    before = set(sys.modules)
    sys.path.insert(0, folder)
    try:
        yield _load(folder)
    finally:
        sys.path.remove(folder)
        for name in {"cases", "files", "judging"} - before:
            sys.modules.pop(name, None)


def _load(folder: str) -> ModuleType:
    spec = spec_from_file_location("sysid_fuzz", f"{folder}/__main__.py")
    assert spec is not None
    assert spec.loader is not None
    module = module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.mark.parametrize("path", CORPUS, ids=lambda path: path.stem)
def test_what_was_once_found(fuzz: ModuleType, path: Path) -> None:
    stored = json.loads(path.read_text())
    for name, verdict in fuzz.run_case(stored["kind"], stored["case"], (stored["call"],)):
        assert verdict.state != "wrong", f"{name}: {verdict.words}"


@pytest.mark.filterwarnings("ignore::sysid_vehicle.SysidWarning")
def test_files_before_they_are_spoilt_are_right(fuzz: ModuleType, tmp_path: Path) -> None:
    for name, (text, reader) in sys.modules["files"].READERS.items():
        (tmp_path / name).write_bytes(text)
        reader(tmp_path / name)


def test_spoilt_files(fuzz: ModuleType) -> None:
    for number in range(300):
        case = sys.modules["files"].draw(number)
        for name, verdict in fuzz.run_case("files", case, ()):
            assert verdict.state != "wrong", f"case {number}, {name}: {verdict.words}"


def test_the_judge_knows_what_is_wrong() -> None:
    def refuse() -> None:
        raise InvalidInput("vx_mps: all values are NaN; give a log with a speed")

    assert judge(refuse).state == "refused"
    assert judge(lambda: {"x": 1.0}).state == "finite"
    assert judge(lambda: {"x": np.array([1.0, np.nan])}).state == "wrong"
    assert judge(lambda: np.array(0.0) / 0.0).state == "wrong"
    assert judge(lambda: [][0]).state == "wrong"  # type: ignore[misc]
    assert not_finite({"a": [1.0, {"b": float("inf")}]}) == "result['a'][1]['b']"


def test_the_fuzzer_writes_what_it_finds_and_goes_on(fuzz: ModuleType, tmp_path: Path) -> None:
    state = tmp_path / "state.json"
    common = ["files", "--workers", "1", "--corpus", str(tmp_path), "--state", str(state)]
    assert fuzz.main([*common, "--count", "20"]) == 0
    assert json.loads(state.read_text()) == {"next": 20}
    assert fuzz.main([*common, "--count", "30"]) == 0
    assert json.loads(state.read_text()) == {"next": 30}
