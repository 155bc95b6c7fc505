"""The check of the sensors against drives whose sensors have known faults."""

import json
import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.signal import lfilter
from smooth_log import drift

import sysid_vehicle as sv
from sysid_vehicle.cli.main import main
from sysid_vehicle.diagnose import considered, possible, refused
from sysid_vehicle.effects import Effect, effect
from sysid_vehicle.simulate import drive_truth

Channels = dict[str, np.ndarray]
NOISE = sv.SensorNoise()


@pytest.fixture(scope="module")
def perfect() -> Channels:
    """30 s of a handling course as sensors without noise and faults would write it."""
    truth = sv.Model(sv.example_vehicle())
    push = sv.RoadDisturbance(150.0, 200.0, 100.0, 0.3)
    course = sv.manoeuvres.handling_course()
    none = sv.SensorNoise.none()
    log = drive_truth(truth, course, seed=11, noise=none, disturbance=push).log.between(0.0, 30.0)
    return {name: np.array(log[name]) for name in log.channels}


def noisy(channels: Channels, seed: int = 5) -> Channels:
    rng = np.random.default_rng(seed)
    n = channels["time_s"].size
    return {
        name: values + getattr(NOISE, name, 0.0) * rng.standard_normal(n)
        for name, values in channels.items()
    }


def as_log(channels: Channels) -> sv.Log:
    return sv.Log.from_arrays(channels, name="drive", check=False)


def with_faults(perfect: Channels) -> Channels:
    """Roll gradient of 5 deg/g, IMU 0.4 m ahead, gyro bias of 0.01 rad/s, v_y 30 ms late."""
    c = dict(perfect)
    dr = np.gradient(c["yaw_rate_radps"], c["time_s"])
    c["ax_mps2"] = c["ax_mps2"] - 0.4 * c["yaw_rate_radps"] ** 2
    c["ay_mps2"] = (1.0 + np.radians(5.0)) * (c["ay_mps2"] + 0.4 * dr)
    c["vy_mps"] = np.interp(c["time_s"] - 0.03, c["time_s"], c["vy_mps"])
    c["yaw_rate_radps"] = c["yaw_rate_radps"] + 0.01
    return noisy(c)


TRUTH = {
    "gain_ay": np.radians(5.0),
    "imu_forward_m": 0.4,
    "bias_yaw_rate_radps": 0.01,
    "delay_vy_s": 0.03,
}


@pytest.fixture(scope="module")
def faulty(perfect: Channels) -> sv.SensorCheck:
    return sv.check(as_log(with_faults(perfect)))


def test_sensors_that_were_not_reconciled_are_not_said_to_agree(faulty: sv.SensorCheck) -> None:
    open_ = replace(
        faulty,
        faults=tuple(replace(fault, found=False) for fault in faulty.faults),
        estimate=replace(faulty.estimate, settled=False),
    )
    assert open_.headline == "drive: no fault was found, but the sensors do not agree."
    assert "none of these faults describes" in str(open_)


def test_a_car_that_slides_has_no_speed_in_another_unit() -> None:
    """Of its turn it feels what the lateral speed does not take up."""
    channels = noisy(drift(np.arange(0.0, 60.0, 0.01)))
    assert sv.check(as_log(channels)).found == ()
    with pytest.raises(sv.errors.InvalidInput, match="vx_mps is in mph"):
        sv.check(as_log({**channels, "vx_mps": channels["vx_mps"] / 0.44704}))


def test_good_sensors_are_called_good(perfect: Channels) -> None:
    found = sv.check(as_log(noisy(perfect)))
    assert found.found == ()
    assert found.map_lines == ()
    assert "sensors agree" in str(found)
    for fault in found.faults:
        assert abs(fault.value) < 3.5 * fault.std, fault
    assert found.noise["ay_mps2"][0].std == pytest.approx(NOISE.ay_mps2, rel=0.15)
    assert found.noise["vx_mps"][0].std == pytest.approx(NOISE.vx_mps, rel=0.1)


