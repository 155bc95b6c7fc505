"""The maximum of the likelihood from values that are already near, and the fit that it makes."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from .. import _core
from .._common.arrays import FloatArray, as_float64
from ..effects import Effect
from ..errors import NumericalError
from ..estimate import Driving, NoiseModel
from ..model import Model
from .fit import Fit
from .intervals.estimates import box_covariance, wald
from .intervals.retimed import pushes_of_time
from .offsets import marginal_information
from .search.box import NO_LAG, free_box, objective_of
from .search.climb import FAR_BELOW, to_the_top
from .search.objective import Objective
from .search.other_noise import likelier_noise
from .search.scanned import go_on, scans
from .search.settle import settle
from .search.starts import Starts

THINNED = 3000  # samples that decide between starts
_FINER = 6.0  # times as many samples, or so, when a search goes on with more of them
_FAR_BELOW_BY_FEW = 50.0  # nats on few samples, chosen as `FAR_BELOW`
# Nats, most that a lag, and any one effect, climbed from where it had settled (`FAR_BELOW`).
_CLIMBS, _ANY_CLIMBS = 4.0, 100.0
# Nats, and standard errors, between maxima that are one: climbs end so far from each other.
_SAME, _NEAR = 0.5, 0.5


def refine(
    model: Model,
    driving: Driving,
    noise: NoiseModel,
    *,
    inputs: FloatArray | None = None,
    least: float = -np.inf,
) -> Fit:
    """Go on from a model's values and a noise model that are already near: one start.

    Parameters
    ----------
    inputs : array, shape (samples, 2), optional
        In place of the driving's own steering angle and wheel force.
    least : float
        Log-likelihood below which nobody asks for the maximum: what ends far below that has not
        converged.
    """
    starts = Starts.none(model.free_names)
    return polish(model, driving, model.vector(), noise, starts, inputs, least)


def far_below(log_likelihood: float, least: float) -> bool:
    """Whether neither noise of another time scale nor a simpler model lifts a fit up to that."""
    return log_likelihood < least - FAR_BELOW


def refine_above(
    model: Model, driving: Driving, fit: Fit, least: float = -np.inf, rival: Fit | None = None
) -> Fit | None:
    """As `refine` under the noise of a poorer fit; None where it ends far below that.

    Few samples, which lead the search most of the way, tell it before all of them are asked.

    Parameters
    ----------
    model : Model
        With a lag that the poorer one lacks.
    driving : Driving
    fit : Fit
        The poorer one.
    least : float
        Log-likelihood below which nobody asks for the maximum: where neither noise of its own nor
        a climb leads up to that it is not sought, nor where few samples lead to no lag.
    rival : Fit, optional
        With another effect. What ends far below that has not converged.
    """
    objective, thinned = objectives(model, driving)
    box, begin = free_box(model), (model.vector(), fit.noise.vector())
    starts, led = Starts.none(model.free_names), None

    def as_it_is(p: FloatArray, v: FloatArray) -> Fit:
        return summary(model, driving, objective, p, NoiseModel.from_vector(v), starts, False)

    if thinned:
        led = settle(thinned[-1], *begin, box, thin=thinned[:-1])[:2]
        reached = thinned[-1].log_likelihood(*led)
        if reached < _by_few(fit, objective) - _FAR_BELOW_BY_FEW:
            return None
        new = np.array([n not in fit.model.free_names for n in model.free_names])
        # Few samples lead to no lag, which is the poorer model: from there no search leads back.
        none = bool(np.any(new & (led[0][box.columns] <= free_box(model, NO_LAG).lower)))
        led_on = log_likelihood_of(objective, *led) > log_likelihood_of(objective, *begin)
        if none and led_on and least > fit.log_likelihood:
            return None
        if rival is not None and reached < _by_few(rival, objective) - _ANY_CLIMBS:
            return as_it_is(*led)
    lowest = max(least - _CLIMBS, fit.log_likelihood - FAR_BELOW)
    p, noise, converged = settle(objective, *begin, box, led=led, least=least - _CLIMBS)
    reached = log_likelihood_of(objective, p, noise)
    if reached < lowest:
        return None
    if rival is not None and reached < rival.log_likelihood - _ANY_CLIMBS:
        return as_it_is(p, noise)
    return top(model, driving, objective, (p, noise, converged), starts, thinned)


def refine_beside(
    model: Model,
    driving: Driving,
    fit: Fit,
    least: float,
    worth: Callable[[Fit], bool] = lambda _: True,
) -> Fit | None:
    """As `refine`, to be compared with a fit of other effects; None where it ends far below that.

    Few samples, on which it climbs to the end, tell it before all of them are asked.

    Parameters
    ----------
    model : Model
    driving : Driving
    fit : Fit
        The other one, whose noise it begins with.
    least : float
        Log-likelihood below which nobody asks for the maximum (`far_below`): noise of other time
        scales is not tried from there.
    worth : callable, optional
        Whether it is tried from the fit at the end of the climb; None where not.
    """
    objective, thinned = objectives(model, driving)
    box, led = free_box(model), (model.vector(), fit.noise.vector())
    if thinned:
        few = thinned[-1]
        led = to_the_top(few, *settle(few, *led, box, thin=thinned[:-1])[:2], box)
        if few.log_likelihood(*led) < _by_few(fit, objective) - _FAR_BELOW_BY_FEW:
            return None
    found = settle(objective, model.vector(), fit.noise.vector(), box, led=led)
    starts = Starts.none(model.free_names)
    at_top = to_the_top(objective, *found[:2], box, least=least - FAR_BELOW)
    told = NoiseModel.from_vector(at_top[1])
    near = summary(model, driving, objective, at_top[0], told, starts, found[2])
    if far_below(near.log_likelihood, least):
        return replace(near, converged=False)
    if not worth(near):
        return None
    return _likeliest(model, driving, objective, at_top, starts, thinned, found[2])


def _by_few(fit: Fit, objective: Objective) -> float:
    """Log-likelihood of a fit on the few samples that lead where an objective has all of them."""
    few = fit.driving.problem(fit.model, most_samples=_counts(objective.samples)[-1])
    told = objective_of(fit.model, few, fit.driving)
    return told.log_likelihood(fit.model.vector(), fit.noise.vector())


def refine_while(
    model: Model, driving: Driving, noise: NoiseModel, goes_on: Callable[[Fit], bool]
) -> Fit | None:
    """As `refine`; None where a fit on the way to the maximum is not worth going on from.

    Parameters
    ----------
    goes_on : callable
        Asked after each part of the climb.
    """
    objective, thinned = objectives(model, driving)
    box, starts = free_box(model), Starts.none(model.free_names)
    settled = settle(objective, model.vector(), noise.vector(), box, thin=thinned)

    def worth(p: FloatArray, noise: FloatArray) -> bool:
        told = NoiseModel.from_vector(noise)
        return goes_on(summary(model, driving, objective, p, told, starts, settled[2]))

    at_top = to_the_top(objective, *settled[:2], box, worth)
    if not worth(*at_top):
        return None
    return _likeliest(model, driving, objective, at_top, starts, thinned, settled[2])


def refit(
    model: Model,
    driving: Driving,
    noise: NoiseModel,
    *,
    rounds: int = 3,
    inputs: FloatArray | None = None,
    scanned: Sequence[Effect] = (),
) -> Fit:
    """Parameters alone, from a model's values, under a noise model that stays as it is.

    The likelihood is never lower than that of the values it starts from. The times of changes
    that the effects `scanned` have are tried at many values. `inputs` as for `refine`.
    """
    objective = objective_of(model, driving.problem(model, other_inputs=inputs), driving)
    tried = scans(model, scanned, driving)
    p, gains = go_on(objective, model, noise.vector(), rounds, tried)
    return summary(model, driving, objective, p, noise, Starts.none(model.free_names), True, gains)


def relearn(model: Model, driving: Driving, noise: NoiseModel, *, inputs: FloatArray) -> Fit:
    """Noise and parameters in turn until they stand, from values that are near; nothing is climbed.

    For those who ask for what the parameters can do besides, to first order: what `refine` gains
    beyond this is a way along them. `inputs` as for `refine`.
    """
    objective = objective_of(model, driving.problem(model, other_inputs=inputs), driving)
    box, starts = free_box(model), Starts.none(model.free_names)
    p, learned, converged = settle(objective, model.vector(), noise.vector(), box)
    told = NoiseModel.from_vector(learned)
    return summary(model, driving, objective, p, told, starts, converged)


def unmoved(model: Model, driving: Driving, noise: NoiseModel) -> Fit:
    """A model's values as they stand, with their standard errors: nothing is searched."""
    objective = objective_of(model, driving.problem(model), driving)
    starts = Starts.none(model.free_names)
    return summary(model, driving, objective, model.vector(), noise, starts, True)


