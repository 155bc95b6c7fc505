"""Identification: parameters and noise of a model from driving, from many starts."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.stats import qmc
from tqdm import tqdm

from .. import _core
from .._arrays import FloatArray
from .._threads import Workers
from ..errors import InvalidInput, NumericalError, warn
from ..estimate import Driving, NoiseModel, first_guess, learn_noise
from ..log import Log, check_excitation
from ..model import Model
from ..vehicle import Vehicle
from .fit import Estimate, Fit, Start
from .search import METHODS, Box, minimise
from .suspects import explaining

__all__ = ["identify", "refine", "refit"]

_THINNED = 3000  # samples that decide between starts
_SAME_OPTIMUM = 1.0  # nats
_SHARES = (1.0, 0.5, 0.25, 0.1, 0.03)  # of a step, tried until the likelihood rises


@explaining
def identify(
    model: Model,
    logs: Log | Sequence[Log] | Driving,
    *,
    starts: int = 12,
    method: str = "gauss-newton",
    seed: int = 0,
    workers: int = 2,
    progress: bool = False,
) -> Fit:
    """Estimate a model's free parameters, and the noise, by maximum likelihood.

    The likelihood is that of the one-step-ahead prediction errors of an extended Kalman filter
    (Ljung, System Identification, 2nd ed., sec. 7.2 and 7.4).

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
    seed : int
        Of the start points.
    workers : int
        Threads.
    progress : bool
        Show a progress bar.

    Returns
    -------
    Fit

    Raises
    ------
    InvalidInput
        Unknown method, no starts or workers, a negative seed, or nothing usable in the logs.
    NumericalError
        No start led anywhere.
    """
    if method not in METHODS:
        raise InvalidInput(f"no optimiser is called '{method}'; there are {', '.join(METHODS)}")
    driving = Driving.of(logs)
    check_excitation(list(driving.logs))
    _say_what_is_not_seen(model, driving)
    names = list(model.free_names)
    box = free_box(model)
    p = model.vector()
    noise = first_guess(driving, model.vehicle)
    thin = driving.problem(model, most_samples=_THINNED)
    frozen = thin.freeze(p, noise.vector())
    begins = _start_points(model, names, box, starts, seed)

    def search(begin: FloatArray) -> tuple[FloatArray, float]:
        full = p.copy()
        full[box.columns] = begin
        try:
            found = minimise(thin, full, frozen, box, method=method, tolerance=0.1)
        except (NumericalError, np.linalg.LinAlgError):
            return begin, np.inf
        return found.x, found.cost

    with Workers(workers) as pool:
        ends = list(
            tqdm(pool.map(search, begins), total=len(begins), desc="starts", disable=not progress)
        )
    costs = np.array([cost for _, cost in ends])
    if not np.isfinite(costs).any():
        raise NumericalError(
            f"{', '.join(log.name for log in driving.logs)}: no start led to a finite likelihood"
        )
    best = int(np.nanargmin(costs))
    table = tuple(
        Start(
            dict(zip(names, map(float, begin), strict=True)),
            dict(zip(names, map(float, end), strict=True)),
            float(cost),
            bool(cost < costs[best] + _SAME_OPTIMUM),
        )
        for begin, (end, cost) in zip(begins, ends, strict=True)
    )
    p[box.columns] = ends[best][0]
    return _polish(model, driving, p, noise, box, names, table)


def refine(
    model: Model, driving: Driving, noise: NoiseModel, *, inputs: FloatArray | None = None
) -> Fit:
    """Go on from a model's values and a noise model that are already near: one start.

    Parameters
    ----------
    inputs : array, shape (samples, 2), optional
        In place of the driving's own steering angle and wheel force.
    """
    names = list(model.free_names)
    p = model.vector()
    return _polish(model, driving, p, noise, free_box(model), names, (), inputs)


def refit(model: Model, driving: Driving, noise: NoiseModel, *, rounds: int = 3) -> Fit:
    """Parameters alone, from a model's values, under a noise model that stays as it is.

    The likelihood is never lower than that of the values it starts from.
    """
    names = list(model.free_names)
    box = free_box(model)
    problem = driving.problem(model)
    p = model.vector()
    p[box.columns] = np.clip(p[box.columns], box.lower, box.upper)
    frozen = problem.freeze(p, noise.vector())
    for _ in range(rounds):
        before = p[box.columns]
        found = minimise(problem, p, frozen, box, rounds=8, tolerance=0.2)
        p, frozen = _risen(problem, p, frozen, found.x, noise, box)
        if np.all(np.abs(p[box.columns] - before) < 1e-4 * (box.upper - box.lower)):
            break
    return _summary(model, driving, problem, p, noise, box, names, (), True, frozen)


def free_box(model: Model) -> Box:
    """The model's free parameters, in the order of their names."""
    names = list(model.free_names)
    known = model.parameters
    bounds = np.array([model.bounds(n) for n in names])
    lower = bounds[:, 0].copy()
    for i, n in enumerate(names):
        # A lag of exactly zero has no derivative; a tenth of its typical size is next to none.
        part = next((e for e in model.parts if n.startswith(f"{e.id}.")), None)
        if part is not None and part.scored_at_typical:
            lower[i] = max(lower[i], 0.1 * known[n].typical)
    return Box([known[n].column for n in names], lower, bounds[:, 1])


