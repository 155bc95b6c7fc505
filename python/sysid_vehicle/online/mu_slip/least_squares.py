"""Least squares on all friction readings at once, what they can tell at best, and their noise."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from ..._common.arrays import FloatArray, as_float64
from ..._common.text import HALF_95
from ..._common.typed import typed
from ...errors import InvalidInput
from .curve import TWO_PARAMETER, MuSlipCurve
from .data import MuSlipData, at_least_one, check_noise, check_values
from .results import MuSlipEstimate, cautions, resting

_ROUNDS = 100  # of a fit with one parameter held


@typed
def mu_slip_fit(
    data: MuSlipData,
    *,
    curve: MuSlipCurve = TWO_PARAMETER,
    start: npt.ArrayLike | None = None,
    bounds: tuple[Sequence[float], Sequence[float]] | None = None,
    max_iterations: int = 100,
    corrected: bool = False,
) -> MuSlipEstimate:
    """Nonlinear least squares on all readings at once.

    Parameters
    ----------
    data : MuSlipData
    curve : MuSlipCurve
        `TWO_PARAMETER` or `MAGIC_FORMULA`.
    start : array_like, optional
        Where to begin. If left out the better of two results is given: from the mean of the
        curve's prior, and from the highest readings.
    bounds : tuple, optional
        Lower and upper limits; those within which the formula holds if left out.
    max_iterations : int
        Linearisations (Gauss-Newton, damped where that does not lower the sum of squares).
    corrected : bool
        Subtract the bias of second order (Box, J. R. Statist. Soc. B 33, 1971, p. 171).

    Raises
    ------
    InvalidInput
        If start or bounds make no sense, or the readings do not determine the parameters or their
        bias.
    """
    low, high = (
        curve.vector(b, "bounds") for b in bounds or (curve.kernels.LOWER, curve.kernels.UPPER)
    )
    if not (low < high).all():
        raise InvalidInput("bounds: a lower limit is not below its upper one; exchange them")
    prior = as_float64(curve.prior.mean)
    starts = [_highest(data, prior), prior] if start is None else [curve.vector(start, "start")]
    most = at_least_one("max_iterations", max_iterations)
    results = [curve.kernels.fit(data.slip, data.mu, s, low, high, most) for s in starts]
    results = [r for r in results if r["determined"]]
    if not results:
        raise InvalidInput(
            f"mu: the readings do not determine the {curve.name} curve; take readings on both "
            "sides of the peak"
        )
    found = min(results, key=lambda r: r["sum_of_squares"])
    freedom = max(1, int(found["used"]) - len(low))
    variance = found["sum_of_squares"] / freedom if data.noise_std is None else data.noise_std**2
    notes = [] if found["converged"] else [f"stopped after {counted(found['iterations'])}"]
    values = found["mean"]
    at_bound = resting(curve, values, low, high)
    notes += cautions(curve, data, values, at_bound)
    open_ = _left_open(data, curve, found, variance, (low, high)) if found["converged"] else ()
    open_ = tuple(name for name in open_ if name not in at_bound)
    notes += [
        f"{name}: the interval is too short, the readings allow values twice as far away; take "
        f"readings nearer the peak"
        for name in open_
    ]
    if corrected:
        values = values - variance * found["bias"]
        outside = (values < low) | (values > high)
        if outside.any():  # an expansion that goes there holds no longer
            name = curve.parameters[int(np.argmax(outside))]
            raise InvalidInput(
                f"mu: the bias of {name} takes it where it cannot be: the readings do not "
                f"determine the {curve.name} curve; take readings on both sides of the peak"
            )
    return MuSlipEstimate(
        "least squares, corrected" if corrected else "least squares",
        curve,
        values,
        variance * found["covariance"],
        tuple(notes),
        at_bound,
        open_,
    )


def _left_open(
    data: MuSlipData,
    curve: MuSlipCurve,
    found: Mapping[str, Any],
    variance: float,
    bounds: tuple[FloatArray, FloatArray],
) -> tuple[str, ...]:
    """Parameters that the readings leave open at twice the half-width of their interval.

    There the sum of squares, least over the other parameters, would be larger by four times what
    ends an interval of 95 %, were the curve straight; it is larger by less than that.
    """
    values, covariance = found["mean"], variance * found["covariance"]
    result = []
    for i, name in enumerate(curve.parameters):
        std = math.sqrt(covariance[i, i])
        for far in (values[i] - 2.0 * HALF_95 * std, values[i] + 2.0 * HALF_95 * std):
            at = min(max(far, bounds[0][i]), bounds[1][i])
            if name in result or abs(at - values[i]) <= HALF_95 * std:
                continue
            low, high = bounds[0].copy(), bounds[1].copy()
            low[i], high[i] = at - 1e-9 * std, at + 1e-9 * std
            start = values + covariance[:, i] / covariance[i, i] * (at - values[i])
            there = curve.kernels.fit(
                data.slip, data.mu, np.clip(start, low, high), low, high, _ROUNDS
            )
            if there["sum_of_squares"] - found["sum_of_squares"] < HALF_95**2 * variance:
                result.append(name)
    return tuple(result)


@typed
def mu_slip_cramer_rao(
    slip: npt.ArrayLike,
    values: npt.ArrayLike,
    noise_std: float,
    *,
    curve: MuSlipCurve = TWO_PARAMETER,
) -> FloatArray:
    """Smallest covariance (p, p) that an unbiased estimator of the parameters can have.

    Raises
    ------
    InvalidInput
        If a slip or the noise cannot be, or readings at these slips do not determine the
        parameters at all.
    """
    at = as_float64(np.atleast_1d(slip))
    check_values("slip", at)
    gradient = curve.points(at, values)[1]
    information = gradient.T @ gradient / check_noise(noise_std) ** 2
    scale = np.sqrt(np.diag(information))
    if (scale == 0.0).any() or np.linalg.cond(information / np.outer(scale, scale)) > 1e14:
        raise InvalidInput(
            "slip: readings at these slips do not determine the parameters; take readings on both "
            "sides of the peak"
        )
    return as_float64(np.linalg.inv(information))


def noise_of(data: MuSlipData, curve: MuSlipCurve) -> float:
    """Give the noise of a reading: as told, else from the residuals of a least-squares fit."""
    if data.noise_std is not None:
        return data.noise_std
    try:
        found = mu_slip_fit(data, curve=curve)
    except InvalidInput as failure:
        raise InvalidInput(
            f"noise_std: cannot be learnt, the readings do not determine the {curve.name} curve; "
            "give its value"
        ) from failure
    error = data.mu - curve.mu(data.slip, found.values)
    freedom = int(np.isfinite(error).sum()) - len(found.values)
    std = math.sqrt(float(np.nansum(error**2)) / max(freedom, 1))
    if freedom < 1 or std < 1e-9:
        raise InvalidInput(
            "noise_std: cannot be learnt, the curve goes through all readings; give its value"
        )
    return std


def counted(iterations: int) -> str:
    """Say how many iterations."""
    return f"{iterations} iteration{'' if iterations == 1 else 's'}"


def _highest(data: MuSlipData, prior: FloatArray) -> FloatArray:
    """Start at the middle of the highest tenth of the readings."""
    there = np.flatnonzero(np.isfinite(data.mu))
    order = np.argsort(-np.abs(data.mu[there]))
    top = there[order[: max(3, len(there) // 10)]]
    start = prior.copy()
    start[0] = max(float(np.median(np.abs(data.mu[top]))), 1e-3)
    start[1] = min(max(float(np.median(np.abs(data.slip[top]))), 5e-3), 1.0)
    return start
