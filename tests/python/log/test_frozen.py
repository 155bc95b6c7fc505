"""Channels that repeat a value for seconds are told once, and their repetitions are no readings."""

import warnings

import numpy as np
import pytest

import sysid_vehicle as sv
from sysid_vehicle.errors import SysidWarning

Columns = dict[str, np.ndarray]
SECONDS = slice(1500, 2300)


@pytest.fixture(scope="module")
def driven() -> Columns:
    car = sv.Model(sv.example_vehicle())
    log = sv.drive(car, sv.manoeuvres.lap(40.0), seed=920020)
    return {name: np.array(log[name]) for name in log.channels}


def frozen(driven: Columns, *channels: str, where: slice = SECONDS) -> Columns:
    columns = {name: values.copy() for name, values in driven.items()}
    for name in channels:
        columns[name][where] = columns[name][where.start]
    return columns


def read(columns: Columns) -> tuple[sv.Log, list[str]]:
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        log = sv.read_log(columns)
    return log, [str(w.message) for w in caught if issubclass(w.category, SysidWarning)]


@pytest.mark.parametrize("name", ["vx_mps", "vy_mps", "yaw_rate_radps", "ay_mps2", "ax_mps2"])
def test_a_frozen_channel_is_told_once_and_counts_as_missing(driven: Columns, name: str) -> None:
    """A yaw rate that stood still was told as a lateral speed that does not fit, v_y not at all."""
    log, told = read(frozen(driven, name))
    (said,) = told
    for word in (f"{name}: frozen", "samples 1500 to 2299", "count as missing", "check the sensor"):
        assert word in said
    assert np.isnan(log[name][SECONDS]).all()
    others = np.delete(np.arange(log.n), SECONDS)
    np.testing.assert_array_equal(log[name][others], driven[name][others])


def test_each_frozen_stretch_counts_as_missing(driven: Columns) -> None:
    columns = frozen(frozen(driven, "vy_mps"), "vy_mps", where=slice(2600, 3200))
    log, (said,) = read(columns)
    assert "and 1 more time(s)" in said
    assert np.isnan(log["vy_mps"][2600:3200]).all()


def test_a_speed_that_comes_back_by_a_jump_was_frozen(driven: Columns) -> None:
    """Where the car gains speed evenly nothing else varies, and yet the speed has moved on."""
    time_s = driven["time_s"]
    rng = np.random.default_rng(920021)
    columns = {name: values.copy() for name, values in driven.items()}
    columns["vx_mps"] = 20.0 + 0.4 * time_s + 0.03 * rng.normal(size=time_s.size)
    columns["ax_mps2"] = 0.4 + 0.06 * rng.normal(size=time_s.size)
    columns = {n: columns[n] for n in ("time_s", "vx_mps", "ax_mps2")} | {
        n: 0.01 * rng.normal(size=time_s.size) for n in ("yaw_rate_radps", "ay_mps2", "steer_rad")
    }
    log, told = read(frozen(columns, "vx_mps"))
    assert any("vx_mps: frozen" in said and "1500 to 2299" in said for said in told)
    assert np.isnan(log["vx_mps"][SECONDS]).all()


def test_what_is_identified_does_not_follow_a_frozen_speed(driven: Columns) -> None:
    """Taken for readings, eight seconds of speed and lateral speed bend the tyres by far more."""
    model = sv.Model(sv.example_vehicle())
    right = {n: model.value(n) for n in ("D_front", "D_rear")}
    log, told = read(frozen(driven, "vx_mps", "vy_mps"))
    assert len(told) == 2
    with pytest.warns(sv.SysidWarning, match="no values at samples 750 to 1149"):
        half = sv.Log.from_arrays({c: log[c][::2] for c in log}, check=False)
    fit = sv.identify(model, half, starts=1)
    for name, value in right.items():
        assert abs(fit[name].value - value) < 4.0 * fit[name].std
    assert fit.noise.sensor[0] < 0.05


def test_a_receiver_that_is_held_and_then_frozen(driven: Columns) -> None:
    columns = {name: values.copy() for name, values in driven.items()}
    for name in ("vx_mps", "vy_mps"):
        columns[name] = np.repeat(columns[name][::10], 10)[: columns[name].size]
    log, told = read(frozen(columns, "vx_mps", "vy_mps"))
    for name in ("vx_mps", "vy_mps"):
        assert any(said.startswith(f"log: {name}: ") for said in told)
        assert np.isnan(log[name][1510:2300]).all()
        assert np.isfinite(log[name]).sum() > 200


@pytest.mark.parametrize(
    ("name", "quantum"),
    [("vx_mps", 1 / 3.6), ("vx_mps", 0.01), ("vy_mps", 0.3), ("yaw_rate_radps", 0.002)],
)
def test_coarse_quanta_are_not_frozen(driven: Columns, name: str, quantum: float) -> None:
    columns = {n: values.copy() for n, values in driven.items()}
    columns[name] = quantum * np.round(columns[name] / quantum)
    log, told = read(columns)
    assert not any("frozen" in said for said in told)
    assert np.isfinite(log[name]).all()


def test_a_channel_of_coarse_quanta_may_be_frozen_too(driven: Columns) -> None:
    columns = {n: values.copy() for n, values in driven.items()}
    columns["vx_mps"] = 0.1 * np.round(columns["vx_mps"] / 0.1)
    log, (said,) = read(frozen(columns, "vx_mps"))
    assert "vx_mps: frozen" in said
    assert np.isnan(log["vx_mps"][SECONDS]).all()


def test_a_parked_car_is_not_frozen(driven: Columns) -> None:
    columns = {n: values.copy() for n, values in driven.items()}
    columns["vx_mps"][-800:] = 0.0
    _, told = read(columns)
    assert not any("frozen" in said for said in told)


def test_what_stands_longer_than_it_moves_stays_and_is_told(driven: Columns) -> None:
    log, told = read(frozen(driven, "vy_mps", where=slice(1000, 3900)))
    assert any("vy_mps: frozen" in s and "too many to go without" in s for s in told)
    assert np.isfinite(log["vy_mps"]).all()