# Where tyres lie in practice; the bounds of the search are wider.
_USUAL = {"B": (4.0, 25.0), "C": (1.0, 2.0), "D": (0.5, 1.8), "E": (-2.0, 0.9)}


def _start_points(
    model: Model, names: list[str], box: Box, starts: int, seed: int
) -> list[FloatArray]:
    given = np.clip([model.value(n) for n in names], box.lower, box.upper)
    for i, n in enumerate(names):
        if "." in n and model.value(n) == model.parameters[n].null_value:
            p = model.parameters[n]
            given[i] = np.clip(p.null_value + 0.3 * p.typical, box.lower[i], box.upper[i])
    points = [given]
    if starts > 1:
        size = 1 << (starts - 2).bit_length() if starts > 2 else 1
        unit = qmc.Sobol(len(names), seed=seed).random(size)[: starts - 1]
        for u in unit:
            x = given.copy()
            for i, n in enumerate(names):
                if n[0] in _USUAL and n[1] == "_":
                    low, high = _USUAL[n[0]]
                    x[i] = low + u[i] * (high - low)
                elif "." in n:
                    p = model.parameters[n]
                    x[i] = p.null_value + (2.0 * u[i] - (0.0 if p.one_sided else 1.0)) * p.typical
                else:
                    x[i] = given[i] * 2.0 ** (2.0 * u[i] - 1.0)
            points.append(np.clip(x, box.lower, box.upper))
    return points


def _polish(
    model: Model,
    driving: Driving,
    p: FloatArray,
    noise: NoiseModel,
    box: Box,
    names: list[str],
    starts: tuple[Start, ...],
    inputs: FloatArray | None = None,
) -> Fit:
    """Noise and parameters of maximum likelihood, from values that are already near."""
    problem = driving.problem(model, other_inputs=inputs)
    # Noise needs fewer samples than parameters do; the last word has all of them.
    thin = driving.problem(model, most_samples=_THINNED, other_inputs=inputs)
    p, noise, converged = settle(problem, thin, model.vehicle, p, noise, box)
    noise, _ = learn_noise(problem, p, noise, model.vehicle, rounds=1)
    return _summary(model, driving, problem, p, noise, box, names, starts, converged)


def _risen(
    problem: _core.Problem,
    p: FloatArray,
    frozen: _core.FrozenFilter,
    x: FloatArray,
    noise: NoiseModel,
    box: Box,
) -> tuple[FloatArray, _core.FrozenFilter]:
    """As far from `p` towards `x` as the likelihood rises, and the filter there.

    The search had the gains of `p`. With its own the point that it found may be a worse one.
    """
    begin = p[box.columns]
    for share in _SHARES:
        trial = p.copy()
        trial[box.columns] = begin + share * (x - begin)
        try:
            there = problem.freeze(trial, noise.vector())
        except NumericalError:
            continue
        if there.log_likelihood >= frozen.log_likelihood:
            return trial, there
    return p, frozen