def polish(
    model: Model,
    driving: Driving,
    p: FloatArray,
    noise: NoiseModel,
    starts: Starts,
    inputs: FloatArray | None = None,
    least: float = -np.inf,
) -> Fit:
    """Noise and parameters of maximum likelihood, from values that are already near."""
    objective, thinned = objectives(model, driving, inputs)
    box, lowest = free_box(model), least - FAR_BELOW - _ANY_CLIMBS
    found = settle(objective, p, noise.vector(), box, thin=thinned, least=lowest)
    return top(model, driving, objective, found, starts, thinned, least)


def objectives(
    model: Model, driving: Driving, inputs: FloatArray | None = None
) -> tuple[Objective, list[Objective]]:
    """The likelihood, and those of fewer samples, the fewest first.

    Noise needs fewer samples than parameters do; the last word has all of them.
    """
    objective = objective_of(model, driving.problem(model, other_inputs=inputs), driving)
    every = objective.samples
    few = [driving.problem(model, most_samples=n, other_inputs=inputs) for n in _counts(every)]
    return objective, [replace(objective, problem=f) for f in few if f.samples < every]


def _counts(every: int) -> list[int]:
    """How many of so many samples lead, the fewest first."""
    levels = max(round(np.log(every / THINNED) / np.log(_FINER)), 1)
    return [round(THINNED * (every / THINNED) ** (n / levels)) for n in range(levels)]


