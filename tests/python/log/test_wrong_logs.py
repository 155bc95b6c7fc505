"""Every wrong log earns exactly one message that names channel, sample or time, and remedy."""

import warnings
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from single_track import Change, Columns, drive, times

from sysid_vehicle.errors import InvalidInput, SysidWarning
from sysid_vehicle.log import Log, check_excitation
from sysid_vehicle.read import read_log


def put(channel: str, where: int | slice, value: float) -> Change:
    def change(data: Columns) -> None:
        data[channel][where] = value

    return change


def renamed(old: str, new: str) -> Change:
    def change(data: Columns) -> None:
        data[new] = data.pop(old)

    return change


def without(*channels: str) -> Change:
    def change(data: Columns) -> None:
        for channel in channels:
            del data[channel]

    return change


def rows(keep: slice) -> Change:
    def change(data: Columns) -> None:
        for channel in data:
            data[channel] = data[channel][keep]

    return change


def freeze(channel: str, where: slice) -> Change:
    def change(data: Columns) -> None:
        data[channel][where] = data[channel][where.start]

    return change


def slow(channel: str, every: int) -> Change:
    def change(data: Columns) -> None:
        data[channel][np.arange(len(data[channel])) % every > 0] = np.nan

    return change


def both(first: Change, second: Change) -> Change:
    def change(data: Columns) -> None:
        first(data)
        second(data)

    return change


_TWICE = np.r_[0:2200, 1200:3000]


def shorten(data: Columns) -> None:
    data["vx_mps"] = data["vx_mps"][:-1]


def parked(data: Columns) -> None:
    data["vx_mps"][300:] = 0.0


def straight(data: Columns) -> None:
    data.update(drive(steer_scale=0.0))


def constant_straight(data: Columns) -> None:
    for channel in ("steer_rad", "yaw_rate_radps", "ay_mps2", "vy_mps"):
        data[channel][:] = 0.0


DEG, G = np.degrees(1.0), 9.80665
read_once = cache(read_log)

