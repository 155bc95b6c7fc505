"""A model with an added effect is never fitted worse than the model that it contains."""

import sys
from dataclasses import replace

import numpy as np
import pytest

import sysid_vehicle as sv
from sysid_vehicle.identify import Fit, free_box, refine
from sysid_vehicle.identify.search.starts import SAME_OPTIMUM

LAGS = [e.id for e in sv.catalogue() if e.scored_at_typical]


@pytest.fixture(scope="module")
def model() -> sv.Model:
    return sv.Model(sv.example_vehicle())


@pytest.fixture(scope="module")
def precise(model: sv.Model) -> sv.Log:
    """A drive of the model itself, of which nothing is missing, by precise sensors."""
    noise = sv.SensorNoise().scaled(0.1)
    return sv.drive(model, sv.manoeuvres.lap(12.0), seed=920011, rate_hz=100.0, noise=noise)


@pytest.fixture(scope="module")
def contained(model: sv.Model, precise: sv.Log) -> Fit:
    return sv.identify(model, precise, starts=1)


@pytest.mark.parametrize("effect", LAGS)
@pytest.mark.filterwarnings("ignore::sysid_vehicle.SysidWarning")
def test_an_added_effect_costs_nothing(
    model: sv.Model, precise: sv.Log, contained: Fit, effect: str
) -> None:
    found = sv.identify(model.add(effect), precise, starts=1)
    assert found.log_likelihood > contained.log_likelihood - SAME_OPTIMUM


@pytest.mark.parametrize("effect", [e.id for e in sv.catalogue()])
def test_an_effect_at_nothing_is_as_good_as_none(
    model: sv.Model, contained: Fit, effect: str
) -> None:
    """The search keeps lags from exactly zero; what that costs has to be next to nothing."""
    fit = refine(contained.model.add(effect), contained.driving, contained.noise)
    assert fit.log_likelihood > contained.log_likelihood - SAME_OPTIMUM
    box = free_box(model.add(effect))
    assert effect not in LAGS or np.all(box.lower[len(model.free_names) :] > 0.0)


def test_a_search_that_ends_at_other_tyres_begins_at_those_without_the_effect(
    model: sv.Model, precise: sv.Log, contained: Fit, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The search of the model with the effect ends far below, as it may from the vehicle file."""
    module = sys.modules["sysid_vehicle.identify.identify"]
    searched = module._maximised
    asked: list[tuple[str, ...]] = []

    def astray(of: sv.Model, *rest: object) -> Fit:
        asked.append(of.effects)
        found: Fit = searched(of, *rest)
        return replace(found, log_likelihood=found.log_likelihood - 500.0) if of.effects else found

    monkeypatch.setattr(module, "_maximised", astray)
    found = sv.identify(model.add("steer_offset"), precise, starts=1)
    assert asked == [("steer_offset",), ()]
    assert found.log_likelihood > contained.log_likelihood - SAME_OPTIMUM


@pytest.mark.parametrize("which", [0, 2])
def test_the_time_of_a_disturbance_that_is_not_there_costs_nothing(
    contained: Fit, which: int
) -> None:
    """Of a force at its least the likelihood has two maxima, the shortest and the longest time."""
    times = list(contained.noise.correlation_time_s)
    assert times[which] < 0.02
    times[which] = 1.0
    slow = replace(contained.noise, correlation_time_s=tuple(times))
    found = refine(contained.model, contained.driving, slow)
    assert found.log_likelihood > contained.log_likelihood - SAME_OPTIMUM
