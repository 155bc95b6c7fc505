"""On readings that no car gives, nothing is named; what is wrong with them is."""

import re
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from sysid_vehicle import (
    Diagnosis,
    Fit,
    InvalidInput,
    Log,
    Model,
    SysidWarning,
    compare,
    diagnose,
    drive,
    identify,
    improve,
    manoeuvres,
    verdicts,
)
from sysid_vehicle.compare import incoherent, unrelated
from sysid_vehicle.diagnose import Omnibus
from sysid_vehicle.diagnose.candidates.reservation import confirmed, reservation
from sysid_vehicle.effects import effect
from sysid_vehicle.estimate import MEASURED, Driving
from sysid_vehicle.sensors import made_ready

NAMED = ("missing", "one of a group", "open")


@pytest.fixture(scope="module")
def clean(truth: Model) -> Log:
    return drive(truth, manoeuvres.lap(25.0), seed=61, rate_hz=50.0)


@pytest.fixture(scope="module")
def shuffled(clean: Log, altered: Callable[..., Log]) -> Log:
    rng = np.random.default_rng(3)
    return altered(clean, ay_mps2=rng.permutation(clean["ay_mps2"]))


@pytest.fixture(scope="module")
def of_shuffled(truth: Model, shuffled: Log) -> Diagnosis:
    return diagnose(identify(truth, shuffled, starts=1))


def test_a_shuffled_channel_is_named_and_no_effect_is(of_shuffled: Diagnosis) -> None:
    dx = of_shuffled
    assert dx.significant, "some effect of the catalogue fits best"
    assert dx.named is None
    with pytest.raises(InvalidInput, match=r"no effect can be named: .*ay_mps2"):
        _ = dx.best
    assert str(dx).startswith("something is missing, but no effect can be named")
    assert "ay_mps2" in str(dx).splitlines()[0]
    told = verdicts(dx)
    assert not [v for v in told.all if v.finding in NAMED]


def test_a_comparison_tells_of_a_shuffled_channel(of_shuffled: Diagnosis, shuffled: Log) -> None:
    found = compare(of_shuffled.fit, shuffled)
    assert set(found.unrelated) == {"ay_mps2"}
    assert "Something else is wrong: ay_mps2: does not follow vx_mps" in str(found)
    assert "ay_mps2: does not follow" in found._repr_html_()


def test_a_study_of_a_shuffled_channel_knows_nothing(truth: Model, shuffled: Log) -> None:
    few = ["accelerometer_scale", "accelerometer_bias", "mass"]
    with pytest.warns(SysidWarning, match="training and validation data"):
        found = improve(truth, shuffled, shuffled, starts=1, candidates=few)
    assert found.verdict == "unknown"
    assert all(a.stands_in for a in found.added)
    assert "Something else is wrong: ay_mps2" in str(found)


def test_what_its_refit_does_not_confirm_is_not_named(
    truth: Model, clean: Log, altered: Callable[..., Log]
) -> None:
    """Lateral acceleration a tenth of a second late: relaxation scores best, and fits worse."""
    late = round(0.1 * clean.rate_hz)
    ay = clean["ay_mps2"]
    log = altered(clean, ay_mps2=np.concatenate([np.full(late, ay[0]), ay[:-late]]))
    dx = diagnose(identify(truth, log, starts=1))
    assert dx.named is None or confirmed(dx.named.statistic, dx.named.effect)
    assert not [v for v in verdicts(dx).all if v.finding in ("missing", "one of a group")]


def test_a_late_yaw_rate_is_told_and_no_inertia_is_named(
    truth: Model, clean: Log, altered: Callable[..., Log]
) -> None:
    """To the model the car answers as one of larger yaw inertia does."""
    time_s = clean["time_s"]
    log = altered(clean, yaw_rate_radps=np.interp(time_s - 0.1, time_s, clean["yaw_rate_radps"]))
    few = ["yaw_inertia", "tyre_relaxation"]
    fit = identify(truth, log, starts=1)
    dx = diagnose(fit, candidates=few)
    assert dx.significant[0].id == "yaw_inertia"
    assert dx.named is None
    told = re.search(
        r"yaw_rate_radps: lags behind ay_mps2 by (\S+) s \(\+- (\S+)\)", dx.reservation
    )
    assert told is not None
    assert float(told[1]) == pytest.approx(0.1, abs=2.0 * float(told[2]))
    assert float(told[2]) < 0.02
    assert not [v for v in verdicts(dx).all if v.finding in NAMED]
    with pytest.warns(SysidWarning, match="training and validation data"):
        found = improve(truth, log, log, starts=1, candidates=few, sensors=False)
    assert found.verdict == "unknown"
    assert all(a.stands_in for a in found.added)
    assert "yaw_rate_radps: lags behind" in str(found)
    # Kinematics tell clocks against that of the yaw rate: what is left of it then is the input's.
    ready, _, found = made_ready([log], [])
    assert found.settles
    (moved,) = (text for text in ready[0].corrections if text.startswith("ay_mps2: taken"))
    assert float(moved.split()[2]) == pytest.approx(100.0, abs=10.0)
    assert moved.endswith("ms earlier in the file")


