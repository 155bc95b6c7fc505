"""Whatever columns come: a log of finite numbers, or an error that says what to do."""

import csv
import re
import warnings
from pathlib import Path

import numpy as np
import pytest
import strategies
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from sysid_vehicle.errors import InvalidInput, SysidWarning
from sysid_vehicle.log import Log
from sysid_vehicle.read import read_log

PLACE = re.compile(r"sample|t = |samples|line|missing column|length|s of the log|byte|at least")
REMEDY = re.compile(
    r"put |give |check|delete|cut |record|correct|rename|leave|map |sort|fill|set |swap|empty|shift"
    r"|export|drive |needed|clocks|choose|complete|close"
)


def read(columns: strategies.Columns, check: bool = True) -> Log | None:
    """Build a log and hold every message to what messages promise; None if it was refused."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        try:
            log = Log.from_arrays(columns, name="run", check=check)
        except InvalidInput as error:
            log = None
            told = [str(error)]
        else:
            told = []
    assert [w for w in caught if not issubclass(w.category, SysidWarning)] == []
    for text in told + [str(w.message) for w in caught]:
        assert text.startswith("run: ")
        assert any(name in text for name in strategies.CHANNELS), text
        assert REMEDY.search(text), text
        assert "\n" not in text
    for text in told:
        assert PLACE.search(text), text
    return log


@given(strategies.logs(), st.booleans())
def test_any_columns_are_a_log_or_an_error(columns: strategies.Columns, check: bool) -> None:
    before = {name: values.copy() for name, values in columns.items()}
    log = read(columns, check)
    for name, values in columns.items():
        np.testing.assert_array_equal(values, before[name])
    if log is None:
        return
    assert np.isfinite(log.rate_hz)
    assert log.rate_hz > 0.0
    assert (np.diff(log["time_s"]) > 0.0).all()
    for name in log.channels:
        assert log[name].shape == (log.n,)
        assert not np.isinf(log[name]).any()
    assert all(part.stop <= log.n for part in log.stretches())
    assert "run" in str(log)


@given(
    strategies.clean_logs(
        lengths=st.integers(200, 2000), rates=st.sampled_from([20.0, 50.0, 100.0])
    )
)
def test_a_clean_log_is_never_refused(columns: strategies.Columns) -> None:
    seconds = columns["time_s"][-1]
    log = read(columns)
    assert log is not None or seconds < 5.0


@pytest.mark.parametrize("seed", [1812152180, 1533802531, 2357659483, 1570158557, 3976774156])
@pytest.mark.parametrize("noise", [0.0, 1.0, 5.0])
def test_force_against_the_drag_of_tight_corners_is_right(seed: int, noise: float) -> None:
    """On a radius of 7 m most of the wheel force holds the speed against the steered wheels."""
    assert read(strategies.car_columns(634, 50.0, seed, 8.0, 9.0, noise)) is not None


@pytest.mark.parametrize("left_out", [(), ("vy_mps",), ("ax_mps2",), ("vy_mps", "ax_mps2")])
def test_corners_alone_are_no_acceleration_that_the_force_must_follow(
    left_out: tuple[str, ...],
) -> None:
    """The force varies by 0.3 m/s2, what corners add to the change of speed by 1.3."""
    columns = strategies.car_columns(1599, 50.0, 2371589828, 9.0, 9.0, 5.0)
    assert read({name: columns[name] for name in columns if name not in left_out}) is not None


def test_a_lateral_speed_that_holds_its_law_is_right_where_yaw_acceleration_looks_alike() -> None:
    """At constant speed both have one shape; without noise a regression takes either."""
    assert read(strategies.car_columns(1810, 20.0, 2579258742, 9.009, 9.0, 0.0)) is not None


@given(strategies.clean_logs(lengths=st.integers(50, 500)), st.integers(0, 10**6), st.data())
def test_uneven_time_loses_no_channel(
    columns: strategies.Columns, seed: int, data: st.DataObject
) -> None:
    """Every channel at a rate of its own, on a clock that jitters."""
    rng = np.random.default_rng(seed)
    n = columns["time_s"].size
    step = columns["time_s"][1]
    columns["time_s"] = columns["time_s"] + step * rng.uniform(-0.2, 0.2, n)
    every = {}
    for name in ("vy_mps", "vx_mps", "ax_mps2"):
        if name in columns:
            every[name] = data.draw(st.sampled_from([1, 2, 5, 10]))
            columns[name][np.arange(n) % every[name] != 0] = np.nan
    log = read(columns, check=False)
    assert log is not None
    for name, rows in every.items():
        if name != "ax_mps2":  # an input is interpolated
            known = np.count_nonzero(np.isfinite(log[name]))
            assert known == pytest.approx(n / rows, rel=0.05, abs=2)


CELLS = st.one_of(
    st.floats(allow_nan=True, allow_infinity=True).map(repr),
    st.sampled_from(["", " ", "x", "1,5", '"', "#", "2024-05-01T10:00:00", "\x00", "1e999", "m/s"]),
)


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.lists(st.lists(CELLS, min_size=1, max_size=9), max_size=6), st.sampled_from(",;\t"))
def test_any_text_is_a_log_or_an_error(
    tmp_path: Path, rows: list[list[str]], delimiter: str
) -> None:
    path = tmp_path / "run.csv"
    with path.open("w", newline="", encoding="utf-8") as stream:
        stream.write(delimiter.join(strategies.CHANNELS) + "\n")
        stream.writelines(delimiter.join(row) + "\n" for row in rows)
    _refused_or_read(path)


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.binary(max_size=400))
def test_any_bytes_are_a_log_or_an_error(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "run.csv"
    path.write_bytes(content)
    _refused_or_read(path)


def _refused_or_read(path: Path) -> None:
    refusal = None
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        try:
            read_log(path)
        except InvalidInput as error:
            refusal = str(error)
    assert [w for w in caught if not issubclass(w.category, SysidWarning)] == []
    assert refusal is None or refusal.startswith(f"{path}: ")


def test_csv_writer_of_others_is_understood(tmp_path: Path) -> None:
    columns = strategies.car_columns(700, 100.0, seed=1)
    with (tmp_path / "run.csv").open("w", newline="", encoding="utf-8") as stream:
        writer = csv.writer(stream, quoting=csv.QUOTE_ALL)
        writer.writerow(columns)
        writer.writerows(np.column_stack(list(columns.values())).tolist())
    np.testing.assert_array_equal(read_log(tmp_path / "run.csv")["ay_mps2"], columns["ay_mps2"])
