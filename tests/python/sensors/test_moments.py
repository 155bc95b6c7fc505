"""A jump of a sensor is no fault that lasts: it is told, and all else without it."""

import matplotlib.pyplot as plt
import numpy as np
import pytest
from pushes import Push

import sysid_vehicle as sv

AT_S, LASTS_S = 12.0, 0.3
SIZES = {"yaw_rate_radps": 0.1, "vy_mps": 0.6, "ay_mps2": -3.0, "vx_mps": -1.5}


def jumped(log: sv.Log, sizes: dict[str, float], at_s: float = AT_S, name: str = "lap") -> sv.Log:
    channels = {c: np.array(log[c]) for c in log.channels}
    inside = (channels["time_s"] >= at_s) & (channels["time_s"] < at_s + LASTS_S)
    for channel, size in sizes.items():
        channels[channel][inside] += size
    return sv.Log.from_arrays(channels, name=name, check=False)


@pytest.fixture(scope="module")
def lap(truth: sv.Model) -> sv.Log:
    return sv.drive(truth, sv.manoeuvres.lap(30.0), seed=6, rate_hz=50.0)


@pytest.fixture(scope="module")
def clean(lap: sv.Log) -> sv.SensorCheck:
    return sv.check(lap)


def test_where_nothing_jumps_there_is_no_moment(clean: sv.SensorCheck) -> None:
    assert clean.moments == ()
    assert clean.to_dict()["moments"] == []
    assert clean.headline.endswith("the sensors agree; no fault was found.")


@pytest.mark.parametrize("channel", SIZES)
def test_a_jump_is_told_with_its_channel_its_time_and_its_size(
    lap: sv.Log, clean: sv.SensorCheck, channel: str
) -> None:
    """With it in the readings v_y came 29 ms late, or a body swung; now all is as without it."""
    log = jumped(lap, {channel: SIZES[channel]})
    found = sv.check(log)
    (moment,) = found.moments
    assert moment.channel == channel
    assert moment.from_s == pytest.approx(AT_S, abs=0.15)
    assert moment.until_s == pytest.approx(AT_S + LASTS_S, abs=0.4)
    noise = clean.noise[channel][0].std
    # The others tell the motion there, less closely.
    assert moment.off == pytest.approx(SIZES[channel], rel=0.3)
    assert moment.times_noise == pytest.approx(abs(moment.off) / noise, rel=0.2)
    assert not found.found
    for fault in found.faults:
        other = clean[fault.name]
        assert fault.told is other.told
        if fault.measured:
            assert abs(fault.value - other.value) < 1.5 * other.std
    assert f"For a moment {channel} contradicts the others." in found.headline
    assert str(moment) in str(found)
    assert found.to_dict()["moments"][0]["channel"] == channel


def test_a_log_that_is_put_right_is_without_it(lap: sv.Log) -> None:
    """Only the log that was checked: another one of the same sensors has no such moment."""
    log = jumped(lap, {"yaw_rate_radps": 0.1})
    found = sv.check(log)
    (moment,) = found.moments
    right = found.apply(log)
    out = np.isnan(right["yaw_rate_radps"])
    inside = (log["time_s"] >= moment.from_s) & (log["time_s"] <= moment.until_s)
    assert np.array_equal(out, inside)
    assert np.isfinite(right["vy_mps"]).all()
    assert any("yaw_rate_radps" in said and "left out" in said for said in right.corrections)
    assert np.isfinite(found.apply(lap)["yaw_rate_radps"]).all()


def test_the_log_of_a_moment_is_known(lap: sv.Log, truth: sv.Model) -> None:
    """Of two logs by the same name, with a jump in each."""
    other = sv.drive(truth, sv.manoeuvres.handling_course(20.0), seed=7, rate_hz=50.0)
    logs = [
        jumped(lap, {"yaw_rate_radps": 0.1}),
        jumped(other, {"vy_mps": 0.6}, at_s=6.0),
    ]
    found = sv.check(logs)
    told = {(m.number, m.channel) for m in found.moments}
    assert told == {(0, "yaw_rate_radps"), (1, "vy_mps")}
    assert "contradict the others" in found.headline
    ax = found.plot("vy_mps", ax=plt.figure().gca())
    (shaded,) = (text for text in ax.get_legend().get_texts() if "left out" in text.get_text())
    assert shaded.get_text().startswith("left out, off by 0.")
    right = found.apply(logs[1])
    assert np.isnan(right["vy_mps"]).any()
    assert np.isfinite(right["yaw_rate_radps"]).all()


def test_a_blow_is_told_once(truth: sv.Model) -> None:
    """Of what several channels feel at once none is a jump of its own."""
    blow = Push(0.0, 0.0, 0.0, 0.3, at_s=AT_S, lasts_s=0.08, force=(0.0, 1e4, 0.0))
    log = sv.drive(truth, sv.manoeuvres.lap(30.0), seed=6, rate_hz=100.0, disturbance=blow)
    found = sv.check(log)
    (moment,) = found.moments
    assert moment.from_s <= AT_S + 0.1
    assert moment.until_s >= AT_S
    assert "a blow that is quicker than this motion" in str(moment)


@pytest.mark.parametrize("seconds", [3.0, 6.0])
def test_short_driving_has_no_moment(truth: sv.Model, seconds: float) -> None:
    """Few blocks tell their noise by chance, and one of them holds most by chance."""
    log = sv.drive(truth, sv.manoeuvres.lap(30.0), seed=8, rate_hz=50.0)
    for begin in (4.0, 10.0, 16.0, 22.0):
        assert sv.check(log.between(begin, begin + seconds)).moments == ()
