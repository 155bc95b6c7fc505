"""Identification of the grey-box car's tyres by maximum likelihood, from many starts."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from ..._common.arguments import whole
from ..._common.arrays import FloatArray, as_float64
from ..._common.progress import doing
from ...errors import InvalidInput, warn
from ...estimate.inputs import white_noise_std
from ...identify.intervals.estimates import BETTER_FOUND, box_covariance, profiled_estimates, wald
from ...identify.search.objective import Objective
from ...identify.search.search import METHODS, Box
from ...identify.search.settle import bottom, descend, settle, settle_finely
from ...identify.search.starts import Runner, Search, Starts, space_filling
from ...identify.search.walk import alternate
from ...vehicle import GRAVITY_MPS2, slip_angles
from .bent import bent_of
from .combined import asks_for_ellipse, warn_of_ellipse, with_ellipse
from .data import GreyBoxVehicle, TyreLog
from .fit import ELLIPSE, PARAMETERS, UNITS, Rival, TyreFit
from .motion import TyreMotion
from .problem import box_of, first_point, free_parameters, objective_of, tyre_problem
from .regression_search import descend_regression

_THINNED = 3200  # samples that decide between starts
_KINEMATIC_VY = 0.1  # how far integrated accelerations may be off [m/s]
_LEVEL_NATS = 1.92  # half the 95 % quantile of chi-square with one degree of freedom
_HOPELESS = 5.0  # nats that the way to the bottom of a valley does not gain
_LOADS = 5.0
_BEYOND = 25.0  # squared distance in standard deviations


@doing("identification of the tyres")
def identify_tyres(
    vehicle: GreyBoxVehicle,
    logs: TyreLog | Sequence[TyreLog],
    *,
    start: Mapping[str, float] | None = None,
    residual_terms: bool = False,
    combined_slip: bool | None = None,
    starts: int = 16,
    profiles: bool = True,
    method: str = "gauss-newton",
    seed: int = 0,
    workers: int | None = None,
    progress: bool | None = None,
) -> TyreFit:
    """Identify B, C, D, E of both axles, and the noise, from driving.

    The likelihood is that of one-step-ahead prediction errors of v_x, v_y, yaw rate and lateral
    acceleration together, of a filter whose noise is learned: nothing smoothed is taken as exact.

    Parameters
    ----------
    vehicle : GreyBoxVehicle
        A tolerance of its mass or yaw inertia makes that an unknown too.
    logs : TyreLog or sequence of TyreLog
        Drives of one car. v_y may be missing.
    start : mapping, optional
        Starting values of some of `PARAMETERS`.
    residual_terms : bool
        Also fit P1, P2, P3 of a_y = ... + P1 v_x^2 + P2 v_y + P3 r.
    combined_slip : bool, optional
        Whether the force along the car costs side force, by a friction ellipse that is identified
        too. If left out, the likelihood decides; where it cannot, and D depends on it, that is
        warned of.
    starts : int
        The given point, and others that fill the whole `BOX` evenly.
    profiles : bool
        Take intervals from the profile likelihood, which follows bent valleys; otherwise from the
        information matrix alone, which is quicker. What has such an interval that fails is told
        (`TyreFit.bent`).
    method : str
        Local optimiser: `gauss-newton`, `nlopt` or `scipy`.
    seed : int
        Of the start points.
    workers : int, optional
        Threads; by default as many as there are cores. The result is the same for any number.
    progress : bool, optional
        Show a progress bar; by default in a terminal or a notebook, after two seconds.

    Raises
    ------
    InvalidInput
        No log, an unknown method or parameter, less than one start, a negative seed, inputs of two
        kinds, a wheel force in some logs only.
    NumericalError
        No start led anywhere.
    """
    several = (logs,) if isinstance(logs, TyreLog) else tuple(logs)
    _check(several, method, starts, seed)
    _check_loads(several, vehicle)
    known = several[0].force_known
    free = free_parameters(vehicle, residual_terms=residual_terms, force_known=known)
    p = first_point({**(start or {}), **({} if known else {"drag_area_m2": 0.0})})
    box = box_of(free, {})
    given = np.clip(p[box.columns], box.lower, box.upper)
    begins = space_filling(given, box.lower, box.upper, starts, seed, list(range(8)))
    runner = Runner(box, workers, progress)
    told = [g if g.sideslip_measured else g.with_kinematic_sideslip() for g in several]
    thin, rough = (
        objective_of(vehicle, logs, _THINNED, residual_terms=residual_terms)
        for logs in (several, told)
    )
    # A regression on the smoothed motion is quick and has few valleys that lead astray; a filter
    # that follows the readings closely has less bias; the likelihood itself decides.
    noise = _loose(several)
    ends, _ = runner.all_of(_regression(vehicle, told), box.put(p, begins))
    follow = partial(descend, rough, noise=noise, box=box, method=method)
    ends, values = runner.all_of(follow, ends)
    ends, values, noise, rivals = alternate(thin, ends, values, noise, runner, method=method)
    table = Starts(free, begins, as_float64(ends[:, box.columns]), values)
    p = ends[int(np.argmax(values))]
    several, p, noise = _between_samples(
        vehicle, several, p, noise, box, residual_terms=residual_terms, method=method
    )
    if combined_slip is not False:
        few = objective_of(vehicle, several, _THINNED, residual_terms=residual_terms)
        free, box, p, noise = _ellipse(few, free, box, p, noise, combined_slip, method)
    whole = objective_of(vehicle, several, residual_terms=residual_terms)
    for left in reversed(range(BETTER_FOUND)):
        passed, noise, _ = settle(whole, p, noise, box, method=method, parameters_first=True)
        p, noise, _ = settle_finely(whole, passed, noise, box)
        fit = _summary(vehicle, several, whole, p, noise, box, free, table)
        fit = _with_rivals(fit, whole, rivals, box, None if profiles else passed)
        ahead = min(fit.rivals, key=lambda rival: rival.lost, default=None)
        if ahead is not None and ahead.lost < 0.0 and left:
            rivals = [p, *(r.parameters for r in fit.rivals if r is not ahead)]
            p = ahead.parameters
            continue
        if not profiles:
            fit = replace(fit, bent=bent_of(fit, whole, box))
            break
        estimates, found, better = profiled_estimates(whole, p, noise, box, fit, workers, progress)
        fit = replace(fit, estimates=estimates, profiles=found)
        if better is None:
            break
        p = better
    warn_of_ellipse(fit, whole, box)
    return fit


def _ellipse(
    objective: Objective,
    free: tuple[str, ...],
    box: Box,
    p: FloatArray,
    noise: FloatArray,
    wanted: bool | None,
    method: str,
) -> tuple[tuple[str, ...], Box, FloatArray, FloatArray]:
    """With the friction ellipse, where that is wanted or the likelihood asks for it."""
    asked, p, noise = asks_for_ellipse(objective, p, noise, box, method)
    if not (asked or wanted):
        return free, box, p, noise
    return (*free, ELLIPSE), with_ellipse(box), p, noise


def _between_samples(
    vehicle: GreyBoxVehicle,
    logs: tuple[TyreLog, ...],
    p: FloatArray,
    noise: FloatArray,
    box: Box,
    *,
    residual_terms: bool,
    method: str,
) -> tuple[tuple[TyreLog, ...], FloatArray, FloatArray]:
    """Logs of which it is said what inputs do between samples: what the likelihood prefers.

    Held inputs act half a sample later than those that move. Where the car answers within some
    samples the wrong choice is taken for another stiffness.
    """
    told = {log.inputs_held for log in logs} - {None}
    if len(told) == 1:
        (held,) = told
        return tuple(replace(log, inputs_held=held) for log in logs), p, noise
    found = []
    for held in (True, False):
        chosen = tuple(replace(log, inputs_held=held) for log in logs)
        thin = objective_of(vehicle, chosen, _THINNED, residual_terms=residual_terms)
        there, its, _ = settle(thin, p, noise, box, method=method, parameters_first=True)
        found.append((thin.log_likelihood(there, its), chosen, there, its))
    return max(found, key=lambda one: one[0])[1:]


def _summary(
    vehicle: GreyBoxVehicle,
    logs: tuple[TyreLog, ...],
    objective: Objective,
    p: FloatArray,
    noise: FloatArray,
    box: Box,
    free: tuple[str, ...],
    ends: Starts,
) -> TyreFit:
    """Result with the uncertainties that the information matrix gives."""
    gains = objective.freeze(p, noise)
    _, _, information = objective.normal_equations(p, gains, box.columns)
    estimates, covariance = wald(free, UNITS, p[box.columns], information, box)
    driven = tyre_problem(vehicle, logs, residual_terms="P1" in free)
    return TyreFit(
        vehicle,
        logs,
        p,
        estimates,
        covariance,
        noise,
        float(gains.log_likelihood),
        ends,
        _driven(vehicle, logs, driven.motion(p, noise)),
    )


def _with_rivals(
    fit: TyreFit,
    objective: Objective,
    rivals: Sequence[FloatArray],
    box: Box,
    passed: FloatArray | None = None,
) -> TyreFit:
    """Add the other optima that the data cannot rule out at 95 %.

    `passed` is a point on the way to the optimum: where the valley bends, the information matrix
    at its bottom does not reach there. A profile follows the bend and needs no such point.
    """
    kept = []
    best = fit.log_likelihood - objective.prior_cost(fit.parameters)

    def keep(p: FloatArray, value: float) -> None:
        apart = (p - fit.parameters)[box.columns]
        # What lies on the same slope is in the interval already.
        beyond = float(apart @ np.linalg.solve(fit.covariance, apart)) > _BEYOND
        if value > best - _LEVEL_NATS and beyond:
            gains = objective.freeze(p, fit.noise)
            _, _, information = objective.normal_equations(p, gains, box.columns)
            kept.append(Rival(p, best - value, box_covariance(information, box, p[box.columns])))

    for p in rivals:
        there, value = descend(objective, p, fit.noise, box)
        if value > best - _HOPELESS:
            there, value = bottom(objective, there, fit.noise, box)
        keep(there, value)
    if passed is not None:
        keep(passed, objective.log_likelihood(passed, fit.noise))
    return replace(fit, rivals=tuple(kept))


def _driven(
    vehicle: GreyBoxVehicle, logs: Sequence[TyreLog], states: FloatArray
) -> tuple[float, float]:
    steer = np.concatenate([log.inputs[:, 1] for log in logs])
    v_x, v_y, r = np.maximum(states[:, 0], 1.0), states[:, 1], states[:, 2]
    slips = slip_angles(vehicle.lf_m, vehicle.lr_m, steer, v_x, v_y, r)
    front, rear = (float(np.percentile(np.abs(a), 99.5)) for a in slips)
    return front, rear


def _check_loads(logs: Sequence[TyreLog], vehicle: GreyBoxVehicle) -> None:
    """Refuse axle loads in another unit; wings may double them, and a paper may halve them."""
    weight_n = vehicle.mass_kg * GRAVITY_MPS2
    for log in logs:
        loads_n = float(np.median(log.inputs[:, 2:].sum(axis=1)))
        if not weight_n / _LOADS < loads_n < _LOADS * weight_n:
            raise InvalidInput(
                f"{log.name}: the axle loads are {loads_n:.4g} N together, where the car weighs "
                f"{weight_n:.4g} N; give both in newtons, and the mass of the car that was driven"
            )


def _check(logs: tuple[TyreLog, ...], method: str, starts: int, seed: int) -> None:
    if not logs:
        raise InvalidInput("no log was given; pass one TyreLog or a list of them")
    if method not in METHODS:
        raise InvalidInput(f"no optimiser is called '{method}'; there are {', '.join(METHODS)}")
    whole(starts, "starts", 1)
    whole(seed, "seed")
    if len({log.inputs_held for log in logs} - {None}) > 1:
        held = next(log.name for log in logs if log.inputs_held)
        raise InvalidInput(
            f"{held}: inputs_held is True, of other logs False; identify from logs of one kind, or "
            "leave it out"
        )
    if len({log.force_known for log in logs}) > 1:
        without = next(log.name for log in logs if not log.force_known)
        raise InvalidInput(
            f"{without}: no wheel force (fx_n), which other logs have; identify from logs of one "
            "kind, or leave fx_n out of all"
        )
    blind = [log.name for log in logs if not log.sideslip_measured]
    if blind:
        warn(
            f"{', '.join(blind)}: v_y is not measured; coefficients that only it tells have wide "
            "intervals"
        )


def _regression(vehicle: GreyBoxVehicle, logs: Sequence[TyreLog]) -> Search:
    """Search of B, C, D, E on the smoothed motion of all logs."""
    motions = [TyreMotion.from_log(log) for log in logs]
    total = sum(m.n for m in motions)
    motion = TyreMotion.joined([m.thinned(max(1, _THINNED * m.n // total)) for m in motions])
    box = box_of(PARAMETERS[:8], {})

    def search(p: FloatArray) -> tuple[FloatArray, float]:
        end, loss = descend_regression(vehicle, motion, p, box)
        return end, -0.5 * loss

    return search


def _loose(logs: Sequence[TyreLog]) -> FloatArray:
    """Noise under which a filter follows the readings, whatever the tyres."""
    sensors = []
    for i, least in enumerate((0.02, 0.005, 0.002, 0.02)):
        seen = [white_noise_std(log.measurements[:, i]) for log in logs]
        sensors.append(max(max(seen), least))
    if not all(log.sideslip_measured for log in logs):
        sensors[1] = _KINEMATIC_VY
    return as_float64([*sensors, 0.03, 0.05, 0.05])