@pytest.mark.parametrize(("channel", "factor"), [("fx_n", 1e-3), ("steer_rad", 16.0)])
def test_inputs_in_a_wrong_unit_name_no_effect(
    hidden_fit: Callable[[str, float], Fit],
    altered: Callable[..., Log],
    channel: str,
    factor: float,
) -> None:
    """No innovation is that of an input; the laws of motion tell its unit."""
    fit = hidden_fit("steer_offset.offset_rad", 0.002)
    dx = diagnose(fit, candidates=["steer_offset"])
    assert dx.named is not None
    log = fit.driving.logs[0]
    wrong = replace(dx, driving=Driving.of(altered(log, **{channel: factor * log[channel]})))
    assert wrong.named is None
    assert wrong.reservation.startswith(f"{channel}: ")
    assert "put factor = " in wrong.reservation


def test_a_slope_explains_a_car_that_brakes_all_the_time(truth: Model) -> None:
    downhill = truth.add("road_grade").with_values({"road_grade.grade_rad": -0.06})
    log = drive(downhill, manoeuvres.slalom(), seed=5, rate_hz=25.0)
    columns = {name: log[name] for name in log.channels if name != "ax_mps2"}
    log = Log.from_arrays(columns, check=False)
    assert [c.channel for c in log.contradictions] == ["fx_n"]
    driving = Driving.of(log)
    assert set(incoherent(driving, truth)) == {"fx_n"}
    assert set(incoherent(driving, truth.add("mass"))) == {"fx_n"}
    assert incoherent(driving, downhill) == {}
    dx = diagnose(identify(truth, log, starts=1), candidates=["road_grade", "gyro_scale"])
    assert dx.best.id == "road_grade"


def test_without_evidence_what_is_wrong_is_told_all_the_same(
    truth: Model, fit: Fit, course: Log, altered: Callable[..., Log]
) -> None:
    dx = diagnose(fit, candidates=["mass"])
    assert not dx.significant
    assert str(dx).startswith("no effect of the catalogue is missing; no remaining error")
    incomplete = replace(dx, omnibus=Omnibus(450.0, 50, 1e-60, "F_y"))
    assert str(incomplete).startswith(
        "no effect of the catalogue explains what is missing: an error that depends on the "
        "driving remains"
    )
    time_s = course["time_s"]
    late = altered(course, ay_mps2=np.interp(time_s - 0.1, time_s, course["ay_mps2"]))
    wrong = replace(dx, driving=Driving.of(late))
    with pytest.raises(InvalidInput, match="channels are wrong: ay_mps2: lags behind"):
        _ = wrong.best


def test_what_the_model_delays_itself_is_no_contradiction(
    truth: Model, clean: Log, altered: Callable[..., Log]
) -> None:
    time_s = clean["time_s"]

    def late(name: str, by_s: float, **values: float) -> dict[str, str]:
        log = altered(clean, **{name: np.interp(time_s - by_s, time_s, clean[name])})
        own = {n.replace("__", "."): v for n, v in values.items()}
        model = truth.add(*{n.split(".")[0] for n in own}).with_values(own)
        return incoherent(Driving.of(log), model)

    assert incoherent(Driving.of(clean), truth) == {}
    assert set(late("yaw_rate_radps", 0.1)) == {"yaw_rate_radps"}
    assert late("yaw_rate_radps", 0.1, sensor_delay__inertial_s=0.1) == {}
    assert set(late("yaw_rate_radps", 0.1, sensor_delay__inertial_s=0.01)) == {"yaw_rate_radps"}
    assert set(late("yaw_rate_radps", 0.1, steer_delay__delay_s=0.1)) == {"yaw_rate_radps"}
    assert set(late("steer_rad", 0.1, steer_delay__delay_s=0.1)) == {"steer_rad"}
    assert set(late("steer_rad", -0.25)) == {"steer_rad"}
    assert late("steer_rad", -0.25, steer_delay__delay_s=0.25) == {}
    assert set(late("steer_rad", -0.25, steer_delay__delay_s=0.02)) == {"steer_rad"}


@pytest.mark.parametrize("effect", ["speed_sensor_lever_arm", "imu_lever_arm"])
def test_an_arm_of_a_sensor_that_the_model_has_is_no_contradiction(
    truth: Model, effect: str
) -> None:
    def model(forward_m: float) -> Model:
        return truth.add(effect).with_values({f"{effect}.forward_m": forward_m})

    driving = Driving.of(drive(model(-1.6), manoeuvres.ramp_steer(), seed=3, rate_hz=50.0))
    # v_y - 1.6 m r reads, at 20 m/s, like a yaw rate that is 80 ms late.
    assert set(incoherent(driving, truth.add("mass"))) == {"yaw_rate_radps"}
    assert incoherent(driving, model(-1.6)) == {}
    # An arm of a few centimetres is none that shifts by that much.
    assert set(incoherent(driving, model(-0.05))) == {"yaw_rate_radps"}


