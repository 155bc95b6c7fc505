"""Identification: parameters and noise of a model from driving, from many starts."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from types import MappingProxyType

import numpy as np

from .. import _core
from .._common.arrays import FloatArray, as_float64
from ..errors import InvalidInput, NumericalError, warn
from ..estimate import Driving, NoiseModel, first_guess, noise_range
from ..estimate.pieces import DrivingProblem
from ..log import Log, check_car, check_excitation
from ..model import Model
from .ahead import predicting_ahead
from .box import free_box, free_prior
from .estimates import BETTER_FOUND, INTERVALS, profiled_estimates, wald
from .fit import Fit
from .objective import Objective
from .offsets import centred, marginal_information
from .search import METHODS, Box, minimise
from .settle import moved, rivalled, settle, settle_finely, to_the_top
from .starts import Runner, Starts, apart, at_typical_sizes, space_filling
from .suspects import explaining

_SLOPES_MPS2 = (0.05, 0.2)  # of a road whose slope varies, to begin with
_HINT, _SHOWN = 2.0, 20.0  # nats that a road gains at first sight, and learned
_THINNED = 3000  # samples that decide between starts
_FINER = 6.0  # times as many samples, or so, when a search goes on with more of them
_ENOUGH = 0.05  # nats: a round of a refit that gains less is the last one
_OFFSETS = 2  # times that offsets of logs and what they share are found in turn


@explaining
def identify(
    model: Model,
    logs: Log | Sequence[Log] | Driving,
    *,
    starts: int = 12,
    method: str = "gauss-newton",
    fixed: Mapping[str, float] | Iterable[str] = (),
    bounds: Mapping[str, tuple[float, float]] = MappingProxyType({}),
    priors: Mapping[str, tuple[float, float]] = MappingProxyType({}),
    intervals: str = "information",
    horizon_s: float = 0.0,
    seed: int = 0,
    workers: int | None = None,
    progress: bool | None = None,
) -> Fit:
    """Estimate a model's free parameters, and the noise, by maximum likelihood.

    The likelihood is that of the one-step-ahead prediction errors of an extended Kalman filter
    (Ljung, System Identification, 2nd ed., sec. 7.2 and 7.4). Statistics need it. Of a model that
    is not quite the car it may give parameters that predict poorly some seconds ahead; for
    simulation and control ask for `horizon_s`.

    Parameters
    ----------
    model : Model
        Its values are the first start.
    logs : Log, sequence of Log, or Driving
        Runs of one car.
    starts : int
        Number of starts; the others fill the box of the parameters evenly (Sobol sequence).
    method : str
        Local optimiser: `gauss-newton`, `nlopt` or `scipy`.
    fixed : mapping of str to float, or names
        Parameters that are known, with their values; at the model's values where only named.
    bounds : mapping of str to (lower, upper)
        Narrower bounds of free parameters.
    priors : mapping of str to (mean, standard deviation)
        What is known of free parameters beforehand, as normal distributions.
    intervals : str
        `information`: 95 % intervals from the information matrix. `profile`: from the profile
        likelihood, which follows bent valleys and takes some tens of searches.
    horizon_s : float
        Fit parameters to predictions so many seconds ahead, from the maximum of the likelihood on:
        `predicting_ahead`. Zero for the likelihood itself.
    seed : int
        Of the start points.
    workers : int, optional
        Threads; by default as many as there are cores. The result is the same for any number.
    progress : bool, optional
        Show a progress bar; by default in a terminal or a notebook, after two seconds.

    Returns
    -------
    Fit

    Raises
    ------
    InvalidInput
        Unknown method, intervals or parameter, bounds or priors that contradict each other, no
        free parameter, no starts or workers, a negative seed, nothing usable in the logs, or logs
        that cannot be of this car: another mass, another steering ratio.
    NumericalError
        No start led anywhere.
    """
    if method not in METHODS:
        raise InvalidInput(f"no optimiser is called '{method}'; there are {', '.join(METHODS)}")
    if intervals not in INTERVALS:
        raise InvalidInput(f"intervals = '{intervals}'; there are {', '.join(INTERVALS)}")
    if horizon_s and intervals == "profile":
        raise InvalidInput("profile intervals are of the likelihood; leave out horizon_s")
    model = _told(model, fixed, bounds, priors)
    driving = Driving.of(logs)
    for log in driving.logs:
        check_car(log, mass_kg=model.vehicle.mass_kg, wheelbase_m=model.vehicle.wheelbase_m)
    check_excitation(list(driving.logs))
    _say_what_is_not_seen(model, driving)
    names = model.free_names
    box = free_box(model)
    p = model.vector()
    noise = first_guess(driving, model.vehicle)
    thin = objective_of(model, driving.problem(model, most_samples=_THINNED), driving)
    frozen = thin.freeze(p, noise.vector())
    # Up to this the log-likelihood is minus half the sum of squares.
    level = frozen.log_likelihood + thin.problem.half_sum_of_squares(p, frozen)

    def search(begin: FloatArray) -> tuple[FloatArray, float]:
        found = minimise(thin, begin, frozen, box, method=method, tolerance=0.1)
        return box.put(begin, found.x), level - found.cost

    begins = _start_points(model, names, box, starts, seed)
    ends, values = Runner(box, workers, progress).all_of(search, box.put(p, begins))
    table = Starts(names, begins, as_float64(ends[:, box.columns]), values)
    # Which end is the best is told by the noise as it then is, not by that of the start.
    objective, thinned = _objectives(model, driving)
    first, *others = apart(ends, values, box)
    best = settle(objective, first, noise.vector(), box, thin=thinned)
    for end in others:
        best = rivalled(objective, best, end, box, thinned)
    fit = _top(model, driving, objective, best, table)
    best = at_top = fit.model.vector(), fit.noise.vector(), fit.converged
    for elsewhere in at_typical_sizes(model, at_top[0]):
        best = rivalled(objective, best, elsewhere, box, thinned)
    if best is not at_top:
        fit = _top(model, driving, objective, best, table)
    fit = _on_its_road(fit)
    if fit.model.offset_names and len(driving.logs) > 1:
        fit = _log_by_log(fit)
    if intervals == "profile":
        return profile_fit(fit, workers=workers, progress=progress)
    return predicting_ahead(fit, horizon_s) if horizon_s else fit


def _log_by_log(fit: Fit) -> Fit:
    """The same fit where each log has nuisances of its own."""
    for _ in range(_OFFSETS):
        model, driving = centred(fit)
        fit = replace(refine(model, driving, fit.noise), starts=fit.starts)
    return fit


def _told(
    model: Model,
    fixed: Mapping[str, float] | Iterable[str],
    bounds: Mapping[str, tuple[float, float]],
    priors: Mapping[str, tuple[float, float]],
) -> Model:
    model = model.with_fixed(fixed).with_bounds(bounds).with_priors(priors)
    if not model.free_names:
        raise InvalidInput("every parameter is fixed: nothing is left to identify; use compare")
    return model


def objective_of(model: Model, problem: DrivingProblem, driving: Driving) -> Objective:
    """The likelihood of a problem with the priors of a model's free parameters."""
    return Objective(problem, free_prior(model), *noise_range(model.vehicle, driving))


