"""The slopes of the road that predictions of several models know."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ... import _core
from ..._common.arrays import FloatArray, as_float64
from ..._common.memo import remembered
from ...errors import NumericalError
from ...estimate import Driving, NoiseModel
from ...identify import Fit, driving_of


def held_together(models: Sequence[Fit], noise: NoiseModel) -> tuple[Fit, ...]:
    """Those of which the crossfall is told: none where there is only one, or the road is level."""
    several = tuple(dict.fromkeys(models))
    return several if len(several) > 1 and noise.sloping else ()


def told_by(
    model: Fit, between: Sequence[Fit], noise: NoiseModel, driving: Driving
) -> FloatArray | None:
    """Gravity along, as a model tells it, and across, as several do in the mean [m/s2].

    Drivers answer slopes: of predictions that do not know them a car that answers less errs less.
    What a smoother tells of a crossfall is not of the road alone: it takes a part of what its model
    errs sideways for one, by which that model would be predicted. Of the mean each model of a pair
    has half of what the other one errs, so that the one which errs more is predicted worse.

    Parameters
    ----------
    model : Fit
    between : sequence of Fit
        Those that are held against each other.
    noise : NoiseModel
        Of the smoothers.
    driving : Driving

    Returns
    -------
    array, shape (samples, 2), or None
        None where the road is level, where there is no other model, and where no model tells it.
    """
    models = held_together(between, noise)
    own = _told(model, noise, driving) if models else None
    found = [s[:, 1] for m in models if (s := _told(m, noise, driving)) is not None]
    if own is None:
        return None
    across = np.mean(found or [own[:, 1]], axis=0)
    return as_float64(np.column_stack([own[:, 0], across]))


def _told(model: Fit, noise: NoiseModel, driving: Driving) -> FloatArray | None:
    """What one model tells, remembered of short driving; None where it loses the car."""
    kept = driving.samples <= _core.TOLD_SAMPLES
    return (_told_remembered if kept else _told_worked_out)(model, noise, driving)


def _told_worked_out(model: Fit, noise: NoiseModel, driving: Driving) -> FloatArray | None:
    problem = driving_of(model, driving).problem(model.model)
    try:
        means = problem.smoothed_means(model.model.vector(), noise.vector())
    except NumericalError:
        return None
    slopes = means[:, -2:].copy()  # a view would hold all of the states
    return slopes if np.isfinite(slopes).all() else None


_told_remembered = remembered(16)(_told_worked_out)
