"""Changes of the tyres of both axles: a wet road is told as that."""

from dataclasses import replace

import numpy as np
import pytest

from sysid_vehicle import Fit, Log, Model, changed, drive, identify, manoeuvres
from sysid_vehicle.diagnose.change.both_axles import (
    FRICTION,
    SCALINGS,
    STIFFNESS,
    Scaled,
    as_tyres,
    factors,
    moves,
    without,
)
from sysid_vehicle.diagnose.change.together import together
from sysid_vehicle.errors import NumericalError
from sysid_vehicle.estimate import Driving

AXLES = ("front", "rear")
RIVALS = ("lateral_load_transfer", "mass")


@pytest.fixture(scope="module")
def before(start: Model, truth: Model) -> Fit:
    return identify(start, drive(truth, manoeuvres.lap(20.0), seed=11, rate_hz=25.0), starts=1)


def driven(truth: Model, friction: float, stiffness: float, mps2: float) -> Log:
    factors = {"D": friction, "B": stiffness / friction}
    names = [(f"{letter}_{axle}", f) for letter, f in factors.items() for axle in AXLES]
    car = truth.with_values({n: f * truth.value(n) for n, f in names})
    return drive(car, manoeuvres.lap(20.0, lateral_mps2=mps2), seed=12, rate_hz=25.0)


def test_a_wet_road_is_told_as_less_friction_of_both_axles(truth: Model, before: Fit) -> None:
    """And not as what costs grip in corners, or as tyres of one axle."""
    change = changed(before, driven(truth, 0.75, 1.0, 6.0), candidates=RIVALS)
    assert [e.id for e in change.named] == [FRICTION]
    found = change[FRICTION]
    assert found.group == ()
    assert abs(found.value[0] + 0.25) < 3.0 * found.std[0]
    assert found.std[0] < 0.05
    assert FRICTION not in change.after.model.effects
    for axle in AXLES:
        peaks = [m.value(f"D_{axle}") for m in (change.after.model, truth)]
        assert peaks[0] == pytest.approx(0.75 * peaks[1], rel=0.1)
        slopes = [m.tyre(axle).cornering_stiffness_per_load for m in (change.after.model, truth)]
        assert slopes[0] == pytest.approx(slopes[1], rel=0.1)


def test_softer_tyres_are_told_as_less_stiffness_of_both_axles(truth: Model, before: Fit) -> None:
    change = changed(before, driven(truth, 1.0, 0.88, 6.0), candidates=RIVALS)
    assert [e.id for e in change.named if not e.group][:1] == [STIFFNESS]
    found = change[STIFFNESS]
    assert abs(found.value[0] + 0.12) < 3.0 * found.std[0]
    assert found.std[0] < 0.03


def test_less_of_both_is_two_changes(truth: Model, before: Fit) -> None:
    """All side forces fall by a quarter."""
    change = changed(before, driven(truth, 0.75, 0.75, 6.0), candidates=RIVALS)
    assert {e.id for e in change.named} == {FRICTION, STIFFNESS}
    for effect in (FRICTION, STIFFNESS):
        found = change[effect]
        assert abs(found.value[0] + 0.25) < 3.0 * found.std[0]


@pytest.fixture
def both(truth: Model) -> Model:
    values = {f"{FRICTION}.relative_error": -0.3, f"{STIFFNESS}.relative_error": 0.2}
    return truth.add(*SCALINGS).with_values(values)


def test_tyres_are_multiplied(truth: Model, both: Model) -> None:
    for axle in AXLES:
        names = [f"{letter}_{axle}" for letter in "BCDE"]
        factors = [as_tyres(both).value(n) / truth.value(n) for n in names]
        assert factors == pytest.approx([1.2 / 0.7, 1.0, 0.7, 1.0])
    assert as_tyres(both).effects == truth.effects
    assert without(both).tyre("front") == truth.tyre("front")
    assert as_tyres(truth) is truth


