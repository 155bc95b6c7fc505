"""How a body swings that is pushed sideways, and what an IMU feels of it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import scipy

from ..._common.arrays import FloatArray, as_float64
from .equations import SWINGS, Readings, predict
from .estimate import Estimate
from .motion import Stretch

_DAMPING = 0.3  # of a body's roll; of cars 0.2 to 0.4
_SMOOTH_HZ = 4.0  # quicker than this no body rolls
_RATE_HZ = 100.0  # at which the oscillators run


def with_swings(readings: Readings, found: Estimate) -> Readings:
    """The same readings of an accelerometer, with their `swings`.

    A body follows the lateral acceleration a as phi'' + 2 D w phi' + w^2 phi = w^2 k a. An IMU
    above the speed sensor feels its phi'', and so does one at its height: gravity by roll is g
    phi, and phi = k a - (phi'' + 2 D w phi') / w^2. What the sensor should have read, smoothed,
    stands for a: the readings themselves swing with their own noise, and would be explained by it.

    Parameters
    ----------
    readings : Readings
    found : Estimate
        Of the same stretches, of a body that does not swing.
    """
    still = {name: fault for name, fault in found.faults.items() if name not in SWINGS}
    push, _, _ = predict(readings, found.grid, found.x, still)
    swings = np.zeros((readings.values.size, len(SWINGS)))
    for stretch in np.unique(readings.stretch):
        own = np.flatnonzero(readings.stretch == stretch)
        time_s = readings.time_s[own]
        even, pushed = smooth(time_s, push[own])
        for i, natural_hz in enumerate(SWINGS.values()):
            swings[own, i] = np.interp(time_s, even, _swing(pushed, natural_hz))
    return replace(readings, swings=as_float64(swings))


def swings_as(
    part: Readings, some: Sequence[Stretch], whole: Readings, stretches: Sequence[Stretch]
) -> Readings:
    """The readings of a part of the driving, with the `swings` of the whole.

    Parameters
    ----------
    part, whole : Readings
        Of the stretches `some` and `stretches`, of which those of the part are pieces.
    some, stretches : sequence of Stretch
    """
    if whole.swings is None:
        return part
    swings = np.zeros((part.values.size, whole.swings.shape[1]))
    for number, piece in enumerate(some):
        own = part.stretch == number
        for other, stretch in enumerate(stretches):
            if stretch.log == piece.log and stretch.first_s <= piece.first_s < stretch.last_s:
                of = whole.stretch == other
                for i, swing in enumerate(whole.swings[of].T):
                    swings[own, i] = np.interp(part.time_s[own], whole.time_s[of], swing)
    return replace(part, swings=as_float64(swings))


def smooth(time_s: FloatArray, values: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Even times, and the values there without what is quicker than a body moves."""
    even = np.arange(time_s[0], time_s[-1] + 1.0 / _RATE_HZ, 1.0 / _RATE_HZ)
    values = np.interp(even, time_s, values)
    low = scipy.signal.butter(2, _SMOOTH_HZ, fs=_RATE_HZ, output="sos")
    if values.size > 3 * 2 * (low.shape[0] + 1):
        values = scipy.signal.sosfiltfilt(low, values)
    return as_float64(even), as_float64(values)


def _swing(pushed: FloatArray, natural_hz: float) -> FloatArray:
    """Second derivative of what follows as an oscillator, from rest where it is pushed at first."""
    w = 2.0 * np.pi * natural_hz
    b, a = scipy.signal.bilinear([w**2, 0.0, 0.0], [1.0, 2.0 * _DAMPING * w, w**2], fs=_RATE_HZ)
    return as_float64(scipy.signal.lfilter(b, a, pushed - pushed[0]))