def refine(
    model: Model, driving: Driving, noise: NoiseModel, *, inputs: FloatArray | None = None
) -> Fit:
    """Go on from a model's values and a noise model that are already near: one start.

    Parameters
    ----------
    inputs : array, shape (samples, 2), optional
        In place of the driving's own steering angle and wheel force.
    """
    return _polish(model, driving, model.vector(), noise, Starts.none(model.free_names), inputs)


def refit(model: Model, driving: Driving, noise: NoiseModel, *, rounds: int = 3) -> Fit:
    """Parameters alone, from a model's values, under a noise model that stays as it is.

    The likelihood is never lower than that of the values it starts from.
    """
    box = free_box(model)
    objective = objective_of(model, driving.problem(model), driving)
    p = box.inside(model.vector())
    gains, value = None, -np.inf
    for _ in range(rounds):
        before, best = p, value
        p, gains = moved(objective, p, noise.vector(), box, rounds=8, tolerance=0.2)
        value = objective.reached(p, gains)
        if value < best + _ENOUGH or box.near(p, before, 1e-4):
            break
    return _summary(model, driving, objective, p, noise, Starts.none(model.free_names), True, gains)


def unmoved(model: Model, driving: Driving, noise: NoiseModel) -> Fit:
    """A model's values as they stand, with their standard errors: nothing is searched."""
    objective = objective_of(model, driving.problem(model), driving)
    starts = Starts.none(model.free_names)
    return _summary(model, driving, objective, model.vector(), noise, starts, True)


def profile_fit(fit: Fit, *, workers: int | None = None, progress: bool | None = None) -> Fit:
    """The same fit at the very bottom of its valley, with intervals of the profile likelihood.

    Where a profile comes upon a better optimum the fit goes on from there.
    """
    objective = objective_of(fit.model, fit.driving.problem(fit.model), fit.driving)
    box = free_box(fit.model)
    p, noise = fit.model.vector(), fit.noise.vector()
    for _ in range(BETTER_FOUND):
        p, noise, _ = settle_finely(objective, p, noise, box)
        told = NoiseModel.from_vector(noise)
        fit = _summary(fit.model, fit.driving, objective, p, told, fit.starts, fit.converged)
        estimates, profiles, better = profiled_estimates(
            objective, p, noise, box, fit, workers, progress
        )
        if better is None:
            break
        p = better
    return replace(fit, estimates=estimates, profiles=profiles)


