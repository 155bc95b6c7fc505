"""What drives can tell: separation of rivals, the next drive."""

import json
from pathlib import Path

import numpy as np
import pytest
from few_drives import asked_of_few

from sysid_vehicle import (
    DriveLimits,
    Driving,
    Fit,
    InvalidInput,
    Log,
    Model,
    RoadDisturbance,
    drive,
    effect,
    identify,
    manoeuvres,
    suggest_manoeuvre,
)
from sysid_vehicle.cli import main
from sysid_vehicle.diagnose import NextDrive, separations
from sysid_vehicle.diagnose.candidates.score import score_board
from sysid_vehicle.diagnose.experiment.information import information_of
from sysid_vehicle.diagnose.experiment.rivals import Fitted
from sysid_vehicle.diagnose.experiment.suggestion import Suggestion, ground_m, path_m
from sysid_vehicle.identify import refine
from sysid_vehicle.simulate import drive_truth

LAG, RELAXATION = effect("steer_lag"), effect("tyre_relaxation")


def test_information_of_two_logs_adds_up(fit: Fit, lap: Log, course: Log) -> None:
    effects = (LAG, RELAXATION)
    parts = [information_of(fit, Driving.of(log), effects) for log in (lap, course)]
    both = information_of(fit, Driving.of([lap, course]), effects)
    np.testing.assert_allclose((parts[0] + parts[1]).matrix, both.matrix, rtol=1e-6)
    assert both.separation("steer_lag", [0.06]) > parts[0].separation("steer_lag", [0.06])


def test_information_is_that_of_the_score(fit: Fit) -> None:
    board = score_board(fit, fit.driving, (LAG,))
    direction = board.directions["steer_lag"]
    known = information_of(fit, fit.driving, (LAG,))
    assert known.about("steer_lag")[0, 0] == pytest.approx(float((direction**2).sum()), rel=1e-6)
    # A rival can only take away.
    pair = information_of(fit, fit.driving, (LAG, RELAXATION))
    assert pair.separation("steer_lag", [0.06], "tyre_relaxation") < pair.separation(
        "steer_lag", [0.06]
    )
    with pytest.raises(InvalidInput, match="shows nothing of 'aero_drag'"):
        pair.about("aero_drag")


@pytest.fixture(scope="module")
def gentle(truth: Model, start: Model) -> Fit:
    log = drive(truth, manoeuvres.constant_radius(60.0, 5.0, 40.0), seed=3, rate_hz=50.0)
    return identify(start, log, starts=1)


@pytest.fixture(scope="module")
def asked(gentle: Fit) -> NextDrive:
    return suggest_manoeuvre(gentle, LAG, RELAXATION, limits=DriveLimits(28.0, 7.0), enough=60.0)


def test_a_drive_that_tells_lag_from_relaxation(asked: NextDrive) -> None:
    assert asked.best.sigmas >= 60.0 > asked.now
    cheaper = [s for s in asked.suggestions if s.duration_s < asked.best.duration_s]
    assert all(s.sigmas < 60.0 for s in cheaper)
    assert "standard errors apart" in str(asked)
    assert "<table" in asked._repr_html_()


def test_what_was_promised_is_achieved(gentle: Fit, asked: NextDrive) -> None:
    small = 0.01  # s, where the test is still linear
    hidden = gentle.model.add(LAG).with_values({"steer_lag.time_constant_s": small})
    log = drive(hidden, asked.best.manoeuvre, seed=9)
    fit = identify(gentle.model, log, starts=1)
    board = score_board(fit, fit.driving, (LAG, RELAXATION))
    beyond = board.joint_statistic("steer_lag", "tyre_relaxation") - board.joint_statistic(
        "tyre_relaxation"
    )
    promised = information_of(fit, fit.driving, (LAG, RELAXATION)).separation(
        "steer_lag", [small], "tyre_relaxation"
    )
    assert promised > 5.0
    assert np.sqrt(max(beyond, 0.0)) == pytest.approx(promised, rel=0.3)


