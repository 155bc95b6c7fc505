"""Putting the channels of a log right."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import scipy

from .._arrays import FloatArray
from ..log import Log

__all__ = ["corrected"]

_SMOOTH_S = 0.2  # yaw acceleration is that of a parabola over this time


def corrected(log: Log, found: Mapping[str, float]) -> tuple[dict[str, FloatArray], list[str]]:
    """Return the channels that change, and sentences on what was done.

    Parameters
    ----------
    log : Log
        As read.
    found : mapping of float
        Faults by the names of `SensorFault`.
    """
    now: dict[str, FloatArray] = {}
    what: list[str] = []

    def values(channel: str) -> FloatArray:
        return now.get(channel, log[channel])

    for channel, name in (
        ("vx_mps", "delay_vx_s"),
        ("vy_mps", "delay_vy_s"),
        ("ay_mps2", "delay_ay_s"),
    ):
        if name in found and log.has(channel):
            now[channel] = _earlier(log["time_s"], values(channel), found[name])
            what.append(f"{channel}: taken {1000.0 * found[name]:.3g} ms later in the file")
    for channel, bias, gain in (
        ("yaw_rate_radps", "bias_yaw_rate_radps", "gain_yaw_rate"),
        ("vy_mps", "bias_vy_mps", ""),
    ):
        b, g = found.get(bias, 0.0), found.get(gain, 0.0)
        if (b or g) and log.has(channel):
            now[channel] = (values(channel) - b) / (1.0 + g)
            what.append(
                f"{channel}: bias of {b:.3g} and scale error of {100.0 * g:.3g} % taken out"
            )
    if log.has("ax_mps2"):
        _accelerations(log, found, now, what)
    elif "gain_ay" in found:
        now["ay_mps2"] = values("ay_mps2") / (1.0 + found["gain_ay"])
        what.append(f"ay_mps2: scale error of {100.0 * found['gain_ay']:.3g} % taken out")
    return now, what


def _accelerations(
    log: Log, found: Mapping[str, float], now: dict[str, FloatArray], what: list[str]
) -> None:
    names = ("gain_ax", "gain_ay", "imu_turn_rad", "imu_forward_m", "imu_left_m")
    if not any(name in found for name in names):
        return
    gx, gy, turn, lx, ly = (found.get(name, 0.0) for name in names)
    ax, ay = (now.get(c, log[c]) for c in ("ax_mps2", "ay_mps2"))
    if turn:
        # ax = (1 + gx) along + turn across, ay = (1 + gy) across - turn along
        scale = (1.0 + gx) * (1.0 + gy) + turn**2
        along, across = ((1 + gy) * ax - turn * ay) / scale, ((1 + gx) * ay + turn * ax) / scale
    else:
        along, across = ax / (1.0 + gx), ay / (1.0 + gy)
    if lx or ly:
        r = _filled(now.get("yaw_rate_radps", log["yaw_rate_radps"]))
        width = max(3, 2 * round(0.5 * _SMOOTH_S * log.rate_hz) + 1)
        smooth = scipy.signal.savgol_filter(r, width, 2)
        dr = scipy.signal.savgol_filter(r, width, 2, deriv=1, delta=1.0 / log.rate_hz)
        along = along + lx * smooth**2 + ly * dr
        across = across - lx * dr + ly * smooth**2
    if gx or turn or lx or ly:
        now["ax_mps2"] = along
    if gy or turn or lx or ly:
        now["ay_mps2"] = across
    done = [
        f"{text} {value:.3g}{unit}"
        for text, value, unit in (
            ("scale error of ax_mps2", 100.0 * gx, " %"),
            ("scale error of ay_mps2", 100.0 * gy, " %"),
            ("turn", np.degrees(turn), " deg"),
            ("place forward", lx, " m"),
            ("place to the left", ly, " m"),
        )
        if value
    ]
    what.append(f"ax_mps2, ay_mps2: taken out: {', '.join(done)}")


def _filled(values: FloatArray) -> FloatArray:
    known = np.flatnonzero(np.isfinite(values))
    return np.interp(np.arange(values.size), known, values[known])


def _earlier(time_s: FloatArray, values: FloatArray, delay_s: float) -> FloatArray:
    """Values that were written `delay_s` later; a hole stays one, beyond the ends is nothing."""
    known = np.isfinite(values)
    if np.count_nonzero(known) < 2:
        return values
    shifted = np.interp(time_s + delay_s, time_s[known], values[known], np.nan, np.nan)
    nearest = np.clip(np.searchsorted(time_s, time_s + delay_s - 1e-9), 0, time_s.size - 1)
    result: FloatArray = np.where(known[nearest], shifted, np.nan)
    return result