def test_a_sweep_at_one_speed_claims_no_delay() -> None:
    """There a delay of all but the yaw rate acts as the IMU's place, up to its square."""
    for seed in (3, 4):
        log = sv.drive(sv.Model(sv.example_vehicle()), sv.manoeuvres.sine_sweep(), seed=seed)
        check = sv.check(log)
        for name in ("delay_vy_s", "delay_ay_s", "imu_forward_m"):
            fault = check[name]
            assert not fault.found
            assert abs(fault.value) < 3.0 * fault.std


@pytest.fixture(scope="module")
def sweep() -> sv.Log:
    """At one speed much acts alike: both scales, and delays and the place of the IMU."""
    model = sv.Model(sv.example_vehicle())
    return sv.drive(model, sv.manoeuvres.sine_sweep(), seed=4).between(0.0, 15.0)


def test_of_two_scales_that_act_alike_none_is_claimed(sweep: sv.Log) -> None:
    check = sv.check(sweep.corrected({"yaw_rate_radps": 1.05 * sweep["yaw_rate_radps"]}, []))
    assert check.found == ()
    gain = check["gain_ay"]
    assert not gain.told
    alike = "the scale of yaw_rate_radps acts alike in this driving; one of the two is there"
    assert gain.why_not.startswith(f"because {alike}")
    assert abs(gain.value) < 3.0 * gain.std  # the gyro may be all of it
    assert gain.or_another == "gain_yaw_rate"
    assert f"{gain.title} (ay_mps2) or scale error (yaw_rate_radps)." in check.headline
    assert "the sensors agree" in sv.check(sweep).headline
    # Gravity by roll makes an accelerometer read more; no gyro is wrong by so much.
    rolled = sv.check(sweep.corrected({"ay_mps2": 1.06 * sweep["ay_mps2"]}, []))
    assert [fault.name for fault in rolled.found] == ["gain_ay"]


def test_the_likelier_of_two_explanations_is_found(sweep: sv.Log) -> None:
    """A search from no fault at all ends with late speeds and an IMU 1.3 m behind."""
    t, ay = sweep["time_s"], sweep["ay_mps2"]
    check = sv.check(sweep.corrected({"ay_mps2": np.interp(t - 0.05, t, ay)}, []))
    assert [fault.name for fault in check.found] == ["delay_ay_s"]
    assert abs(check["delay_ay_s"].value - 0.05) < 3.0 * check["delay_ay_s"].std


def test_a_wide_interval_does_not_say_that_nothing_is_there(sweep: sv.Log) -> None:
    delay = sv.check(sweep.between(0.0, 7.0))["delay_vx_s"]
    assert delay.interval[1] > 0.03
    assert not delay.found
    assert not delay.told


def test_faults_are_named_with_their_size(faulty: sv.SensorCheck) -> None:
    assert {fault.name for fault in faulty.found} == set(TRUTH)
    for name, true in TRUTH.items():
        fault = faulty[name]
        assert abs(fault.value - true) < 3.0 * fault.std, fault
        assert fault.std < 0.2 * true, fault  # other noise moves the place by a sixth
    low, high = faulty["gain_ay"].interval
    assert low < np.radians(5.0) < high
    assert any("roll gradient" in text for text in faulty.remarks)
    assert {line.split()[0] for line in faulty.map_lines} == {
        "vy_mps", "yaw_rate_radps", "ay_mps2"
    }  # fmt: skip


def test_a_turned_speed_sensor_is_no_bias_of_the_lateral_speed(perfect: Channels) -> None:
    c, turn = noisy(perfect), np.radians(1.5)
    rough = 0.6 * np.random.default_rng(3).standard_normal((2, c["time_s"].size))
    vx, vy = c["vx_mps"], c["vy_mps"]
    c["vx_mps"] = np.cos(turn) * vx + np.sin(turn) * vy
    c["vy_mps"] = np.cos(turn) * vy - np.sin(turn) * vx
    c["ax_mps2"], c["ay_mps2"] = c["ax_mps2"] + rough[0], c["ay_mps2"] + rough[1]
    check = sv.check(as_log(c))
    assert not check["bias_vy_mps"].found
    low, high = check["imu_turn_rad"].interval
    assert low < -turn < high


