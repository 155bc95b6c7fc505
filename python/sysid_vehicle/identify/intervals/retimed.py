"""What parameters owe to the time of readings that were put right by an estimate.

A filter of a sensor that was undone, or a delay that was taken out, is known to within an error of
its own, which is the same in all of a log: no noise of the likelihood, and not averaged by more
driving. A fit goes with it by

    d = cov(d) F' (e(t + s) - e(t)),

one Gauss-Newton step, with e the residuals, s the standard error of the time and F the
sensitivities to the parameters.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ..._common.arrays import FloatArray
from ...estimate import Driving
from ...log import Log, Retimed


def pushes_of_time(driving: Driving, slope: Callable[[Driving], FloatArray]) -> FloatArray:
    """Change of the slope of a criterion for each time that is not sure, by one standard error.

    Parameters
    ----------
    driving : Driving
    slope : callable
        From this driving, or one of the same stretches whose readings differ, to the slope of the
        criterion of the fit by its free parameters, shape (n,); downhill.

    Returns
    -------
    array, shape (n, times)
        Its product with the inverse of the curvature is what the parameters change by.
    """
    times = dict.fromkeys(moved for log in driving.logs for moved in log.retimed)
    here = slope(driving)
    later = [driving.read_otherwise([_moved(log, t) for log in driving.logs]) for t in times]
    return np.array([slope(d) - here for d in later]).reshape(len(later), len(here)).T


def _moved(log: Log, by: Retimed) -> Log:
    """A log whose readings come a standard error earlier where they were moved by an estimate."""
    if by not in log.retimed:
        return log
    now = {}
    for channel in by.channels:
        change = np.gradient(log[channel]) * log.rate_hz * by.std_s
        now[channel] = log[channel] + np.where(np.isfinite(change), change, 0.0)
    return log.corrected(now, ())
