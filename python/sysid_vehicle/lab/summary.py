"""From an optimum to a result: uncertainties, rivals, how far the tyres slipped."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from .._arrays import FloatArray
from ..identify.estimates import box_covariance, wald
from ..identify.objective import Objective
from ..identify.search import Box
from ..identify.settle import bottom, descend
from ..identify.starts import Starts
from .tyre_data import GreyBoxVehicle, TyreLog, tyre_problem
from .tyre_fit import UNITS, Rival, TyreFit

_LEVEL_NATS = 1.92  # half the 95 % quantile of chi-square with one degree of freedom
_HOPELESS = 5.0  # nats that the way to the bottom of a valley does not gain
_BEYOND = 25.0  # squared distance in standard deviations


def summary(
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
    return TyreFit(
        vehicle,
        logs,
        p,
        estimates,
        covariance,
        noise,
        float(gains.log_likelihood),
        ends,
        _driven(vehicle, logs, tyre_problem(vehicle, logs).states(p, gains)),
    )


def with_rivals(
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
        gains = objective.freeze(passed, fit.noise)
        keep(passed, gains.log_likelihood - objective.prior_cost(passed))
    return replace(fit, rivals=tuple(kept))


def _driven(
    vehicle: GreyBoxVehicle, logs: Sequence[TyreLog], states: FloatArray
) -> tuple[float, float]:
    steer = np.concatenate([log.inputs[:, 1] for log in logs])
    v_x = np.maximum(states[:, 0], 1.0)
    front = steer - np.arctan((states[:, 1] + vehicle.lf_m * states[:, 2]) / v_x)
    rear = -np.arctan((states[:, 1] - vehicle.lr_m * states[:, 2]) / v_x)
    high = [float(np.percentile(np.abs(a), 99.5)) for a in (front, rear)]
    return high[0], high[1]