def test_lines_are_drawn_along_what_the_errors_do(both: Model) -> None:
    """Of what is multiplied; the factors of the others apply to it as well."""
    size = 1e-6
    for e in SCALINGS:
        (name,) = e.named
        more = both.with_values({name: both.value(name) + size})
        for tyre, moved in moves(e.id, both).items():
            slope = (as_tyres(more).value(tyre) - as_tyres(both).value(tyre)) / size
            assert slope == pytest.approx(factors(both)[tyre] * moved, rel=1e-5)


def test_derivatives_are_those_of_the_multiplied_tyres(both: Model, fit: Fit, course: Log) -> None:
    problem, noise = Scaled.of(Driving.of(course), both), fit.noise.vector()
    known = both.parameters
    names = ("D_front", "B_rear", "C_rear", *(n for e in SCALINGS for n in e.named))
    columns = [known[n].column for n in names]
    p = both.vector()
    gains = problem.freeze(p, noise)
    G = problem.sensitivities(p, gains, columns)
    e = problem.residuals(p, gains).ravel()
    alone = Driving.of(course).problem(as_tyres(both))
    assert problem.log_likelihoods(p[None], noise) == pytest.approx(
        alone.log_likelihoods(as_tyres(both).vector()[None], noise)
    )
    cost, descent, information = problem.normal_equations(p, gains, columns)
    assert cost == pytest.approx(0.5 * e @ e) == problem.half_sum_of_squares(p, gains)
    np.testing.assert_allclose(descent, G.T @ e, rtol=1e-6)
    np.testing.assert_allclose(information, G.T @ G, rtol=1e-6)
    for j, c in enumerate(columns):
        step = np.zeros_like(p)
        step[c] = 1e-5
        slope = (problem.residuals(p - step, gains) - problem.residuals(p + step, gains)) / 2e-5
        assert np.abs(G[:, j] - slope.ravel()).max() < 1e-3 * np.abs(slope).max()


def test_no_car_has_tyres_beyond_any(both: Model, fit: Fit, course: Log) -> None:
    """Of friction that no driving tells both factors may be large: no likelihood is told then."""
    problem, noise = Scaled.of(Driving.of(course), both), fit.noise.vector()
    known, p = both.parameters, both.vector()
    beyond = p.copy()
    beyond[known["D_front"].column] = 4.0
    beyond[known[f"{FRICTION}.relative_error"].column] = 1.0
    with pytest.raises(NumericalError, match="beyond those of any car"):
        problem.freeze(beyond, noise)
    gains, columns = problem.freeze(p, noise), [known["D_front"].column]
    assert problem.half_sum_of_squares(beyond, gains) == np.inf  # searches turn back from there
    assert problem.normal_equations(beyond, gains, columns)[0] == np.inf
    alone, lost = problem.log_likelihoods(np.array([p, beyond]), noise)
    assert lost == -np.inf
    assert alone == pytest.approx(problem.log_likelihoods(p[None], noise)[0])
    assert problem.log_likelihoods(beyond[None], noise)[0] == -np.inf


def test_what_stays_is_no_nearer_to_the_reference_than_both_drives_say(
    fit: Fit, course: Log
) -> None:
    """Its estimates are no prior: coefficients that no driving tells may be any in the same car."""
    later = replace(fit, driving=Driving.of(course))
    objective = together(fit, later, fit.model, fit.model, ())
    p, noise = fit.model.vector(), fit.noise.vector()
    p[fit.model.parameters["C_front"].column] += 0.5
    drivings = (later.driving, fit.driving)
    of_both = sum(d.problem(fit.model).log_likelihoods(p[None], noise)[0] for d in drivings)
    assert objective.log_likelihood(p, noise) == pytest.approx(of_both)
    # What the user knew of it counts, as in the fit itself.
    known = replace(fit, model=fit.model.with_priors({"C_front": (1.4, 0.1)}))
    told = together(known, later, fit.model, fit.model, ()).log_likelihood(p, noise)
    assert told < objective.log_likelihood(p, noise) - 5.0
    free = together(known, later, fit.model, fit.model, ("C_front",))
    assert free.prior == ()
