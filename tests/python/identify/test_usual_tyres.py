"""A maximum with tyres that no car has is left for one with usual tyres, where that is better."""

from dataclasses import replace

import numpy as np
import pytest

import sysid_vehicle as sv
from sysid_vehicle.estimate import Driving, first_guess
from sysid_vehicle.identify import maximum
from sysid_vehicle.identify.maximum import objectives
from sysid_vehicle.identify.search.box import free_box
from sysid_vehicle.identify.search.objective import Objective
from sysid_vehicle.identify.search.tyre_shape import of_usual_shape, stiffness
from sysid_vehicle.identify.search.usual_tyres import from_usual_tyres

Place = tuple[Objective, list[Objective], Driving]


@pytest.fixture(scope="module")
def place(start: sv.Model, lap: sv.Log) -> Place:
    driving = Driving.of(lap)
    return *objectives(start, driving), driving


def test_the_same_stiffness() -> None:
    strange = np.array([6.9, 2.18, 0.64, -3.8])
    usual = of_usual_shape(strange)
    assert stiffness(usual) == pytest.approx(stiffness(strange))
    assert tuple(usual[1:]) == (1.4, 1.0, 0.0)


def test_tyres_that_no_car_has_are_left(start: sv.Model, place: Place, fit: sv.Fit) -> None:
    objective, thin, driving = place
    first = first_guess(driving, start.vehicle).vector()
    p = fit.model.vector()
    for axle in (slice(0, 4), slice(4, 8)):
        c, d = 2.5, 0.6
        p[axle] = [stiffness(p[axle]) / (c * d), c, d, -6.0]
    noise = objective.learn_noise(p, first).noise
    poor = objective.log_likelihood(p, noise)
    assert poor < fit.log_likelihood - 100.0
    found = from_usual_tyres(objective, (p, noise), first, free_box(start), thin)
    assert found is not None
    assert objective.log_likelihood(*found[:2]) > fit.log_likelihood - 5.0


def test_a_complete_model_is_asked_nothing(
    start: sv.Model, place: Place, fit: sv.Fit, monkeypatch: pytest.MonkeyPatch
) -> None:
    objective, thin, driving = place
    first = first_guess(driving, start.vehicle).vector()
    known = fit.model.vector(), fit.noise.vector()
    monkeypatch.setattr(Objective, "learn_noise", None)
    assert from_usual_tyres(objective, known, first, free_box(start), thin) is None


def test_a_search_that_leads_back_to_the_known_maximum_ends_there(
    place: Place, fit: sv.Fit, monkeypatch: pytest.MonkeyPatch
) -> None:
    objective, thin, _ = place
    monkeypatch.setattr(maximum, "likelier_noise", pytest.fail)
    p, noise = fit.model.vector(), fit.noise.vector()
    end = maximum.another_top(fit, objective, (p, noise, True), thin)
    assert end is not None
    assert end.log_likelihood >= fit.log_likelihood - 0.01
    # Far below nothing more is tried either, and what is likelier is searched to its end.
    above = replace(fit, log_likelihood=fit.log_likelihood + 2.0 * maximum.FAR_BELOW)
    assert maximum.another_top(above, objective, (p, noise, True), thin) is None
    tried: list[int] = []
    monkeypatch.setattr(maximum, "likelier_noise", lambda _, at, *__: tried.append(1) or at)
    below = replace(fit, log_likelihood=fit.log_likelihood - 2.0)
    assert maximum.another_top(below, objective, (p, noise, True), thin) is not None
    first, *others = fit.estimates
    elsewhere = replace(first, value=first.value + 2.0 * first.std)
    moved = replace(fit, estimates=(elsewhere, *others))
    assert maximum.another_top(moved, objective, (p, noise, True), thin) is not None
    assert len(tried) == 2
