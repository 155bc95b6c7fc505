"""The friction filter, one reading at a time and over a record, and the smoother that goes with it.

The extended Kalman filter with pseudo-noise is that of R. Rudd, "Estimating the Mu Slip Curve via
Extended Kalman Filtering", The Mathematica Journal 11:1 (2008), doi:10.3888/tmj.11.1-5.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from ..._common.arrays import FloatArray, as_float64
from ..._common.typed import typed
from ...errors import InvalidInput
from .curve import TWO_PARAMETER, MuSlipCurve, MuSlipPrior
from .data import MuSlipData, at_least_one, check_noise, check_values
from .least_squares import noise_of
from .results import MuSlipRun, MuSlipSmoothed

_NOISE_FACTOR = 3.0  # Rudd, In[20]: keeps the truth inside the one-sigma contour


class MuSlipFilter:
    """The filter, one reading at a time.

    Parameters
    ----------
    noise_std : float
        Standard deviation of a friction reading.
    curve : MuSlipCurve
        Formula to fit.
    prior : MuSlipPrior, optional
        Of the parameters; that of the curve if left out. Starting at the high end works best.
    noise_factor : float
        The filter takes readings to be noisier than they are by this factor.
    pseudo_noise : bool
        Add the variance of the terms of second order to that of a reading.
    iterations : int
        Linearisations per reading; more than one is the iterated filter.
    drift_std : sequence of float, optional
        Random walk of each parameter per reading, for surfaces that change; none if left out.
    """

    @typed
    def __init__(
        self,
        noise_std: float,
        *,
        curve: MuSlipCurve = TWO_PARAMETER,
        prior: MuSlipPrior | None = None,
        noise_factor: float = _NOISE_FACTOR,
        pseudo_noise: bool = True,
        iterations: int = 1,
        drift_std: Sequence[float] | None = None,
    ) -> None:
        prior = prior or curve.prior
        self._core = curve.filter_type(
            curve.vector(prior.mean, "prior"),
            prior.covariance(),
            check_noise(noise_std) * _factor(noise_factor),
            pseudo_noise,
            at_least_one("iterations", iterations),
            _drift(curve, drift_std),
        )

    @typed
    def update(self, slip: float, mu: float) -> None:
        """Use one reading; a `mu` of NaN only lets the parameters drift.

        Raises
        ------
        InvalidInput
            If slip or friction cannot be; the filter is left as it was.
        """
        for name, value in (("slip", slip), ("mu", mu)):
            if not abs(value) <= 1.0:  # the common case, without an array
                check_values(name, np.array([value]), first=self.readings)
        self._core.update(slip, mu)

    @property
    def mean(self) -> FloatArray:
        """Parameters, shape (p,)."""
        return self._core.mean

    @property
    def covariance(self) -> FloatArray:
        """Their covariance, shape (p, p)."""
        return self._core.covariance

    @property
    def readings(self) -> int:
        """How many readings there were."""
        return self._core.readings


@typed
def mu_slip_ekf(
    data: MuSlipData,
    *,
    curve: MuSlipCurve = TWO_PARAMETER,
    prior: MuSlipPrior | None = None,
    noise_factor: float = _NOISE_FACTOR,
    pseudo_noise: bool = True,
    iterations: int = 1,
    passes: int = 1,
    drift_std: Sequence[float] | None = None,
) -> MuSlipRun:
    """Run the filter over all readings; the defaults are the published ones.

    Parameters are those of :class:`MuSlipFilter`. With `passes` above 1 the readings are used
    again, each time from the last estimate with the prior's covariance. That removes most of the
    bias. The covariance stays that of one pass, as it should: no reading is new.

    Raises
    ------
    InvalidInput
        If a setting makes no sense.
    NumericalError
        If the filter leaves the range of numbers; the message gives the sample.
    """
    prior = prior or curve.prior
    sensor_std = noise_of(data, curve)
    noise_std = sensor_std * _factor(noise_factor)
    start = curve.vector(prior.mean, "prior")
    for _ in range(at_least_one("passes", passes)):
        begun = start
        found = curve.kernels.filter(
            data.slip,
            data.mu,
            begun,
            prior.covariance(),
            noise_std,
            pseudo_noise,
            at_least_one("iterations", iterations),
            _drift(curve, drift_std),
        )
        start = found["mean"][-1].copy()
    name = "EKF" if iterations == 1 else "iterated EKF"
    return MuSlipRun(
        name if passes == 1 else f"{name}, pass {passes}",
        curve,
        data,
        (begun, prior.covariance()),
        found["mean"],
        found["covariance"],
        found["innovation"],
        found["innovation_variance"],
        noise_std**2 + found["pseudo_variance"],
        found["signal_before"],
        found["signal_after"],
        _drift(curve, drift_std),
        sensor_std,
    )


@typed
def mu_slip_smooth(
    data: MuSlipData,
    *,
    curve: MuSlipCurve = TWO_PARAMETER,
    prior: MuSlipPrior | None = None,
    drift_std: Sequence[float] | None = None,
    max_rounds: int = 50,
) -> MuSlipSmoothed:
    """Most probable parameters given all readings, by the iterated smoother.

    Readings count with their own noise: once the linearisation is made at the smoothed estimate,
    nothing is left that pseudo-noise would have to cover, and the covariance is honest.

    Raises
    ------
    InvalidInput
        If a setting makes no sense.
    NumericalError
        If a round leaves the range of numbers; the message gives the sample.
    """
    prior = prior or curve.prior
    found = curve.kernels.smooth(
        data.slip,
        data.mu,
        curve.vector(prior.mean, "prior"),
        prior.covariance(),
        noise_of(data, curve),
        True,
        _drift(curve, drift_std),
        at_least_one("max_rounds", max_rounds),
    )
    return MuSlipSmoothed(
        curve, data, found["mean"], found["covariance"], found["rounds"], found["converged"]
    )


def _drift(curve: MuSlipCurve, drift_std: Sequence[float] | None) -> FloatArray:
    drift = as_float64(drift_std if drift_std is not None else [0.0] * len(curve.parameters))
    if drift.shape != (len(curve.parameters),) or not (drift >= 0.0).all():
        raise InvalidInput(
            f"drift_std: {drift_std}; give one number of 0 or more for each of "
            f"{', '.join(curve.parameters)}"
        )
    if not np.isfinite(drift).all():
        raise InvalidInput("drift_std: a value is not finite; give numbers")
    return drift


def _factor(noise_factor: float) -> float:
    if not (math.isfinite(noise_factor) and noise_factor > 0.0):
        raise InvalidInput(f"noise_factor: {noise_factor:g} is not above 0; give 1 for the true")
    return noise_factor
