"""The clock of the steering angle against that of the yaw rate: seconds apart, or running away."""

from __future__ import annotations

from itertools import combinations

import numpy as np

from ..._common.arrays import NORMAL_MAD, FloatArray
from ...errors import InvalidInput
from .laws import Contradiction
from .motion import Motion
from .steering import several_frequencies

_RATE_HZ = 10.0
_WINDOW_S, _EVERY_S = 20.0, 10.0
_REACH_S = 5.0
_CORNERS_MPS2 = 0.5  # spread of speed times yaw rate in a window that tells a lag
_FOLLOWS = 0.85  # correlation of steering and yaw rate at the right lag
_WORSE = 2.0  # times the misfit at the right lag, which there must be without one
_ALIKE = 1.2  # times the least misfit: of lags that fit so alike the smallest one is taken
_TINY = 1e-3
_MIN_WINDOWS = 3
_SCATTER_S = 0.15
_APART_S = 0.3
_DRIFT_S = 0.6  # over the log, where a constant delay mends too little
_CLEAR = 6.0  # deviations of single lags
# Of speed times yaw rate, that the lateral speed changes by beside the path of the rear axle: in a
# slide the driver steers against the turn, and steering and yaw rate tell no clock.
_SLIDES = 0.3
_UNDERSTEER_MPS2 = 1400.0  # square of the speed at which a usual car steers twice as much


def clock_notes(motion: Motion) -> list[Contradiction]:
    """Compare steering angle and yaw rate window by window, up to 5 s apart.

    Returns
    -------
    list of Contradiction
        One where the steering is early or late by more than 0.3 s throughout.

    Raises
    ------
    InvalidInput
        The lag drifts through the log, so that no constant delay mends it.
    """
    found = _lags_over_time(motion)
    if np.count_nonzero(np.abs(found[:, 1]) > _APART_S) < _MIN_WINDOWS:
        return []
    times, lags = found[:, 0], found[:, 1]
    drift = float(np.median([(b[1] - a[1]) / (b[0] - a[0]) for a, b in combinations(found, 2)]))
    middle = float(np.median(lags - drift * times))
    scatter = NORMAL_MAD * float(np.median(np.abs(lags - middle - drift * times)))
    if scatter > _SCATTER_S:
        return []
    begin, end = (middle + drift * t for t in (motion.time_s[0], motion.time_s[-1]))
    seen = abs(drift) * float(np.ptp(times))
    if seen > max(_DRIFT_S, _CLEAR * scatter):
        raise InvalidInput(
            f"steer_rad: its clock drifts against that of yaw_rate_radps: {_off(begin)} at "
            f"t = {motion.time_s[0]:.6g} s, {_off(end)} at t = {motion.time_s[-1]:.6g} s; put "
            f"steer_rad on the clock of the other channels before the log is read"
        )
    lag = float(np.median(lags))
    note = (
        f"steer_rad: {_off(lag)} against yaw_rate_radps over the whole log; put "
        f"delay_s = {lag:.2g} for steer_rad in the channel map, or set the clocks right"
    )
    return [Contradiction("steer_rad", note, lag)] if abs(lag) > _APART_S else []


def _off(lag: float) -> str:
    return f"{abs(lag):.2g} s {'late' if lag > 0.0 else 'early'}"


def _lags_over_time(m: Motion) -> FloatArray:
    """Return the time of each window that tells a lag, and that lag, both in s."""
    none = np.zeros((0, 2))
    every = max(1, round(m.rate_hz / _RATE_HZ))
    rate = m.rate_hz / every
    count = m.time_s.size // every
    width, reach = round(_WINDOW_S * rate), round(_REACH_S * rate)
    if count < width + 2 * reach or not several_frequencies(m):
        return none
    c = m.channels
    asked = c["steer_rad"] * c["vx_mps"] / (1.0 + c["vx_mps"] ** 2 / _UNDERSTEER_MPS2)
    steer, turn, speed, felt = (
        v[: count * every].reshape(count, every).mean(axis=1)
        for v in (asked, c["yaw_rate_radps"], c["vx_mps"], c["ay_mps2"])
    )
    found = []
    for start in range(reach, count - width - reach + 1, round(_EVERY_S * rate)):
        rows = slice(start, start + width)
        bend = speed[rows] * turn[rows]
        if float(np.std(bend)) < _CORNERS_MPS2 or _slides(felt[rows], bend, turn[rows]):
            continue
        alike = _correlations(steer[start - reach : start + width + reach], turn[rows])
        best = float(alike.max())
        if best < _FOLLOWS or -float(alike.min()) > best:
            continue
        lags = (np.arange(alike.size) - reach) / rate
        misfit = (1.0 - np.minimum(alike, 1.0)) / max(1.0 - best, _TINY)
        near = lags[misfit < _ALIKE]
        lag = float(near[np.argmin(np.abs(near))])
        inside = abs(lag) < _REACH_S - 2.0 / rate
        if not inside or (abs(lag) > _APART_S and misfit[reach] < _WORSE):
            continue
        found.append((m.time_s[(start + width // 2) * every], lag))
    return np.array(found) if found else none


def _slides(felt: FloatArray, bend: FloatArray, turn: FloatArray) -> bool:
    """Whether the lateral speed changes by more than the yaw rate makes it, ``vy = l r``."""
    slip = felt - bend
    columns = np.column_stack([np.gradient(turn), np.ones_like(turn)])
    rest = slip - columns @ np.linalg.lstsq(columns, slip, rcond=None)[0]
    return float(np.std(rest)) > _SLIDES * float(np.std(bend))


def _correlations(longer: FloatArray, turn: FloatArray) -> FloatArray:
    """Return the correlation of `turn` with each part of `longer`."""
    parts = np.lib.stride_tricks.sliding_window_view(longer, turn.size)
    parts = parts - parts.mean(axis=1, keepdims=True)
    level = turn - turn.mean()
    size = np.linalg.norm(parts, axis=1) * float(np.linalg.norm(level))
    result: FloatArray = parts @ level / np.maximum(size, 1e-12)
    return result