def test_a_log_put_right_holds_no_fault_any_more(faulty: sv.SensorCheck, perfect: Channels) -> None:
    right = faulty.apply(faulty.logs[0])
    # The accelerometer is not late, whatever is usual of a body that leans.
    assert [text.split(":")[0] for text in right.corrections] == [
        "vy_mps", "yaw_rate_radps", "ax_mps2, ay_mps2"
    ]  # fmt: skip
    assert any("which this log does not show" in text for text in faulty.remarks)
    assert right.corrections[0] in str(right)
    assert right.between(5.0, 10.0).corrections == right.corrections
    for name, most in (("ay_mps2", 0.1), ("vy_mps", 0.04), ("yaw_rate_radps", 3e-3)):
        inside = slice(100, -100)
        error = right[name][inside] - perfect[name][inside]
        assert float(np.sqrt(np.mean(error**2))) < most, name
    assert sv.check(right).found == ()
    # What was not found to be wrong stays as it was.
    assert right["steer_rad"] is faulty.logs[0]["steer_rad"]
    assert np.array_equal(right["vx_mps"], faulty.logs[0]["vx_mps"])


def test_the_mean_of_a_driving_acceleration_is_taken_out(faulty: sv.SensorCheck) -> None:
    """Bias or slope: without wheel force either would drive the model away."""
    offsets = {"grade": (-0.21, 0.01), "bank": (0.3, 0.01)}
    found = replace(faulty, estimate=replace(faulty.estimate, offsets=offsets))
    (log,) = faulty.logs
    columns = {c: log[c] for c in log.channels if c != "fx_n"}
    coasting = sv.Log.from_arrays(columns, name="no force", check=False)
    one, other = (check.apply(coasting) for check in (faulty, found))
    np.testing.assert_allclose(other["ax_mps2"], one["ax_mps2"] + 0.21)
    np.testing.assert_array_equal(other["ay_mps2"], one["ay_mps2"])
    assert any("-0.21 m/s2 on average" in text for text in other.corrections)
    # With wheel force logged a study tells them apart.
    np.testing.assert_array_equal(found.apply(log)["ax_mps2"], faulty.apply(log)["ax_mps2"])


def test_a_slow_channel_enters_at_its_own_times(perfect: Channels) -> None:
    c = with_faults(perfect)
    for name in ("vx_mps", "vy_mps"):
        slow = np.full(c[name].size, np.nan)
        slow[::5] = c[name][::5]
        c[name] = slow
    found = sv.check(as_log(c))
    assert {s.channel: s.rate_hz for s in found.signals}["vy_mps"] == pytest.approx(20.0)
    for name in ("gain_ay", "delay_vy_s"):
        assert abs(found[name].value - TRUTH[name]) < 3.5 * found[name].std
        assert found[name].found


def test_estimates_scatter_no_more_than_they_say(perfect: Channels) -> None:
    """Noise times the derivative of noise would move delays and places by several times that."""
    rng, names = np.random.default_rng(40), ("delay_ay_s", "delay_vy_s", "imu_forward_m")
    off = []
    for seed in range(6):
        c = noisy(perfect, 50 + seed)
        for name in ("ax_mps2", "ay_mps2"):
            fresh = rng.standard_normal(c[name].size) * 0.03 * np.sqrt(1.0 - np.exp(-0.02 / 0.3))
            c[name] = c[name] + lfilter([1.0], [1.0, -np.exp(-0.01 / 0.3)], fresh)
        found = sv.check(as_log(c))
        assert found.found == ()
        off.append([found[name].value / found[name].std for name in names])
    assert float(np.max(np.sqrt(np.mean(np.square(off), axis=0)))) < 1.3


