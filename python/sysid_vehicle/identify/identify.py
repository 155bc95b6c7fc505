"""Identification: parameters and noise of a model from driving, from many starts."""

from __future__ import annotations

import time
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from types import MappingProxyType

import numpy as np

from .._common.arguments import duration
from .._common.arrays import FloatArray, as_float64
from .._common.text import few
from .._common.threads import before
from .._common.typed import typed
from ..errors import InvalidInput, warn
from ..estimate import Driving, NoiseModel, first_guess
from ..log import LEAST_USABLE_S, Log, check_car, check_excitation, copies
from ..model import Model
from .ahead.ahead import predicting_ahead
from .beside_noise import beside_noise
from .contained import above_contained
from .fit import NOT_FOLLOWED, Fit, late_sentence
from .intervals.estimates import BETTER_FOUND, INTERVALS, profiled_estimates
from .kinds_of_noise import on_its_road, with_coloured_sensors
from .maximum import THINNED, another_top, log_likelihood_of, objectives, refine, summary, top
from .offsets import centred
from .search.box import free_box, objective_of
from .search.objective import Objective
from .search.search import METHODS, Box, minimise
from .search.settle import rivalled, settle, settle_finely
from .search.starts import Runner, Starts, apart, at_typical_sizes, space_filling
from .search.usual_tyres import from_usual_tyres
from .suspects import explaining

_STARTED = 0.3  # of the time that a search has, for its starts
_NO_PROFILES = "profiles were not finished: intervals are those of the information matrix"
_OFFSETS = 2  # times that offsets of logs are found, and noise of other time scales is tried
_OF_PLACES = ("ins_lever_arm", "imu_lever_arm", "speed_sensor_lever_arm")


