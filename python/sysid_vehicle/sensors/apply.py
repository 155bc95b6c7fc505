"""Putting the channels of a log right."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import scipy

from .._common.arrays import FloatArray, filled
from ..log import Log, Retimed, interpolated
from .faults import SensorFault
from .kinematics.equations import SLIPS
from .kinematics.slip import slips_of, smoothed

_SMOOTH_S = 0.2  # yaw acceleration is that of a parabola over this time
# What makes a channel late.
LATE = {
    "vx_mps": ("delay_vx_s",),
    "vy_mps": ("delay_vy_s",),
    "ax_mps2": ("lean_ax_s",),
    "ay_mps2": ("delay_ay_s", "lean_ay_s"),
}


def corrected(log: Log, found: Mapping[str, float]) -> tuple[dict[str, FloatArray], list[str]]:
    """Return the channels that change, and sentences on what was done.

    Parameters
    ----------
    log : Log
        As read.
    found : mapping of float
        Faults by the names of `SensorFault`; `lean_ax_s` and `lean_ay_s` are how late an axis is
        because gravity by pitch and roll is a part of it.
    """
    now: dict[str, FloatArray] = {}
    what: list[str] = []

    def values(channel: str) -> FloatArray:
        return now.get(channel, log[channel])

    if any(name in found for name in SLIPS) and log.has("ax_mps2"):
        known = np.isfinite(log["ax_mps2"])
        felt = smoothed(log["time_s"][known], log["ax_mps2"][known], log["time_s"])
        size, speed = np.array([found.get(name, 0.0) for name in SLIPS]), values("vx_mps")
        now["vx_mps"] = speed / (1.0 + slips_of(felt, speed) @ size)
        what.append("vx_mps: slip of the wheels taken out")
    for channel, names in LATE.items():
        late_s = sum(found.get(name, 0.0) for name in names)
        if late_s and log.has(channel):
            now[channel] = shifted(log["time_s"], values(channel), late_s)
            when = "later" if late_s > 0.0 else "earlier"
            what.append(f"{channel}: taken {1000.0 * abs(late_s):.3g} ms {when} in the file")
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


def retimed(log: Log, found: Mapping[str, float], faults: Sequence[SensorFault]) -> list[Retimed]:
    """How sure the times are by which `corrected` moves channels.

    Parameters
    ----------
    log : Log
    found : mapping of float
        As for `corrected`.
    faults : sequence of SensorFault
        With their standard errors.
    """
    std = {fault.name: fault.std for fault in faults}
    moved = []
    for channel, names in LATE.items():
        # How late an axis is because the body leans is told together with its delay.
        told = {name.replace("lean_", "delay_") for name in names if found.get(name)}
        error_s = max((std.get(name, 0.0) for name in told), default=0.0)
        if log.has(channel) and 0.0 < error_s < np.inf:
            moved.append(Retimed((channel,), error_s))
    return moved


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
        r = filled(now.get("yaw_rate_radps", log["yaw_rate_radps"]))
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


def shifted(time_s: FloatArray, values: FloatArray, delay_s: float) -> FloatArray:
    """Values that were written `delay_s` later; a hole stays one, beyond the ends is nothing.

    Between two samples stands what a signal of their bandwidth has there (`interpolated`).
    """
    known = np.flatnonzero(np.isfinite(values))
    if known.size < 2:
        return values
    shifted_to = time_s + delay_s
    result = interpolated(time_s[known], values[known], shifted_to)
    every = int(np.median(np.diff(known)))
    nearest = np.clip(np.searchsorted(time_s, shifted_to - 1e-9), 0, time_s.size - 1)
    there = np.isfinite(values) if every > 1 else np.isfinite(values[nearest])
    kept: FloatArray = np.where(there, result, np.nan)
    return kept
