"""What a study says is to be done next."""

from dataclasses import replace

import pytest

from sysid_vehicle import Model, Study, drive, improve, manoeuvres
from sysid_vehicle.study import AddedEffect
from sysid_vehicle.study.next_steps import next_steps


@pytest.fixture(scope="module")
def adequate(start: Model, truth: Model) -> Study:
    train, test = (drive(truth, manoeuvres.lap(20.0), seed=s) for s in (61, 62))
    return improve(start, train, test, candidates=["mass", "steer_lag"], starts=1)


@pytest.fixture(scope="module")
def unknown(start: Model, truth: Model) -> Study:
    """Nothing in the catalogue that may be tried turns the yaw rate by a constant."""
    biased = truth.add("gyro_bias").with_values({"gyro_bias.bias_radps": 0.02})
    train, test = (drive(biased, manoeuvres.lap(20.0), seed=s) for s in (63, 64))
    return improve(start, train, test, candidates=["mass", "aero_drag"], starts=1)


def test_a_model_that_may_be_used_asks_for_nothing(adequate: Study) -> None:
    assert adequate.verdict == "adequate"
    assert adequate.next_steps == ()
    assert "Next:" not in str(adequate)


def test_what_no_effect_explains_is_to_be_looked_at(unknown: Study) -> None:
    assert unknown.verdict == "unknown"
    said = " ".join(unknown.next_steps)
    assert "define an effect" in said
    assert "sysid-vehicle check" in said
    assert "fx_n" not in said  # it is logged
    assert str(unknown).count("Next: ") == len(unknown.next_steps)
    assert unknown.to_dict()["next_steps"] == list(unknown.next_steps)
    assert "<li>Next: " in unknown._repr_html_()


def test_a_search_that_was_cut_short_is_to_go_on(unknown: Study) -> None:
    cut = replace(unknown, stopped=("mass", "steer_lag"), checked=True)
    said = next_steps(cut)
    assert said[0] == "give the search more time: mass, steer_lag were still to be tried"
    assert not any("check the sensors" in text for text in said)


def test_only_what_the_driving_leaves_open_asks_for_harder_driving(unknown: Study) -> None:
    first, second, *others = unknown.fit.estimates
    notes = (replace(first, note="not determined"), replace(second, note="at bound"))
    rest = tuple(replace(e, note="") for e in others)
    fit = replace(unknown.fit, estimates=(*notes, *rest))
    (said,) = (t for t in next_steps(replace(unknown, fits=(fit,))) if "limit of the tyres" in t)
    assert first.name in said
    assert second.name not in said


def test_what_is_confounded_is_to_be_told_apart(unknown: Study) -> None:
    drag = AddedEffect("aero_drag", (), 2.0, 1.0, 1e-9, confounded_with=("head_wind",))
    proxy = AddedEffect("mass", (), 2.0, 1.0, 1e-9, stands_in="it is not constant")
    first, second, *_ = next_steps(replace(unknown, added=(drag, proxy)))
    assert first.startswith("tell aero_drag from head_wind: `sysid-vehicle next-drive`")
    assert second.startswith("do not take the size of mass for a property of the car")