ERRORS: dict[str, tuple[Change, list[str]]] = {
    "column missing": (without("yaw_rate_radps"), ["missing column yaw_rate_radps", "channel map"]),
    "column misnamed": (
        renamed("yaw_rate_radps", "yaw_rate"),
        ["missing column yaw_rate_radps", "did you mean 'yaw_rate'"],
    ),
    "no longitudinal input": (without("fx_n", "ax_mps2"), ["fx_n and ax_mps2", "at least one"]),
    "unequal lengths": (shorten, ["vx_mps: has 3999 samples, time_s has 4000", "equal length"]),
    "time back": (put("time_s", 700, 3.0), ["time_s: goes back", "sample 700 (t = 3 s)", "sort"]),
    "time repeats": (put("time_s", 700, 6.99), ["repeats at sample 700 (t = 6.99 s)", "delete"]),
    "time missing": (put("time_s", 700, np.nan), ["time_s", "sample 700", "t = 6.99 s", "delete"]),
    "time endless": (put("time_s", 700, np.inf), ["time_s", "sample 700", "t = 6.99 s"]),
    "time jumps": (
        put("time_s", slice(2000, None), 1e9 + np.arange(2000.0) * 0.01),  # type: ignore[arg-type]
        ["time_s: jumps by 1e+09 s at sample 2000", "cut the log"],
    ),
    "time in ms": (times(time_s=1e3), ["time_s: steps of 10", "sample 0", "factor = 0.001"]),
    "time in us": (times(time_s=1e6), ["time_s: steps of 1e+04", "factor = 1e-6"]),
    "empty channel": (put("ay_mps2", slice(None), np.nan), ["ay_mps2: holds no value", "map"]),
    "infinite": (put("ay_mps2", 50, np.inf), ["ay_mps2: infinite at sample 50 (t = 0.5 s)"]),
    "steer in deg": (times(steer_rad=DEG), ["steer_rad", "at sample", "factor = 0.0174533"]),
    "small steer in deg": (
        lambda data: data.update(drive(0.4), steer_rad=drive(0.4)["steer_rad"] * DEG),
        ["steer_rad", "at t = ", "wheelbase", "factor = 0.0174533"],
    ),
    "yaw rate in deg/s": (
        times(yaw_rate_radps=DEG),
        ["yaw_rate_radps: seems to be in degrees", "t = ", "factor = 0.0174533"],
    ),
    "ay in g": (times(ay_mps2=1 / G), ["ay_mps2: seems to be in g", "t = ", "factor = 9.80665"]),
    "ax in g": (times(ax_mps2=1 / G), ["ax_mps2: seems to be in g", "t = ", "factor = 9.80665"]),
    "vx in km/h": (times(vx_mps=3.6), ["vx_mps: seems to be in km/h", "t = ", "0.2777778"]),
    "vx in mph": (times(vx_mps=1 / 0.44704), ["vx_mps: seems to be in miles", "0.44704"]),
    "two wrong units": (
        times(yaw_rate_radps=DEG, ay_mps2=1 / G),
        ["yaw_rate_radps: seems", "ay_mps2: seems", "0.0174533 for yaw", "9.80665 for ay"],
    ),
    "straight, vx in km/h": (
        lambda data: data.update(drive(0.0), vx_mps=drive(0.0)["vx_mps"] * 3.6),
        ["vx_mps: seems to be in km/h", "t = ", "0.2777778"],
    ),
    "steer sign": (times(steer_rad=-1), ["steer_rad: wrong sign", "t = ", "factor = -1"]),
    "yaw rate sign": (times(yaw_rate_radps=-1), ["yaw_rate_radps: wrong sign", "factor = -1"]),
    "ay sign": (times(ay_mps2=-1), ["ay_mps2: wrong sign", "t = ", "factor = -1"]),
    "vy sign": (times(vy_mps=-1), ["vy_mps: wrong sign", "t = ", "factor = -1"]),
    "z down but for the steering": (
        times(yaw_rate_radps=-1, ay_mps2=-1, vy_mps=-1),
        ["steer_rad: wrong sign", "-1 for it in", "for yaw_rate_radps, ay_mps2 and vy_mps instead"],
    ),
    "z down but for a sensor of v_y": (
        times(steer_rad=-1, yaw_rate_radps=-1, ay_mps2=-1),
        ["vy_mps: wrong sign", "or for yaw_rate_radps, ay_mps2 and steer_rad instead", "SAE J670"],
    ),
    "ax sign": (times(ax_mps2=-1), ["ax_mps2: wrong sign", "t = ", "factor = -1"]),
    "fx sign": (times(fx_n=-1), ["fx_n: wrong sign", "t = ", "factor = -1"]),
    "vx sign": (times(vx_mps=-1), ["vx_mps: wrong sign", "t = ", "factor = -1"]),
    "steering dropouts": (
        lambda d: [put("steer_rad", slice(k, k + 4), 8.333)(d) for k in (700, 1500)] and None,
        [
            "steer_rad: 8 impossible value(s), 8.333 rad at samples 700 to 703 (t = 7 to 7.03 s)",
            "and 1 more time(s)",
            "dropped out",
            "despike = true",
        ],
    ),
    "dropouts in degrees": (
        lambda d: times(steer_rad=DEG)(d) or put("steer_rad", slice(700, 704), 477.0)(d),
        ["steer_rad: 477 rad at sample 700", "factor = 0.0174533"],
    ),
}

