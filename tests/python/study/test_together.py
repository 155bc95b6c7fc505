"""Several effects that are added in one step."""

import math
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import pytest

from sysid_vehicle import Model, diagnose, drive, identify, manoeuvres
from sysid_vehicle.diagnose import Candidate
from sysid_vehicle.diagnose.candidates.reservation import beside
from sysid_vehicle.effects import effect
from sysid_vehicle.estimate import Driving
from sysid_vehicle.identify import refine
from sysid_vehicle.rules import USUAL
from sysid_vehicle.study.search import together
from sysid_vehicle.study.search.together import (
    _from_within,
    _leading_subsets,
    _likeliest_within,
    _with_subset,
    first_together,
    in_place_of,
)
from sysid_vehicle.study.search.trail import Trail

RATE_HZ = 25.0  # tells as much of these effects as 100 Hz, in less than half the time


class Known(SimpleNamespace):
    """A fit of which little is known; as fits are, it is itself alone."""

    __hash__ = object.__hash__  # type: ignore[assignment]


def test_two_are_added_together_where_the_posterior_names_both(truth: Model, start: Model) -> None:
    sizes = {"gyro_bias.bias_radps": 0.006, "steer_ratio.ratio_error": 0.1}
    both = ("gyro_bias", "steer_ratio")
    car = truth.add(*both).with_values(sizes)
    train, test = (
        drive(car, manoeuvre, seed=seed, rate_hz=RATE_HZ)
        for manoeuvre, seed in ((manoeuvres.ramp_steer(), 81), (manoeuvres.lap(25.0), 82))
    )
    fit, test = identify(start, train, starts=1), Driving.of(test)
    dx = diagnose(fit, candidates=[*both, "mass"], refits=0)
    found = first_together(dx, test, None, 2)
    assert found is not None
    assert found[0] == both
    for name, size in sizes.items():
        assert abs(found[1][name].value - size) < 4.0 * found[1][name].std
    in_place = in_place_of(found[1], both, dx)
    assert {e: r.names for e, r in in_place.items()} == {"gyro_bias": (), "steer_ratio": ()}
    trail = Trail([fit])
    trail.note_several(dx, found[0], in_place)
    assert set(trail.p_values) == set(both)
    assert max(trail.p_values.values()) < 1e-6
    assert first_together(dx, test, None, 1) is None  # there has to be room for two


@pytest.mark.manual
def test_a_group_with_a_value_that_no_car_has_is_not_added(truth: Model, start: Model) -> None:
    both = ("gyro_bias", "steer_ratio")
    sizes = {"gyro_bias.bias_radps": 0.006, "steer_ratio.ratio_error": -0.36}
    car = truth.add(*both).with_values(sizes)
    fit = identify(start, drive(car, manoeuvres.ramp_steer(), seed=81, rate_hz=50.0), starts=1)
    test = Driving.of(drive(car, manoeuvres.lap(25.0), seed=82, rate_hz=50.0))
    dx = diagnose(fit, candidates=[*both, "mass"], refits=0)
    assert both in _leading_subsets(dx, 2)
    assert _with_subset(dx, both) is None
    tolerant = replace(dx, rules=replace(USUAL, implausible=9.0))
    found = _with_subset(tolerant, both)
    assert found is not None
    assert found.model.effects == both
    assert first_together(dx, test, None, 2) is None


def test_several_effects_never_end_below_a_model_that_they_contain(
    truth: Model, start: Model, monkeypatch: pytest.MonkeyPatch
) -> None:
    sizes = {"steer_lag.time_constant_s": 0.08, "gyro_bias.bias_radps": 0.004}
    both = ("steer_lag", "gyro_bias")
    car = truth.add(*both).with_values(sizes)
    fit = identify(start, drive(car, manoeuvres.lap(20.0), seed=5, rate_hz=50.0), starts=1)
    lag = fit.model.add("steer_lag").with_values({"steer_lag.time_constant_s": 0.05})
    single = refine(lag, fit.driving, fit.noise)
    bare, none = fit.model.add(*both), {"steer_lag.time_constant_s": 0.0005}
    # Under the noise that was learned without the lag the search does not find it.
    hidden = _from_within(bare, none, fit)
    assert hidden is not None
    assert hidden.log_likelihood < single.log_likelihood - 20.0
    end = _from_within(bare, none, single)
    assert end is not None
    assert end.model.effects == both
    assert end.log_likelihood >= single.log_likelihood
    # Sizes that lead below the contained model are left for none.
    far = _from_within(bare, {"gyro_bias.bias_radps": 5.0}, single)
    assert far is not None
    assert far.log_likelihood >= single.log_likelihood

    dx = diagnose(fit, candidates=both, refits=0)
    foretold = {"steer_lag": ((0.0005,), (0.1,)), "gyro_bias": ((0.0,), (0.1,))}
    dx = replace(dx, proposed=replace(dx.proposed, sizes=foretold))
    monkeypatch.setattr(together, "_none_at_nothing", lambda *_: True)
    assert _likeliest_within(fit, both, [single]) is single
    assert _likeliest_within(fit, both[1:], [single]) is fit
    found = _with_subset(dx, both, [single])
    assert found is not None
    assert found.model.effects == both
    assert found.log_likelihood >= single.log_likelihood


