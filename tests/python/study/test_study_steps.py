"""One step of the way: what stands in for others is exchanged, what is not needed is dropped."""

from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from sysid_vehicle import Diagnosis, Fit, Model, compare, diagnose, drive, identify, manoeuvres
from sysid_vehicle.diagnose import possible
from sysid_vehicle.effects import effect
from sysid_vehicle.estimate import Driving
from sysid_vehicle.identify import Estimate, refine
from sysid_vehicle.rules import share_explained
from sysid_vehicle.study.search.search import Search
from sysid_vehicle.study.search.steps import (
    _distance,
    _mattering,
    alternatives,
    better,
    exchanged,
    first_that_holds,
    lead,
    likeliest,
    way,
    without_insignificant,
)
from sysid_vehicle.study.search.trail import Trail, step_in_words
from sysid_vehicle.study.validation import (
    error_falls,
    fall_in_error,
    gain_in_log_likelihood,
)

AGAINST = ["aero_drag", "rolling_resistance", "head_wind"]
RATE_HZ = 50.0  # tells as much of these effects as 100 Hz, in half the time
HIDDEN = {"aero_drag.drag_area_m2": 0.6, "rolling_resistance.coefficient": 0.012}


@pytest.fixture(scope="module")
def driving(truth: Model) -> tuple[Driving, Driving]:
    car = truth.add("aero_drag", "rolling_resistance").with_values(HIDDEN)
    train = drive(car, manoeuvres.lap(30.0), seed=61, rate_hz=RATE_HZ)
    test = drive(car, manoeuvres.handling_course(30.0, lateral_mps2=7.5), seed=62, rate_hz=RATE_HZ)
    return Driving.of(train), Driving.of(test)


@pytest.fixture(scope="module")
def baseline(start: Model, driving: tuple[Driving, Driving]) -> Fit:
    return identify(start, driving[0], starts=1)


@pytest.fixture(scope="module")
def dx(baseline: Fit) -> Diagnosis:
    return diagnose(baseline, candidates=AGAINST)


def by_id(dx: Diagnosis, name: str) -> Fit:
    (found,) = (c.fit for c in dx.ranking if c.id == name)
    assert found is not None
    return found


@pytest.mark.manual
def test_a_head_wind_gives_way_to_drag_and_rolling_resistance(
    dx: Diagnosis, driving: tuple[Driving, Driving]
) -> None:
    (wind,) = (c for c in dx.ranking if c.id == "head_wind")
    near = alternatives(dx, wind)
    assert {c.id for c in near} == {"aero_drag", "rolling_resistance"}
    windy = by_id(dx, "head_wind")
    found = exchanged(windy, {"head_wind": near}, driving[1], most_effects=4)
    assert set(found.model.effects) == {"aero_drag", "rolling_resistance"}
    assert found.log_likelihood > windy.log_likelihood
    one = exchanged(windy, {"head_wind": near}, driving[1], most_effects=1)
    assert len(one.model.effects) == 1
    assert exchanged(windy, {}, driving[1], most_effects=4) is windy


def test_what_fits_to_the_last_digit_alike_is_no_alternative(dx: Diagnosis) -> None:
    (wind,) = (c for c in dx.ranking if c.id == "head_wind")
    others = tuple(
        replace(c, statistic=wind.statistic) if c.id == "aero_drag" else c for c in dx.ranking
    )
    assert [c.id for c in alternatives(replace(dx, ranking=others), wind)] == ["rolling_resistance"]


@pytest.mark.parametrize(("below", "asked"), [(2.0, ["aero_drag"]), (10.0, [])])
def test_what_is_as_likely_by_its_price_need_not_be_significant(
    dx: Diagnosis, below: float, asked: list[str]
) -> None:
    """Two parameters of another effect fit by chance what the one of the right effect does not."""
    wind, drag = (next(c for c in dx.ranking if c.id == name) for name in ("head_wind", AGAINST[0]))
    assert wind.fit is not None
    fit = replace(by_id(dx, drag.id), log_likelihood=wind.fit.log_likelihood - below)
    weak = replace(drag, statistic=0.1 * wind.statistic, p_value=1.0, fit=fit)
    assert [c.id for c in alternatives(replace(dx, ranking=(wind, weak)), wind)] == asked