@pytest.mark.manual
def test_a_missing_effect_is_named_and_others_stay_open(
    truth: Model, hidden_fit: Callable[[str, float], Fit]
) -> None:
    dx = diagnose(hidden_fit("steer_offset.offset_rad", 0.002))
    assert dx.reservation == ""
    assert dx.named is not None
    assert dx.named.id == dx.best.id == "steer_offset"
    assert str(dx).startswith("most likely missing: ")
    assert "with it no remaining error" in str(dx)
    two = truth.add("mass", "gyro_scale").with_values(
        {"mass.relative_error": 0.1, "gyro_scale.scale_error": 0.05}
    )
    log = drive(two, manoeuvres.lap(25.0), seed=62, rate_hz=50.0)
    dx = diagnose(identify(truth, log, starts=1))
    told = verdicts(dx)
    assert dx.best.id in ("mass", "gyro_scale")
    assert [v.effect.id for v in told.of("missing")] in ([dx.best.id], [])
    opened = told.of("open")
    assert {"mass", "gyro_scale"} - {dx.best.id} <= {v.effect.id for v in opened}
    assert all(f"add {dx.best.id} and diagnose again" in v.sentence for v in opened)


def test_channels_that_contradict_the_others(clean: Log, rng: np.random.Generator) -> None:
    driving = Driving.of(clean)
    y = driving.measured
    noise = 0.02 * np.std(y, axis=0) * rng.standard_normal(y.shape)
    i = MEASURED.index("yaw_rate_radps")
    spread = np.ones_like(y)
    assert unrelated(driving, noise, spread) == {}

    def predicted(values: np.ndarray) -> dict[str, str]:
        e = noise.copy()
        e[:, i] = y[:, i] - values
        return unrelated(driving, e, spread)

    assert "reads 1000" in predicted(1e-3 * y[:, i])["yaw_rate_radps"]
    assert "reads -1" in predicted(-y[:, i])["yaw_rate_radps"]
    assert "worse than its own mean" in predicted(np.roll(y[:, i], 300))["yaw_rate_radps"]
    # A sensor as noisy as it likes is no contradiction, nor is a prediction that is noise itself.
    assert predicted(y[:, i] + np.std(y[:, i]) * rng.standard_normal(len(y))) == {}
    assert predicted(0.5 * np.std(y[:, i]) * rng.standard_normal(len(y))) == {}
    # Nor is a gain that is some per cent off.
    assert predicted(0.8 * y[:, i]) == {}


@pytest.mark.filterwarnings("ignore:.*not excited:sysid_vehicle.SysidWarning")
def test_a_straight_contradicts_nothing(truth: Model) -> None:
    log = drive(truth, manoeuvres.straight_acceleration(), seed=1, rate_hz=50.0)
    assert compare(identify(truth, log, starts=1), log).unrelated == {}


def test_what_stays_as_it_was_is_doubted(fit: Fit) -> None:
    class Left:
        worst = "the largest innovations are those of ay_mps2 (3.00 expected)"

        def __init__(self, statistic: float, p_value: float, *others: float) -> None:
            self.unrelated: dict[str, str] = {}
            self.fit = fit.__class__(**{**vars(fit), "model": fit.model.add("mass")})
            self.omnibus = Omnibus(statistic, 50, p_value, "F_y")
            self.board = type("Board", (), {"family_p_values": lambda _: dict(enumerate(others))})()

    before = Omnibus(450.0, 50, 1e-60, "F_y")
    assert reservation(Left(60.0, 0.2), before, 3.0, 1.0) == ""  # type: ignore[arg-type]
    stays = reservation(Left(430.0, 1e-50, 0.001), before, 3.0, 2.95)  # type: ignore[arg-type]
    assert "95 % of the evidence" in stays
    assert "ay_mps2" in stays
    # Beside another effect that is missing too much is left.
    assert reservation(Left(430.0, 1e-50, 0.001), before, 3.0, 2.0) == ""  # type: ignore[arg-type]
    alone = reservation(Left(150.0, 1e-9, 0.5), before, 3.0, 1.5)  # type: ignore[arg-type]
    assert "no other effect of the catalogue explains that" in alone


def test_a_refit_confirms_what_gains_more_than_chance() -> None:
    drag, two = effect("aero_drag"), effect("tyre_temperature")
    assert confirmed(12.0, drag)
    assert not confirmed(3.0, drag)
    assert not confirmed(-84.6, drag)
    assert confirmed(8.0, drag)
    assert not confirmed(8.0, two)