# Where tyres lie in practice; the bounds of the search are wider.
_USUAL = {"B": (4.0, 25.0), "C": (1.0, 2.0), "D": (0.5, 1.8), "E": (-2.0, 0.9)}


def _start_points(
    model: Model, names: Sequence[str], box: Box, starts: int, seed: int
) -> FloatArray:
    given = np.clip([model.value(n) for n in names], box.lower, box.upper)
    low, high = given.copy(), given.copy()
    for i, n in enumerate(names):
        if n[0] in _USUAL and n[1] == "_":
            low[i], high[i] = _USUAL[n[0]]
        elif "." in n:
            p = model.parameters[n]
            if model.value(n) == p.null_value:
                given[i] = p.null_value + 0.3 * p.typical
            low[i] = p.null_value - (0.0 if p.one_sided else p.typical)
            high[i] = p.null_value + (2.0 if p.one_sided else 1.0) * p.typical
        else:
            low[i], high[i] = 0.5 * given[i], 2.0 * given[i]
    return np.clip(space_filling(given, low, high, starts, seed), box.lower, box.upper)


def _polish(
    model: Model,
    driving: Driving,
    p: FloatArray,
    noise: NoiseModel,
    starts: Starts,
    inputs: FloatArray | None = None,
) -> Fit:
    """Noise and parameters of maximum likelihood, from values that are already near."""
    objective, thinned = _objectives(model, driving, inputs)
    found = settle(objective, p, noise.vector(), free_box(model), thin=thinned)
    return _top(model, driving, objective, found, starts)


def _objectives(
    model: Model, driving: Driving, inputs: FloatArray | None = None
) -> tuple[Objective, list[Objective]]:
    """The likelihood, and those of fewer samples, the fewest first.

    Noise needs fewer samples than parameters do; the last word has all of them.
    """
    objective = objective_of(model, driving.problem(model, other_inputs=inputs), driving)
    every = objective.samples
    levels = max(round(np.log(every / _THINNED) / np.log(_FINER)), 1)
    thinned = [round(_THINNED * (every / _THINNED) ** (n / levels)) for n in range(levels)]
    few = [driving.problem(model, most_samples=n, other_inputs=inputs) for n in thinned]
    return objective, [replace(objective, problem=f) for f in few if f.samples < every]


def _top(
    model: Model,
    driving: Driving,
    objective: Objective,
    settled: tuple[FloatArray, FloatArray, bool],
    starts: Starts,
) -> Fit:
    """The maximum, from where a search has settled."""
    p, noise = to_the_top(objective, *settled[:2], free_box(model))
    told = NoiseModel.from_vector(noise)
    return _summary(model, driving, objective, p, told, starts, settled[2])


def _on_its_road(fit: Fit) -> Fit:
    """The same fit where the road is level, another where its slope varies."""
    model, driving, p = fit.model, fit.driving, fit.model.vector()
    objective = objective_of(model, driving.problem(model), driving)

    def log_likelihood(noise: NoiseModel) -> float:
        try:
            return float(objective.freeze(p, noise.vector()).log_likelihood)
        except NumericalError:
            return -np.inf

    sloping = [replace(fit.noise, road=(slope, slope)) for slope in _SLOPES_MPS2]
    values = [log_likelihood(noise) for noise in sloping]
    best = sloping[int(np.argmax(values))]
    if max(values) < fit.log_likelihood + _HINT:
        return fit
    learned, value, _ = objective.learn_noise(p, best.vector(), rounds=6)
    if value < fit.log_likelihood + _SHOWN:
        return fit
    found = _polish(model, driving, p, NoiseModel.from_vector(learned), fit.starts)
    return found if found.log_likelihood > fit.log_likelihood else fit


def _summary(
    model: Model,
    driving: Driving,
    objective: Objective,
    p: FloatArray,
    noise: NoiseModel,
    starts: Starts,
    converged: bool,
    frozen: _core.FrozenFilter | None = None,
) -> Fit:
    box, names = free_box(model), model.free_names
    if frozen is None:
        frozen = objective.freeze(p, noise.vector())
    if driving.offsets:
        information = marginal_information(model, driving, p, noise)
    else:
        _, _, information = objective.normal_equations(p, frozen, box.columns)
    x = p[box.columns]
    units = {n: parameter.unit for n, parameter in model.parameters.items()}
    estimates, covariance = wald(names, units, x, information, box)
    return Fit(
        model.with_values(dict(zip(names, map(float, x), strict=True))),
        noise,
        estimates,
        covariance,
        float(frozen.log_likelihood),
        driving,
        starts,
        converged,
    )


def _say_what_is_not_seen(model: Model, driving: Driving) -> None:
    if not driving.force_known:
        blind = [e.id for e in model.parts if e.needs_force]
        if blind:
            warn(
                f"{driving}: without fx_n the log cannot show {', '.join(blind)}; "
                "log the wheel force, or drop the effect"
            )
