"""The log object: grid, holes, stretches, parts, files and displays."""

import pickle
import time
import warnings
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from smooth_log import Columns, columns, make

from sysid_vehicle.errors import InvalidInput, SysidWarning
from sysid_vehicle.log import CHANNELS, Log
from sysid_vehicle.read import read_log


@pytest.fixture
def data() -> Columns:
    return columns(np.arange(1001) * 0.01)


def test_holds_what_it_was_given(data: Columns) -> None:
    data["temperature"] = np.arange(1001)
    data["driver"] = np.array(["Ann"] * 1001)
    data["date"] = np.datetime64("2014-02-22") + np.arange(1001)
    log = make(data)
    assert (log.name, log.n, len(log), log.uniform) == ("run 1", 1001, 1001, True)
    assert log.duration_s == pytest.approx(10.0, abs=1e-12)
    assert log.rate_hz == pytest.approx(100.0, rel=1e-12)
    assert log.channels == (*(name for name in CHANNELS if name in data), "temperature")
    assert log.extras == ("temperature",)
    assert log.has("ax_mps2")
    assert not log.has("vy_mps")
    for name in log.channels[1:]:
        np.testing.assert_array_equal(log[name], data[name])
    assert log["temperature"].dtype == np.float64


def test_dates_without_time_are_no_time(data: Columns) -> None:
    data["time_s"] = np.datetime64("2014-02-22") + np.arange(1001)
    with pytest.raises(InvalidInput, match=r"time_s: the stamps are 8.64e\+04 s apart.*sample 0"):
        make(data)


def test_channels_are_private_and_read_only(data: Columns) -> None:
    log = make(data)
    data["vx_mps"][:] = 0.0
    assert log["vx_mps"].min() == 20.0
    with pytest.raises(ValueError, match="read-only"):
        log["vx_mps"][0] = 1.0
    copy = pickle.loads(pickle.dumps(log))
    np.testing.assert_array_equal(copy["vx_mps"], log["vx_mps"])


def test_a_data_frame_works_as_it_is(data: Columns) -> None:
    class Frame:
        """Behaves as a DataFrame does: keys are an index object, columns are series."""

        def keys(self) -> np.ndarray:
            return np.array(list(data), dtype=object)

        def __getitem__(self, key: str) -> list[float]:
            return data[key].tolist()

    np.testing.assert_array_equal(Log.from_arrays(Frame(), check=False)["ay_mps2"], data["ay_mps2"])


def test_absent_channels(data: Columns) -> None:
    log = make(data)
    assert set(log.missing()) == {"vy_mps", "fx_n"}
    assert "sideslip" in log.missing()["vy_mps"]
    with pytest.raises(InvalidInput, match=r"no channel 'vy_mps'.*sideslip is not measured"):
        log["vy_mps"]
    with pytest.raises(InvalidInput, match="did you mean 'steer_rad'"):
        log["steer"]


def test_part_of_a_log(data: Columns) -> None:
    part = make(data).between(2.0, 3.0)
    assert (part.n, part["time_s"][0]) == (101, pytest.approx(2.0))
    assert part.rate_hz == pytest.approx(100.0)
    np.testing.assert_array_equal(part["ay_mps2"], data["ay_mps2"][200:301])
    with pytest.raises(InvalidInput, match="between 20 and 30 s; the log goes from 0 to 10 s"):
        make(data).between(20.0, 30.0)


def test_csv_round_trip_is_exact(data: Columns, tmp_path: Path) -> None:
    data["vy_mps"] = np.sin(data["time_s"]) / 3.0
    data["vy_mps"][5:9] = np.nan
    data["oil, hot"] = np.cos(data["time_s"])
    log = make(data)
    log.to_csv(tmp_path / "out.csv")
    again = read_log(tmp_path / "out.csv", check=False)
    assert again.channels == log.channels
    for name in log.channels[1:]:
        np.testing.assert_array_equal(again[name], log[name])
    np.testing.assert_allclose(again["time_s"], log["time_s"], rtol=0, atol=1e-13)
    assert [path.name for path in tmp_path.iterdir()] == ["out.csv"]


