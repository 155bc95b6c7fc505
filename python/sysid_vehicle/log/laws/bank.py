"""Roads that lean: of gravity along them no accelerometer feels anything."""

from __future__ import annotations

import math

import numpy as np

from ...vehicle import GRAVITY_MPS2
from .laws import EXCITED, Drive, spread_of
from .motion import Windows

_STEEPEST = 0.6  # sine of the bank of any track
_OF_TURNS = 0.9  # share of the windows that lean in which the car turns that way
_FOLLOWED_S = 4.0  # over which a lateral speed follows what is demanded of it, whatever its noise
_WINDOWS = 8  # of that length
_OF_A_ROAD = 0.15 * GRAVITY_MPS2  # m/s2, crossfall of public roads and more
_BEYOND = 3.0  # times the most that speeds of some spread change by, chance and biases included


def leans_deg(drive: Drive) -> float | None:
    """How far a road leans into its turns, as the lateral speed tells [deg].

    The lateral speed changes by more than the lateral acceleration and the yaw rate demand.

    Parameters
    ----------
    drive : Drive
        With `vy_mps`.

    Returns
    -------
    float or None
        None where that is no bank: hardly anything, steeper than any, to the outside, or on a
        straight.
    """
    c = drive.motion.channels
    turn = drive.mean(c["vx_mps"] * c["yaw_rate_radps"])
    beyond = drive.change(c["vy_mps"]) - (drive.mean(c["ay_mps2"]) - turn)
    most = float(np.quantile(np.abs(beyond), 0.98))
    if not EXCITED < most < _STEEPEST * GRAVITY_MPS2:
        return None
    leans = np.abs(beyond) > 0.5 * most
    inside = (beyond * np.sign(turn) > 0.0) & (np.abs(turn) > most)
    if float(np.mean(inside[leans])) < _OF_TURNS:
        return None
    return math.degrees(math.asin(most / GRAVITY_MPS2))


def wanders_deg(drive: Drive) -> float | None:
    """How far a road leans this way and that under a car that goes straight [deg].

    A driver who steers against such a road leaves next to no lateral speed, however much the
    accelerometer and the yaw rate demand: more in a few seconds than a speed of this spread, in
    whatever order its samples are, could change by.

    Parameters
    ----------
    drive : Drive
        With `vy_mps`.

    Returns
    -------
    float or None
        None where such a lateral speed could follow, or the road would be steeper than any.
    """
    c, rate_hz = drive.motion.channels, drive.motion.rate_hz
    vy = c["vy_mps"]
    windows = Windows(vy.size, max(1, round(0.5 * _FOLLOWED_S * rate_hz)), rate_hz)
    if windows.centres.size < _WINDOWS:
        return None
    turn = c["vx_mps"] * c["yaw_rate_radps"]
    demanded = windows.mean(c["ay_mps2"] - turn)
    most = float(np.quantile(np.abs(windows.change(vy) - demanded), 0.98))
    if spread_of(demanded) * _FOLLOWED_S < _BEYOND * math.sqrt(2.0) * float(np.std(vy)):
        return None
    return math.degrees(math.asin(most / GRAVITY_MPS2)) if most < _OF_A_ROAD else None
