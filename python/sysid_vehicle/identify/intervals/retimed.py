"""What parameters owe to the time of readings that were put right by an estimate.

A filter of a sensor that was undone, or a delay that was taken out, is known to within an error of
its own, which is the same in all of a log: no noise of the likelihood, and not averaged by more
driving. A fit goes with it by

    d = cov(d) F' (e(t + s) - e(t)),

one Gauss-Newton step, with e the residuals, s the standard error of the time and F the
sensitivities to the parameters.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from ..._common.arrays import FloatArray
from ...estimate import Driving
from ...log import Log, Retimed
from ...model import Model


def pushes_of_time(
    model: Model, driving: Driving, p: FloatArray, gains: Any, columns: list[int]
) -> FloatArray:
    """Change of the likelihood's slope for each time that is not sure, by one standard error.

    Parameters
    ----------
    model : Model
    driving : Driving
    p : array, shape (parameters,)
        Of the core.
    gains : frozen gains
        Of the filter with these parameters.
    columns : list of int
        Of the free parameters.

    Returns
    -------
    array, shape (n, times)
        Its product with the covariance is what the parameters change by.
    """
    times = dict.fromkeys(moved for log in driving.logs for moved in log.retimed)
    if not times:
        return np.empty((len(columns), 0))

    def slope(of: Driving) -> FloatArray:
        found: FloatArray = of.problem(model).normal_equations(p, gains, columns)[1]
        return found

    here = slope(driving)
    later = [driving.read_otherwise([_moved(log, t) for log in driving.logs]) for t in times]
    return np.column_stack([slope(d) - here for d in later])


def _moved(log: Log, by: Retimed) -> Log:
    """A log whose readings come a standard error earlier where they were moved by an estimate."""
    if by not in log.retimed:
        return log
    now = {}
    for channel in by.channels:
        change = np.gradient(log[channel]) * log.rate_hz * by.std_s
        now[channel] = log[channel] + np.where(np.isfinite(change), change, 0.0)
    return log.corrected(now, ())
