"""What a search does not make simpler, as nobody asks for it."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from sysid_vehicle import Diagnosis, Fit, Model, diagnose, drive, identify, manoeuvres
from sysid_vehicle.estimate import Driving
from sysid_vehicle.identify import far_below, refine
from sysid_vehicle.rules import USUAL
from sysid_vehicle.study.search import search
from sysid_vehicle.study.search.search import Search
from sysid_vehicle.study.search.steps import first_that_holds, without_insignificant


@pytest.fixture(scope="module")
def driving(truth: Model) -> tuple[Driving, Driving]:
    """Of a car with a drag that the model lacks."""
    car = truth.add("aero_drag").with_values({"aero_drag.drag_area_m2": 0.8})
    train, test = (drive(car, manoeuvres.lap(25.0), seed=s, rate_hz=50.0) for s in (61, 62))
    return Driving.of(train), Driving.of(test)


@pytest.fixture(scope="module")
def baseline(start: Model, driving: tuple[Driving, Driving]) -> Fit:
    return identify(start, driving[0], starts=1)


@pytest.fixture(scope="module")
def dx(baseline: Fit) -> Diagnosis:
    return diagnose(baseline, candidates=["aero_drag"])


def with_drag(dx: Diagnosis) -> Fit:
    (fit,) = (c.fit for c in dx.ranking)
    assert fit is not None
    return fit


def test_what_validation_data_do_not_confirm_is_not_made_simpler(
    dx: Diagnosis, baseline: Fit, driving: tuple[Driving, Driving], monkeypatch: pytest.MonkeyPatch
) -> None:
    asked = []

    def simpler(fit: Fit, _: object) -> Fit:
        asked.append(fit)
        return fit

    known = first_that_holds.__globals__
    monkeypatch.setitem(known, "insignificant", lambda *_: {"aero_drag"})
    monkeypatch.setitem(known, "without_insignificant", simpler)
    held = first_that_holds(dx, baseline, driving[1])
    assert held is not None
    assert held[1] in asked
    asked.clear()
    monkeypatch.setitem(known, "speaks_for", lambda *_: None)
    assert first_that_holds(dx, baseline, driving[1]) is None
    assert asked == []


def test_what_is_needed_is_not_searched_to_the_end_without_it(
    dx: Diagnosis, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The poorer model has to come near what the richer one is worth, or nobody asks for it."""
    fit, told = with_drag(dx), []

    def refining(model: Model, driving: Driving, noise: object, *, least: float) -> Fit:
        told.append(least)
        return refine(model, driving, fit.noise, least=least)

    known = without_insignificant._function.__globals__
    monkeypatch.setitem(known, "insignificant", lambda *_: {"aero_drag"})
    monkeypatch.setitem(known, "refine", refining)
    assert without_insignificant._function(fit, USUAL) is fit
    price = 0.5 * np.log(fit.driving.samples)
    assert told == [pytest.approx(fit.log_likelihood - USUAL.apart - price)]
    poorer = refining(fit.model.drop("aero_drag"), fit.driving, None, least=told[0])
    assert far_below(poorer.log_likelihood, told[0])
    assert not poorer.converged


def test_what_is_needless_beside_its_noise_goes(
    baseline: Fit,
    driving: tuple[Driving, Driving],
    searching: Callable[..., Search],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """With the noise held a standard error may be half of that beside it, or less."""
    beside = identify(baseline.model.add("steer_offset"), driving[0], starts=1)
    held = replace(
        beside,
        estimates=tuple(
            replace(e, std=0.01 * e.std) if e.name.startswith("steer_offset") else e
            for e in beside.estimates
        ),
    )
    assert without_insignificant(held, USUAL) is held
    monkeypatch.setattr(search, "beside_noise", lambda fit: beside if fit is held else fit)
    looks = searching(driving[1])
    assert looks.lean(held).model.effects == ()
    assert replace(looks, ends=0.0).lean(held) is beside
