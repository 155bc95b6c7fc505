"""Other driving is predicted with parameters that are no surer than the fit left them."""

from dataclasses import replace

import numpy as np
import pytest

from sysid_vehicle import Fit, Log, Model, drive, identify, manoeuvres
from sysid_vehicle.estimate import Driving
from sysid_vehicle.identify import predict
from sysid_vehicle.identify.maximum import unmoved
from sysid_vehicle.identify.predictive import _remembered


@pytest.fixture(scope="module")
def gentle(start: Model, truth: Model) -> Fit:
    """Tells the cornering stiffness, and nothing of the peak."""
    return identify(start, drive(truth, manoeuvres.sine_sweep(), seed=1, rate_hz=50.0), starts=2)


def plain(fit: Fit, driving: Driving) -> float:
    """Log density at the fitted values, in the units of `predict`."""
    trace = driving.problem(fit.model).trace(fit.model.vector(), fit.noise.vector(), False)
    return float(np.sum(trace["log_density"]) - 0.5 * np.sum(trace["whitened"] ** 2))


@pytest.mark.manual
def test_it_is_the_integral_over_the_parameters(
    fit: Fit, truth: Model, course: Log, rng: np.random.Generator
) -> None:
    """By importance sampling, where hours of driving leave little unsure."""
    # The truth is far from all bounds, at which the approximation would be a poor one.
    long = replace(fit, model=truth, driving=Driving.of([*fit.driving.logs * 30]))
    other = Driving.of([course] * 10)
    found = predict(long, other, fit.noise)
    whole = _remembered(long)
    # One course stands for all of them: they are alike.
    problem, noise = Driving.of(course).problem(fit.model), fit.noise.vector()
    p = found.model.vector()
    centre = p[whole.box.columns].copy()
    _, _, learnt = problem.normal_equations(p, problem.freeze(p, noise), whole.box.columns)
    units = whole.box.units(centre)
    root = np.linalg.cholesky(
        np.linalg.inv(whole.information + 10.0 * learnt * np.outer(units, units))
    )
    half_log_det = 0.5 * np.linalg.slogdet(whole.information)[1] + np.log(np.diag(root)).sum()
    at_fit = problem.freeze(truth.vector(), noise).log_likelihood
    terms = []
    for z in rng.standard_normal((400, len(centre))):
        step = root @ z
        p[whole.box.columns] = np.where(units == 1.0, centre + step, centre * np.exp(step))
        price = 0.5 * float(np.sum(whole(p)[0] ** 2))
        ahead = problem.freeze(p, noise).log_likelihood - at_fit
        terms.append(10.0 * ahead - price + half_log_det + 0.5 * z @ z)
    integral = float(np.logaddexp.reduce(terms) - np.log(len(terms)))
    assert abs(integral) > 2.0
    gain = found.log_density.sum() - plain(long, other)
    assert gain == pytest.approx(integral, abs=0.3)


def test_moving_the_parameters_and_their_spread_have_their_price(fit: Fit, course: Log) -> None:
    """Laplace's approximation, put together from its parts."""
    other = Driving.of(course)
    found = predict(fit, other, fit.noise)
    told, noise = _remembered(fit), fit.noise.vector()
    problem, p = other.problem(fit.model), found.model.vector()
    x = p[told.box.columns]
    units = np.where(told.box.lower > 0.0, x, 1.0)
    off = np.where(told.box.lower > 0.0, np.log(x / told.fitted), x - told.fitted)
    moved = 0.5 * float(off @ told.information @ off)
    _, _, learnt = problem.normal_equations(p, problem.freeze(p, noise), told.box.columns)
    both = np.linalg.solve(told.information, learnt * np.outer(units, units))
    narrowed = 0.5 * np.linalg.slogdet(np.eye(len(x)) + both)[1]
    assert moved > 0.1
    assert narrowed > 1.0
    there = plain(replace(fit, model=found.model), other)
    assert found.log_density.sum() == pytest.approx(there - moved - narrowed, abs=1e-3)
    # They serve both drivings: no other parameters on the way pay less.
    for share in (0.0, 0.5, 1.5):
        p[told.box.columns] = told.fitted + share * (x - told.fitted)
        at = replace(fit, model=fit.model.from_vector(p))
        assert plain(at, other) - share**2 * moved < there - moved


def test_what_the_fit_never_saw_is_no_reason_to_fail(gentle: Fit, lap: Log, truth: Model) -> None:
    other = Driving.of(lap)
    found = predict(gentle, other, gentle.noise)
    best = plain(replace(gentle, model=truth), other)
    assert plain(gentle, other) < best - 100.0
    assert found.log_density.sum() > best - 40.0
    assert plain(replace(gentle, model=found.model), other) > best - 20.0


def test_what_both_drivings_saw_lies_between(
    fit: Fit, truth: Model, lap: Log, start: Model
) -> None:
    stiff = truth.with_values({"B_front": 1.02 * truth.value("B_front")})
    other = Driving.of(drive(stiff, manoeuvres.lap(40.0), seed=1, rate_hz=50.0))
    both = replace(fit, model=predict(fit, other, fit.noise).model)
    anew = identify(start, other, starts=1)
    one, between, two = (f.derived[0] for f in (fit, both, anew))
    assert two.value - one.value > 5.0 * one.std
    assert one.value + 2.0 * one.std < between.value < two.value - 2.0 * two.std


def test_a_lag_that_nobody_searched_predicts_as_none(fit: Fit, course: Log) -> None:
    lagging = unmoved(fit.model.add("steer_lag"), fit.driving, fit.noise)
    assert lagging.model.value("steer_lag.time_constant_s") == 0.0
    found, without = (predict(f, Driving.of(course), f.noise) for f in (lagging, fit))
    assert found.log_density.sum() == pytest.approx(
        without.log_density.sum(), abs=10.0
    )  # its price