def test_what_is_not_logged_cannot_be_told(perfect: Channels) -> None:
    c = noisy(perfect)
    del c["vy_mps"]
    found = sv.check(as_log(c))
    assert found.found == ()
    lost = {fault.name: fault.why_not for fault in found.not_told}
    assert lost["imu_forward_m"] == "because vy_mps is not logged"
    assert "cannot be told: IMU ahead" in str(found)
    assert "sensor_delay" not in found.settles
    del c["ax_mps2"]
    assert {"imu_forward_m", "imu_left_m"} <= {f.name for f in sv.check(as_log(c)).not_told}


def test_held_and_quantised_channels_are_seen(perfect: Channels) -> None:
    c = noisy(perfect)
    c["ay_mps2"] = np.repeat(c["ay_mps2"][::2], 2)[: c["ay_mps2"].size]
    c["yaw_rate_radps"] = 0.005 * np.round(c["yaw_rate_radps"] / 0.005)
    found = sv.check(as_log(c))
    by = {s.channel: s for s in found.signals}
    assert by["ay_mps2"].held_rows == pytest.approx(2.0)
    assert by["ay_mps2"].rate_hz == pytest.approx(50.0)
    assert by["yaw_rate_radps"].quantum == pytest.approx(0.005)
    assert by["vx_mps"].quantum == 0.0
    assert by["vx_mps"].held_rows == 0.0
    assert found.found == ()


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"yaw_rate_radps": -1.0}, "positive to the right"),
        ({"ay_mps2": 1.0 / 9.80665}, "factor = 9.80665 for ay_mps2"),
        ({"yaw_rate_radps": 57.29578}, "factor = 0.01745329 for yaw_rate_radps"),
        ({"vx_mps": 3.6}, "factor = 0.2777778 for vx_mps"),
    ],
)
def test_mirrored_channels_and_wrong_units_are_refused(
    perfect: Channels, change: dict[str, float], said: str
) -> None:
    c = {name: change.get(name, 1.0) * values for name, values in noisy(perfect).items()}
    with pytest.raises(sv.InvalidInput, match=said):
        sv.check(as_log(c))


def test_swapped_accelerations_are_refused(perfect: Channels) -> None:
    c = noisy(perfect)
    c["ax_mps2"], c["ay_mps2"] = c["ay_mps2"], c["ax_mps2"]
    with pytest.raises(sv.InvalidInput, match="swapped"):
        sv.check(as_log(c))


def test_no_driving_is_refused(perfect: Channels) -> None:
    c = {name: np.zeros_like(v) if name == "vx_mps" else v for name, v in perfect.items()}
    with pytest.raises(sv.InvalidInput, match="nowhere does the car move"):
        sv.check(as_log(c))
    with pytest.raises(sv.InvalidInput, match="no log was given"):
        sv.check([])


def test_result_shows_itself(faulty: sv.SensorCheck) -> None:
    assert "<table>" in faulty._repr_html_()
    json.dumps(faulty.to_dict())
    with pytest.raises(sv.InvalidInput, match="imu_forward_m"):
        faulty["imu_forwards_m"]
    with pytest.raises(sv.InvalidInput, match="was not checked"):
        faulty.residuals("fx_n")


def test_a_study_uses_what_the_check_settled(
    faulty: sv.SensorCheck, monkeypatch: pytest.MonkeyPatch
) -> None:
    class Stop(Exception):
        pass

    heard: list[sv.Driving] = []

    def stop(model: sv.Model, driving: sv.Driving, **_: object) -> None:
        heard.append(driving)
        raise Stop

    from sysid_vehicle.study import improve as module

    monkeypatch.setattr(sys.modules[module.__module__], "maximised", stop)
    log, model = faulty.logs[0], sv.Model(sv.example_vehicle())
    with pytest.raises(Stop), pytest.warns(sv.SysidWarning, match="training and validation data"):
        sv.improve(model, log, log, sensors=faulty)
    (driving,) = heard
    assert all(log.corrections for log in driving.logs)
    assert "gyro_bias" in faulty.settles
    assert "imu_lever_arm" not in faulty.settles


