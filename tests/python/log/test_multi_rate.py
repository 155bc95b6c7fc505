"""Channels that are sampled more slowly than the log: empty in between, or held."""

import re
import warnings

import numpy as np
import pytest
from smooth_log import Columns, columns, make

from sysid_vehicle.errors import SysidWarning
from sysid_vehicle.log import Log
from sysid_vehicle.log.held import blank_held, held_rows


@pytest.fixture
def data() -> Columns:
    return columns(np.arange(1001) * 0.01)


class TestEmptyInBetween:
    @pytest.mark.parametrize(("every", "rate_hz"), [(2, 50.0), (5, 20.0), (10, 10.0), (100, 1.0)])
    @pytest.mark.parametrize("jitter", [0.0, 0.01, 0.3])
    def test_slow_channel_keeps_its_samples(
        self, rng: np.random.Generator, every: int, rate_hz: float, jitter: float
    ) -> None:
        time_s = 0.01 * (np.arange(2001) + jitter * rng.uniform(-1.0, 1.0, 2001))
        values = columns(time_s)
        values["vy_mps"] = np.where(np.arange(2001) % every == 0, 0.3 * np.sin(time_s), np.nan)
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            log = make(values)
        known = np.isfinite(log["vy_mps"])
        assert np.count_nonzero(known) == pytest.approx(2000 / every + 1, abs=1)
        exact = 0.3 * np.sin(log["time_s"][known])
        # A line over a period, or for lone samples the value half a step away.
        bound = 0.3 * max(1.0 / rate_hz**2 / 8, 0.0 if every < 100 else 0.008)
        np.testing.assert_allclose(log["vy_mps"][known], exact, atol=1.2 * bound)
        assert np.isfinite(log["ay_mps2"]).all()
        assert len(caught) == (1 if jitter else 0)
        if jitter:
            own = re.search(r"vy_mps at its own ([\d.]+) Hz", str(caught[0].message))
            assert own is not None
            assert float(own[1]) == pytest.approx(rate_hz, rel=0.02)

    def test_rows_of_several_sources(self, rng: np.random.Generator) -> None:
        """A 100 Hz sensor and a 20 Hz one whose rows lie in between."""
        fast, slow = 0.01 * np.arange(1001), 0.05 * np.arange(1, 200) + 0.0037
        time_s = np.sort(np.concatenate((fast, slow)))
        is_slow = np.isin(time_s, slow)
        values = columns(time_s)
        for name in values:
            if name != "time_s":
                values[name][is_slow if name != "vx_mps" else ~is_slow] = np.nan
        with pytest.warns(SysidWarning, match=r"resampled at 100 Hz, vx_mps at its own 20 Hz"):
            log = make(values)
        assert (log.n, round(log.rate_hz)) == (1001, 100)
        assert np.isfinite(log["ay_mps2"]).all()
        known = np.isfinite(log["vx_mps"])
        assert np.count_nonzero(known) == 199
        np.testing.assert_allclose(
            log["vx_mps"][known], 20.0 + 0.5 * log["time_s"][known], atol=0.5 * 0.005
        )

    def test_slow_input_is_interpolated_and_told(self, data: Columns) -> None:
        data["steer_rad"][np.arange(1001) % 20 != 0] = np.nan
        with pytest.warns(SysidWarning, match=r"steer_rad: holds a value only every 0.2 s"):
            log = make(data)
        np.testing.assert_allclose(log["steer_rad"], 0.05 * np.sin(data["time_s"]), atol=3e-4)


class TestHeld:
    """A slow channel that the logger repeats until its next sample."""

    @pytest.mark.parametrize("rows", [2, 4, 10, 10 / 3, 50])
    def test_only_fresh_samples_count(self, rows: float, rng: np.random.Generator) -> None:
        values = columns(np.arange(4001) * 0.01)
        true = values["ay_mps2"] + rng.normal(0.0, 0.05, 4001)
        _, first, of = np.unique(
            np.floor(np.arange(4001) / rows + 1e-9), return_index=True, return_inverse=True
        )
        fresh = first[of]
        values["ay_mps2"] = true[fresh]
        with pytest.warns(SysidWarning) as caught:
            log = Log.from_arrays(values, name="run 1")
        text = str(caught[0].message)
        assert f"ay_mps2: each value is held for {rows:.3g} samples" in text
        assert f"a channel of {100 / rows:.3g} Hz in a log of 100 Hz" in text
        known = np.flatnonzero(np.isfinite(log["ay_mps2"]))
        np.testing.assert_array_equal(known, np.unique(fresh))
        np.testing.assert_array_equal(log["ay_mps2"][known], true[known])

    @pytest.mark.parametrize("quantum", [1e-3, 0.01, 0.1, 0.5, 1.0])
    @pytest.mark.parametrize("noise", [0.0, 0.01, 0.3])
    def test_coarse_channels_are_not_held(
        self, quantum: float, noise: float, rng: np.random.Generator
    ) -> None:
        time_s = np.arange(6001) * 0.01
        for true in (
            20.0 + 0.7 * time_s,
            4.0 * np.sin(0.5 * time_s),
            20.0 + 5.0 * np.sin(0.3 * time_s) + np.sin(1.7 * time_s),
        ):
            values = true + rng.normal(0.0, noise, 6001) if noise else true
            assert held_rows(np.round(values / quantum) * quantum) == 0.0

    def test_equal_readings_of_a_held_channel_in_quanta_are_readings(
        self, rng: np.random.Generator
    ) -> None:
        values = np.repeat(0.02 * np.round(rng.normal(0.0, 0.025, 500) / 0.02), 2)
        notes: list[str] = []
        known = np.flatnonzero(np.isfinite(blank_held({"vy_mps": values}, 100.0, notes)["vy_mps"]))
        assert "vy_mps: each value is held for 2 samples" in notes[0]
        np.testing.assert_array_equal(known[:-2], np.arange(0, 2 * known.size - 4, 2))
        # Of what is the same to the end of the record only the first is a reading.
        assert known.size > 495

    def test_a_repeated_force_that_is_off_for_seconds_is_known(
        self, rng: np.random.Generator
    ) -> None:
        """While a car stood its force was missing, and no run of the model went across that."""
        force = np.repeat(rng.normal(0.0, 500.0, 1500), 2)
        force[400:1000] = 0.0
        known = np.isfinite(blank_held({"fx_n": force}, 100.0, [])["fx_n"])
        np.testing.assert_array_equal(np.flatnonzero(known)[:1400], np.arange(0, 2800, 2))
        # Of what is measured nobody knows whether it stands.
        assert not np.isfinite(blank_held({"ay_mps2": force}, 100.0, [])["ay_mps2"])[402:1000].any()