@pytest.mark.parametrize(("lag", "begins"), [("steer_lag", 2), ("sensor_delay", 1)])
def test_of_several_lags_none_is_no_begin(
    start: Model, monkeypatch: pytest.MonkeyPatch, lag: str, begins: int
) -> None:
    """The model without them is not the one with each at its smallest."""
    contained: Any = SimpleNamespace(
        model=start, estimates=(), driving=None, noise=None, log_likelihood=0.0
    )
    below, asked = SimpleNamespace(log_likelihood=-9.0), []

    def refitting(model: Model, *_: object, **__: object) -> Any:
        asked.append(model.value("gyro_bias.bias_radps"))
        return below

    monkeypatch.setattr(together, "refit", refitting)
    bare = start.add(lag, "gyro_bias")
    assert _from_within(bare, {"gyro_bias.bias_radps": 0.01}, contained) is below
    assert asked == [0.01, 0.0][:begins]


@pytest.mark.parametrize(
    ("lag", "gained", "tried"),
    [("sensor_delay", 0.0, False), ("sensor_delay", 1.0, True), ("steer_lag", 0.0, True)],
)
def test_lags_that_were_lost_alone_are_not_tried_beside_others(
    start: Model, monkeypatch: pytest.MonkeyPatch, lag: str, gained: float, tried: bool
) -> None:
    fit: Any = Known(model=start, log_likelihood=0.0, driving=None)
    alike = {"retained": 1.0, "variance_ratio": 1.0, "fit": fit}
    ranking = tuple(
        Candidate(effect(name), size, 0.0, (), (), **alike)
        for name, size in ((lag, gained), ("gyro_bias", 9.0))
    )
    proposed = SimpleNamespace(sizes={})
    dx: Any = SimpleNamespace(fit=fit, ranking=ranking, proposed=proposed, rules=USUAL)
    asked = []
    monkeypatch.setattr(together, "_from_within", lambda *_: asked.append(1))
    assert _with_subset(dx, (lag, "gyro_bias")) is None
    assert bool(asked) == tried


def test_what_fits_as_well_in_the_place_of_one_of_several_is_told(
    truth: Model, start: Model, monkeypatch: pytest.MonkeyPatch
) -> None:
    hidden = {"rolling_resistance.coefficient": 0.02, "gyro_bias.bias_radps": 0.006}
    car = truth.add("rolling_resistance", "gyro_bias").with_values(hidden)
    train = drive(car, manoeuvres.lap(25.0), seed=5, rate_hz=RATE_HZ)
    bare = start.add("accelerometer_bias")
    fit = identify(bare, train, starts=1)
    both = ("road_grade", "gyro_bias")
    dx = diagnose(fit, candidates=[*both, "rolling_resistance", "mass"], refits=0)
    # A slope whose gravity the accelerometer does not feel is a rolling resistance.
    found = identify(bare.add(*both), train, starts=1)
    in_place = in_place_of(found, both, dx)
    alike = {e: r.names for e, r in in_place.items()}
    assert alike == {"road_grade": ("rolling_resistance",), "gyro_bias": ()}
    # It is the same by another name, of a parameter more.
    (lead,) = in_place["road_grade"].leads
    assert -USUAL.apart < lead + 0.5 * math.log(found.driving.samples) < USUAL.apart
    assert in_place["road_grade"].better() == ()
    trail = Trail([fit])
    trail.note_several(dx, both, in_place)
    assert trail.rivals["road_grade"] == ("rolling_resistance",)
    value, std = trail.sizes["rolling_resistance"]  # in its place, not beside it
    assert abs(value[0] - 0.02) < 4.0 * std[0] < 0.01
    assert in_place_of(found, both, dx, ends=0.0) == {}  # no time

    def unscored(*args: Any) -> SimpleNamespace:
        scores = [s for s in beside(*args).board.scores if s.effect.id != "road_grade"]
        return SimpleNamespace(board=SimpleNamespace(scores=scores))

    # What parameters of the poorer model can copy has no score: the refits alone tell.
    monkeypatch.setattr(together, "beside", unscored)
    alone = in_place_of(found, ("road_grade",), dx)
    assert alone["road_grade"].names == ("rolling_resistance",)


def test_a_mass_with_a_yaw_inertia_may_be_a_gain_of_the_force(truth: Model, start: Model) -> None:
    heavy = {"mass.relative_error": 0.16, "yaw_inertia.relative_error": 0.16}
    car = truth.add("mass", "yaw_inertia").with_values(heavy)
    train = drive(car, manoeuvres.lap(20.0), seed=5, rate_hz=RATE_HZ)
    some = ("force_gain", "mass", "yaw_inertia", "aero_drag")
    dx = diagnose(identify(start, train, starts=1), candidates=some, refits=0)
    found = identify(start.add("force_gain"), train, starts=1)
    in_place = in_place_of(found, ("force_gain",), dx)["force_gain"]
    mass = next(c for c in in_place.rivals if c.id == "mass")
    assert mass.fit is not None
    assert {*mass.fit.model.effects} == {"mass", "yaw_inertia"}
    assert abs(mass.value[0] - 0.16) < 3.0 * mass.std[0]
    # Where no yaw inertia is sought the mass alone is none.
    few = diagnose(found, candidates=("mass", "aero_drag"), refits=0)
    alone = in_place_of(found, ("force_gain",), few)["force_gain"]
    assert "mass" not in alone.names


def test_the_likeliest_rivals_are_tried_in_an_effects_place() -> None:
    wind, toe, bank = (
        Candidate(effect(e), 9.0, 1e-9, (0.1,), (0.01,), 1.0, 1.0)
        for e in ("side_wind", "rear_toe", "road_bank")
    )
    told = together.InPlace((wind, toe, bank), (-2.0, 3.0, 1.0))
    assert told.likeliest == (toe, bank)
    assert together.InPlace().likeliest == ()
