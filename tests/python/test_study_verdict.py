"""What is said of added effects beside what is left."""

from dataclasses import replace

import pytest

from sysid_vehicle import Fit, Log, Model, compare, drive, improve, manoeuvres
from sysid_vehicle.diagnose import Omnibus
from sysid_vehicle.diagnose.verdicts import EffectVerdict, Finding, Verdicts
from sysid_vehicle.effects import effect
from sysid_vehicle.study.verdict import Left, _alone, _small, _taken_up


def test_an_effect_named_alone_should_have_explained_what_is_left() -> None:
    def alone(*left: Omnibus, **findings: Finding) -> set[str]:
        each = (EffectVerdict(effect(name), found) for name, found in findings.items())
        return _alone(Verdicts(tuple(each)), set(findings), left)

    forward, turning = (Omnibus(99.0, 9, 1e-9, target) for target in ("F_x", "M_z"))
    assert alone(turning, mass="missing", yaw_inertia="negligible") == {"mass"}
    assert alone(forward, mass="one of a group") == {"mass"}
    assert alone(mass="missing") == set()
    assert alone(turning, mass="missing", aero_drag="missing") == set()
    # Beside a proxy something else may be missing, which may be all that is left.
    assert alone(turning, mass="missing", yaw_inertia="proxy") == set()
    assert alone(turning, forward, mass="missing", yaw_inertia="proxy") == {"mass"}


def test_what_is_left_on_held_out_driving_takes_more_evidence() -> None:
    def of(p_value: float, statistic: float = 99.0) -> Omnibus:
        return Omnibus(statistic, 9, p_value, "M_z")

    none = of(0.5)
    assert Left(none, none).nothing
    assert Left(none, none, of(0.001)).nothing
    assert not Left(none, none, of(1e-5)).nothing
    assert not Left(none, of(0.005), none).nothing
    assert not Left(none, none, none, candidates=True).nothing
    assert Left(none, of(0.005), of(1e-3)).evidence == ()
    assert [o.p_value for o in Left(none, of(1e-4), of(1e-5)).evidence] == [1e-4, 1e-5]
    assert Left(of(1e-9, 109.0), of(1e-5, 59.0)).share == pytest.approx(0.5)
    assert Left(of(1e-9, 109.0), of(0.5, 5.0)).share == 0.0


def test_what_took_up_less_than_is_left_is_doubted() -> None:
    taken = {"large": 10.0, "middle": 2.0, "tiny": 0.1}
    assert _small(taken, 0.01, set()) == set()
    assert _small(taken, 0.5, set()) == {"tiny"}
    # What proxies took up is unexplained too, and so is what was doubted for it.
    assert _small(taken, 1.95, set()) == {"tiny", "middle"}
    assert _small(taken, 0.5, {"large"}) == {"tiny", "middle"}
    assert _small({}, 1.0, set()) == set()


def test_of_effects_that_act_alike_the_later_counts_for_what_it_adds(fit: Fit, lap: Log) -> None:
    baseline, before = fit, compare(fit, lap)
    drag = replace(baseline, model=baseline.model.add("aero_drag"))
    wind = replace(drag, model=drag.model.add("head_wind"))
    errors = [replace(before, error=e) for e in (3.0, 2.0, 1.9)]
    taken = _taken_up([baseline, drag, wind], errors)
    assert taken == pytest.approx({"aero_drag": 5.0, "head_wind": 0.39})


def test_tyres_that_the_fit_never_saw_do_not_speak_against_the_right_effect(
    start: Model, truth: Model
) -> None:
    """A sine in the linear range is fitted, a lap held out."""
    car = truth.add("accelerometer_scale").with_values(
        {"accelerometer_scale.ax_error": 0.05, "accelerometer_scale.ay_error": 0.05}
    )
    study = improve(
        start,
        drive(car, manoeuvres.sine_sweep(), seed=3),
        drive(car, manoeuvres.lap(30.0), seed=13),
        candidates=["accelerometer_scale", "gyro_scale", "steer_ratio"],
        starts=2,
    )
    assert [a.id for a in study.added] == ["accelerometer_scale"]
    assert study.test[-1].error > 2.0  # the lap is beyond what the fit knows of the tyres
    assert study.verdict == "explained"
    assert study.omnibus_held_out is not None
    assert not study.omnibus_held_out.rejects