@typed
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
    time_limit_s: float | None = None,
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
        What is known of free parameters beforehand, as normal distributions. One that the data
        contradict is told by a warning, and by `Fit.against_priors`.
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
    time_limit_s : float, optional
        After so many seconds the fit ends, wherever it is, but for some passes over the data. The
        starts have a share of the time. A search that was ended gives the likeliest that was seen,
        which has not converged and tells no intervals; profiles and predictions ahead that were
        not finished are left out. A warning and `Fit.late_facts` tell what was left out.
    progress : bool, optional
        Show a progress bar; by default in a terminal or a notebook, after two seconds.

    Returns
    -------
    Fit

    Raises
    ------
    InvalidInput
        Unknown method, intervals or parameter, bounds or priors that contradict each other or are
        not two numbers each, a fixed value that is no number or that no tyre has, no free
        parameter, no starts or workers, a negative seed, nothing usable in the logs, or logs that
        cannot be of this car: another mass, another steering ratio.
    NumericalError
        No start led anywhere.

    Warns
    -----
    SysidWarning
        Priors that the data contradict, a log that is given twice, effects that the logs cannot
        show; or the time limit left something out.
    """
    ends = time.perf_counter() + duration(time_limit_s, "time_limit_s")
    if method not in METHODS:
        raise InvalidInput(f"no optimiser is called '{method}'; there are {', '.join(METHODS)}")
    if intervals not in INTERVALS:
        raise InvalidInput(f"intervals = '{intervals}'; there are {', '.join(INTERVALS)}")
    if horizon_s and intervals == "profile":
        raise InvalidInput("profile intervals are of the likelihood; leave out horizon_s")
    model = _told(model, fixed, bounds, priors)
    fit = maximised(
        model,
        Driving.of(logs),
        starts=starts,
        method=method,
        seed=seed,
        workers=workers,
        progress=progress,
        ends=ends,
    )
    for against in fit.against_priors:
        warn(str(against))
    if intervals == "profile" and not fit.broken_off:
        work = partial(profile_fit, fit, workers=workers, progress=progress)
        fit = before(ends, work, None) or _late(fit, _NO_PROFILES)
    elif horizon_s:
        ahead = None
        if not fit.broken_off:
            ahead = before(ends, partial(predicting_ahead, fit, horizon_s), None)
        fit = ahead or _late(fit, f"it was not fitted to predictions {horizon_s:g} s ahead")
    if fit.late_facts:
        warn(late_sentence(fit.late_facts))
    return fit.without_intervals() if fit.broken_off else fit


def _late(fit: Fit, *facts: str) -> Fit:
    return replace(fit, late_facts=(*fit.late_facts, *facts))


def maximised(
    model: Model,
    driving: Driving,
    *,
    starts: int,
    method: str = "gauss-newton",
    seed: int = 0,
    workers: int | None = None,
    progress: bool | None = None,
    ends: float = np.inf,
) -> Fit:
    """The maximum of the likelihood from many starts, or the likeliest that was seen in time.

    Parameters
    ----------
    model : Model
    driving : Driving
    starts, method, seed, workers, progress
        As in `identify`.
    ends : float
        When the search ends, wherever it is, by `time.perf_counter`. The fit has not converged
        then, and a pass or two over the data are still to come.

    Raises
    ------
    InvalidInput, NumericalError
        As in `identify`.
    """
    _check(model, driving)

    def maximum(model: Model) -> Fit:
        return _maximised(model, driving, starts, method, seed, workers, progress, ends)

    fit = maximum(model)
    return before(ends, lambda: above_contained(fit, model, maximum), fit)


def _maximised(
    model: Model,
    driving: Driving,
    starts: int,
    method: str,
    seed: int,
    workers: int | None,
    progress: bool | None,
    ends: float,
) -> Fit:
    names = model.free_names
    box = free_box(model)
    p = model.vector()
    noise = first_guess(driving, model.vehicle)
    thin = objective_of(model, driving.problem(model, most_samples=THINNED), driving)
    frozen = thin.freeze(p, noise.vector())
    # Up to this the log-likelihood is minus half the sum of squares.
    level = frozen.log_likelihood + thin.problem.half_sum_of_squares(p, frozen)

    def search(begin: FloatArray) -> tuple[FloatArray, float]:
        found = minimise(thin, begin, frozen, box, method=method, tolerance=0.1)
        return box.put(begin, found.x), level - found.cost

    late: list[FloatArray] = []

    def in_time(begin: FloatArray) -> tuple[FloatArray, float]:
        found = before(started, lambda: search(begin), None)
        if found is None:
            late.append(begin)
            found = begin, level - thin.problem.half_sum_of_squares(begin, frozen)
        return found

    now = time.perf_counter()
    started = now + _STARTED * (ends - now)
    begins = _start_points(model, names, box, starts, seed)
    points, values = Runner(box, workers, progress).all_of(in_time, box.put(p, begins))
    table = Starts(names, begins, as_float64(points[:, box.columns]), values)
    # Which end is the best is told by the noise as it then is, not by that of the start.
    objective, thinned = objectives(model, driving)
    few = apart(points, values, box)

    def found() -> Fit:
        return _from_ends(model, driving, objective, thinned, few, noise, table)

    facts = (f"{len(late)} of {len(begins)} starts were not searched to their ends",)
    fit = before(ends, found, None)
    if fit is not None:
        return _late(beside_noise(fit), *(facts if late else ()))
    seen = [s for s in (o.likeliest for o in (objective, *thinned)) if s is not None]
    every = [(s.p, s.noise) for s in seen] or [(few[0], noise.vector())]
    likeliest = max(every, key=lambda at: log_likelihood_of(objective, *at))
    noise = NoiseModel.from_vector(likeliest[1])
    return _late(
        summary(model, driving, objective, likeliest[0], noise, table, False), NOT_FOLLOWED
    )


def _from_ends(
    model: Model,
    driving: Driving,
    objective: Objective,
    thinned: list[Objective],
    ends: Sequence[FloatArray],
    noise: NoiseModel,
    table: Starts,
) -> Fit:
    """The maximum, from the best few ends of searches under this noise."""
    box = free_box(model)
    first, *others = ends
    best = settle(objective, first, noise.vector(), box, thin=thinned)
    for end in others:
        best = rivalled(objective, best, end, box, thinned)
    fit = top(model, driving, objective, best, table, thinned)
    known = fit.model.vector(), fit.noise.vector()
    usual = from_usual_tyres(objective, known, noise.vector(), box, thinned)
    if usual is not None:
        rival = another_top(fit, objective, usual, thinned)
        if rival is not None and rival.log_likelihood > fit.log_likelihood:
            fit = rival
    best = at_top = fit.model.vector(), fit.noise.vector(), fit.converged
    for elsewhere in at_typical_sizes(model, at_top[0]):
        best = rivalled(objective, best, elsewhere, box, thinned)
    if best is not at_top:
        fit = top(model, driving, objective, best, table, thinned)
    return with_own_offsets(with_coloured_sensors(on_its_road(fit)))


def _check(model: Model, driving: Driving) -> None:
    if not model.free_names:
        raise InvalidInput("every parameter is fixed: nothing is left to identify; use compare")
    if driving.usable_s < LEAST_USABLE_S:
        raise InvalidInput(
            f"{driving}: at least {LEAST_USABLE_S:g} s are needed, 30 s with corners are good; add "
            "logs of other manoeuvres of the same car"
        )
    again = copies(driving.logs)
    if again:
        warn(
            f"{few(again)} is given twice and counts twice: intervals come out too narrow; leave "
            "one of the two out"
        )
    car = model.vehicle
    # A model that knows where the sensors lie, or has forces of the user's, explains such a log.
    known = any(e.acts or e.id in _OF_PLACES for e in model.parts)
    lf_m = None if known else car.lf_m
    for log in driving.logs:
        check_car(log, mass_kg=car.mass_kg, wheelbase_m=car.wheelbase_m, lf_m=lf_m)
    check_excitation(list(driving.logs))
    _say_what_is_not_seen(model, driving)


def with_own_offsets(fit: Fit) -> Fit:
    """The same fit where each log has nuisances of its own, found beside all that the model has.

    Those that a poorer model left hold a part of what it lacked.
    """
    if len(fit.driving.logs) == 1 or not fit.model.offset_names:
        return fit
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
    return model.with_fixed(fixed).with_bounds(bounds).with_priors(priors)


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
        known = summary(fit.model, fit.driving, objective, p, told, fit.starts, fit.converged)
        fit = beside_noise(known)
        estimates, profiles, better = profiled_estimates(
            objective, p, noise, box, fit, workers, progress, known.by_noise
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


def _say_what_is_not_seen(model: Model, driving: Driving) -> None:
    if not driving.force_known:
        blind = [e.id for e in model.parts if e.needs_force]
        if blind:
            warn(
                f"{driving}: without fx_n the log cannot show {', '.join(blind)}; "
                "log the wheel force, or drop the effect"
            )
