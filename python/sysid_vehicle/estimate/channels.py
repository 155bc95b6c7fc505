"""Columns of a log that effects of users read: known inputs beside steering and wheel force."""

from __future__ import annotations

import numpy as np

from .._common.arrays import FloatArray, as_float64
from ..effects import Effect, channels_in_use
from ..errors import InvalidInput, near_names
from ..log import Log
from .inputs import quiet

_BRIDGED_S = 1.0  # holes up to this are interpolated,
_BRIDGED_PERIODS = 1.5  # or up to so many of the channel's own periods: a slow one has no holes


def logged_channels(log: Log, where: slice) -> FloatArray:
    """What the log holds of the channels in use, their white noise reduced as that of the steering.

    A channel is linear between its own samples, and held beyond its first and last. It is NaN where
    the log lacks it, and inside a hole that is too long to be bridged.

    Returns
    -------
    array, shape (n, channels in use)
    """
    columns = [_between_samples(log, name)[where] for name in channels_in_use()]
    calm = [quiet(c) if np.isfinite(c).all() else c for c in columns]
    n = len(log["time_s"][where])
    return as_float64(np.column_stack(calm) if calm else np.empty((n, 0)))


def has_channels(log: Log, where: slice, effect: Effect) -> bool:
    """Whether a stretch of a log holds what an effect of a user reads."""
    return all(
        log.has(name) and bool(np.isfinite(_between_samples(log, name)[where]).all())
        for name in effect.channels
    )


def check_channels(log: Log, where: slice, effects: tuple[Effect, ...]) -> None:
    """Refuse a log that lacks what effects of a model read.

    Raises
    ------
    InvalidInput
        The column is absent, holds no value, or has a hole that is too long.
    """
    for effect in effects:
        for name in effect.channels:
            if not log.has(name):
                raise InvalidInput(
                    f"{log.name}: the effect {effect.id} reads the column {name}"
                    f"{near_names(name, log.extras)}, which the log lacks; add the column, or drop "
                    "the effect"
                )
            lost = ~np.isfinite(_between_samples(log, name)[where])
            if lost.any():
                time_s = log["time_s"][where][lost]
                raise InvalidInput(
                    f"{log.name}: {name}, which the effect {effect.id} reads, holds no value from "
                    f"t = {time_s[0]:.6g} to {time_s[-1]:.6g} s; cut the log there with between, "
                    "or fill the column"
                )


def _between_samples(log: Log, name: str) -> FloatArray:
    if not log.has(name):
        return np.full(log.n, np.nan)
    values, time_s = log[name], log["time_s"]
    own = np.flatnonzero(np.isfinite(values))
    if own.size == 0:
        return np.full(log.n, np.nan)
    period = float(np.median(np.diff(time_s[own]))) if own.size > 1 else 0.0
    longest = max(_BRIDGED_S, _BRIDGED_PERIODS * period)
    filled = np.interp(time_s, time_s[own], values[own])
    nearest = np.searchsorted(time_s[own], time_s)
    before = time_s - time_s[own[np.clip(nearest - 1, 0, own.size - 1)]]
    after = time_s[own[np.clip(nearest, 0, own.size - 1)]] - time_s
    # Beyond the first and the last sample one of the two is negative, and the other tells.
    hole = np.where((before < 0.0) | (after < 0.0), np.maximum(-before, -after), before + after)
    filled[(hole > longest) & ~np.isfinite(values)] = np.nan
    return as_float64(filled)
