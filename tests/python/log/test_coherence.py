"""Channels against the laws of motion: good logs pass in silence, corrupted ones are named."""

import dataclasses
import re
import warnings
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from smooth_log import drift

from sysid_vehicle import Log, Model, RoadDisturbance, drive, lab, manoeuvres, published, read_log
from sysid_vehicle.errors import InvalidInput, SysidWarning
from sysid_vehicle.log.laws.regression import find_lag, in_most, regress

Columns = dict[str, np.ndarray]

# True of the drive, and said of it rightly.
TRUE_NOTES = ("not excited", "the rate is only", "constant (")


def columns_of(log: Log) -> Columns:
    return {name: np.array(log[name]) for name in log.channels}


AT_1000_HZ = ("lap", "double_lane_change")  # the others take too long and show the same


def heard(columns: Columns) -> str:
    """Return what reading says, but for what is true of the drive."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        try:
            Log.from_arrays(columns)
        except InvalidInput as error:
            return str(error)
    told = [str(w.message) for w in caught]
    return "; ".join(t for t in told if not any(note in t for note in TRUE_NOTES))


@pytest.mark.parametrize(
    ("name", "rate_hz"),
    [
        pytest.param(
            name, rate, marks=() if rate < 1000.0 or name in AT_1000_HZ else pytest.mark.manual
        )
        for name in manoeuvres.all()
        for rate in (5.0, 10.0, 20.0, 100.0, 1000.0)
    ],
)
def test_own_drives_are_read_in_silence(truth: Model, name: str, rate_hz: float) -> None:
    data = columns_of(drive(truth, manoeuvres.all()[name], seed=7, rate_hz=rate_hz))
    assert heard(data) == ""
    n = data["time_s"].size
    for start in (0.0, 0.3, 0.6):
        part = slice(int(start * n), int(start * n) + int(12.0 * rate_hz))
        assert heard({c: v[part] for c, v in data.items()}) == ""


def test_a_car_that_slides_and_is_steered_against_it() -> None:
    """Its steering follows neither yaw rate nor a_y, and its speed changes by v_y r."""
    data = drift(np.arange(0.0, 90.0, 0.01))
    assert heard(data) == ""
    wrong = {**data, "yaw_rate_radps": -data["yaw_rate_radps"]}
    assert "yaw_rate_radps" in heard(wrong) or "ay_mps2" in heard(wrong)


def test_a_double_lane_change_keeps_its_speed(truth: Model, tmp_path: Path) -> None:
    """Most of its a_x is v_y r: without that term its speed looked like km/h."""
    for seed in range(4):
        log = drive(truth, manoeuvres.double_lane_change(), seed=seed)
        log.to_csv(tmp_path / "lane.csv")
        assert read_log(tmp_path / "lane.csv")["vx_mps"].max() == log["vx_mps"].max()


@pytest.mark.parametrize("without", [("vy_mps",), ("vy_mps", "fx_n"), ("ax_mps2",)])
def test_with_fewer_channels_too(truth: Model, without: tuple[str, ...]) -> None:
    for manoeuvre in manoeuvres.all().values():
        data = columns_of(drive(truth, manoeuvre, seed=8))
        assert heard({c: v for c, v in data.items() if c not in without}) == ""


@pytest.mark.parametrize("duration_s", [120.0, 200.0])
def test_the_laboratory_drives_an_oval(duration_s: float) -> None:
    oval = dataclasses.replace(published.Oval(), duration_s=duration_s)
    log = lab.run_closed_loop(oval, lab.Setup.default(), seed=1).to_log()
    assert heard(columns_of(log)) == ""


BENCHMARK = ("reading", "corruptions")

# What a lap holds too little of: its v_y is too slow to have a time.
LAP_MISSES = {("0.1 s late", "vy_mps")}


@pytest.mark.parametrize("seed", [21, pytest.param(22, marks=pytest.mark.manual)])
def test_corruptions_of_a_lap_are_noticed(
    truth: Model, program: SimpleNamespace, seed: int
) -> None:
    data = columns_of(drive(truth, manoeuvres.lap(), seed=seed))
    rng = np.random.default_rng(seed)
    for kind, channels in program.corruptions.CORRUPTIONS.items():
        for channel, corrupt in channels.items():
            spoilt = corrupt(data, rng)
            if (kind, channel) in LAP_MISSES or not program.corruptions.matters(data, spoilt):
                continue
            said = heard(spoilt)
            assert said, (kind, channel)
            assert re.search(r"t = |whole log|samples|sample ", said), said
            assert re.search(r"put |check |swap ", said), said


class TestLags:
    @pytest.mark.parametrize(
        ("channel", "late_s", "words"),
        [
            ("yaw_rate_radps", 0.1, "yaw_rate_radps: lags behind ay_mps2 by"),
            ("yaw_rate_radps", -0.1, "yaw_rate_radps: runs ahead of ay_mps2 by"),
            ("ay_mps2", 0.1, "ay_mps2: lags behind yaw_rate_radps by"),
            ("vy_mps", 0.1, "vy_mps: lags behind ay_mps2 and yaw_rate_radps by"),
            ("vx_mps", 0.1, "vx_mps: lags behind ax_mps2 by"),
            ("ax_mps2", 0.1, "vx_mps: runs ahead of ax_mps2 by"),
            ("fx_n", 0.1, "fx_n: lags behind ax_mps2 by"),
            ("steer_rad", 0.1, "steer_rad: lags behind yaw_rate_radps and ay_mps2 by"),
        ],
    )
    def test_who_is_late_and_by_how_much(
        self, truth: Model, channel: str, late_s: float, words: str
    ) -> None:
        data = columns_of(drive(truth, manoeuvres.double_lane_change(), seed=9))
        time_s = data["time_s"]
        said = heard({**data, channel: np.interp(time_s - late_s, time_s, data[channel])})
        found = re.search(words + r" ([\d.]+) s", said)
        assert found is not None, said
        # The steering depends on tyres that are not known, and so does its time.
        assert float(found[1]) == pytest.approx(0.1, abs=0.03 if channel == "steer_rad" else 0.01)

    @pytest.mark.parametrize("early_s", [0.1, -0.1])
    def test_of_a_speed_that_comes_early_slip_is_the_rival(
        self, truth: Model, early_s: float
    ) -> None:
        data = columns_of(drive(truth, manoeuvres.double_lane_change(), seed=9))
        time_s, vx = data["time_s"], data["vx_mps"]
        said = heard({**data, "vx_mps": np.interp(time_s + early_s, time_s, vx)})
        found = re.search(r"slip of ([\d.]+) % per m/s2 does the same", said)
        assert (found is not None) is (early_s > 0.0), said
        if found is not None:
            assert float(found[1]) == pytest.approx(100.0 * early_s / np.median(vx), rel=0.3)

    def test_the_remedy_mends_it(self, truth: Model) -> None:
        data = columns_of(drive(truth, manoeuvres.step_steer(), seed=9))
        time_s, yaw = data["time_s"], data["yaw_rate_radps"]
        late = {**data, "yaw_rate_radps": np.interp(time_s - 0.1, time_s, yaw)}
        found = re.search(r"put delay_s = (\S+) for yaw_rate_radps", heard(late))
        assert found is not None
        entry = {"yaw_rate_radps": {"delay_s": float(found[1])}}
        with warnings.catch_warnings():
            warnings.simplefilter("error", SysidWarning)
            log = read_log(late, entry)
        inner = slice(100, -100)
        np.testing.assert_allclose(log["yaw_rate_radps"][inner], yaw[inner], atol=0.02)
        assert np.isnan(log["yaw_rate_radps"][-5:]).all()

    @pytest.mark.parametrize("name", ["lap", "handling_course"])
    @pytest.mark.parametrize(
        "hidden", [{}, {"tyre_load_sensitivity.sensitivity": 0.25}, {"mass.relative_error": 0.12}]
    )
    def test_steering_that_is_late_near_the_limit(
        self, truth: Model, name: str, hidden: dict[str, float]
    ) -> None:
        """Tyres are far from linear there, and none of them is known."""
        effects = {value.split(".")[0] for value in hidden}
        car = truth.add(*effects).with_values(hidden) if effects else truth
        data = columns_of(drive(car, manoeuvres.all()[name], seed=10, rate_hz=50.0))
        assert heard(data) == ""
        time_s = data["time_s"]
        said = heard({**data, "steer_rad": np.interp(time_s - 0.1, time_s, data["steer_rad"])})
        found = re.search(r"steer_rad: lags behind yaw_rate_radps and ay_mps2 by ([\d.]+) s", said)
        assert found is not None, said
        assert float(found[1]) == pytest.approx(0.1, abs=0.03)

    @pytest.mark.parametrize(
        "hidden",
        [
            {"steer_delay.delay_s": 0.1},
            {"steer_lag.time_constant_s": 0.1},
            {"tyre_relaxation.relaxation_length_m": 0.9},
            {"front_tyre_relaxation.relaxation_length_m": 0.9},
            {"rear_tyre_relaxation.relaxation_length_m": 0.9},
            {"force_lag.time_constant_s": 0.2},
            {"speed_sensor_lever_arm.forward_m": 0.8, "speed_sensor_lever_arm.left_m": 0.4},
        ],
    )
    def test_what_a_car_delays_is_no_late_channel(
        self, truth: Model, hidden: dict[str, float]
    ) -> None:
        car = truth.add(next(iter(hidden)).split(".")[0]).with_values(hidden)
        for name in ("double_lane_change", "sine_sweep", "slalom", "step_steer"):
            log = drive(car, manoeuvres.all()[name], seed=11, rate_hz=50.0)
            assert heard(columns_of(log)) == "", name

    @pytest.mark.parametrize(
        "seed", [2093, *(pytest.param(s, marks=pytest.mark.manual) for s in (417566, 888012))]
    )
    def test_gusts_while_braking_in_a_turn_are_no_late_steering(
        self, truth: Model, seed: int
    ) -> None:
        """They push the axle and turn the car; least squares alone tell 0.07 to 0.17 s."""
        gusts = RoadDisturbance(fx_n=120.0, fy_n=150.0, mz_nm=150.0, correlation_time_s=0.3)
        course = manoeuvres.brake_in_turn(lateral_mps2=5.0)
        data = columns_of(drive(truth, course, seed=seed, disturbance=gusts, rate_hz=50.0))
        assert heard(data) == ""
        time_s = data["time_s"]
        said = heard({**data, "steer_rad": np.interp(time_s - 0.12, time_s, data["steer_rad"])})
        found = re.search(r"steer_rad: lags behind yaw_rate_radps and ay_mps2 by ([\d.]+) s", said)
        assert found is not None, said
        assert float(found[1]) == pytest.approx(0.12, abs=0.06)

    def test_at_one_frequency_a_lag_is_only_a_phase(self, truth: Model) -> None:
        data = columns_of(drive(truth, manoeuvres.slalom(), seed=12, rate_hz=50.0))
        for late_s in (0.0, 0.05):
            time_s, steer = data["time_s"], data["steer_rad"]
            assert heard({**data, "steer_rad": np.interp(time_s - late_s, time_s, steer)}) == ""

    def test_a_shift_between_samples(self, rng: np.random.Generator) -> None:
        time_s = np.arange(3000) * 0.02
        signal = np.sin(time_s) + np.sin(2.7 * time_s)
        noisy = signal + rng.normal(0.0, 0.05, time_s.size)

        def sides(lag: float) -> tuple[np.ndarray, np.ndarray]:
            moved = np.interp(time_s + 0.0537 - lag, time_s, signal)
            return noisy, np.column_stack([moved, np.ones(time_s.size)])

        free = np.full(2, np.inf)
        lag = find_lag(sides, np.zeros(2), free, np.ones(time_s.size, dtype=bool))
        assert lag.seconds == pytest.approx(0.0537, abs=4.0 * lag.deviation)
        assert 0.0 < lag.deviation < 0.002


@pytest.fixture(scope="module")
def long_course(truth: Model) -> Columns:
    return columns_of(drive(truth, manoeuvres.handling_course(120.0), seed=13, rate_hz=25.0))


class TestClock:
    @staticmethod
    def late(data: Columns, begin_s: float, end_s: float) -> str:
        time_s = data["time_s"]
        by = np.linspace(begin_s, end_s, time_s.size)
        return heard({**data, "steer_rad": np.interp(time_s - by, time_s, data["steer_rad"])})

    def test_a_clock_that_drifts_is_refused(self, long_course: Columns) -> None:
        assert heard(long_course) == ""
        said = self.late(long_course, 0.0, 3.0)
        found = re.search(r"its clock drifts .*: (\S+) s (early|late) at .*, (\S+) s late at", said)
        assert found is not None, said
        assert float(found[1]) == pytest.approx(0.0, abs=0.3)
        assert float(found[3]) == pytest.approx(3.0, abs=0.3)
        assert re.search(r" 2\.\d s early at", self.late(long_course, 0.1, -2.2))

    @pytest.mark.parametrize("late_s", [1.5, -0.6])
    def test_a_clock_that_is_off_throughout(self, long_course: Columns, late_s: float) -> None:
        found = re.search(
            r"steer_rad: .* against yaw_rate_radps .*delay_s = (\S+) ",
            self.late(long_course, *2 * [late_s]),
        )
        assert found is not None
        # The car answers late itself.
        assert float(found[1]) == pytest.approx(late_s - 0.1, abs=0.15)

    def test_steering_that_explains_nothing_is_refused(self, long_course: Columns) -> None:
        steer = np.roll(long_course["steer_rad"], long_course["time_s"].size // 3)
        assert "steer_rad: does not turn with yaw_rate_radps" in heard(
            {**long_course, "steer_rad": steer}
        )


def test_a_regression_is_not_bent_by_outliers(rng: np.random.Generator) -> None:
    x = np.column_stack([rng.normal(size=400), np.ones(400)])
    y = x @ np.array([2.0, 1.0]) + rng.normal(0.0, 0.1, 400)
    y[:20] += 50.0
    found = regress(y, x, np.zeros(2), np.full(2, np.inf))
    np.testing.assert_allclose(found.coefficients, [2.0, 1.0], atol=0.05)
    assert 0.003 < found.deviations[0] < 0.01
    assert found.coherence > 0.7


def test_a_car_that_spins_is_no_wrong_unit() -> None:
    """Without the lateral speed: of a spin the ratio of a_y to v_x r is below one, and any."""
    rng = np.random.default_rng(5)
    yaw = np.repeat(rng.uniform(-0.8, 0.8, 40), 200)
    yaw = np.convolve(yaw, np.full(60, 1.0 / 60.0), "same")
    share = np.interp(np.arange(yaw.size), np.arange(0, yaw.size, 150), rng.uniform(0.1, 1.0, 54))
    turn = 12.0 * yaw
    assert in_most(0.45, turn, 0.45 * turn, 1.0)
    assert not in_most(0.55, turn, share * turn, 1.0)
