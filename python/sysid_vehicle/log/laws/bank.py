"""Roads that lean into their turns: of gravity along them no accelerometer feels anything."""

from __future__ import annotations

import math

import numpy as np

from ...vehicle import GRAVITY_MPS2
from .laws import EXCITED, Drive

_STEEPEST = 0.6  # sine of the bank of any track
_OF_TURNS = 0.9  # share of the windows that lean in which the car turns that way


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