def test_failed_writing_leaves_the_old_file(
    data: Columns, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    target = tmp_path / "out.csv"
    target.write_text("precious")

    def fail(*_: object) -> None:
        raise OSError("disk full")

    monkeypatch.setattr("os.replace", fail)
    with pytest.raises(InvalidInput, match="disk full"):
        make(data).to_csv(target)
    assert target.read_text() == "precious"
    assert [path.name for path in tmp_path.iterdir()] == ["out.csv"]


class TestGrid:
    def test_jitter_is_resampled(self, rng: np.random.Generator) -> None:
        jittered = np.arange(1001) * 0.01 + rng.uniform(-2e-3, 2e-3, 1001)
        with pytest.warns(SysidWarning, match="time_s: has steps of .* resampled at") as caught:
            log = make(columns(jittered))
        assert len(caught) == 1
        assert not log.uniform
        np.testing.assert_allclose(np.diff(log["time_s"]), 1.0 / log.rate_hz, rtol=1e-9)
        exact = columns(log["time_s"])
        # No worse than a line, which between samples h apart misses it by at most 2 h^2 / 8.
        np.testing.assert_allclose(log["ay_mps2"], exact["ay_mps2"], atol=2 * 0.014**2 / 8)
        np.testing.assert_allclose(log["vx_mps"], exact["vx_mps"], rtol=1e-12)

    def test_one_percent_is_uniform(self) -> None:
        even = np.arange(1001) * 0.01
        even[500] += 0.9e-4
        assert make(columns(even)).uniform

    def test_time_written_with_few_decimals_is_uniform(self) -> None:
        exact = np.arange(1501) / 150.0
        log = make(columns(np.round(exact, 3)))
        assert log.uniform
        np.testing.assert_allclose(log["time_s"], exact, atol=1e-3)

    def test_lost_rows_are_interpolated(self, data: Columns) -> None:
        kept = np.delete(np.arange(1001), [400, 401, 700])
        with pytest.warns(SysidWarning, match="lacks rows in 2 places, first at sample 400"):
            log = make({name: values[kept] for name, values in data.items()})
        assert log.n == 1001
        np.testing.assert_allclose(log["vx_mps"], data["vx_mps"], rtol=1e-12)
        np.testing.assert_array_equal(log["ay_mps2"][500:700], data["ay_mps2"][500:700])

    def test_long_gap_becomes_nan_and_splits_the_stretches(self, data: Columns) -> None:
        kept = np.delete(np.arange(1001), np.arange(400, 500))
        with pytest.warns(
            SysidWarning, match=r"1 gap of up to 1.01 s, .*sample 400 \(t = 5 s\)"
        ) as w:
            log = make({name: values[kept] for name, values in data.items()})
        assert len(w) == 1
        assert np.isnan(log["ay_mps2"][400:500]).all()
        np.testing.assert_array_equal(log["ay_mps2"][:400], data["ay_mps2"][:400])
        np.testing.assert_array_equal(log["ay_mps2"][500:], data["ay_mps2"][500:])
        assert log.stretches() == [slice(0, 400), slice(500, 1001)]

    @pytest.mark.parametrize("scale", [1e3, 1e6, 1e9])
    @pytest.mark.parametrize("rate_hz", [5.0, 100.0, 1000.0])
    def test_other_units_of_time(self, scale: float, rate_hz: float) -> None:
        values = columns(np.arange(1001) / rate_hz * scale)
        factor = {1e3: "0.001", 1e6: "1e-6", 1e9: "1e-9"}[scale]
        with pytest.raises(InvalidInput, match=f"time_s: steps of .*factor = {factor} "):
            make(values)

    def test_time_that_nearly_repeats(self, data: Columns) -> None:
        data["time_s"][500] = np.nextafter(data["time_s"][499], 9.0)
        with pytest.raises(InvalidInput, match=r"time_s: nearly repeats at sample 500 \(t = 4.99"):
            make(data)

    def test_time_without_end(self, data: Columns) -> None:
        data["time_s"][[0, -1]] = -1.7e308, 1.7e308
        with pytest.raises(InvalidInput, match=r"time_s: goes from -1.7e\+308 to 1.7e\+308"):
            make(data)

    @pytest.mark.parametrize("lost", [[17], [50], [33, 66], [24, 49, 74]])
    def test_lost_rows_of_a_time_with_few_decimals(self, lost: list[int]) -> None:
        values = columns(np.setdiff1d(np.arange(100), lost) / 100.0)
        with pytest.warns(SysidWarning, match=f"lacks rows in {len(lost)} places"):
            log = make(values)
        assert log.rate_hz == pytest.approx(100.0)
        np.testing.assert_allclose(log["vx_mps"], 20.0 + 0.5 * log["time_s"], atol=1e-9)

    @pytest.mark.parametrize("rate_hz", [80.0, 99.0, 60.0, 30.0])
    def test_an_even_time_that_was_rounded(self, rate_hz: float) -> None:
        values = columns(np.round(np.arange(1200) / rate_hz, 2))
        log = make(values)
        assert log.n == 1200
        assert log.rate_hz == pytest.approx(rate_hz, rel=1e-3)
        np.testing.assert_array_equal(log["vx_mps"], values["vx_mps"])

    @given(
        start=st.floats(-1e3, 1e5), rate=st.floats(20.0, 1000.0), lost=st.sets(st.integers(1, 98))
    )
    def test_grid_always_covers_the_log(self, start: float, rate: float, lost: set[int]) -> None:
        kept = np.setdiff1d(np.arange(100), list(lost))
        values = columns(start + kept / rate)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", SysidWarning)
            log = make(values)
        grid = log["time_s"]
        # Whatever was lost, the values on the grid are those of the line they came from.
        assert grid[0] == values["time_s"][0]
        assert grid[-1] == pytest.approx(values["time_s"][-1], abs=1.01 / log.rate_hz)
        known = np.isfinite(log["vx_mps"])
        np.testing.assert_allclose(log["vx_mps"][known], 20.0 + 0.5 * grid[known], atol=1e-6)


class TestStretches:
    def test_slow_parts_are_left_out(self, data: Columns) -> None:
        data["vx_mps"][300:600] = 1.0
        assert make(data).stretches() == [slice(0, 300), slice(600, 1001)]
        assert make(data).stretches(min_speed_mps=0.5) == [slice(0, 1001)]
        assert make(data).stretches(min_duration_s=3.5) == [slice(600, 1001)]

    def test_missing_measurements_break_nothing(self, data: Columns) -> None:
        for name in ("vx_mps", "yaw_rate_radps", "ay_mps2"):
            data[name][100:140] = np.nan
        log = make(data)
        assert log.stretches() == [slice(0, 1001)]
        assert np.isnan(log["vx_mps"][100:140]).all()

    def test_short_hole_in_an_input_is_interpolated(self, data: Columns) -> None:
        truth = data["ax_mps2"].copy()
        data["ax_mps2"][100:110] = np.nan
        with pytest.warns(SysidWarning, match=r"ax_mps2: 10 missing.*sample 100 \(t = 1 s\)"):
            log = make(data)
        np.testing.assert_allclose(log["ax_mps2"], truth)
        assert log.stretches() == [slice(0, 1001)]

    def test_the_model_starts_where_the_speed_is_measured(self, data: Columns) -> None:
        # A filter begins at the first speed; before it, it would have to guess one.
        for channel in ("vx_mps", "ax_mps2"):
            data[channel][:60] = np.nan
        data["fx_n"] = np.full(1001, 800.0)
        with pytest.warns(SysidWarning):
            log = make(data)
        assert log.stretches() == [slice(60, 1001)]

    def test_a_stretch_without_a_speed_is_left_out(self, data: Columns) -> None:
        data["vx_mps"][390:611] = np.nan
        data["steer_rad"][380:400] = data["steer_rad"][600:620] = np.nan
        with pytest.warns(SysidWarning):
            log = make(data)
        assert log.stretches() == [slice(0, 380), slice(620, 1001)]

    def test_long_hole_in_an_input_splits(self, data: Columns) -> None:
        data["steer_rad"][400:411] = np.nan
        assert make(data).stretches() == [slice(0, 400), slice(411, 1001)]

    def test_commanded_force_takes_precedence_over_acceleration(self, data: Columns) -> None:
        data["fx_n"] = np.full(1001, 800.0)
        data["fx_n"][:200] = np.nan
        data["ax_mps2"][500:540] = np.nan
        with pytest.warns(SysidWarning, match="fx_n: no values at samples 0 to 199"):
            log = make(data)
        assert log.stretches() == [slice(200, 1001)]

    def test_none(self, data: Columns) -> None:
        assert make(data).stretches(min_speed_mps=100.0) == []


class TestSpikes:
    def test_despike_removes_only_the_spikes(self, data: Columns, rng: np.random.Generator) -> None:
        steer = data["steer_rad"] + rng.normal(0.0, 2e-4, 1001)
        data["steer_rad"] = steer.copy()
        data["steer_rad"][[123, 456, 900]] += [0.1, -0.05, 0.4]
        with pytest.warns(
            SysidWarning, match=r"removed 3 one-sample .*123 \(t = 1.23 s\)"
        ) as caught:
            log = make(data, despike=["steer_rad"])
        assert len(caught) == 1
        np.testing.assert_allclose(log["steer_rad"], steer, atol=2e-3)
        untouched = np.delete(np.arange(1001), [123, 456, 900])
        np.testing.assert_array_equal(log["steer_rad"][untouched], steer[untouched])

    def test_spikes_of_a_measurement_stay_missing(self, data: Columns) -> None:
        data["ay_mps2"][500] = 30.0
        with pytest.warns(SysidWarning, match="ay_mps2: removed 1"):
            log = make(data, despike=["ay_mps2"])
        assert np.flatnonzero(np.isnan(log["ay_mps2"])).tolist() == [500]

    @pytest.mark.parametrize(
        "movement",
        [
            lambda t: np.where(t < 5.0, 0.0, 0.1),
            lambda t: 0.05 * np.sin(2 * np.pi * 6.0 * t),
            lambda t: np.round(0.05 * np.sin(t) / 0.008) * 0.008,
            lambda t: 0.1 * np.maximum(0.0, 1.0 - np.abs(t - 5.0) / 0.1),
            lambda t: np.zeros_like(t),
        ],
        ids=["step", "fast sine", "coarse", "flick", "zero"],
    )
    def test_true_movements_are_no_spikes(
        self, data: Columns, movement: Callable[[np.ndarray], np.ndarray]
    ) -> None:
        data["steer_rad"] = movement(data["time_s"])
        np.testing.assert_array_equal(
            make(data, despike=["steer_rad"])["steer_rad"], data["steer_rad"]
        )

    def test_random_noise_holds_no_spikes(self, data: Columns, rng: np.random.Generator) -> None:
        data["steer_rad"] = rng.normal(0.0, 0.01, 1001)
        assert not np.isnan(make(data, despike=["steer_rad"])["steer_rad"]).any()


class TestDisplay:
    def test_text_table(self, data: Columns) -> None:
        data["ay_mps2"][:50] = np.nan
        lines = str(make(data)).splitlines()
        assert lines[0] == "run 1: 10 s at 100 Hz, 1001 samples"
        assert lines[1].split() == ["channel", "unit", "min", "max", "missing", "%"]
        row = next(line for line in lines if "ay_mps2" in line)
        assert row.split() == ["ay_mps2", "m/s2", "-2", "2", "5"]
        assert any("absent: vy_mps" in line for line in lines)
        assert "run 1" in repr(make(data))

    def test_html_table(self, data: Columns) -> None:
        data["<x>"] = data["ay_mps2"]
        text = make(data)._repr_html_()
        assert text.count("<tr>") == 1 + len(data)
        assert "&lt;x&gt;" in text

    def test_plot(self, data: Columns) -> None:
        log = make(data)
        axes = log.plot()
        assert [ax.get_ylabel() for ax in axes] == [
            "vx_mps",
            "steer_rad",
            "yaw_rate_radps",
            "ay_mps2",
            "ax_mps2",
        ]
        assert len(log.plot(axes)[0].lines) == 2
        with pytest.raises(InvalidInput, match="needs 5 axes, got 2"):
            log.plot(axes[:2])


def test_building_a_long_log_is_quick() -> None:
    long = columns(np.arange(55_000) * 0.01)
    start = time.process_time()
    make(long)
    assert time.process_time() - start < 1.0


def test_times_of_a_clock_are_counted_from_the_first(data: Columns) -> None:
    log = make({**data, "time_s": data["time_s"] + 1.7e9})
    np.testing.assert_allclose(log["time_s"], data["time_s"], atol=1e-6)
    assert log.rate_hz == pytest.approx(100.0)
    assert make({**data, "time_s": data["time_s"] + 5e5})["time_s"][0] == 5e5
