"""Channels that contradict the others: no effect of a car explains them.

A noise model learns whatever spread the prediction errors have, so that normalised errors never
look gross. What tells is the channel's own variance: readings that the other channels predict
worse than their own mean does have nothing to do with them, and readings that follow the
prediction at another scale are in another unit, or turned round. And the laws of motion, which need
no model of the car, tell what no model can be fitted to.
"""

from __future__ import annotations

import numpy as np

from .._common.arrays import FloatArray
from .._common.text import number
from ..estimate import MEASURED, Driving, NoiseModel
from ..estimate.inputs import white_noise_std
from ..log import Contradiction, Log
from ..model import Model
from .clock import steering_on_time

_IGNORANT = 2.0  # times the usual spread
_WORSE = 1.1  # of the channel's variance: a prediction that errs more is worse than the mean
_FELT = 0.1  # of the channel's variance, which a prediction must have to be called one
_SIGNAL = 0.5  # of the variance of a prediction: the rest is white noise
_ALIKE = 0.5  # square of the correlation, beyond which readings follow their prediction
_SCALES = (0.5, 2.0)
_TIMES = 2.0  # of its own lag, which a model explains: of an arm 0.6 to 1.6 are seen
_LATERAL = ("vy_mps", "yaw_rate_radps", "ay_mps2")


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


def incoherent(driving: Driving, model: Model, noise: NoiseModel | None = None) -> dict[str, str]:
    """Find the channels that break the laws of motion: wrong unit, sign, order or time.

    Effects that move forces seem to explain such readings: a yaw rate that is late looks like a
    larger yaw inertia.

    Parameters
    ----------
    driving : Driving
    model : Model
        What its effects do themselves, with the values that they have, is no contradiction.
    noise : NoiseModel, optional
        Beside the model: neither is what a road does whose slope varies, where it has one, nor a
        lag of the steering that the likelihood does not see.

    Returns
    -------
    dict of str to str
        A sentence for each such channel.
    """
    found: dict[str, str] = {}
    for own in driving.each_log():
        log = own.logs[0]
        for c in log.contradictions:
            if not _explained(c, own, model, noise):
                text = f"{log.name}: {c.text}" if len(driving.logs) > 1 else c.text
                found.setdefault(c.channel, text)
    return found


def _explained(
    told: Contradiction, driving: Driving, model: Model, noise: NoiseModel | None
) -> bool:
    """Whether the model does what a log of `driving` is told for, or finds that it is not so."""
    if told.on_the_level:
        on_a_slope = any(e.breaks == "on a slope" for e in model.parts)
        if on_a_slope or (noise is not None and noise.sloping):
            return True
    if not told.late_s:
        return False
    if abs(told.late_s) <= _TIMES * _own_lag_s(model, told, driving.logs[0]):
        return True
    if noise is None or told.channel != "steer_rad":
        return False
    return steering_on_time(driving, model, noise, told.late_s)


def _own_lag_s(model: Model, told: Contradiction, log: Log) -> float:
    """By how much the effects of a model shift the time of a channel themselves [s]."""
    shifting = {"readings late"} if told.channel in (*MEASURED, "steer_rad") else set()
    if told.channel in _LATERAL:
        # At constant speed an arm ahead of the others reads as a yaw rate that is early.
        shifting.add("readings elsewhere")
    if told.channel == "steer_rad" and told.late_s < 0.0:
        # A car that answers late makes its steering early. None makes it late.
        shifting.add("answers late")
    speed_mps = float(np.nanmedian(log["vx_mps"]))
    return sum(
        _shift_s(model.value(name), p.unit, speed_mps)
        for e in model.parts
        if e.breaks in shifting
        for name, p in e.named.items()
    )


def _shift_s(value: float, unit: str, speed_mps: float) -> float:
    """Time that a delay or a distance at this speed stands for; anything else has any."""
    if unit == "m":
        return abs(value) / speed_mps
    return abs(value) if unit == "s" else np.inf if value else 0.0