def test_limits_are_kept(gentle: Fit, monkeypatch: pytest.MonkeyPatch) -> None:
    small = DriveLimits(20.0, 6.0, area_m=(60.0, 40.0))
    found = suggest_manoeuvre(gentle, LAG, RELAXATION, limits=small)
    assert found.refused > 5
    for s in found.suggestions:
        made = drive_truth(gentle.model, s.manoeuvre, seed=0)
        assert max(ground_m(made)) <= 66.0
        assert max(s.ground_m) <= 60.0
        assert min(s.ground_m) <= 40.0
        assert s.speed_mps[1] <= 1.02 * small.speed_mps
        assert s.lateral_mps2 <= 1.05 * small.lateral_mps2
    asked_of_few(monkeypatch)
    nowhere = suggest_manoeuvre(
        gentle, LAG, RELAXATION, limits=DriveLimits(20.0, 6.0, area_m=(2.0, 1.0))
    )
    with pytest.raises(InvalidInput, match="widen"):
        nowhere.best  # noqa: B018
    headline, remedy = str(nowhere).splitlines()
    assert headline.endswith(" apart.")
    assert remedy == nowhere.reserve == nowhere.to_dict()["reserve"]
    with pytest.raises(InvalidInput, match="DriveLimits: speed_mps = -1"):
        DriveLimits(-1.0)
    with pytest.raises(InvalidInput, match=r"suggest_manoeuvre: enough = nan; give positive"):
        suggest_manoeuvre(gentle, LAG, RELAXATION, enough=float("nan"))