def top(
    model: Model,
    driving: Driving,
    objective: Objective,
    settled: tuple[FloatArray, FloatArray, bool],
    starts: Starts,
    thinned: Sequence[Objective] = (),
    least: float = -np.inf,
) -> Fit:
    """The maximum, from where a search has settled, whichever time scale its noise began with.

    `thinned` is the likelihood of fewer samples, the fewest first; `least` as for `refine`.
    """
    at_top = to_the_top(objective, *settled[:2], free_box(model), least=least - FAR_BELOW)
    if far_below(log_likelihood_of(objective, *at_top), least):
        p, told = at_top[0], NoiseModel.from_vector(at_top[1])
        return summary(model, driving, objective, p, told, starts, False)
    return _likeliest(model, driving, objective, at_top, starts, thinned, settled[2])


def another_top(
    known: Fit,
    objective: Objective,
    settled: tuple[FloatArray, FloatArray, bool],
    thinned: Sequence[Objective] = (),
) -> Fit | None:
    """As `top` where a search has settled elsewhere; None where it leads far below.

    Noise of other time scales is not tried there, from where nothing comes up, nor where the climb
    ends at the known maximum, of which it was tried.
    """
    model, driving, box = known.model, known.driving, free_box(known.model)
    least = known.log_likelihood - FAR_BELOW
    at_top = to_the_top(objective, *settled[:2], box, least=least)
    above = log_likelihood_of(objective, *at_top) - known.log_likelihood
    if above < -FAR_BELOW:
        return None
    p, noise = at_top
    if abs(above) < _SAME and _near(known, p[box.columns], _NEAR):
        told = NoiseModel.from_vector(noise)
        return summary(model, driving, objective, p, told, known.starts, settled[2])
    return _likeliest(model, driving, objective, at_top, known.starts, thinned, settled[2])


def _near(fit: Fit, x: FloatArray, share: float) -> bool:
    """Whether free parameters are those of a fit, to a share of their standard errors."""
    return all(
        abs(e.value - v) <= share * e.std or e.value == v
        for e, v in zip(fit.estimates, x, strict=True)
    )


def _likeliest(
    model: Model,
    driving: Driving,
    objective: Objective,
    at_top: tuple[FloatArray, FloatArray],
    starts: Starts,
    thinned: Sequence[Objective],
    converged: bool,
) -> Fit:
    """The fit of a maximum, or of a likelier one with noise of other time scales."""
    few = next(iter(thinned), objective)
    p, noise = likelier_noise(objective, at_top, free_box(model), few)
    told = NoiseModel.from_vector(noise)
    return summary(model, driving, objective, p, told, starts, converged)


def log_likelihood_of(objective: Objective, p: FloatArray, noise: FloatArray) -> float:
    """Minus infinity where the model fails."""
    try:
        return float(objective.freeze(p, noise).log_likelihood)
    except NumericalError:
        return -np.inf


def summary(
    model: Model,
    driving: Driving,
    objective: Objective,
    p: FloatArray,
    noise: NoiseModel,
    starts: Starts,
    converged: bool,
    frozen: _core.FrozenFilter | None = None,
) -> Fit:
    """A fit with the standard errors of its parameters."""
    box, names = free_box(model), model.free_names
    if frozen is None:
        frozen = objective.freeze(p, noise.vector())
    _, descent, information = objective.normal_equations(p, frozen, box.columns)
    if driving.offsets:
        information = marginal_information(model, driving, p, noise)
    x = p[box.columns]
    units = {n: parameter.unit for n, parameter in model.parameters.items()}
    ends = [model.bounds(n) for n in names]

    def slope(of: Driving) -> FloatArray:
        if of is driving:
            return descent
        other = objective_of(model, of.problem(model), of)
        return other.normal_equations(p, frozen, box.columns)[1]

    pushes = pushes_of_time(driving, slope)
    pushed = as_float64(box_covariance(information, box, x) @ pushes)
    estimates, covariance = wald(names, units, x, information, box, ends, descent, pushed)
    return Fit(
        model.with_values(dict(zip(names, map(float, x), strict=True))),
        noise,
        estimates,
        covariance,
        float(frozen.log_likelihood),
        driving,
        starts,
        converged,
        pushed=pushed,
    )
