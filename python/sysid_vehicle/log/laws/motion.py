"""Means and changes of channels over short windows, in which kinematics hold without derivatives.

Over a window of any length the change of a speed equals the mean of its acceleration times the
length, exactly. Both sides go through the same filter, so that no ratio is bent by smoothing.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from ..._common.arrays import FloatArray, filled
from ..grid import own_period
from ..signals import disorder, median_of_five, white_noise

_RATE_HZ = 50.0  # enough for what a car does; quicker logs are averaged down
_MEDIAN_ABOVE_HZ = 40.0  # below, a median of five samples would take movement for spikes
_KNOWN_S = 0.1  # a value counts as known so close to a sample


class Windows:
    """Windows of samples, each half over the next."""

    def __init__(self, samples: int, half: int, rate_hz: float) -> None:
        self.half, self.rate_hz = half, rate_hz
        self.centres = np.arange(half, samples - half, half)

    def mean(self, values: FloatArray) -> FloatArray:
        """Return the mean over each window (trapezoids)."""
        area = np.concatenate(([0.0], np.cumsum(0.5 * (values[1:] + values[:-1]))))
        over = area[self.centres + self.half] - area[self.centres - self.half]
        result: FloatArray = over / (2.0 * self.half)
        return result

    def change(self, values: FloatArray) -> FloatArray:
        """Return the mean rate of change over each window [1/s]."""
        over = values[self.centres + self.half] - values[self.centres - self.half]
        result: FloatArray = over / (2.0 * self.half) * self.rate_hz
        return result


class Motion:
    """Channels of a log at a moderate rate, with means and changes over windows.

    Parameters
    ----------
    columns : mapping of ndarray, shape (n,)
        Canonical channels on a uniform grid, `time_s` among them; NaN is missing.
    rate_hz : float
        Rate of the grid.

    Attributes
    ----------
    channels : dict of ndarray, shape (m,)
        Without spikes and holes, at `rate_hz`, with `time_s` beside.
    disorder : dict of float
        Share of a channel's variance that is white.
    noise : dict of float
        White noise of a channel's mean over one second.
    usable : ndarray of bool, shape (count,)
        Windows in which every channel is known.
    """

    def __init__(self, columns: Mapping[str, FloatArray], rate_hz: float) -> None:
        every = max(1, round(rate_hz / _RATE_HZ))
        time_s = columns["time_s"]
        count = time_s.size // every
        self.rate_hz = rate_hz / every
        self.time_s = _averaged(time_s, every, count)
        self.channels: dict[str, FloatArray] = {}
        self.disorder: dict[str, float] = {}
        self.noise: dict[str, float] = {}
        known = np.ones(count, dtype=bool)
        for name, values in columns.items():
            if name == "time_s":
                continue
            own = values[np.isfinite(values)]
            self.disorder[name] = disorder(own)
            # A mean over one second has the noise of one sample over the root of their number.
            per_second = rate_hz * own.size / values.size
            self.noise[name] = white_noise(own) / max(per_second, 1.0) ** 0.5
            dense = filled(values)
            if rate_hz > _MEDIAN_ABOVE_HZ:
                dense = median_of_five(dense)
            self.channels[name] = _averaged(dense, every, count)
            known &= _known(time_s, values)[: count * every : every]
        self._unknown = np.concatenate(([0.0], np.cumsum(~known)))
        self.windows(0.4)

    def windows(self, length_s: float) -> None:
        """Use windows of about `length_s` [s] from here on, each half over the next."""
        n = self.time_s.size
        half = min(max(1, round(0.5 * length_s * self.rate_hz)), max(1, (n - 1) // 2))
        self._windows = Windows(n, half, self.rate_hz)
        centres = self._windows.centres
        self.usable = self._unknown[centres + half + 1] - self._unknown[centres - half] == 0.0

    @property
    def count(self) -> int:
        """Number of windows."""
        return self._windows.centres.size

    @property
    def times_s(self) -> FloatArray:
        """Centres of the windows [s]."""
        return self.time_s[self._windows.centres]

    def at(self, name: str, lag_s: float = 0.0) -> FloatArray:
        """Return a channel as it would be if it were `lag_s` earlier."""
        return self.shifted(self.channels[name], lag_s)

    def shifted(self, values: FloatArray, lag_s: float) -> FloatArray:
        """Return samples from `lag_s` later, interpolated."""
        if lag_s == 0.0:
            return values
        whole = np.arange(values.size) + lag_s * self.rate_hz
        result: FloatArray = np.interp(whole, np.arange(values.size), values)
        return result

    def mean(self, values: FloatArray) -> FloatArray:
        """Return the mean over each window."""
        return self._windows.mean(values)

    def change(self, values: FloatArray) -> FloatArray:
        """Return the mean rate of change over each window [1/s]."""
        return self._windows.change(values)


def _averaged(values: FloatArray, every: int, count: int) -> FloatArray:
    if every == 1:
        return values
    averaged: FloatArray = values[: count * every].reshape(count, every).mean(axis=1)
    return averaged


def _known(time_s: FloatArray, values: FloatArray) -> np.ndarray:
    """Tell at which samples a channel has a value of its own nearby."""
    own = np.flatnonzero(np.isfinite(values))
    if own.size == values.size:
        return np.ones(values.size, dtype=bool)
    if own.size == 0:
        return np.zeros(values.size, dtype=bool)
    reach = max(_KNOWN_S, 1.01 * own_period(time_s, values))
    after = np.clip(np.searchsorted(own, np.arange(values.size)), 0, own.size - 1)
    before = np.clip(after - 1, 0, own.size - 1)
    apart = np.minimum(np.abs(time_s[own[after]] - time_s), np.abs(time_s - time_s[own[before]]))
    result: np.ndarray = apart <= reach
    return result