@pytest.mark.manual
def test_a_slope_and_a_bias_give_way_to_rolling_resistance(start: Model, truth: Model) -> None:
    """Beside the slope the bias does to the last digit what rolling resistance does alone."""
    car = truth.add("rolling_resistance").with_values({"rolling_resistance.coefficient": 0.02})
    driving = Driving.of(drive(car, manoeuvres.lap(30.0), seed=163, rate_hz=50.0))
    test = Driving.of(drive(car, manoeuvres.handling_course(30.0), seed=164, rate_hz=50.0))
    sloping = identify(start.add("road_grade"), driving, starts=1)
    dx = diagnose(sloping, candidates=["accelerometer_bias", "rolling_resistance"])
    bias, rolling = (by_id(dx, name) for name in ("accelerometer_bias", "rolling_resistance"))
    assert abs(bias.log_likelihood - rolling.log_likelihood) < 2.0
    (chosen,) = (c for c in dx.ranking if c.id == "accelerometer_bias")
    same = replace(next(c for c in dx.ranking if c is not chosen), statistic=chosen.statistic)
    near = alternatives(replace(dx, ranking=(chosen, same)), chosen)
    assert [c.id for c in near] == ["rolling_resistance"]
    found = exchanged(bias, {chosen.id: near}, test, most_effects=4)
    assert found.model.effects == ("rolling_resistance",)
    # Both have two effects, but one of them hardly has a slope.
    assert (_mattering(bias), _mattering(rolling), _mattering(found)) == (2, 1, 1)
    # The bias has a part along a_y besides, which gains a nat by chance.
    assert better(found, bias, test)
    assert not better(bias, found, test)


def test_validation_data_have_a_say_between_what_the_fit_cannot_tell_apart(
    dx: Diagnosis, baseline: Fit, driving: tuple[Driving, Driving]
) -> None:
    wind, drag = (next(c for c in dx.ranking if c.id == name) for name in AGAINST[::-2])
    assert wind.fit is not None
    assert drag.fit is not None
    ahead = lead(wind.fit, drag.fit, driving[1])
    assert abs(ahead) > 1.0
    preferred, other = (wind, drag) if ahead > 0.0 else (drag, wind)
    for told_apart in (True, False):
        first = replace(other, indistinguishable_from=() if told_apart else (preferred.id,))
        chosen = first_that_holds(replace(dx, ranking=(first, preferred)), baseline, driving[1])
        assert chosen is not None
        assert chosen[0].id == (other.id if told_apart else preferred.id)


def test_an_effect_that_wants_more_than_is_known_of_it_is_not_added(
    baseline: Fit, driving: tuple[Driving, Driving]
) -> None:
    """What told its bounds refuses the size: with the largest one left it stands for another."""
    drag = effect("aero_drag")
    for upper in (drag.parameters[0].upper, 0.2):
        known = replace(drag, parameters=(replace(drag.parameters[0], upper=upper),))
        dx = diagnose(baseline, candidates=[known])
        (found,) = dx.ranking
        assert found.value[0] <= upper
        chosen = first_that_holds(dx, baseline, driving[1])
        assert (chosen is None) is (upper < HIDDEN["aero_drag.drag_area_m2"])


@pytest.mark.manual
def test_what_was_driven_in_part_is_not_refused_for_being_too_sure(
    start: Model, truth: Model
) -> None:
    """Nobody brakes in the fitted driving, and the other half of the effect is right."""
    car = truth.add("force_gain").with_values(
        {"force_gain.drive_error": 0.08, "force_gain.brake_error": 0.08}
    )
    fit = identify(start, drive(car, manoeuvres.ramp_steer(), seed=21, rate_hz=50.0), starts=1)
    test = Driving.of(drive(car, manoeuvres.lap(30.0), seed=22, rate_hz=50.0))
    dx = diagnose(fit, candidates=["force_gain"])
    (gain,) = (c.fit for c in dx.ranking)
    assert gain is not None
    assert not np.isfinite(gain["force_gain.brake_error"].std)
    # At its value in the fit, the null value, the other half spoils what this one explains.
    shares = [
        share_explained(compare(fit, d, noise=gain.noise).error, compare(gain, d).error)
        for d in (fit.driving, test)
    ]
    assert shares[0] == pytest.approx(1.0, abs=0.05)
    assert 0.2 < shares[1] < 0.6
    ahead = gain_in_log_likelihood(fit, gain, test)
    assert ahead.value > 2.0 * ahead.error > 0.0
    chosen = first_that_holds(dx, fit, test)
    assert chosen is not None


def test_of_two_that_are_as_good_the_simpler_is_preferred(
    dx: Diagnosis, driving: tuple[Driving, Driving]
) -> None:
    simple = by_id(dx, "aero_drag")
    more = identify(simple.model.add("steer_offset"), simple.driving, starts=1)
    assert better(simple, more, driving[1])
    assert not better(more, simple, driving[1])
    both = identify(simple.model.add("rolling_resistance"), simple.driving, starts=1)
    assert better(both, simple, driving[1])
    assert not better(simple, both, driving[1])


