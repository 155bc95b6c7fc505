"""Every effect gets a verdict, and the verdict of what is absent holds its bound."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from sysid_vehicle import (
    Diagnosis,
    Fit,
    Model,
    diagnose,
    drive,
    effect,
    identify,
    manoeuvres,
    verdicts,
)
from sysid_vehicle.diagnose import EffectVerdict, Verdicts, possible
from sysid_vehicle.diagnose.candidates.judge import _of_present, judge
from sysid_vehicle.diagnose.candidates.possible import possible_in
from sysid_vehicle.effects import Effect
from sysid_vehicle.identify import Estimate, refit
from sysid_vehicle.rules import USUAL

Hidden = Callable[[str, float], Fit]
OFFSET = "steer_offset.offset_rad", 0.002


@pytest.fixture(scope="module")
def found(hidden_fit: Hidden) -> Diagnosis:
    return diagnose(hidden_fit(*OFFSET))


@pytest.fixture(scope="module")
def judged(found: Diagnosis) -> Verdicts:
    return verdicts(found)


def test_the_hidden_effect_is_missing_with_its_size(judged: Verdicts) -> None:
    first = judged.all[0]
    assert first.effect.id == "steer_offset"
    assert first.finding == "missing"
    assert abs(first.value[0] - OFFSET[1]) < 4.0 * first.std[0]
    assert first.sentence.startswith(f"missing; offset_rad {first.value[0]:.3g} +- ")


def test_every_effect_is_judged_once(judged: Verdicts, found: Diagnosis) -> None:
    ids = [v.effect.id for v in judged.all]
    assert sorted(ids) == sorted(e.id for e in found.fit.model.candidates)
    assert sum(len(judged.of(f)) for f in ("missing", "one of a group", "proxy")) < len(ids) / 2


def test_what_refines_another_is_judged_where_it_was_asked_for(found: Diagnosis) -> None:
    assert effect("body_roll").refines
    asked = diagnose(found.fit, candidates=["steer_offset", "body_roll"])
    assert {"steer_offset", "body_roll"} == {c.id for c in asked.ranking}
    assert verdicts(asked)["body_roll"].finding != "missing"


def test_what_only_acted_like_it_is_a_proxy_of_it(judged: Verdicts, found: Diagnosis) -> None:
    others = [c.id for c in found.significant if c.id != "steer_offset"]
    assert others  # many effects push a car to one side
    for name in others:
        assert judged[name].finding in ("proxy", "one of a group")
        assert judged[name].group == ("steer_offset",)
    assert "steer_offset" in judged[others[0]].sentence


def test_a_rival_of_what_is_not_missing_itself_is_not_missing_either(
    found: Diagnosis, judged: Verdicts
) -> None:
    (fit,) = (c.fit for c in found.ranking if c.id == "steer_offset")
    assert fit is not None
    both = identify(fit.model.add("aero_drag"), fit.driving, starts=1)
    others = [c.id for c in found.significant if c.id != "steer_offset"]
    rival = next(e for e in others if judged[e].finding == "proxy")

    def of(groups: dict[str, tuple[str, ...]]) -> EffectVerdict:
        lacked = {e.id for e in found.fit.model.candidates}
        acted = {c.id for c in found.significant}
        told = judge(both, lacked=lacked, groups=groups, acted=acted)
        assert told["aero_drag"].finding not in ("missing", "one of a group")
        return told[rival]

    assert of({"steer_offset": (rival,)}).finding == "one of a group"
    assert of({"steer_offset": (rival,)}).group == ("steer_offset",)
    assert of({"aero_drag": (rival,)}).finding == "proxy"
    assert of({}).finding == "proxy"


def test_what_time_did_not_suffice_for_is_open(found: Diagnosis) -> None:
    def of(untried: tuple[str, ...]) -> EffectVerdict:
        known = found.scores, found.family, found.sizes
        lacked = {e.id for e in found.fit.model.candidates}
        told = judge(
            found.fit, lacked=lacked, groups={}, acted=set(), scored=known, settled=True,
            untried=untried,
        )  # fmt: skip
        return told["steer_offset"]

    assert "does not improve the prediction" in of(()).because
    assert of(("steer_offset",)).finding == "open"
    assert of(("steer_offset",)).sentence.startswith("significant, not tried yet; offset")


def test_what_is_absent_is_bounded_below_what_matters(judged: Verdicts) -> None:
    absent = judged.of("absent")
    assert len(absent) >= 5
    for v in absent:
        for p, bound in zip(v.effect.parameters, v.bound, strict=True):
            assert bound < p.matters or p.scan
    # The bound is the truth's: none of these acts.
    assert judged["gyro_bias"].finding == "absent"
    assert "at 95 %" in judged["gyro_bias"].sentence


def test_bounds_hold_the_truth_as_often_as_they_say(complete_fits: tuple[Fit, ...]) -> None:
    told = [v for fit in complete_fits for v in verdicts(diagnose(fit)).all if v.bound]
    exceeded = [
        abs(v.value[0] - v.effect.parameters[0].null_value) > 1.645 * v.std[0]
        for v in told
        if not v.effect.parameters[0].one_sided
    ]
    # 10 % on two sides; effects share their noise, so that few fits scatter widely.
    assert sum(exceeded) / len(exceeded) < 0.25
    assert not [v for v in told if v.finding in ("missing", "one of a group")]


def test_what_this_driving_cannot_show_is_not_testable(truth: Model, start: Model) -> None:
    straight = drive(truth, manoeuvres.sine_sweep(15.0, lateral_mps2=1.0), seed=4, rate_hz=50.0)
    judged = verdicts(diagnose(identify(start, straight, starts=1), refits=0))
    # A weave at one speed, far from the limit, tells nothing of grip.
    for name in ("lateral_load_transfer", "aero_downforce", "tyre_load_sensitivity"):
        assert judged[name].finding == "not testable"
        assert judged[name].effect.excited_by in judged[name].sentence


def present(of: Effect, value: tuple[float, ...], std: tuple[float, ...]) -> EffectVerdict:
    return _of_present(of, value, std, (), USUAL, possible(of, value, std))


def kind(name: str, value: float, std: float) -> EffectVerdict:
    return present(effect(name), (value,), (std,))


def test_impossible_and_negligible_values() -> None:
    drag = effect("aero_drag").parameters[0]
    assert kind("aero_drag", drag.typical, 0.01).finding == "missing"
    assert kind("aero_drag", 0.3 * drag.matters, 0.1 * drag.matters).finding == "negligible"
    assert kind("aero_drag", 8.0 * drag.typical, 0.01).finding == "proxy"
    assert kind("tyre_relaxation", -0.5, 0.1).finding == "proxy"  # below its bound
    assert "physically implausible" in kind("aero_drag", 8.0 * drag.typical, 0.01).sentence


def test_a_value_at_its_bound_has_no_error() -> None:
    rolling = effect("rolling_resistance")
    found = present(rolling, (0.012, 0.0), (0.001, float("inf")))
    assert found.sentence.startswith("missing; coefficient 0.012 +- 0.001, per_speed_spm 0 (at a")
    most = rolling.parameters[1].upper
    beyond = present(rolling, (0.012, most), (0.001, float("inf")))
    assert beyond.finding == "proxy"
    assert "physically implausible" in beyond.sentence


def test_a_bound_that_the_data_do_not_press_against_is_a_value_that_a_car_can_have() -> None:
    slip = effect("combined_slip")
    (name,) = slip.named
    most = slip.parameters[0].upper
    held = Estimate(name, most, float("inf"), "1", "at bound", bounds=(0.0, most))

    def can_be(unbounded: tuple[float, float] | None) -> bool:
        return possible_in({name: replace(held, unbounded=unbounded)}, slip)  # type: ignore[arg-type]

    assert can_be((most + 0.1, 0.1))  # the bound lies in its 95 % interval, as half of cars there
    assert not can_be((most + 0.3, 0.1))
    assert not can_be(None)
    # A bound that lies beyond what any car has is no value of a car, however unsure.
    trail = effect("aligning_moment")
    far = trail.parameters[0].upper
    assert far > 5.0 * trail.parameters[0].typical
    (long,) = trail.named
    wide = replace(held, name=long, value=far, unbounded=(1.1 * far, far))
    assert not possible_in({long: wide}, trail)  # type: ignore[arg-type]
    # Of what is held at nothing no size was wanted.
    free = replace(held, value=0.0, unbounded=(-5.0, 0.1))
    assert possible_in({name: free}, slip)  # type: ignore[arg-type]


@pytest.fixture(scope="module")
def much_slip(truth: Model) -> Fit:
    car = truth.add("combined_slip").with_values({"combined_slip.ellipse": 1.5})
    log = drive(car, manoeuvres.lap(20.0), seed=12, rate_hz=50.0)
    return identify(car, log, starts=1)


def test_a_true_value_at_its_bound_is_no_stand_in(much_slip: Fit) -> None:
    name, slip = "combined_slip.ellipse", much_slip.model.parts[0]
    assert much_slip[name].note == "at bound"
    assert possible_in(much_slip, slip)
    # The same data ask for more than a car with a lower bound could have.
    least = much_slip.model.with_values({name: 0.7}).with_bounds({name: (0.0, 0.8)})
    pressed = refit(least, much_slip.driving, much_slip.noise)
    assert pressed[name].value == pytest.approx(0.8, abs=1e-4)
    assert pressed[name].std == np.inf
    value, std = pressed[name].unbounded or (0.0, 0.0)
    assert 0.8 + 50.0 * std < value < 2.0
    narrow = replace(slip, parameters=(replace(slip.parameters[0], upper=0.8),))
    assert not possible_in(pressed, narrow)


def test_what_is_told_of_a_value_keeps_to_its_bounds() -> None:
    loose = kind("tyre_relaxation", 0.05, 0.27)
    assert loose.sentence.startswith(
        "missing; relaxation_length_m 0.05 (95 %: 0 (bound) .. 0.579) m"
    )
    upper = effect("tyre_relaxation").parameters[0].upper
    unknown = EffectVerdict(effect("tyre_relaxation"), "not testable", bound=(upper,))
    assert f"below {upper:.2g} (bound) m at 95 %" in unknown.sentence
    assert kind("tyre_relaxation", 0.5, 10.0 * upper).bound == (upper,)
    # A negative prediction stays what it is.
    assert "-0.5 +- 0.1" in kind("tyre_relaxation", -0.5, 0.1).sentence


def test_verdicts_show_themselves(judged: Verdicts) -> None:
    assert "steer_offset" in str(judged).splitlines()[0]
    assert "<table" in judged._repr_html_()
    assert judged.to_dict()["steer_offset"]["finding"] == "missing"
    with pytest.raises(KeyError, match="there are"):
        judged["magic"]


def test_one_that_only_acted_like_others_names_them() -> None:
    of = EffectVerdict(effect("mass"), "proxy", group=("steer_lag",))
    assert of.sentence == "its evidence is explained by steer_lag"
    both = EffectVerdict(effect("mass"), "proxy", group=("steer_lag", "aero_drag"))
    assert both.sentence == "its evidence is explained by steer_lag, aero_drag"


def test_a_factor_is_as_many_times_smaller_as_it_may_be_larger() -> None:
    inertia = effect("yaw_inertia")
    assert possible(inertia, (1.2,), (0.01,))
    assert possible(inertia, (-0.5,), (0.01,))
    assert not possible(inertia, (-0.76,), (0.08,))
    assert not possible(inertia, (1.3,), (0.01,))