WARNINGS: dict[str, tuple[Change, list[str]]] = {
    "hole": (
        put("ay_mps2", slice(1000, 1100), np.nan),
        ["ay_mps2: no values at samples 1000 to 1099 (t = 10 to 10.99 s)", "check the sensor"],
    ),
    "hole in the steering": (
        put("steer_rad", slice(1000, 1100), np.nan),
        ["steer_rad: no values at samples 1000 to 1099", "no run of the model goes across"],
    ),
    "several holes": (
        lambda d: [put("vy_mps", slice(k, k + 100), np.nan)(d) for k in (500, 900)] and None,
        ["vy_mps: no values at samples 500 to 599", "1 more block", "check the sensor"],
    ),
    "short hole in the steering": (
        put("steer_rad", slice(1000, 1005), np.nan),
        ["steer_rad: 5 missing sample(s)", "sample 1000 (t = 10 s)", "interpolated"],
    ),
    "optional channel empty": (
        put("vy_mps", slice(None), np.nan),
        ["vy_mps: holds no value", "treated as absent", "leave the column out"],
    ),
    "spikes in the steering": (
        put("steer_rad", [700, 1500], 0.3),  # type: ignore[arg-type]
        ["steer_rad: 2 one-sample spike(s)", "sample 700 (t = 7 s)", "despike = true"],
    ),
    "dropout of one sample": (
        put("steer_rad", 700, 8.333),
        ["steer_rad: 1 impossible value(s), 8.333 rad at sample 700 (t = 7 s)", "despike = true"],
    ),
    "straight": (straight, ["steer_rad and ay_mps2: not excited", "drive corners"]),
    "straight without noise": (constant_straight, ["not excited", "drive corners"]),
    "slow": (rows(slice(None, None, 10)), ["time_s: the rate is only 10 Hz", "20 Hz or more"]),
    "constant speed": (
        put("vx_mps", slice(None), 20.0),
        ["vx_mps: constant (20) over all samples 0 to 3999", "check the sensor"],
    ),
    "constant force": (put("fx_n", slice(None), 0.0), ["fx_n: constant (0)", "leave it out"]),
    "frozen yaw rate": (
        freeze("yaw_rate_radps", slice(1000, 1300)),
        ["yaw_rate_radps: frozen", "samples 1000 to 1299", "300 samples count as missing"],
    ),
    "frozen ay": (
        freeze("ay_mps2", slice(1000, 1300)),
        ["ay_mps2: frozen", "samples 1000 to 1299 (t = 10 to 12.99 s)", "check the sensor"],
    ),
    "frozen yaw rate of a slow channel": (
        both(freeze("yaw_rate_radps", slice(1000, 1300)), slow("yaw_rate_radps", 5)),
        ["yaw_rate_radps: frozen", "samples 1000 to 1295", "296 samples count as missing"],
    ),
    "a piece that stands there twice": (
        lambda data: data.update({c: x[_TWICE] for c, x in data.items() if c != "time_s"}),
        ["all channels at samples 2200 to 3199", "repeat those at samples 1200 to 2199", "cut"],
    ),
    "rows lost": (
        lambda data: rows(np.delete(np.arange(4000), slice(1000, 1100)))(data),  # type: ignore[arg-type]
        ["time_s: has 1 gap of up to 1.01 s", "sample 1000 (t = 11 s)", "fixed rate"],
    ),
}


@pytest.fixture
def data() -> Columns:
    return drive()


def test_a_right_log_is_silent(data: Columns) -> None:
    log = Log.from_arrays(data)
    assert log.stretches() == [slice(0, log.n)]


@pytest.mark.parametrize("case", ERRORS)
def test_error(data: Columns, case: str) -> None:
    change, words = ERRORS[case]
    change(data)
    with pytest.raises(InvalidInput) as caught:
        Log.from_arrays(data, name="lap 3")
    message = str(caught.value)
    for word in ["lap 3: ", *words]:
        assert word in message
    assert "\n" not in message


@pytest.mark.parametrize("case", WARNINGS)
def test_warning(data: Columns, case: str) -> None:
    change, words = WARNINGS[case]
    change(data)
    with pytest.warns(SysidWarning) as caught:
        Log.from_arrays(data, name="lap 3")
    assert [str(warning.message) for warning in caught] == [str(caught[0].message)]
    for word in ["lap 3: ", *words]:
        assert word in str(caught[0].message)
    assert caught[0].filename == __file__


@pytest.mark.parametrize(
    "change",
    [
        times(steer_rad=-1, yaw_rate_radps=-1, ay_mps2=-1, vy_mps=-1),
        times(steer_rad=0.5, yaw_rate_radps=1.05, ay_mps2=0.95),
        put("steer_rad", slice(100, 120), np.nan),
        put("ay_mps2", slice(100, 140), np.nan),
        put("yaw_rate_radps", [500, 900], 5.0),  # type: ignore[arg-type]
        without("vy_mps", "ax_mps2"),
        without("vy_mps", "fx_n"),
        rows(slice(None, None, 4)),
        lambda data: data.update(time_s=data["time_s"] - 17.0),
        lambda data: data.update(steer_rad=data["steer_rad"] + 0.02),
        lambda data: data.update(ay_mps2=data["ay_mps2"] * 1.02 + 0.3),
    ],
    ids=[
        "mirrored",
        "small scale errors",
        "short hole that splits",
        "short hole in a measurement",
        "spikes in a measurement",
        "force only",
        "acceleration only",
        "25 Hz",
        "time before zero",
        "steering offset",
        "gravity through roll and bank",
    ],
)
def test_usable_logs_are_silent(data: Columns, change: Change) -> None:
    change(data)
    assert Log.from_arrays(data).n > 0


