"""Speeds over ground in place of those of the body: their direction turns with the car."""

from __future__ import annotations

import numpy as np

from ..._common.arrays import as_float64
from .laws import Drive, Implausible, cosine

WITH_THE_CAR = (0.8, 1.25)
"""Turns of the direction of motion for each of the car; those of the sideslip are far fewer."""

LEAST_RADPS = 0.03  # of the yaw rate, root mean square
_USUAL = 90.0  # percentile of the yaw rates
_CLOSELY = 0.9  # cosine from which both turns go together


def check_over_ground(drive: Drive) -> None:
    """Refuse `vx_mps` and `vy_mps` that are a velocity over ground.

    Raises
    ------
    Implausible
        If their direction turns as the yaw rate does, of whatever sign that is.
    """
    c = drive.motion.channels
    direction = as_float64(np.unwrap(np.arctan2(c["vy_mps"], c["vx_mps"])))
    turns, rate = drive.change(direction), drive.mean(c["yaw_rate_radps"])
    # A car that spins turns against its sideslip: not in most of a drive.
    usual = np.abs(rate) <= np.percentile(np.abs(rate), _USUAL)
    place, turns, rate = drive.place(rate), turns[usual], rate[usual]
    square = float(rate @ rate)
    if square < LEAST_RADPS**2 * rate.size or abs(cosine(turns, rate)) < _CLOSELY:
        return
    if WITH_THE_CAR[0] < abs(float(turns @ rate)) / square < WITH_THE_CAR[1]:
        raise Implausible(
            "vx_mps",
            f"vx_mps and vy_mps: are speeds over ground: their direction turns with the car, "
            f"{place}; name them east and north beside the heading in the table "
            f"[ground] of the channel map, or map a speed and leave vy_mps out",
        )
