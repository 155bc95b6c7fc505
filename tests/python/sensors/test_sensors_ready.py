"""Logs whose noise is coloured, or whose channels are late, are made ready for the likelihood."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy import signal

import sysid_vehicle as sv
from sysid_vehicle.sensors import explaining, made_ready
from sysid_vehicle.sensors import ready as _ready
from sysid_vehicle.sensors.apply import shifted
from sysid_vehicle.sensors.condition import Conditioning, conditioned
from sysid_vehicle.sensors.faults import SensorFault, to_put_right
from sysid_vehicle.sensors.low_pass.forms import Response

SPEEDS, INERTIAL = ("vx_mps", "vy_mps"), ("yaw_rate_radps", "ax_mps2", "ay_mps2")
MOTION = (*SPEEDS, *INERTIAL)
NOISE = sv.SensorNoise()
# Of the bilinear transform of Butterworth's filter of 15 Hz at 100 Hz.
DELAY_S = float(np.sqrt(2.0) / (200.0 * np.tan(np.pi * 0.15)))


@pytest.fixture(scope="module")
def log() -> sv.Log:
    return sv.drive(sv.Model(sv.example_vehicle()), sv.manoeuvres.lap(), seed=61)


def _with(log: sv.Log, **channels: np.ndarray) -> sv.Log:
    return log.corrected(channels, [])


def _low_pass(values: np.ndarray, hz: float = 15.0, order: int = 2) -> np.ndarray:
    b, a = signal.butter(order, hz, fs=100.0)
    return signal.lfilter(b, a, values, zi=signal.lfilter_zi(b, a) * values[0])[0]


def _delay(values: np.ndarray, true: np.ndarray) -> float:
    """By regression on the slope of the true signal [s]."""
    slow = signal.savgol_filter(true, 41, 3)
    slope = signal.savgol_filter(true, 41, 3, deriv=1, delta=0.01)
    there = np.isfinite(values)
    return float(-(slope[there] @ (values - slow)[there]) / (slope[there] @ slope[there]))


def low_passes_of(logs: list[sv.Log]) -> dict[str, tuple[Response, float]]:
    return Conditioning.of(logs).low_passes


def test_white_noise_is_left_as_it_is(log: sv.Log) -> None:
    assert conditioned([log])[0] is log
    own, others, found = made_ready([log], [log])
    assert own[0] is log
    assert others[0] is log
    assert not found.settles


def test_a_low_pass_is_told_from_the_noise_it_leaves(log: sv.Log) -> None:
    told = low_passes_of([_with(log, **{c: _low_pass(log[c]) for c in MOTION})])
    assert sorted(told) == sorted(MOTION)
    for response, std_s in told.values():
        assert std_s < 0.001
        assert abs(response.delay_s - DELAY_S) < 2.5 * std_s
        assert response.corner_hz == pytest.approx(16.2, rel=0.1)
        assert response.digital


def test_one_filter_serves_both_devices_where_it_explains_them(log: sv.Log) -> None:
    alike = low_passes_of([_with(log, **{c: _low_pass(log[c]) for c in MOTION})])
    assert len({response for response, _ in alike.values()}) == 1
    unlike = {c: _low_pass(log[c], 22.0) for c in SPEEDS}
    unlike |= {c: _low_pass(log[c], 11.0) for c in INERTIAL}
    told = {c: response for c, (response, _) in low_passes_of([_with(log, **unlike)]).items()}
    assert told["vx_mps"] == told["vy_mps"] != told["ax_mps2"] == told["yaw_rate_radps"]
    assert told["vx_mps"].delay_s == pytest.approx(np.sqrt(0.5) / (np.pi * 22.0), abs=0.002)
    assert told["ax_mps2"].delay_s == pytest.approx(np.sqrt(0.5) / (np.pi * 11.0), abs=0.003)
    alone = {c: _low_pass(log[c]) for c in INERTIAL}
    assert sorted(low_passes_of([_with(log, **alone)])) == sorted(INERTIAL)


def test_a_filter_is_told_behind_vibration_quanta_and_held_samples(log: sv.Log) -> None:
    rng = np.random.default_rng(8)
    phase = np.cumsum(0.05 * rng.standard_normal(log.n))
    shaken = {c: np.array(log[c]) for c in log.channels if log.has(c)}
    keep = np.exp(-0.01 / 0.03)
    for channel, bumps, amplitude in (
        ("ax_mps2", 0.1, 0.4),
        ("ay_mps2", 0.13, 0.5),
        ("yaw_rate_radps", 0.0, 0.004),
    ):
        road = signal.lfilter([np.sqrt(1.0 - keep**2)], [1.0, -keep], rng.standard_normal(log.n))
        shaken[channel] += bumps * road
        shaken[channel] += amplitude * np.sin(2.0 * np.pi * 12.0 * log["time_s"] + phase)
    for channel, quantum in zip(MOTION, (0.02, 0.02, 0.002, 0.05, 0.05), strict=True):
        counted = quantum * np.round(_low_pass(shaken[channel]) / quantum)
        shaken[channel] = np.repeat(counted[::2], 2)[: log.n]
    with pytest.warns(sv.SysidWarning, match="held for 2 samples"):
        coarse = sv.Log.from_arrays(shaken)
    told = low_passes_of([coarse])
    assert sorted(told) == sorted(MOTION)
    response, std_s = told["ay_mps2"]
    assert std_s < 0.0015
    assert abs(response.delay_s - DELAY_S) < 2.5 * std_s


def test_bumps_of_the_road_are_no_low_pass(log: sv.Log) -> None:
    rng = np.random.default_rng(4)
    keep = np.exp(-0.01 / 0.03)
    bumps = {}
    for channel in INERTIAL:
        road = signal.lfilter([np.sqrt(1.0 - keep**2)], [1.0, -keep], rng.standard_normal(log.n))
        bumps[channel] = log[channel] + 2.5 * getattr(NOISE, channel) * road
    shaken = _with(log, **bumps)
    assert not low_passes_of([shaken])
    assert conditioned([shaken])[0] is shaken


def test_what_no_form_fits_tells_no_delay(log: sv.Log) -> None:
    # Steeper filters, and smoothing without delay, are not of the form that is fitted.
    assert not low_passes_of([_with(log, **{c: _low_pass(log[c], order=4) for c in MOTION})])
    b, a = signal.butter(1, 15.0, fs=100.0)
    smooth = {c: signal.filtfilt(b, a, log[c]) for c in MOTION}
    assert not low_passes_of([_with(log, **smooth)])
    # One channel shifted against the others of its device would be an error of its own.
    assert not low_passes_of([_with(log, ay_mps2=_low_pass(log["ay_mps2"]))])


def test_motion_that_no_noise_covers_is_no_noise(log: sv.Log) -> None:
    # Without noise all that is seen above 5 Hz comes from the driving.
    model = sv.Model(sv.example_vehicle())
    clean = sv.drive(model, sv.manoeuvres.lap(), seed=1, noise=sv.SensorNoise.none())
    assert conditioned([clean])[0] is clean


def test_a_filter_that_is_told_is_undone(log: sv.Log) -> None:
    late = _with(log, **{c: _low_pass(log[c]) for c in MOTION})
    (ready,) = conditioned([late])
    inner = slice(50, -50)
    for channel in MOTION:
        assert np.isfinite(ready[channel]).sum() == log.n - 100
        left = (ready[channel] - log[channel])[inner]
        assert np.std(left) < 0.35 * getattr(NOISE, channel)
        assert np.std((late[channel] - log[channel])[inner]) > 0.8 * getattr(NOISE, channel)
    for channel in ("yaw_rate_radps", "ay_mps2"):
        assert _delay(late[channel], log[channel]) == pytest.approx(0.014, abs=0.002)
        assert _delay(ready[channel], log[channel]) == pytest.approx(0.0, abs=0.001)
    assert len(ready.corrections) == 5
    assert "low-pass of 1" in ready.corrections[0]
    # One filter for both devices: their times are off together.
    (moved,) = ready.retimed
    assert sorted(moved.channels) == sorted(MOTION)
    assert 0.0 < moved.std_s < 0.001


def test_a_check_tells_low_passes_and_takes_them_out_of_other_logs(log: sv.Log) -> None:
    late = _with(log, **{c: _low_pass(log[c]) for c in MOTION})
    check = sv.check(late)
    assert check.logs == (late,)
    assert check.headline.endswith("no fault was found. Sensors have a low-pass.")
    told = f"{', '.join(MOTION)}: the noise is that of a low-pass of 1"
    assert sum(text.startswith(told) for text in check.remarks) == 1
    figures = check.to_dict()["low_passes"]
    assert sorted(figures) == sorted(MOTION)
    off = figures["ay_mps2"]["delay_s"] - DELAY_S
    assert abs(off) < 2.5 * figures["ay_mps2"]["delay_std_s"]
    # Eight seconds are too short to tell a filter of their own.
    short = late.between(20.0, 28.0)
    assert conditioned([short])[0] is short
    for part in (late, short):
        ready = check.apply(part)
        true = log.between(part["time_s"][0], part["time_s"][-1])
        for channel in ("yaw_rate_radps", "ay_mps2"):
            assert _delay(ready[channel], true[channel][: part.n]) == pytest.approx(0.0, abs=0.0015)
        assert ready.retimed[0].std_s == figures["ay_mps2"]["delay_std_s"]


def test_a_check_of_white_noise_has_no_low_pass(log: sv.Log) -> None:
    check = sv.check(log.between(0.0, 30.0))
    assert check.low_passes == {}
    assert "low-pass" not in str(check)


def test_beside_a_gap_a_filter_is_not_undone(log: sv.Log) -> None:
    filtered = {c: _low_pass(log[c]) for c in MOTION}
    filtered["vy_mps"][3000:3020] = np.nan
    (ready,) = conditioned([_with(log, **filtered)])
    assert np.isnan(ready["vy_mps"][2991:3029]).all()
    assert np.isfinite(ready["vy_mps"][2900:2988]).all()
    assert np.isfinite(ready["vx_mps"][2900:3100]).all()


def test_vibration_is_taken_out_and_nothing_else(log: sv.Log) -> None:
    rng = np.random.default_rng(5)
    phase = np.cumsum(0.05 * rng.standard_normal(log.n))
    shaken = log["ay_mps2"] + 0.5 * np.sin(2.0 * np.pi * 12.0 * log["time_s"] + phase)
    (ready,) = conditioned([_with(log, ay_mps2=shaken)])
    inner = slice(50, -50)
    left = (ready["ay_mps2"] - log["ay_mps2"])[inner]
    assert np.isnan(ready["ay_mps2"]).sum() == 100
    # Anywhere: a few readings at the ends, wrong by little, would outweigh the score of a lag.
    assert np.max(np.abs(left)) < 0.2
    assert np.std(left) < 0.04  # of noise of 0.06 m/s2 and vibration of 0.35 m/s2 rms
    b, a = signal.butter(4, 3.0, fs=100.0)
    assert np.std(signal.filtfilt(b, a, (ready["ay_mps2"] - shaken)[inner])[100:-100]) < 0.002
    assert ready.corrections == ("ay_mps2: vibration at 12 Hz taken out",)


@pytest.mark.parametrize("delay_s", [0.005, 0.0123, -0.004])
def test_a_shift_by_parts_of_a_sample_leaves_white_noise_white(delay_s: float) -> None:
    time_s = np.arange(6000) / 100.0
    noise = shifted(time_s, np.random.default_rng(6).standard_normal(6000), delay_s)[20:-20]
    assert np.std(noise) == pytest.approx(1.0, abs=0.07)
    assert abs(np.corrcoef(noise[1:], noise[:-1])[0, 1]) < 0.12
    wave = shifted(time_s, np.sin(2.0 * np.pi * 4.0 * time_s), delay_s)[20:-20]
    true = np.sin(2.0 * np.pi * 4.0 * (time_s[20:-20] + delay_s))
    np.testing.assert_allclose(wave, true, atol=3e-3)


@pytest.mark.filterwarnings("ignore:.*trigger all sensors by one clock:sysid_vehicle.SysidWarning")
@pytest.mark.parametrize("off_ms", [3, pytest.param(4, marks=pytest.mark.manual)])
def test_sensors_a_few_ms_apart_have_no_fault(off_ms: int) -> None:
    """Read off straight lines, the noise of the speeds would be that of a low-pass."""
    fine = sv.drive(
        sv.Model(sv.example_vehicle()), sv.manoeuvres.lap(), seed=656905, rate_hz=1000.0
    )
    ms = np.arange(fine.n)
    speeds, others = ms % 10 == off_ms, ms % 10 == 0
    rows = {"time_s": fine["time_s"][speeds | others]}
    for name in fine:
        if name != "time_s":
            own = speeds if name in ("vx_mps", "vy_mps") else others
            rows[name] = np.where(own, fine[name], np.nan)[speeds | others]
    found = sv.check(sv.read_log(rows))
    assert found.found == ()
    assert found.conditioning is not None
    assert not found.conditioning.filters


def test_where_no_fault_is_found_no_part_is_asked(
    log: sv.Log, monkeypatch: pytest.MonkeyPatch
) -> None:
    part = log.between(0.0, 30.0)
    assert sv.check(part).found == ()

    def refused(*_: object) -> None:
        raise RuntimeError("a part")

    monkeypatch.setattr(explaining, "cut", refused)
    with pytest.raises(RuntimeError, match="a part"):
        sv.check(part)
    own, _, found = made_ready([part], [])
    assert not found.settles
    assert own[0] is part


def test_late_speeds_are_read_earlier_in_all_logs(log: sv.Log) -> None:
    late = {c: np.interp(log["time_s"] - 0.02, log["time_s"], log[c]) for c in MOTION[:2]}
    own, others, found = made_ready([_with(log, **late)], [_with(log, **late)])
    assert found.settles
    for ready in (*own, *others):
        inner = slice(10, -10)
        for channel in MOTION[:2]:
            off = ready[channel][inner] - log[channel][inner]
            assert abs(np.mean(np.gradient(log[channel])[inner] * off)) < 2e-4
        assert sum("later in the file" in text for text in ready.corrections) == 2
        assert [moved.channels for moved in ready.retimed] == [("vx_mps",), ("vy_mps",)]
        assert all(0.0 < moved.std_s < 0.01 for moved in ready.retimed)


def test_on_a_road_that_wanders_kinematics_tells_no_delays(
    log: sv.Log, monkeypatch: pytest.MonkeyPatch
) -> None:
    # The driver steers and brakes against the road, which looks like a delay.
    log = log.between(0.0, 30.0)
    late = _with(log, vx_mps=np.interp(log["time_s"] - 0.03, log["time_s"], log["vx_mps"]))
    checked = sv.check(late)
    assert checked["delay_vx_s"].found
    monkeypatch.setattr(_ready, "checked", lambda *_, **__: checked)
    assert made_ready([late], [])[2].settles
    wandering = replace(checked.estimate, road_mps2={"grade": 0.15, "bank": 0.0})
    monkeypatch.setattr(_ready, "checked", lambda *_, **__: replace(checked, estimate=wandering))
    own, _, found = made_ready([late], [])
    assert not found.settles
    assert own[0] is late


def _fault(name: str, value: float, *, found: bool) -> SensorFault:
    return SensorFault(name, name[6:8], "delay", value, 0.003, "s", True, found)


@pytest.mark.parametrize(("other", "follows"), [(0.008, True), (0.004, False), (-0.012, False)])
def test_a_late_speed_takes_the_other_one_with_it_where_that_is_late_too(
    other: float, follows: bool
) -> None:
    vx, vy = _fault("delay_vx_s", 0.011, found=True), _fault("delay_vy_s", other, found=False)
    expected = {"delay_vx_s": 0.011} | ({"delay_vy_s": other} if follows else {})
    assert to_put_right([vx, vy, _fault("delay_ay_s", 0.01, found=False)]) == expected
    assert to_put_right([vy]) == {}
    absent = SensorFault("delay_vy_s", "vy_mps", "delay", 0.0, np.inf, "s", False, False)
    assert to_put_right([vx, absent]) == {"delay_vx_s": 0.011}


def test_a_check_says_what_it_takes_out_with_the_other_speed(log: sv.Log) -> None:
    check = sv.check(log.between(0.0, 30.0))
    faults = {f.name: f for f in check.faults}
    faults["delay_vx_s"] = replace(faults["delay_vx_s"], value=0.011, found=True)
    faults["delay_vy_s"] = replace(faults["delay_vy_s"], value=0.008, found=False, told=True)
    late = replace(check, faults=tuple(faults.values()))
    row = next(line for line in str(late).splitlines() if "delay" in line and "vy_mps" in line)
    assert row.endswith("like the other speed")
    assert [line.split()[0] for line in late.map_lines] == ["vx_mps", "vy_mps"]
    assert [text.split(":")[0] for text in late.apply(log).corrections] == ["vx_mps", "vy_mps"]


@pytest.mark.parametrize("factor", [0.94, 1.06])
def test_a_scale_of_the_longitudinal_acceleration_is_told_and_taken_out(
    log: sv.Log, factor: float
) -> None:
    part = log.between(0.0, 40.0)
    check = sv.check(_with(part, ax_mps2=factor * part["ax_mps2"]))
    assert [f.name for f in check.found] == ["gain_ax"]
    low, high = check["gain_ax"].interval
    assert low < factor - 1.0 < high
    assert "scale error, or gravity by pitch" in str(check)
    by_the_body = [text for text in check.remarks if "pitch gradient" in text]
    assert len(by_the_body) == (factor > 1.0)
    ready = check.apply(_with(part, ax_mps2=factor * part["ax_mps2"]))
    np.testing.assert_allclose(ready["ax_mps2"], part["ax_mps2"], atol=0.03, rtol=0.01)


def test_a_body_that_rolls_makes_no_sensor_late(truth: sv.Model) -> None:
    roll = {"body_roll.roll_per_g_rad": 0.09, "body_roll.frequency_hz": 1.5}
    rolling = truth.add("body_roll").with_values(roll)
    log = sv.drive(rolling, sv.manoeuvres.lap(60.0), seed=3)
    check = sv.check(log)
    assert check["gain_ay"].found
    assert not check["delay_ay_s"].found
    # What the roll made late goes with it, where the log shows it: put right, it holds neither.
    (late,) = (text for text in check.apply(log).corrections if text.startswith("ay_mps2: taken"))
    slow_ms = 1000.0 * 0.09 / 1.09 * 2.0 * 0.3 / (2.0 * np.pi * 1.5)  # and more towards 1.5 Hz
    assert 0.5 * slow_ms < float(late.split()[2]) < 2.5 * slow_ms
    assert not sv.check(check.apply(log)).found
    assert not made_ready([log], [])[2].settles
    # A sensor that is later than that is told on the same car.
    ay = np.interp(log["time_s"] - 0.03, log["time_s"], log["ay_mps2"])
    own, _, found = made_ready([_with(log, ay_mps2=ay)], [])
    assert found.settles
    (moved,) = (text for text in own[0].corrections if text.startswith("ay_mps2: taken"))
    assert float(moved.split()[2]) == pytest.approx(30.0, abs=4.0)