@pytest.mark.manual
def test_no_more_effects_are_added_than_allowed(
    baseline: Fit,
    searching: Callable[..., Search],
    driving: tuple[Driving, Driving],
) -> None:
    def followed(way: Search) -> Trail:
        trail = Trail([baseline])
        way.follow(trail)
        return trail

    looking = partial(searching, driving[1], candidates=AGAINST)
    none = followed(looking(most_effects=0))
    assert none.fit is baseline
    assert len(none.diagnoses) == 1
    late = followed(looking(most_effects=6, ends=0.0))
    assert late.fit is baseline
    assert len(late.diagnoses) == 1
    assert set(late.stopped) == {c.id for c in late.diagnoses[0].significant}
    assert late.stopped
    assert none.stopped == ()
    one = followed(looking(most_effects=1))
    assert len(one.fit.model.effects) == 1
    assert one.diagnoses[-1].fit is one.fit


def test_what_was_refitted_when_the_time_is_over_is_added(
    dx: Diagnosis,
    baseline: Fit,
    driving: tuple[Driving, Driving],
    searching: Callable[..., Search],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The diagnosis begins in time and ends late: no further refit, and no step is lost."""
    clock = iter([0.0])
    monkeypatch.setattr("time.perf_counter", lambda: next(clock, 2.0))
    monkeypatch.setattr(Search, "_diagnosis", lambda _, fit, *__: replace(dx, fit=fit))
    for refits in ("together._with_subset", "steps._with_others"):
        monkeypatch.setattr(f"sysid_vehicle.study.search.{refits}", pytest.fail)
    trail = Trail([baseline])
    searching(driving[1], candidates=AGAINST, ends=1.0).follow(trail)
    held = first_that_holds(dx, baseline, driving[1])
    assert held is not None
    assert [f.model.effects for f in trail.fits] == [(), held[1].model.effects]
    assert set(trail.stopped) == {c.id for c in dx.significant}


def test_the_story_leads_over_every_effect_of_its_end(
    dx: Diagnosis, baseline: Fit, driving: tuple[Driving, Driving]
) -> None:
    (wind,) = (c for c in dx.ranking if c.id == "head_wind")
    windy = by_id(dx, "head_wind")
    final = exchanged(windy, {"head_wind": alternatives(dx, wind)}, driving[1], most_effects=4)
    story = way([baseline, windy, final])
    assert story[0] is baseline
    assert story[-1] is final
    assert [len(f.model.effects) for f in story] == [0, 1, 2]
    assert "head_wind" not in story[1].model.effects
    assert way([baseline]) == [baseline]
    assert way([baseline, windy, final], 0.0) == [baseline, final]


def test_what_is_not_there_is_dropped_and_what_is_needed_stays(dx: Diagnosis) -> None:
    fit = by_id(dx, "aero_drag")
    assert without_insignificant(fit).model.effects == ("aero_drag",)
    model = fit.model.add("steer_offset")
    insignificant = identify(model, fit.driving, starts=1)
    assert without_insignificant(insignificant).model.effects == ("aero_drag",)


def test_what_is_at_a_bound_stays_only_where_it_is_needed(
    dx: Diagnosis, driving: tuple[Driving, Driving]
) -> None:
    drag, speed = effect("aero_drag").parameters[0], effect("rolling_resistance").parameters[1]
    inf = float("inf")
    for value in (0.0, speed.upper):
        assert _distance(Estimate("a", value, inf, "s/m", "at bound"), speed) == 0.0
    # Steering that is late by less than the filter resolves is felt by nothing, nor is it nothing.
    fit = by_id(dx, "aero_drag")
    late = fit.model.add("steer_delay").with_values({"steer_delay.delay_s": 0.001})
    assert without_insignificant(refine(late, fit.driving, fit.noise)).model.effects == (
        "aero_drag",
    )
    # What is marginalised is no finding: nothing asks whether it is there.
    for model, kept in (
        (fit.model.add("gyro_bias"), ()),
        (fit.model.with_nuisances(["gyro_bias"]), ("gyro_bias",)),
    ):
        left = without_insignificant(refine(model, fit.driving, fit.noise)).model.effects
        assert left == ("aero_drag", *kept)
    # A resistance at the end of its range is significant, though no error of it is known.
    bounded = identify(fit.model.drop("aero_drag").add("rolling_resistance"), fit.driving, starts=1)
    assert not np.isfinite(bounded["rolling_resistance.per_speed_spm"].std)
    assert without_insignificant(bounded).model.effects == ("rolling_resistance",)
    assert _distance(Estimate("a", 0.3, 0.1, "m2", ""), drag) == pytest.approx(3.0)


def test_a_possible_value_comes_before_an_impossible_one(
    dx: Diagnosis, baseline: Fit, driving: tuple[Driving, Driving]
) -> None:
    (drag,) = (c for c in dx.ranking if c.id == "aero_drag")
    assert drag.fit is not None
    (name,), upper, inf = drag.effect.named, drag.effect.parameters[0].upper, float("inf")
    ends = (replace(e, value=upper, std=inf) if e.name == name else e for e in drag.fit.estimates)
    at_its_bound = replace(drag.fit, estimates=tuple(ends))
    far = replace(drag, value=(upper,), std=(inf,), fit=at_its_bound)
    assert not possible(far.effect, far.value, far.std)
    others = tuple(c for c in dx.ranking if c.id != "aero_drag" and c.fit is not None)
    chosen = first_that_holds(replace(dx, ranking=(far, *others)), baseline, driving[1])
    assert chosen is not None
    assert chosen[0].id != "aero_drag"
    alone = first_that_holds(replace(dx, ranking=(far,)), baseline, driving[1])
    assert alone is not None
    assert alone[0] is far


def test_a_search_that_ends_at_its_bound_wanted_more_than_any_car_has() -> None:
    rolling = effect("rolling_resistance")
    most = [p.upper for p in rolling.parameters]
    inf = float("inf")
    assert possible(rolling, (0.012, 0.0), (0.001, inf))  # nothing is a bound, and possible
    assert not possible(rolling, (0.012, most[1]), (0.001, inf))
    assert possible(rolling, (0.012, 0.5 * most[1]), (0.001, inf))  # not told, but not at a bound
    assert not possible(rolling, (-0.02, 0.0), (0.001, 0.001))


@pytest.mark.manual
@pytest.mark.parametrize("downforce", [1.3, 0.0])
def test_two_that_may_hold_only_together_are_sought_together(
    truth: Model,
    start: Model,
    searching: Callable[..., Search],
    downforce: float,
) -> None:
    both = ["steer_lag", "aero_downforce"]
    values = {
        "steer_lag.time_constant_s": 0.06,
        "aero_downforce.cl_a_front_m2": 0.7 * downforce,
        "aero_downforce.cl_a_rear_m2": downforce,
    }
    car = truth.add(*both).with_values(values)
    train = drive(car, manoeuvres.step_steer((17.0, 27.0), (3.0, 6.0)), seed=71, rate_hz=50.0)
    test = Driving.of(
        drive(car, manoeuvres.handling_course(30.0, lateral_mps2=5.5), seed=72, rate_hz=50.0)
    )
    baseline = identify(start, train, starts=1)
    alone = diagnose(baseline, candidates=both)
    first = likeliest(alone)
    assert first is not None
    assert first.id == "steer_lag"
    trail = Trail([baseline])
    looking = searching(test, candidates=both, most_effects=2)
    found = looking._beside_others(alone, trail)
    if downforce == 0.0:
        assert found is None
        return
    assert found is not None
    assert found[0] == tuple(both)
    assert found[1].model.effects == tuple(both)
    assert error_falls(baseline, found[1], test)
    assert "aero_downforce" in trail.p_values
    assert replace(looking, most_effects=1)._beside_others(alone, trail) is None
    told: list[str] = []
    silent = replace(alone, ranking=tuple(replace(c, p_value=1.0) for c in alone.ranking))
    assert likeliest(silent) is None
    assert replace(looking, say=told.append)._beside_others(silent, trail) is None


def test_what_came_with_a_step_is_told(dx: Diagnosis) -> None:
    fit = by_id(dx, "aero_drag")
    assert step_in_words(fit, ()).startswith("Added aero_drag: drag_area_m2 ")
    assert step_in_words(fit, ()).endswith(" m2.")
    exchanged = step_in_words(fit, ("head_wind", "mass"))
    assert exchanged.startswith("Added aero_drag: drag_area_m2 ")
    assert exchanged.endswith(" m2. Removed head_wind and mass.")
    assert step_in_words(fit, ("head_wind", "aero_drag")) == "Removed head_wind."


def test_the_fall_in_error_is_by_the_richer_models_floor(
    dx: Diagnosis, baseline: Fit, driving: tuple[Driving, Driving]
) -> None:
    drag = by_id(dx, "aero_drag")
    late = drag.model.add("steer_lag").with_values({"steer_lag.time_constant_s": 0.02})
    richer = replace(drag, model=late)
    before, after = (compare(f, driving[1], noise=richer.noise).error for f in (baseline, richer))
    measured = int(np.isfinite(driving[1].measured).sum())
    whole = fall_in_error(baseline, richer, driving[1])
    assert whole.value == pytest.approx(measured * (before**2 - after**2), rel=1e-6)
    # Of a drag alone, those of the motion along the car.
    fall = fall_in_error(baseline, drag, driving[1])
    assert fall.value > 2.0 * fall.error > 0.0
    broken = replace(baseline, model=baseline.model.with_values({"B_front": float("nan")}))
    assert fall_in_error(baseline, broken, driving[1]).value == -np.inf