def settle(
    problem: _core.Problem,
    thin: _core.Problem,
    vehicle: Vehicle,
    p: FloatArray,
    noise: NoiseModel,
    box: Box,
    *,
    rounds: int = 10,
) -> tuple[FloatArray, NoiseModel, bool]:
    """Alternate between noise, learned on `thin`, and parameters until the likelihood stands still.

    It never ends below the likelihood of its start.

    Returns
    -------
    tuple of array, NoiseModel and bool
        The core's parameter vector, the noise, and whether it came to a stand.
    """
    p = p.copy()
    p[box.columns] = np.clip(p[box.columns], box.lower, box.upper)
    best = -np.inf
    frozen = problem.freeze(p, noise.vector())
    for round_ in range(rounds):
        learned, _ = learn_noise(thin, p, noise, vehicle, rounds=6 if round_ == 0 else 3)
        there = problem.freeze(p, learned.vector())
        if there.log_likelihood >= frozen.log_likelihood:  # which `thin` does not warrant
            noise, frozen = learned, there
        if frozen.log_likelihood < best + 0.5:
            return p, noise, True
        best = frozen.log_likelihood
        x = minimise(problem, p, frozen, box, rounds=8, tolerance=0.05).x
        p, frozen = _risen(problem, p, frozen, x, noise, box)
    return p, noise, False


def _summary(
    model: Model,
    driving: Driving,
    problem: _core.Problem,
    p: FloatArray,
    noise: NoiseModel,
    box: Box,
    names: list[str],
    starts: tuple[Start, ...],
    converged: bool,
    frozen: _core.FrozenFilter | None = None,
) -> Fit:
    frozen = problem.freeze(p, noise.vector()) if frozen is None else frozen
    _, _, information = problem.normal_equations(p, frozen, box.columns)
    estimates, covariance = _estimates(model, p, box, names, information)
    return Fit(
        model.with_values(dict(zip(names, map(float, p[box.columns]), strict=True))),
        noise,
        estimates,
        covariance,
        float(frozen.log_likelihood),
        driving,
        starts,
        converged,
    )


def _estimates(
    model: Model, p: FloatArray, box: Box, names: list[str], information: FloatArray
) -> tuple[tuple[Estimate, ...], FloatArray]:
    x = p[box.columns]
    margin = 1e-6 * (box.upper - box.lower)
    at_bound = (x <= box.lower + margin) | (x >= box.upper - margin)
    scale = np.sqrt(np.maximum(np.diag(information), 1e-300))
    free = ~at_bound & (np.diag(information) > 0.0)  # of what is never felt nothing is known
    covariance = np.zeros_like(information)
    if free.any():
        scaled = information[np.ix_(free, free)] / np.outer(scale[free], scale[free])
        values, vectors = np.linalg.eigh(scaled)
        values = np.maximum(values, 1e-12)
        inverse = (vectors / values) @ vectors.T
        covariance[np.ix_(free, free)] = inverse / np.outer(scale[free], scale[free])
    estimates = []
    for i, n in enumerate(names):
        std = float(np.sqrt(covariance[i, i])) if free[i] else float("inf")
        # Uniform over the whole box has a standard deviation of 29 % of it: nothing was learned.
        unknown = std > 0.25 * (box.upper[i] - box.lower[i])
        note = "at bound" if at_bound[i] else "not determined" if unknown else ""
        estimates.append(Estimate(n, float(x[i]), std, model.parameters[n].unit, note))
    return tuple(estimates), covariance


def _say_what_is_not_seen(model: Model, driving: Driving) -> None:
    if not driving.force_known:
        blind = [e.id for e in model.parts if e.needs_force]
        if blind:
            warn(
                f"{driving}: without fx_n the log cannot show {', '.join(blind)}; "
                "log the wheel force, or drop the effect"
            )
