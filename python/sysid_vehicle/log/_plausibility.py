"""Wrong units and wrong signs, found by what the channels of a moving car must have in common.

The lateral acceleration of a car is ``ay = d(vy)/dt + vx * yaw_rate``, the longitudinal one
``ax = d(vx)/dt - vy * yaw_rate``; the other terms average out, so a ratio near a known unit factor
or a clear opposition betrays a channel.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from ..errors import InvalidInput
from ._channels import DEG, FloatArray
from ._grid import at
from ._signals import Relation, filled, median_of_five, relation, smoothed

_MOVING = 3.0  # in whatever unit vx has; only samples above are compared
_MIN_ACCELERATION = 0.5  # m/s2, below which noise and road bank could decide
_MIN_SLIDING = 0.2  # m/s2, the same for the change of vy, which is a small part of ay
_MIN_SECONDS = 1.0
_RATIO_BAND = 1.25
_MAX_STEER_RAD = 1.2
_MAX_APPARENT_WHEELBASE_M = 150.0

_YAW_DEG = ("yaw_rate_radps", "degrees per second", f"factor = {DEG}")
_AY_G = ("ay_mps2", "g", "factor = 9.80665")
_AX_G = ("ax_mps2", "g", "factor = 9.80665")
_VX_KMH = ("vx_mps", "km/h", "factor = 0.2777778")
_VX_MPH = ("vx_mps", "miles per hour", "factor = 0.44704")
_Slip = tuple[str, str, str]

_LATERAL_SLIPS: tuple[tuple[float, tuple[_Slip, ...]], ...] = (
    (math.pi / 180.0, (_YAW_DEG,)),
    (1.0 / 9.80665, (_AY_G,)),
    (1.0 / 3.6, (_VX_KMH,)),
    (0.44704, (_VX_MPH,)),
    (math.pi / 180.0 / 9.80665, (_YAW_DEG, _AY_G)),
    (math.pi / 180.0 / 3.6, (_YAW_DEG, _VX_KMH)),
    (1.0 / 9.80665 / 3.6, (_AY_G, _VX_KMH)),
    (math.pi / 180.0 / 9.80665 / 3.6, (_YAW_DEG, _AY_G, _VX_KMH)),
)
_LONGITUDINAL_SLIPS: tuple[tuple[float, tuple[_Slip, ...]], ...] = (
    (1.0 / 9.80665, (_AX_G,)),
    (1.0 / 3.6, (_VX_KMH,)),
    (0.44704, (_VX_MPH,)),
    (1.0 / 9.80665 / 3.6, (_AX_G, _VX_KMH)),
)


def check_units_and_signs(columns: Mapping[str, FloatArray], rate_hz: float) -> None:
    """Raise :class:`InvalidInput` for the first channel in a wrong unit or with a wrong sign.

    Parameters
    ----------
    columns : mapping of ndarray, shape (n,)
        Canonical channels on a uniform grid, `time_s` among them.
    rate_hz : float
        Rate of the grid.
    """
    time_s = columns["time_s"]
    _check_steer_size(columns["steer_rad"], time_s)
    vx = smoothed(columns["vx_mps"], round(0.2 * rate_hz))
    moving = np.abs(vx) > _MOVING
    if np.count_nonzero(moving) < _MIN_SECONDS * rate_hz:
        return
    if np.median(vx[moving]) < 0.0:
        raise InvalidInput(_wrong_sign("vx_mps", "is negative for most of the drive", vx, time_s))
    part = {
        name: smoothed(median_of_five(filled(values)), round(0.2 * rate_hz))[moving]
        for name, values in columns.items()
        if name != "time_s"
    }
    ramp = {
        name: np.gradient(smoothed(columns[name], round(0.3 * rate_hz)), 1.0 / rate_hz)[moving]
        for name in ("vx_mps", "vy_mps")
        if name in columns
    }
    where = time_s[moving]
    _check_lateral(part, where)
    _check_apparent_wheelbase(part, where)
    if "vy_mps" in part:
        _check_lateral_velocity(part, ramp["vy_mps"], where)
    _check_longitudinal(part, ramp["vx_mps"], where)


def _check_steer_size(steer: FloatArray, time_s: FloatArray) -> None:
    size = np.abs(median_of_five(filled(steer)))
    if size.max() > _MAX_STEER_RAD:
        i = int(np.argmax(size))
        raise InvalidInput(
            f"steer_rad: {steer[i]:.4g} at {at(i, time_s)} is no road-wheel angle in radians; if "
            f"it is in degrees, put factor = {DEG} in the channel map; if it is the angle of the "
            f"steering wheel, divide the factor by the steering ratio"
        )


def _check_lateral(part: Mapping[str, FloatArray], where: FloatArray) -> None:
    ay, turn = part["ay_mps2"], part["vx_mps"] * part["yaw_rate_radps"]
    steer = part["steer_rad"]
    if max(np.percentile(np.abs(ay), 95), np.percentile(np.abs(turn), 95)) < _MIN_ACCELERATION:
        return
    both = relation(turn, ay)
    steer_turn = relation(steer, turn)
    if both.opposed:
        # Two of the three channels agree; the third is the odd one out.
        odd = "ay_mps2" if steer_turn.cosine > 0.0 else "yaw_rate_radps"
        other = "yaw_rate_radps * vx_mps" if odd == "ay_mps2" else "ay_mps2"
        text = f"moves against both {other} and steer_rad"
        raise InvalidInput(_wrong_sign(odd, text, part[odd], where))
    if steer_turn.opposed and both.together:
        text = "moves against both yaw_rate_radps and ay_mps2"
        raise InvalidInput(_wrong_sign("steer_rad", text, steer, where))
    if both.together:
        _check_ratio(both, _LATERAL_SLIPS, "ay_mps2 / (vx_mps * yaw_rate_radps)", turn, where)


def _check_apparent_wheelbase(part: Mapping[str, FloatArray], where: FloatArray) -> None:
    """Refuse a steering angle that is small enough, but that the car hardly answers to."""
    turn, steer = part["yaw_rate_radps"], part["vx_mps"] * part["steer_rad"]
    answer = relation(turn, steer)
    excited = np.percentile(np.abs(part["ay_mps2"]), 95) > _MIN_ACCELERATION
    if excited and answer.together and answer.ratio > _MAX_APPARENT_WHEELBASE_M:
        i = int(np.argmax(np.abs(steer)))
        raise InvalidInput(
            f"steer_rad: {part['steer_rad'][i]:.4g} at t = {where[i]:.6g} s is too large for the "
            f"yaw rate of {turn[i]:.4g} rad/s there (a wheelbase of {answer.ratio:.0f} m would "
            f"answer so); if it is in degrees, put factor = {DEG} in the channel map"
        )


def _check_lateral_velocity(
    part: Mapping[str, FloatArray], ramp: FloatArray, where: FloatArray
) -> None:
    expected = part["ay_mps2"] - part["vx_mps"] * part["yaw_rate_radps"]
    if np.percentile(np.abs(ramp), 95) > _MIN_SLIDING and relation(ramp, expected).opposed:
        text = "changes against what ay_mps2 - vx_mps * yaw_rate_radps demands"
        raise InvalidInput(_wrong_sign("vy_mps", text, part["vy_mps"], where))


def _check_longitudinal(
    part: Mapping[str, FloatArray], ramp: FloatArray, where: FloatArray
) -> None:
    if np.percentile(np.abs(ramp), 95) < _MIN_ACCELERATION:
        return
    if "ax_mps2" in part:
        answer = relation(ramp, part["ax_mps2"])
        if answer.opposed:
            text = "moves against the change of vx_mps"
            raise InvalidInput(_wrong_sign("ax_mps2", text, part["ax_mps2"], where))
        if answer.together:
            _check_ratio(answer, _LONGITUDINAL_SLIPS, "ax_mps2 / (d vx_mps / dt)", ramp, where)
    if "fx_n" in part and relation(ramp, part["fx_n"]).opposed:
        text = "moves against the change of vx_mps"
        raise InvalidInput(_wrong_sign("fx_n", text, part["fx_n"], where))


def _check_ratio(
    found: Relation,
    slips: tuple[tuple[float, tuple[_Slip, ...]], ...],
    formula: str,
    driver: FloatArray,
    where: FloatArray,
) -> None:
    for ratio, channels in slips:
        if ratio / _RATIO_BAND < found.ratio < ratio * _RATIO_BAND:
            i = int(np.argmax(np.abs(driver)))
            units = " and ".join(
                f"{channel}: seems to be in {unit}" for channel, unit, _ in channels
            )
            remedy = " and ".join(f"{factor} for {channel}" for channel, _, factor in channels)
            raise InvalidInput(
                f"{units}: {formula} is {found.ratio:.3g} instead of about 1, most clearly around "
                f"t = {where[i]:.6g} s; put {remedy} in the channel map"
            )


def _wrong_sign(channel: str, what: str, values: FloatArray, where: FloatArray) -> str:
    i = int(np.argmax(np.abs(values)))
    return (
        f"{channel}: wrong sign: it {what}, most clearly around t = {where[i]:.6g} s "
        f"(ISO 8855: x forward, y and yaw to the left); put factor = -1 in the channel map"
    )