def test_what_acts_alike_only_beside_others_is_asked_with_these(
    truth: Model, start: Model, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A gain of the force is a mass with another yaw inertia and another drag, at these speeds."""
    both = {"force_gain.drive_error": 0.08, "force_gain.brake_error": 0.08}
    car = truth.add("force_gain").with_values(both)
    log = drive(car, manoeuvres.step_steer((17.0, 27.0), (3.0, 6.0)), seed=5, rate_hz=50.0)
    asked_of_few(monkeypatch, 22)  # what is asked for is what the driving at hand tells
    limits = DriveLimits(30.0, 8.0, duration_s=30.0)
    now = [
        suggest_manoeuvre(
            identify(start.add(*beside), log, starts=1), "force_gain", "mass", limits=limits
        ).now
        for beside in ((), ("yaw_inertia", "aero_drag"))
    ]
    assert now[0] > 10.0
    assert now[1] < 1.5


def test_small_ground_is_driven_slowly(gentle: Fit) -> None:
    ground = DriveLimits(26.0, 7.0, area_m=(80.0, 25.0))
    found = suggest_manoeuvre(gentle, LAG, RELAXATION, limits=ground)
    assert found.suggestions
    for s in found.suggestions:
        assert max(s.ground_m) <= 80.0
        assert min(s.ground_m) <= 25.0
    # Short manoeuvres fit too, not circles alone.
    assert len({s.manoeuvre.name for s in found.suggestions}) > 1


def test_separations_of_all_pairs(fit: Fit) -> None:
    found = separations(fit, ["steer_lag", "tyre_relaxation", "steer_offset"])
    assert len(found) == 3
    assert found["steer_lag", "steer_offset"] > found["steer_lag", "tyre_relaxation"] > 0.0


def test_what_cannot_be_asked_is_refused(gentle: Fit) -> None:
    has = identify(gentle.model.add("steer_offset"), gentle.driving, starts=1)
    with pytest.raises(InvalidInput, match="has 'steer_offset' already"):
        suggest_manoeuvre(has, "steer_offset", "road_bank")
    with pytest.raises(InvalidInput, match="'road_bank' alone: name what it is to be told from"):
        suggest_manoeuvre(gentle, "road_bank")
    with pytest.raises(InvalidInput, match="'mass' is named twice"):
        suggest_manoeuvre(gentle, "mass", "aero_drag", "mass")


def _reached(start: Model, logs: list[Log], right: str, wrong: str) -> float:
    """Standard errors by which the likelihood of some logs tells the right effect."""
    driving = Driving.of(logs)
    base = identify(start, driving, starts=1)
    fits = [
        max(
            (
                refine(model, driving, base.noise)
                for model in (base.model.add(e), base.model.add(e).with_values(typical))
            ),
            key=lambda f: f.log_likelihood,
        )
        for e in (right, wrong)
        for typical in [{n: p.typical for n, p in effect(e).named.items()}]
    ]
    gain = 2.0 * (fits[0].log_likelihood - fits[1].log_likelihood)
    return float(np.sign(gain) * np.sqrt(abs(gain)))


def test_the_promise_is_that_of_the_size_at_hand(
    truth: Model, start: Model, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Half the typical delay: of a lag it differs by a quarter of what a typical one does."""
    car = truth.add("steer_delay").with_values({"steer_delay.delay_s": 0.02})
    log = drive(car, manoeuvres.ramp_steer((18.0, 27.0), 8.0, 4.0), seed=31, rate_hz=50.0)
    fit = identify(start, log, starts=1)
    asked_of_few(monkeypatch, 8)
    found = suggest_manoeuvre(fit, "steer_delay", "steer_lag")
    best = found.best
    assert found.sizes == "at hand"
    assert found.now < 5.0 <= best.sigmas
    assert "as large as this driving shows them" in str(found)
    more = [drive(car, best.manoeuvre, seed=32 + i, rate_hz=50.0) for i in range(best.times)]
    reached = _reached(start, [log, *more], "steer_delay", "steer_lag")
    # Chance moves a distance by one, the size at hand by as much again.
    assert reached == pytest.approx(best.if_acts["steer_delay"], abs=4.0)
    typical = suggest_manoeuvre(fit, "steer_delay", "steer_lag", size=[0.04])
    assert typical.sizes == "given"
    assert "of the size asked for" in str(typical)


def test_what_the_rival_takes_for_a_disturbance_it_takes_for_one_again(
    truth: Model, start: Model, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A yaw rate that is off looks like a road whose slope lasts, beside a side wind."""
    car = truth.add("gyro_bias").with_values({"gyro_bias.bias_radps": 0.006})
    road = RoadDisturbance(fx_n=120.0, fy_n=150.0, mz_nm=150.0, correlation_time_s=0.3)

    def driven(manoeuvre: manoeuvres.Manoeuvre, seed: int) -> Log:
        log = drive(car, manoeuvre, seed=seed, disturbance=road, rate_hz=25.0)
        kept = {c: log[c] for c in log.channels if c != "vy_mps"}
        return Log.from_arrays(kept, name=log.name, check=False)

    log = driven(manoeuvres.step_steer((17.0, 27.0), (3.0, 6.0)), 33)
    fit = identify(start, log, starts=1)
    asked_of_few(monkeypatch, 8)
    asked = suggest_manoeuvre(fit, "gyro_bias", "side_wind")
    more = [driven(asked.best.manoeuvre, 34 + i) for i in range(asked.best.times)]
    reached = _reached(start, [log, *more], "gyro_bias", "side_wind")
    assert reached == pytest.approx(asked.best.if_acts["gyro_bias"], abs=4.0)


def test_a_size_that_is_hardly_known_is_a_usual_one(truth: Model, start: Model) -> None:
    scale = {"accelerometer_scale.ax_error": 0.05, "accelerometer_scale.ay_error": 0.05}
    car = truth.add("accelerometer_scale").with_values(scale)
    log = drive(car, manoeuvres.sine_sweep(25.0, 25.0, 3.5), seed=35, rate_hz=50.0)
    effects = (effect("accelerometer_scale"), effect("body_attitude"))
    known = Fitted.of(identify(start, log, starts=1), effects)
    assert known is not None
    found, driven = known.fits[0], known.car
    assert found["accelerometer_scale.ax_error"].std > 0.05  # the speed stays
    usual = driven.value("accelerometer_scale.ax_error")
    assert abs(usual) < 0.5 * abs(found["accelerometer_scale.ax_error"].value)
    lateral = driven.value("accelerometer_scale.ay_error")
    assert lateral == pytest.approx(found["accelerometer_scale.ay_error"].value, rel=0.01)


def test_it_says_that_no_drive_is_enough(truth: Model, start: Model) -> None:
    """Rolling resistance can do all that a head wind does on a level road, and more."""
    car = truth.add("head_wind").with_values({"head_wind.speed_mps": 6.0})
    log = drive(car, manoeuvres.lap(20.0), seed=36, rate_hz=50.0)
    limits = DriveLimits(25.0, 6.0)
    found = suggest_manoeuvre(
        identify(start, log, starts=1), "head_wind", "rolling_resistance", limits=limits
    )
    assert not found.reaches
    assert all(s.if_acts["head_wind"] < 5.0 for s in found.suggestions)
    told = found.to_dict()
    assert told["reached"] is False
    assert "None of these reaches 5 standard errors" in told["reserve"]
    assert "the same road out and back" in told["reserve"]
    assert told["reserve"] in str(found)


def test_a_drive_is_repeated_where_once_is_not_enough(
    gentle: Fit, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked_of_few(monkeypatch)
    limits = DriveLimits(28.0, 7.0)
    once = suggest_manoeuvre(gentle, LAG, RELAXATION, limits=limits, enough=5.0)
    by_name = {id_of(s): s for s in once.suggestions}
    most = max(s.sigmas for s in once.suggestions if s.duration_s < 50.0)
    more = suggest_manoeuvre(gentle, LAG, RELAXATION, limits=limits, enough=1.2 * most)
    again = [s for s in more.suggestions if s.times > 1]
    assert again
    for s in again:
        assert s.sigmas >= more.enough > by_name[id_of(s)].sigmas
        assert s.times * s.duration_s <= limits.duration_s
        assert s.instructions().startswith(f"{s.times} times ")
        assert s.to_dict()["times"] == s.times
    order = [s.whole_s for s in more.suggestions if s.sigmas >= more.enough]
    assert order == sorted(order)
    # So much that no number of drives within the limits reaches it.
    never = suggest_manoeuvre(gentle, LAG, RELAXATION, limits=limits, enough=1e4)
    assert not never.reaches
    assert all(s.times == 1 and s.needed is None for s in never.suggestions)


def id_of(s: Suggestion) -> tuple[str, float, float, float]:
    return s.manoeuvre.name, s.duration_s, round(s.speed_mps[1], 1), s.lateral_mps2


def test_several_rivals_are_told_from_the_first(
    gentle: Fit, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked_of_few(monkeypatch)
    limits = DriveLimits(28.0, 7.0)
    pair = suggest_manoeuvre(gentle, LAG, RELAXATION, limits=limits)
    three = suggest_manoeuvre(gentle, LAG, RELAXATION, "steer_offset", limits=limits)
    assert [e.id for e in three.rivals] == ["tyre_relaxation", "steer_offset"]
    assert three.to_dict()["between"] == ["steer_lag", "tyre_relaxation", "steer_offset"]
    assert three.now <= pair.now
    for s in three.suggestions:
        assert s.sigmas == min(s.if_acts.values())
        assert set(s.if_acts) == {"steer_lag", "tyre_relaxation", "steer_offset"}
    assert "(the nearest)" in str(three)


def test_the_driver_knows_the_tyres_that_were_fitted(truth: Model, start: Model) -> None:
    """By the tyres of the vehicle file he would steer too much: the car would exceed the limits."""
    fit = identify(start, drive(truth, manoeuvres.lap(20.0), seed=37, rate_hz=50.0), starts=1)
    found = suggest_manoeuvre(fit, LAG, RELAXATION)
    assert found.refused == 0
    steps = [s for s in found.suggestions if s.manoeuvre.name == "step_steer"]
    for s in steps:
        assert s.lateral_mps2 <= 0.75 * DriveLimits().lateral_mps2


@pytest.mark.parametrize(
    ("manoeuvre", "hz"),
    [
        (manoeuvres.sine_sweep(speed_mps=20.0, lateral_mps2=3.0), (0.2, 4.0)),
        (manoeuvres.constant_radius(50.0, 5.0, 60.0), None),
    ],
    ids=["sine sweep", "constant radius"],
)
def test_a_suggestion_says_how_it_is_driven(
    truth: Model, manoeuvre: manoeuvres.Manoeuvre, hz: tuple[float, float] | None
) -> None:
    drive = drive_truth(truth, manoeuvre, seed=0)
    told = Suggestion(manoeuvre, drive.log.duration_s, 7.0, drive)
    if hz is None:
        assert told.steer_hz is None
        # A circle to the left and one to the right, each 100 m wide.
        length, width = told.ground_m
        assert width == pytest.approx(100.0, rel=0.03)
        assert 200.0 <= length <= 240.0  # with what leads from one to the other
    else:
        assert told.steer_hz is not None
        assert hz[0] <= told.steer_hz[0] < told.steer_hz[1] <= hz[1]
        assert told.speed_mps == pytest.approx((20.0, 20.0), abs=0.5)
    assert f"{told.lateral_mps2:.1f} m/s2" in str(told)
    assert "Hz" in str(told) or hz is None


def test_a_suggestion_as_a_table_and_pictures(truth: Model, tmp_path: Path) -> None:
    manoeuvre = manoeuvres.step_steer((15.0,), (3.0,))
    told = Suggestion(manoeuvre, 10.0, 7.0, drive_truth(truth, manoeuvre, seed=0))
    told.to_csv(tmp_path / "next.csv")
    read = np.genfromtxt(tmp_path / "next.csv", delimiter=",", names=True)
    for name, column in told.columns().items():
        np.testing.assert_allclose(read[name], column, rtol=1e-5, atol=1e-12)
    # The path has the length that the speed gives it.
    length = np.hypot(*np.diff(path_m(told.drive), axis=0).T).sum()
    speed = np.hypot(*told.drive.states[:, :2].T)
    assert length == pytest.approx(speed[1:].sum() / told.drive.log.rate_hz, rel=1e-9)
    assert told.plot().get_title() == manoeuvre.name
    assert [ax.get_title() for ax in told.picture().axes[:2]] == [manoeuvre.name, "steering"]


def test_the_next_drive_from_the_command_line(
    truth: Model, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    log = drive(truth, manoeuvres.constant_radius(60.0, 5.0, 30.0), seed=3, rate_hz=50.0)
    log.to_csv(tmp_path / "log.csv")
    truth.vehicle.to_toml(tmp_path / "car.toml")
    base = ["next-drive", str(tmp_path / "log.csv"), "--vehicle", str(tmp_path / "car.toml")]
    out = {n: tmp_path / f"next.{n}" for n in ("csv", "svg", "json")}
    wanted = ["--csv", str(out["csv"]), "--picture", str(out["svg"]), "--json", str(out["json"])]
    limits = ["--top-speed", "15", "--lateral", "6", "--duration", "30"]
    assert main([*base, "--between", "steer_lag,tyre_relaxation", *limits, *wanted]) == 0
    printed = capsys.readouterr().out
    first = json.loads(out["json"].read_text("utf-8"))["suggestions"][0]
    assert first["manoeuvre"] in printed
    assert first["speed_mps"][1] <= 15.3
    assert first["duration_s"] <= 30.0
    assert out["svg"].read_bytes().startswith(b"<?xml")
    assert len(out["csv"].read_text("utf-8").splitlines()) > 100
    assert main([*base, "--between", "steer_lag"]) == 2
    assert "give two effects" in capsys.readouterr().err


def test_what_acts_is_no_disturbance_that_hides_the_difference(
    truth: Model, start: Model, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A drag that the fit lacks, told from rolling resistance by the driving at hand."""
    car = truth.add("aero_drag").with_values({"aero_drag.drag_area_m2": 0.3})
    log = drive(car, manoeuvres.handling_course(30.0, 4.0), seed=4, rate_hz=25.0)
    fit = identify(start, log, starts=1)
    pair = [identify(start.add(e), log, starts=1) for e in ("aero_drag", "rolling_resistance")]
    apart = np.sqrt(2.0 * (pair[0].log_likelihood - pair[1].log_likelihood))
    asked_of_few(monkeypatch, 22)  # what is asked for is what the driving at hand tells
    found = suggest_manoeuvre(fit, "aero_drag", "rolling_resistance", size=[0.3])
    assert apart > 6.0
    assert 0.5 * apart < found.now < 3.0 * apart  # the likelihood is flat far from the better one
    assert separations(fit, ["aero_drag", "rolling_resistance"]) != {}
