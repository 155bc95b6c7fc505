"""From an optimum to a result: uncertainties, what is not determined, how far the tyres slipped."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from tqdm.auto import tqdm

from .._arrays import FloatArray, as_float64
from .._threads import Workers
from ..identify import Estimate
from ..identify.search import Box
from .descent import bottom, descend
from .likelihood import Likelihood
from .multistart import Ends
from .profile import Profile, Quantity, profile
from .tyre_data import GreyBoxVehicle, TyreLog
from .tyre_fit import AXLES, PARAMETERS, UNITS, Rival, TyreFit
from .tyre_shape import COMBINATIONS, slope_of

__all__ = ["box_covariance", "quantities", "summary", "with_profiles", "with_rivals"]

_SPREAD_OF_BOX = np.sqrt(1.0 / 12.0)  # standard deviation of a uniform over a box of width 1
_UNKNOWN = 0.2  # of the width
_LEVEL_NATS = 1.92  # half the 95 % quantile of chi-square with one degree of freedom
_HOPELESS = 5.0  # nats that the way to the bottom of a valley does not gain
_BEYOND = 25.0  # squared distance in standard deviations
_WIDE = 0.5  # of the width, for an interval


def summary(
    vehicle: GreyBoxVehicle,
    logs: tuple[TyreLog, ...],
    objective: Likelihood,
    p: FloatArray,
    noise: FloatArray,
    box: Box,
    free: tuple[str, ...],
    ends: Ends,
) -> TyreFit:
    """Result with the uncertainties that the information matrix gives."""
    gains = objective.problem.freeze(p, noise)
    _, _, information = objective.normal_equations(p, gains, box.columns)
    covariance = box_covariance(information, box, p[box.columns])
    width = box.upper - box.lower
    margin = 1e-6 * width
    estimates = []
    for i, name in enumerate(free):
        x, std = float(p[box.columns[i]]), float(np.sqrt(covariance[i, i]))
        at_bound = x <= box.lower[i] + margin[i] or x >= box.upper[i] - margin[i]
        unknown = std > _UNKNOWN * width[i]
        note = "not determined" if unknown else "at bound" if at_bound else ""
        estimates.append(Estimate(name, x, std, UNITS[name], note))
    states = objective.problem.states(p, gains)
    return TyreFit(
        vehicle,
        logs,
        p,
        tuple(estimates),
        covariance,
        noise,
        float(gains.log_likelihood),
        ends,
        _driven(vehicle, logs, states),
    )


def with_rivals(
    fit: TyreFit,
    objective: Likelihood,
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
            gains = objective.problem.freeze(p, fit.noise)
            _, _, information = objective.normal_equations(p, gains, box.columns)
            kept.append(Rival(p, best - value, box_covariance(information, box, p[box.columns])))

    for p in rivals:
        there, value = descend(objective, p, fit.noise, box)
        if value > best - _HOPELESS:
            there, value = bottom(objective, there, fit.noise, box)
        keep(there, value)
    if passed is not None:
        gains = objective.problem.freeze(passed, fit.noise)
        keep(passed, gains.log_likelihood - objective.prior_cost(passed))
    return replace(fit, rivals=tuple(kept))


def quantities(names: Sequence[str]) -> list[Quantity]:
    """Parameters of these names, and the combinations of both axles."""
    found = [_parameter(n) for n in names]
    for axle in AXLES:
        for name, (function, _) in COMBINATIONS.items():
            found.append(_combination(f"{name}_{axle}", 4 * AXLES.index(axle), function))
    return found


def _parameter(name: str) -> Quantity:
    column = PARAMETERS.index(name)
    return Quantity(
        name, lambda p: float(p[column]), lambda p: np.eye(len(p))[column], column=column
    )


def _combination(name: str, first: int, function: Callable[[FloatArray], float]) -> Quantity:
    def slope(p: FloatArray) -> FloatArray:
        out = np.zeros(len(p))
        out[first : first + 4] = np.nan_to_num(slope_of(function, p[first : first + 4]))
        return out

    return Quantity(name, lambda p: function(p[first : first + 4]), slope)


def with_profiles(
    fit: TyreFit, objective: Likelihood, box: Box, *, workers: int, progress: bool
) -> tuple[TyreFit, FloatArray | None]:
    """Replace the intervals by those of the profile likelihood.

    Returns
    -------
    fit : TyreFit
    better : array, shape (parameters,), or None
        A point of higher likelihood that was come upon.
    """
    gains = objective.problem.freeze(fit.parameters, fit.noise)

    def one(what: Quantity) -> tuple[Profile, FloatArray | None]:
        with np.errstate(over="ignore", invalid="ignore"):
            return profile(objective, fit.parameters, gains, box, fit.covariance, what)

    wanted = quantities([e.name for e in fit.estimates])
    with Workers(workers) as pool:
        found = list(
            tqdm(pool.map(one, wanted), total=len(wanted), desc="profiles", disable=not progress)
        )
    profiles = tuple(f for f, _ in found)
    width = dict(zip([e.name for e in fit.estimates], box.upper - box.lower, strict=True))
    estimates = tuple(
        replace(e, note=_note(e, f, width[e.name]))
        for e, f in zip(fit.estimates, profiles, strict=False)
    )
    better = [b for _, b in found if b is not None]
    return (
        replace(fit, estimates=estimates, profiles=profiles),
        max(better, key=lambda p: -objective.half_sum_of_squares(p, gains)) if better else None,
    )


def _note(estimate: Estimate, found: Profile, width: float) -> str:
    if found.high - found.low > _WIDE * width or (found.open_below and found.open_above):
        return "not determined"
    if found.open_below or found.open_above:
        return "no lower end" if found.open_below else "no upper end"
    return "" if estimate.note == "not determined" else estimate.note


def box_covariance(information: FloatArray, box: Box, x: FloatArray) -> FloatArray:
    """Covariance from the information of the data and that of having looked in the box only.

    Without the second, coefficients that copy each other would have no covariance at all, and the
    combinations that are known none either. It is that of a uniform over the box, about the
    estimate `x`: an estimate at a bound is further from the rest of the box than one amid it.
    """
    width = box.upper - box.lower
    spread = np.hypot(_SPREAD_OF_BOX * width, x - 0.5 * (box.lower + box.upper))
    per_std = 1.0 / spread
    total = information + np.diag(per_std**2)
    scale = np.sqrt(np.diag(total))
    inverse = np.linalg.inv(total / np.outer(scale, scale))
    return as_float64(0.5 * (inverse + inverse.T) / np.outer(scale, scale))


def _driven(
    vehicle: GreyBoxVehicle, logs: Sequence[TyreLog], states: FloatArray
) -> tuple[float, float]:
    steer = np.concatenate([log.inputs[:, 1] for log in logs])
    v_x = np.maximum(states[:, 0], 1.0)
    front = steer - np.arctan((states[:, 1] + vehicle.lf_m * states[:, 2]) / v_x)
    rear = -np.arctan((states[:, 1] - vehicle.lr_m * states[:, 2]) / v_x)
    high = [float(np.percentile(np.abs(a), 99.5)) for a in (front, rear)]
    return high[0], high[1]