@pytest.mark.parametrize(("channel", "value"), [("steer_rad", 8.333), ("ay_mps2", 327.67)])
def test_the_remedy_for_dropouts_mends_them(data: Columns, channel: str, value: float) -> None:
    clean = data[channel].copy()
    put(channel, slice(700, 704), value)(data)
    with pytest.warns(SysidWarning, match=r"removed 4 value\(s\) that no car reaches"):
        log = Log.from_arrays(data, despike=[channel])
    away = np.r_[0:700, 704:4000]
    np.testing.assert_array_equal(log[channel][away], clean[away])
    assert not np.any(np.abs(log[channel][700:704]) > np.abs(clean).max())


def test_a_contradiction_names_the_channel_that_the_text_is_about(data: Columns) -> None:
    put("yaw_rate_radps", slice(700, 704), 90.0)(data)
    (found,) = Log.from_arrays(data, check=False).contradictions
    assert found.channel == "yaw_rate_radps"
    assert found.text.startswith("yaw_rate_radps: 4 impossible")


def test_plausibility_can_be_switched_off(data: Columns) -> None:
    times(yaw_rate_radps=DEG, ay_mps2=-1)(data)
    assert Log.from_arrays(data, check=False).n == 4000


def test_error_comes_without_warnings(data: Columns) -> None:
    put("vy_mps", slice(100, 300), np.nan)(data)
    times(ay_mps2=-1)(data)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        with pytest.raises(InvalidInput, match="wrong sign"):
            Log.from_arrays(data)
    assert caught == []


def test_cell_that_is_no_number() -> None:
    values = {name: column.tolist() for name, column in drive(duration_s=6.0).items()}
    values["ay_mps2"][40] = "n/a"  # type: ignore[call-overload]
    with pytest.raises(InvalidInput, match=r"ay_mps2: 'n/a' at sample 40 is not a number"):
        Log.from_arrays(values)


class TestExcitation:
    def test_corners_are_excitation(self, data: Columns) -> None:
        assert check_excitation(Log.from_arrays(data))

    def test_straight_driving_is_not(self) -> None:
        log = Log.from_arrays(drive(0.0), name="motorway", check=False)
        with pytest.warns(SysidWarning, match=r"motorway: .*not excited.*drive corners") as caught:
            assert not check_excitation(log)
        assert len(caught) == 1

    def test_one_run_with_corners_suffices(self, data: Columns) -> None:
        straight_run = Log.from_arrays(drive(0.0), check=False)
        assert check_excitation([straight_run, Log.from_arrays(data)])

    def test_all_straight_runs_are_one_message(self) -> None:
        runs = [Log.from_arrays(drive(0.0), name=name, check=False) for name in ("a", "b")]
        with pytest.warns(SysidWarning, match="a: .*; b: ") as caught:
            assert not check_excitation(runs)
        assert len(caught) == 1


@pytest.mark.parametrize(
    ("channel", "factor", "words"),
    [
        ("steer_rad", DEG, ["steer_rad", "0.0174533"]),
        ("yaw_rate_radps", DEG, ["yaw_rate_radps: seems to be in degrees", "0.0174533"]),
        ("ay_mps2", 1 / G, ["ay_mps2: seems to be in g", "9.80665"]),
        ("ax_mps2", 1 / G, ["ax_mps2: seems to be in g", "9.80665"]),
        ("vx_mps", 3.6, ["vx_mps: seems to be in km/h", "0.2777778"]),
        ("steer_rad", -1, ["steer_rad: wrong sign", "factor = -1"]),
        ("yaw_rate_radps", -1, ["yaw_rate_radps: wrong sign", "factor = -1"]),
        ("ay_mps2", -1, ["ay_mps2: wrong sign", "factor = -1"]),
        ("ax_mps2", -1, ["ax_mps2: wrong sign", "factor = -1"]),
    ],
)
@pytest.mark.parametrize(
    "file",
    [
        "carsim_like_handling/handling_course.csv",
        "tum_devbot_sim/data_to_train_2.csv",
        "tum_devbot_sim/data_to_run.csv",
        "revs_250lm/revs_250lm_20140222_run1.csv",
    ],
)
def test_spoilt_logs_of_others(
    repo: Path, shared_data: Path, file: str, channel: str, factor: float, words: list[str]
) -> None:
    channels = repo / "benchmarks" / "real_driving" / f"{file.split('/')[0]}.channels.toml"
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", SysidWarning)
        log = read_once(shared_data / file, channels)
        spoilt = {name: log[name] for name in log.channels}
        spoilt[channel] = spoilt[channel] * factor
        with pytest.raises(InvalidInput) as caught:
            Log.from_arrays(spoilt)
    for word in words:
        assert word in str(caught.value)
