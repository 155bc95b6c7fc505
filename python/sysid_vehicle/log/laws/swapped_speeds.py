"""Longitudinal and lateral speed in each other's columns."""

from __future__ import annotations

import numpy as np

from ..signals import least_speed_mps
from .laws import MIN_WINDOWS, Drive, Implausible, cosine
from .motion import Motion
from .over_ground import LEAST_RADPS, check_over_ground
from .regression import size_of

_FOLLOWS = 0.3  # cosine from which a sign is told


def check_swapped_speeds(motion: Motion) -> None:
    """Refuse speeds of which the lateral one is the larger, while the car turns.

    No car slides at more than 45 deg for most of a drive. Where it drives straight on, speeds over
    ground look like that, too.

    Raises
    ------
    Implausible
        The message names the signs that the columns have then, where the motion tells them.
    """
    c = motion.channels
    if "vy_mps" not in c:
        return
    vx, vy = motion.mean(c["vx_mps"]), motion.mean(c["vy_mps"])
    speed = np.hypot(vx, vy)
    moving = motion.usable & (speed > least_speed_mps(speed))
    if (
        np.count_nonzero(moving) < MIN_WINDOWS
        or np.mean(np.abs(vy) > np.abs(vx), where=moving) <= 0.5
    ):
        return
    drive = Drive(motion, moving)
    rate = drive.mean(c["yaw_rate_radps"])
    if size_of(rate) < LEAST_RADPS:
        return
    check_over_ground(drive)
    raise Implausible(
        "vx_mps",
        f"vx_mps and vy_mps: seem to be swapped: vy_mps is the larger one while the car turns, "
        f"{drive.place(rate)}; in the channel map name the column of vy_mps for vx_mps and that of "
        f"vx_mps for vy_mps{_signs(drive)}",
    )


def _signs(drive: Drive) -> str:
    """Which of the columns need a factor in their new places, in words."""
    c = drive.motion.channels
    forward = drive.mean(c["vy_mps"])
    backwards = float(np.median(forward)) < 0.0
    turn = drive.mean(c["vy_mps"] * c["yaw_rate_radps"]) * (-1.0 if backwards else 1.0)
    # Where a whole unit is turned its accelerations are swapped as well.
    readings = [drive.mean(c[name]) for name in ("ay_mps2", "ax_mps2") if name in c]
    lateral = max(readings, key=lambda a: abs(cosine(turn, a)))
    slide = np.sign(cosine(turn, lateral)) * lateral - turn
    along = cosine(drive.change(c["vx_mps"]), slide)
    turned = ["vx_mps"] * backwards + ["vy_mps"] * (along < -_FOLLOWS)
    said = f", with factor = -1 for {' and '.join(turned)}" if turned else ""
    if abs(along) < _FOLLOWS:
        said += "; check the sign of vy_mps then (ISO 8855: positive to the left)"
    return said
