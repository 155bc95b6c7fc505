"""What speaks against a name that would stand beside something that is missing."""

from dataclasses import replace

import pytest

from sysid_vehicle import Fit, Model, drive, identify, manoeuvres
from sysid_vehicle.diagnose import Candidate
from sysid_vehicle.effects import effect
from sysid_vehicle.estimate import Driving
from sysid_vehicle.identify import Estimate, refit
from sysid_vehicle.study.ahead.horizons import moved_by
from sysid_vehicle.study.judge import contested
from sysid_vehicle.study.judge.contested import errors_grow, of_no_use, other_values, spoken_against
from sysid_vehicle.study.judge.disagree import Disagreement
from sysid_vehicle.study.search.together import InPlace

NAME = "aero_downforce.cl_a_rear_m2"


@pytest.fixture(scope="module")
def fit(start: Model, truth: Model) -> Fit:
    """With a downforce that the car has."""
    sizes = {"aero_downforce.cl_a_front_m2": 1.0, NAME: 1.5}
    car = truth.add("aero_downforce").with_values(sizes)
    log = drive(car, manoeuvres.lap(25.0), seed=3, rate_hz=50.0)
    return identify(start.add("aero_downforce"), log, starts=1)


def told(fit: Fit, here: float, there: float, std: float = 0.1) -> dict[str, str]:
    """What two values that differ beyond doubt say of the effect."""
    a, b = (Estimate(NAME, x, std, "m2") for x in (here, there))
    return other_values([Disagreement(a, b)], fit)


def test_two_values_tell_one_effect_only_if_both_are_off_nothing(fit: Fit) -> None:
    assert told(fit, 1.4, 0.7) == {}  # they differ, and there is a downforce in both
    assert told(fit, 0.8, 1.2) == {}
    assert set(told(fit, 1.42, 0.28)) == {"aero_downforce"}
    assert set(told(fit, 0.28, 1.42)) == {"aero_downforce"}
    assert set(told(fit, 1.0, -1.0)) == {"aero_downforce"}
    assert (
        "1.42 +- 0.1 m2 from training data, 0.28 +- 0.1 from validation data"
        in told(fit, 1.42, 0.28)["aero_downforce"]
    )
    # What training data do not feel is not what the name stands by.
    assert told(fit, 0.2, -1.0) == {}
    tyre = Estimate("B_front", 9.0, 0.1, "1")
    assert other_values([Disagreement(tyre, replace(tyre, value=1.0))], fit) == {}


def test_a_value_that_no_car_has_or_does_not_matter_is_no_name(fit: Fit) -> None:
    def named(effect_id: str, value: float, *, small: bool = True) -> str:
        part = effect(effect_id)
        known = {n: Estimate(n, value, 2.0, p.unit) for n, p in part.named.items()}
        return of_no_use(part, known, small=small)  # type: ignore[arg-type]

    # Five typical sizes are 30 m/s; the interval reaches below.
    assert "physically implausible (speed_mps -32.6 m/s)" in named("head_wind", -32.6)
    assert named("head_wind", -29.0) == ""
    assert "too small to matter" in named("locked_differential", 17500.0)
    assert named("locked_differential", 17500.0, small=False) == ""
    assert named("locked_differential", 20500.0) == ""


def test_names_are_asked_of_values_and_of_what_is_likelier_in_their_place(
    fit: Fit, monkeypatch: pytest.MonkeyPatch
) -> None:
    bare = refit(fit.model.drop("aero_downforce"), fit.driving, fit.noise)
    test = Driving.of(drive(fit.model, manoeuvres.lap(20.0), seed=4, rate_hz=50.0))
    rival = Candidate(effect("tyre_temperature"), 9.0, 1e-9, (0.1, 20.0), (0.01, 1.0), 1.0, 1.0)
    rival = replace(rival, fit=fit)

    def against(lead: float, gain: float = 1.0) -> dict[str, str]:
        known = {"aero_downforce": InPlace((rival,), (lead,))}
        monkeypatch.setattr(contested, "gain_with_exact_inputs", lambda *_: gain)
        return spoken_against(bare, fit, ["aero_downforce"], ["aero_downforce"], known, test)

    assert against(4.0) == {}
    assert against(5.0, gain=-1.0) == {}
    assert "tyre_temperature in its place would fit" in against(5.0)["aero_downforce"]
    # What makes it likelier is said to be beside it.
    rival = replace(rival, fit=replace(fit, model=fit.model.add("tyre_temperature", "yaw_inertia")))
    told = against(5.0)["aero_downforce"]
    assert "tyre_temperature with yaw_inertia in its place would fit" in told
    other = {
        "aero_downforce": "aero_downforce.cl_a_rear_m2 1.4 from training data, 0.2 from others"
    }
    monkeypatch.setattr(contested, "other_values", lambda *_: other)
    assert "validation data alone give another value" in against(0.0)["aero_downforce"]


def test_no_name_stands_whose_interval_holds_no_effect_beside_what_is_missing(fit: Fit) -> None:
    test = Driving.of(drive(fit.model, manoeuvres.lap(20.0), seed=4, rate_hz=50.0))
    bare = refit(fit.model.drop("aero_downforce"), fit.driving, fit.noise)
    name = ["aero_downforce"]
    # Standard errors of a fifth and of the whole of its size.
    own = fit.covariance.diagonal()[[e.name == NAME for e in fit.estimates]]
    size = fit[NAME].value ** 2 / float(own.max())
    sure, unsure = (times * size * fit.covariance for times in (0.04, 1.0))
    assert spoken_against(bare, fit, name, name, {}, test, wide=sure) == {}
    found = spoken_against(bare, fit, name, name, {}, test, wide=unsure)
    assert found["aero_downforce"].startswith("its 99 % interval, with what is missing included")
    # Beyond the 95 % interval that is printed, and within that of the rule.
    between = size / 2.2**2 * fit.covariance
    assert "its 99 % interval" in spoken_against(bare, fit, name, name, {}, test, wide=between).get(
        "aero_downforce", ""
    )
    assert spoken_against(bare, fit, name, [], {}, test, wide=unsure) == {}  # one of a group


def test_no_name_stands_for_what_makes_errors_grow(fit: Fit) -> None:
    """The motion that an effect moves counts; what is lost is as wrong as anything."""
    name = ["aero_downforce"]
    test = Driving.of(drive(fit.model, manoeuvres.lap(20.0), seed=4, rate_hz=50.0))
    bare = refit(fit.model.drop("aero_downforce"), fit.driving, fit.noise)
    assert not errors_grow(bare, fit, test, moved_by(fit.model.parts[0]))
    wrong = replace(fit, model=fit.model.with_values({NAME: 6.0}))
    assert errors_grow(fit, wrong, test, moved_by(fit.model.parts[0]))
    found = spoken_against(fit, wrong, name, name, {}, test)
    assert found[name[0]] == "as fitted, the errors 0.5 to 5 s ahead of the channels it moves grow"
    assert not errors_grow(fit, fit, test, ["vx_mps"])