class TestSeveralClocks:
    """Sensors of one rate whose rows lie a constant few ms apart."""

    def rows(self, off_ms: int, rng: np.random.Generator, every_ms: int = 10) -> Columns:
        ms = np.arange(60_001)
        own = {"vx_mps": ms % every_ms == off_ms, "": ms % every_ms == 0}
        there = own["vx_mps"] | own[""]
        time_s = 0.001 * ms
        values = columns(time_s)
        values["vx_mps"] = 20.0 + np.sin(3.0 * time_s) + rng.normal(0.0, 0.03, ms.size)
        for name in values:
            if name != "time_s":
                at = own["vx_mps" if name == "vx_mps" else ""]
                values[name] = np.where(at, values[name], np.nan)
        return {name: x[there] for name, x in values.items()}

    @pytest.mark.parametrize("off_ms", [1, 3, 4, 6, 9])
    def test_each_keeps_its_rate_its_times_and_its_noise(
        self, off_ms: int, rng: np.random.Generator
    ) -> None:
        """Steps of 4 and 6 ms are no rounded ones of 5 ms; a line would halve the noise."""
        with pytest.warns(SysidWarning, match=r"resampled at 100 Hz; trigger all sensors by one"):
            log = make(self.rows(off_ms, rng))
        assert log.rate_hz == pytest.approx(100.0, rel=1e-9)
        noise = (log["vx_mps"] - 20.0 - np.sin(3.0 * log["time_s"]))[20:-20]
        assert np.std(noise) == pytest.approx(0.03, rel=0.08)
        assert abs(np.corrcoef(noise[1:], noise[:-1])[0, 1]) < 0.15
        assert abs(np.mean(noise * np.cos(3.0 * log["time_s"][20:-20]))) < 0.0015  # 0.25 ms
        np.testing.assert_allclose(log["steer_rad"], 0.05 * np.sin(log["time_s"]), atol=1e-9)

    def test_stamps_that_jitter_and_drift(self, rng: np.random.Generator) -> None:
        """Two devices, the second 3 ms later, 100 ppm slow, its stamps up to 2 ms off."""
        even = 0.01 * np.arange(6000)
        other = 1.0001 * even + 0.003 + rng.uniform(-0.002, 0.002, even.size)
        time_s = np.union1d(even, other)
        values = columns(time_s)
        values["vx_mps"] = 20.0 + np.sin(3.0 * time_s) + rng.normal(0.0, 0.03, time_s.size)
        for name in values:
            if name != "time_s":
                own = other if name == "vx_mps" else even
                values[name] = np.where(np.isin(time_s, own), values[name], np.nan)
        with pytest.warns(SysidWarning, match="resampled at 1"):
            log = make(values)
        noise = (log["vx_mps"] - 20.0 - np.sin(3.0 * log["time_s"]))[20:-20]
        noise = noise[np.isfinite(noise)]
        assert noise.size > 5900
        assert np.std(noise) == pytest.approx(0.03, rel=0.08)
        assert abs(np.corrcoef(noise[1:], noise[:-1])[0, 1]) < 0.15

    def test_half_a_period_apart_is_a_log_of_twice_the_rate(self, rng: np.random.Generator) -> None:
        """Each sample then stands at its own time, and nothing is interpolated but the inputs."""
        given = self.rows(5, rng)
        with pytest.warns(
            SysidWarning, match=r"(steer_rad|ax_mps2): holds a value only every 0.01 s"
        ):
            log = make(given)
        assert log.rate_hz == pytest.approx(200.0, rel=1e-9)
        np.testing.assert_array_equal(log["vx_mps"], given["vx_mps"])

    def test_times_in_whole_ms(self, rng: np.random.Generator) -> None:
        """Of 200 Hz: steps of 2 and 3 ms would be rounded ones of 2.5 ms."""
        with pytest.warns(SysidWarning, match=r"resampled at 200 Hz; trigger all sensors by one"):
            log = make(self.rows(2, rng, every_ms=5))
        assert log.rate_hz == pytest.approx(200.0, rel=1e-9)