def test_an_effect_is_no_larger_than_kinematics_leaves_it(faulty: sv.SensorCheck) -> None:
    """What is not told well enough to be settled is known all the same."""
    known = {f.name: f for f in faulty.faults}
    known["gain_ax"] = replace(known["gain_ax"], value=-0.014, std=0.016, found=False, told=False)
    known["gain_yaw_rate"] = replace(known["gain_yaw_rate"], std=np.inf, found=False, told=False)
    check = replace(faulty, faults=tuple(known.values()))
    scale, pitch, gyro, drag = (
        effect(e) for e in ("accelerometer_scale", "body_attitude", "gyro_scale", "aero_drag")
    )
    found = check.narrowed([scale, pitch, gyro, drag])
    assert found[2:] == (gyro, drag)
    along, across = found[0].parameters
    assert (along.lower, along.upper) == pytest.approx((-0.014 - 4.5 * 0.016, -0.014 + 4.5 * 0.016))
    # What was found is put right: what may be left of it lies about nothing.
    left = 4.5 * faulty["gain_ay"].std
    assert (across.lower, across.upper) == pytest.approx((-left, left))
    # A body leans to the outside; bounds of the catalogue hold.
    assert (found[1].parameters[0].lower, found[1].parameters[0].upper) == (0.0, along.upper)
    # A search that ends there wanted more than the sensors allow; one at nothing wanted none.
    model = sv.Model(sv.example_vehicle())
    assert possible(scale, (0.2, 0.0), (0.02, 0.01))
    assert not refused(scale, (0.5, 0.0), model)
    assert refused(found[0], (along.upper, 0.0), model)
    assert refused(found[0], (0.0, across.lower), model)
    assert not refused(found[0], (0.02, 0.0), model)
    assert not refused(found[1], (0.0, 0.0), model)


def test_a_study_seeks_no_more_than_the_check_leaves(
    faulty: sv.SensorCheck, monkeypatch: pytest.MonkeyPatch
) -> None:
    class Stop(Exception):
        pass

    heard: list[Sequence[Effect]] = []

    def search(*_: object, candidates: Sequence[Effect], **__: object) -> None:
        heard.append(candidates)
        raise Stop

    from sysid_vehicle.study import improve as module

    where = sys.modules[module.__module__]
    monkeypatch.setattr(where, "maximised", lambda *_, **__: object())
    monkeypatch.setattr(where, "Search", search)
    unsure = replace(
        faulty,
        faults=tuple(replace(f, told=f.told and f.name != "gain_ax") for f in faulty.faults),
    )
    model = sv.Model(sv.example_vehicle())
    with pytest.raises(Stop), pytest.warns(sv.SysidWarning, match="training and validation data"):
        sv.improve(model, unsure.logs[0], unsure.logs[0], sensors=unsure)
    ((scale,),) = ([e for e in some if e.id == "accelerometer_scale"] for some in heard)
    assert scale.parameters[0].upper < 0.1 < effect("accelerometer_scale").parameters[0].upper
    # Where it is considered, at whatever step, it keeps these bounds.
    assert scale in considered(model.add("tyre_relaxation"), heard[0])


def test_command_prints_and_writes(
    faulty: sv.SensorCheck, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    faulty.logs[0].between(0.0, 15.0).to_csv(tmp_path / "drive.csv")
    told = tmp_path / "told.json"
    page = tmp_path / "check.html"
    command = ["check", str(tmp_path / "drive.csv"), "--json", str(told), "--report", str(page)]
    assert main(command) == 0
    assert "IMU ahead of the speed sensor" in capsys.readouterr().out
    faults = json.loads(told.read_text(encoding="utf-8"))["faults"]
    assert faults["imu_forward_m"]["found"]
    assert page.read_text(encoding="utf-8").count("<figure>") == 5
