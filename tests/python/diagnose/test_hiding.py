"""What hidden effects do to identified parameters: the report against refits of other drives."""

import warnings
from dataclasses import replace

import numpy as np
import pytest

import sysid_vehicle as sv
from sysid_vehicle.diagnose import BiasReport
from sysid_vehicle.diagnose.experiment.replay import Replay

pytestmark = pytest.mark.manual  # refits of many simulated drives

# What disturbances take up, and what moves the tyres much.
HARMLESS = ("aero_drag", "rolling_resistance", "road_grade", "head_wind")
HARMFUL = ("speed_sensor_lever_arm", "steer_ratio", "locked_differential", "steer_compliance")
STIFFNESS = ("stiffness_front", "stiffness_rear")
RATE_HZ = 50.0


def lap(car: sv.Model, seed: int, without: tuple[str, ...] = ()) -> sv.Log:
    log = sv.drive(car, sv.manoeuvres.lap(30.0), seed=seed, rate_hz=RATE_HZ)
    return sv.Log.from_arrays({c: log[c] for c in log.channels if c not in without}, check=False)


@pytest.fixture(scope="module")
def blind(truth: sv.Model, start: sv.Model) -> sv.Fit:
    """The baseline fitted to a lap of the complete car."""
    return sv.identify(start, lap(truth, 1), starts=3)


@pytest.fixture(scope="module")
def report(blind: sv.Fit) -> BiasReport:
    return sv.bias_report(blind, [*HARMLESS, *HARMFUL])


def actual(
    truth: sv.Model,
    start: sv.Model,
    report: BiasReport,
    name: str,
    without: tuple[str, ...] = (),
) -> list[float]:
    """What a refit from other tyres is off by on a drive with the effect, and with other noise."""
    bias = report[name]
    values = {
        f"{name}.{p.name}": p.null_value + v
        for p, v in zip(bias.effect.parameters, bias.size, strict=True)
    }
    fit = sv.identify(start, lap(truth.add(name).with_values(values), 5, without), starts=3)

    def stiffness(m: sv.Model) -> np.ndarray:
        return np.array([np.prod([m.value(f"{x}_{a}") for x in "BCD"]) for a in ("front", "rear")])

    return list(stiffness(fit.model) / stiffness(truth) - 1.0)


@pytest.mark.parametrize("name", [*HARMLESS, *HARMFUL])
def test_bias_is_what_a_refit_finds(
    truth: sv.Model, start: sv.Model, report: BiasReport, name: str
) -> None:
    found = actual(truth, start, report, name)
    told = [report[name].relative[s] for s in STIFFNESS]
    assert (max(map(abs, found)) < 0.01) == (name in HARMLESS)
    for one, other in zip(told, found, strict=True):
        assert one == pytest.approx(other, rel=0.2, abs=0.01)


def test_the_report_reads_the_most_harmful_first(report: BiasReport) -> None:
    harm = [max(abs(b.relative[s]) for s in STIFFNESS) for b in report.biases]
    assert harm == sorted(harm, reverse=True)
    assert report.biases[0].effect.id == "speed_sensor_lever_arm"
    assert "that is not modelled adds +" in str(report.biases[0])
    assert report["aero_drag"].worst == ()
    assert "adds less than one percent to any parameter" in str(report["aero_drag"])
    assert "steer_ratio" in str(report)
    assert "<table" in report._repr_html_()
    with pytest.raises(KeyError, match="there are"):
        report["magic"]


def test_the_same_report_twice(blind: sv.Fit, report: BiasReport) -> None:
    again = sv.bias_report(blind, [sv.effect("steer_ratio")], workers=1)
    assert again["steer_ratio"].relative == report["steer_ratio"].relative


def test_effects_that_cannot_be_named(blind: sv.Fit) -> None:
    with pytest.raises(sv.InvalidInput, match="no effect is called 'magic'"):
        sv.bias_report(blind, ["magic"])
    has = replace(blind, model=blind.model.add("steer_offset"))
    with pytest.raises(sv.InvalidInput, match="identifies 'steer_offset' already"):
        sv.bias_report(has, ["steer_offset"])


def test_what_depends_on_the_driver_is_not_stated(truth: sv.Model, start: sv.Model) -> None:
    log = sv.drive(truth, sv.manoeuvres.step_steer((17.0, 27.0)), seed=2, rate_hz=RATE_HZ)
    told = sv.bias_report(sv.identify(start, log, starts=2), ["steer_offset"])["steer_offset"]
    assert told.relative == {}
    assert "by the driver" in told.because
    assert told.worst == ()
    assert "not stated, " in str(told)


def test_a_car_that_cannot_follow_says_so(blind: sv.Fit) -> None:
    ice = {f"D_{axle}": 0.3 for axle in ("front", "rear")}
    report = sv.bias_report(replace(blind, model=blind.model.with_values(ice)), ["aero_drag"])
    assert "cannot follow this driving: it is lost at t = " in report["aero_drag"].because
    assert "not stated: " in str(report)


@pytest.mark.parametrize("seed", [3, 5, 6])
def test_without_force_and_lateral_speed(truth: sv.Model, start: sv.Model, seed: int) -> None:
    """What is stated is right; where tyres that fit as well would give other figures, it is not."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", sv.SysidWarning)
        fit = sv.identify(start, lap(truth, seed, without=("fx_n", "vy_mps")), starts=2)
        report = sv.bias_report(fit, ["aero_drag", "steer_ratio"])
        found = actual(truth, start, report, "steer_ratio", without=("fx_n", "vy_mps"))
    assert max(abs(report["aero_drag"].relative[s]) for s in STIFFNESS) < 0.01
    told = report["steer_ratio"]
    assert max(map(abs, found)) > 0.02
    if seed == 3:
        assert told.relative == {}
        assert "tyres that fit as well" in told.because
    else:
        assert [told.relative[s] for s in STIFFNESS] == pytest.approx(found, rel=0.2, abs=0.01)


def test_a_long_drive_is_done_again_in_windows(blind: sv.Fit) -> None:
    replay = Replay(blind, 300, 0)
    parts = replay._stretches
    assert [s.start_s for s in parts] == pytest.approx([0.0, 25.0], abs=0.1)
    assert sum(len(s.steer) for s in parts) <= 400
    # Grip lost before the second window is felt there from its beginning.
    lost = blind.model.add("friction_change").with_values(
        {"friction_change.drop": 0.5, "friction_change.at_s": 20.0}
    )
    p = blind.model.vector()
    ends = [
        replay._driven(car, 1.0, True).half_sum_of_squares(
            p, replay._driven(blind.model, 1.0, True).freeze(p, blind.noise.vector())
        )
        for car in (blind.model, lost)
    ]
    assert ends[1] > 2.0 * ends[0]
