"""Errors some seconds ahead where two models predict something else: elsewhere neither is told of.

A heavier car errs where it speeds up, a locked differential where it turns slowly. Over all blocks
of a lap alike such an effect takes nothing from most of them.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from ..._common.arrays import FloatArray, as_float64, spread_of_known
from ...estimate import MEASURED, Driving, equal_blocks, moving
from ...identify import Fit
from .fitted_range import Bools
from .horizons import PREDICTED, errors_ahead, explainable, lost_as_large


class Apart(NamedTuple):
    """Squares of errors of two models, and noise of the sensors.

    Attributes
    ----------
    squares : array, shape (2, blocks, errors)
        An error for each horizon and channel that is predicted; NaN where the models predict the
        same, or nothing.
    noise : array, shape (errors,)
        Variance of the sensor.
    """

    squares: FloatArray
    noise: FloatArray


def apart(
    one: Fit,
    other: Fit,
    driving: Driving,
    horizons_s: Sequence[float],
    channels: Collection[str],
    counted: Bools | None = None,
) -> Apart:
    """Work out errors some seconds ahead where two models differ.

    That is by the prediction of some channels, where it differs by a quarter at least of what it
    does over all the driving (`moving`), for each horizon by itself. Blocks hold equal times of
    that.

    Parameters
    ----------
    one, other : Fit
        The latter's noise starts every prediction.
    driving : Driving
    horizons_s : sequence of float
    channels : collection of str
        Those that count; where none of them is predicted, all.
    counted : array of bool, shape (horizons, samples), optional
        Predictions that count, by the sample at which they end; by default all.
    """
    noise = other.noise.floor()
    predicted = [c for c in explainable(driving) if c in driving.present]
    asked = [c for c in predicted if c in channels] or predicted
    columns = [PREDICTED.index(c) for c in asked]
    ahead, models = tuple(horizons_s), (one, other)
    errors = np.stack(
        [errors_ahead(fit, noise, driving, ahead, models)[..., columns] for fit in models]
    )
    if counted is not None:
        errors[:, ~counted] = np.nan
    differ = np.stack([_differ(e, asked, driving) for e in errors.swapaxes(0, 1)])
    there = ~np.any(np.isnan(errors), axis=0) & differ[..., None]
    starts = equal_blocks(as_float64(differ.mean(axis=0)), driving)
    found = np.add.reduceat(np.where(there, errors, 0.0) ** 2, starts, axis=2)
    count = np.add.reduceat(there.astype(float), starts, axis=1)
    with np.errstate(invalid="ignore", divide="ignore"):
        means = np.where(count > 0.0, found / count, np.nan)
    squares = lost_as_large(as_float64(means.swapaxes(1, 2)))
    seen = np.isfinite(squares).any(axis=(0, 1))
    sensor = np.array([noise.reading[MEASURED.index(c)] for c in asked]) ** 2
    return Apart(
        as_float64(squares[:, :, seen]),
        as_float64(np.broadcast_to(sensor, seen.shape)[seen]),
    )


def _differ(errors: FloatArray, channels: Sequence[str], driving: Driving) -> npt.NDArray[np.bool_]:
    """Where predictions of one horizon, (2, samples, channels), differ, by their typical errors."""
    known = ~np.any(np.isnan(errors), axis=0)
    spread = spread_of_known(np.column_stack([driving.channel(c) for c in channels]), axis=0)
    with np.errstate(invalid="ignore"):
        # What differs by more than the channel varies at all is lost, wherever it goes.
        by = np.minimum(np.nan_to_num(np.abs(errors[0] - errors[1]), nan=np.inf), spread)
        larger = np.minimum(np.max(np.abs(errors), axis=0), spread)
    sums = np.full(driving.samples, np.nan)
    for j in range(len(channels)):
        at = known[:, j]
        typical = float(np.median(larger[at, j])) if at.any() else 0.0
        if typical > 0.0:
            sums[at] = np.nan_to_num(sums[at]) + (by[at, j] / typical) ** 2
    return moving(as_float64(sums), driving)
