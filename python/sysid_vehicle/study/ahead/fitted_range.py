"""Where tyres work as far as they were fitted: beyond, their curves are extrapolated.

What a model errs there its tyres do, with whatever effect beside them: that says of no effect
whether the car has it.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from ..._common.arrays import FloatArray, as_float64
from ..._common.memo import remembered
from ...errors import NumericalError
from ...estimate import Driving
from ...identify import Fit, driving_of
from ...identify.reached import RARE, slips
from ...rules import USUAL, Rules, share_of

Bools = npt.NDArray[np.bool_]


def within_fitted_range(
    fit: Fit, driving: Driving, horizons_s: Sequence[float], rules: Rules = USUAL
) -> Bools:
    """Find the predictions in which both axles stay within the slip angles that were fitted.

    Parameters
    ----------
    fit : Fit
    driving : Driving
        Of that of the fit itself, all is within.
    horizons_s : sequence of float
    rules : Rules

    Returns
    -------
    array of bool, shape (horizons, samples)
        By the sample at which a prediction ends. All, where all or none are within.
    """
    inside = fitted(fit, driving, rules)
    found = np.zeros((len(horizons_s), driving.samples), dtype=bool)
    if inside.all():
        return ~found
    beyond = np.concatenate([[0], np.cumsum(~inside)])
    for first, end, rate in driving.spans:
        for within, horizon in zip(found, horizons_s, strict=True):
            ahead = max(round(horizon * rate), 1)
            ends = np.arange(first + ahead, end)
            within[ends] = beyond[ends + 1] == beyond[ends - ahead]
    return found if found.any() else ~found


@remembered(16)
def fitted(fit: Fit, driving: Driving, rules: Rules = USUAL) -> Bools:
    """At which samples the slip angle of neither axle is larger than those that were fitted.

    One fitted sample in 200 may be an outlier, and is no measure. A model that is not shown to err
    more beyond (`Rules.explainable`, `Rules.bound`) holds there too: then all is within. So it is
    where a part no larger than `Rules.explainable` is beyond: medians do not see it.

    Parameters
    ----------
    fit : Fit
    driving : Driving
    rules : Rules

    Returns
    -------
    array of bool, shape (samples,)
        All samples of the driving of the fit, and where the model fails.
    """
    every = np.ones(driving.samples, dtype=bool)
    if driving is fit.driving:
        return every
    try:
        most = np.percentile(_slips(fit, fit.driving), RARE, axis=1)
        within = np.asarray((_slips(fit, driving) <= most[:, None]).all(axis=0))
        squares = _squares(fit, driving)
    except NumericalError:
        return every
    if not within.any() or not 1.0 - np.mean(within) > rules.explainable:
        return every
    beyond, inside = squares[~within], float(np.mean(squares[within]))
    least = np.mean(beyond) - rules.bound * np.std(beyond) / np.sqrt(len(beyond))
    return within if share_of(float(least), inside) > rules.explainable else every


@remembered(16)
def _slips(fit: Fit, driving: Driving) -> FloatArray:
    return slips(fit.model, fit.noise, driving_of(fit, driving))


def _squares(fit: Fit, driving: Driving) -> FloatArray:
    """Squared errors one step ahead in units of the noise floor, over all channels."""
    problem = driving_of(fit, driving).problem(fit.model)
    trace = problem.trace(fit.model.vector(), fit.noise.floor().vector(), False)
    return as_float64(np.sum(trace["whitened"] ** 2, axis=1))
