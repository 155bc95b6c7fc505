"""Channels that contradict the others: no effect of a car explains them.

A noise model learns whatever spread the prediction errors have, so that normalised errors never
look gross. What tells is the channel's own variance: readings that the other channels predict
worse than their own mean does have nothing to do with them, and readings that follow the
prediction at another scale are in another unit, or turned round. And the laws of motion, which need
no model of the car, tell what no model can be fitted to.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from .._common.arrays import FloatArray
from .._common.text import number
from ..effects import Effect, effect
from ..estimate import MEASURED, Driving
from ..estimate.inputs import white_noise_std

_IGNORANT = 2.0  # times the usual spread
_WORSE = 1.1  # of the channel's variance: a prediction that errs more is worse than the mean
_FELT = 0.1  # of the channel's variance, which a prediction must have to be called one
_SIGNAL = 0.5  # of the variance of a prediction: the rest is white noise
_ALIKE = 0.5  # square of the correlation, beyond which readings follow their prediction
_SCALES = (0.5, 2.0)


def unrelated(driving: Driving, innovation: FloatArray, spread: FloatArray) -> dict[str, str]:
    """Find the channels that contradict the others, and say how.

    Parameters
    ----------
    driving : Driving
    innovation : array, shape (samples, 5)
        Of a model with noise of its own: measurement less prediction.
    spread : array, shape (samples, 5)
        Expected standard deviation of that. Where it is large the filter knows nothing yet.

    Returns
    -------
    dict of str to str
        A sentence for each such channel, the worst first.
    """
    found: list[tuple[float, str, str]] = []
    for i, name in enumerate(MEASURED):
        y, e = driving.measured[:, i], innovation[:, i]
        there = np.isfinite(y) & np.isfinite(e)
        if there.any():
            there &= spread[:, i] < _IGNORANT * np.median(spread[there, i])
        if np.count_nonzero(there) < 3:
            continue
        y, e = y[there], e[there]
        predicted = y - e
        own, missed = float(np.var(y)), float(np.mean(e**2))
        # Where a channel hardly moves its prediction is noise of the other sensors.
        felt = float(np.var(predicted)) - white_noise_std(predicted) ** 2
        if own <= 0.0 or felt <= _SIGNAL * float(np.var(predicted)):
            continue
        slope = float(np.mean((y - y.mean()) * (predicted - predicted.mean()))) / felt
        alike = slope**2 * felt / own
        scaled = not _SCALES[0] < slope < _SCALES[1]
        if alike > _ALIKE and scaled and missed > _FELT * min(own, felt):
            told = f"{name}: reads {number(slope, 4)} times what the other channels predict"
            found.append((missed / own, name, f"{told}; check its unit and sign"))
        elif missed > _WORSE * own and felt > _FELT * own:
            told = f"{name}: the other channels predict it worse than its own mean does"
            found.append((missed / own, name, f"{told}; check what the column holds"))
    return {name: text for _, name, text in sorted(found, reverse=True)}


def incoherent(driving: Driving, effects: Iterable[str | Effect]) -> dict[str, str]:
    """Find the channels that break the laws of motion: wrong unit, sign, order or time.

    Effects that move forces seem to explain such readings: a yaw rate that is late looks like a
    larger yaw inertia.

    Parameters
    ----------
    driving : Driving
    effects : iterable of str or Effect
        Of the model; what they do themselves is no contradiction.

    Returns
    -------
    dict of str to str
        A sentence for each such channel.
    """
    breaks = {effect(e).breaks for e in effects}
    delayed: set[str] = {*MEASURED, "steer_rad"} if "readings late" in breaks else set()
    if "readings elsewhere" in breaks:
        # At constant speed an arm ahead of the others reads as a yaw rate that is early.
        delayed |= {"vy_mps", "yaw_rate_radps", "ay_mps2"}
    found: dict[str, str] = {}
    for log in driving.logs:
        for c in log.contradictions:
            # A car that answers late makes its steering early. None makes it late.
            answered = "answers late" in breaks and c.channel == "steer_rad" and c.late_s < 0.0
            if c.late_s and (answered or c.channel in delayed):
                continue
            if c.on_the_level and "on a slope" in breaks:
                continue
            found.setdefault(
                c.channel, f"{log.name}: {c.text}" if len(driving.logs) > 1 else c.text
            )
    return found
