"""How a body swings that is pushed sideways, and what an IMU feels of it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import scipy

from ..._common.arrays import FloatArray, as_float64
from .equations import SWINGS, Readings

_DAMPING = 0.3  # of a body's roll; of cars 0.2 to 0.4
_SMOOTH_HZ = 4.0  # quicker than this no body rolls
_RATE_HZ = 100.0  # at which the oscillators run


def with_swings(readings: Readings) -> Readings:
    """The same readings of an accelerometer, with their `swings`.

    A body follows the lateral acceleration a as phi'' + 2 D w phi' + w^2 phi = w^2 k a. An IMU
    above the speed sensor feels its phi'', and so does one at its height: gravity by roll is g
    phi, and phi = k a - (phi'' + 2 D w phi') / w^2. The readings themselves, smoothed, stand for a.

    Parameters
    ----------
    readings : Readings
    """
    found = np.zeros((readings.values.size, len(SWINGS)))
    for stretch in np.unique(readings.stretch):
        own = np.flatnonzero(readings.stretch == stretch)
        time_s = readings.time_s[own]
        even = np.arange(time_s[0], time_s[-1] + 1.0 / _RATE_HZ, 1.0 / _RATE_HZ)
        pushed = _smooth(np.interp(even, time_s, readings.values[own]))
        for i, natural_hz in enumerate(SWINGS.values()):
            found[own, i] = np.interp(time_s, even, _swing(pushed, natural_hz))
    return replace(readings, swings=as_float64(found))


def _smooth(values: FloatArray) -> FloatArray:
    low = scipy.signal.butter(2, _SMOOTH_HZ, fs=_RATE_HZ, output="sos")
    if values.size <= 3 * 2 * (low.shape[0] + 1):
        return values
    return as_float64(scipy.signal.sosfiltfilt(low, values))


def _swing(pushed: FloatArray, natural_hz: float) -> FloatArray:
    """Second derivative of what follows as an oscillator, from rest where it is pushed at first."""
    w = 2.0 * np.pi * natural_hz
    b, a = scipy.signal.bilinear([w**2, 0.0, 0.0], [1.0, 2.0 * _DAMPING * w, w**2], fs=_RATE_HZ)
    return as_float64(scipy.signal.lfilter(b, a, pushed - pushed[0]))
