"""The sign of the lateral speed, by the slip of the rear axle in slow driving.

``vy / vx = d yaw_rate / vx - K ay + J d(yaw_rate)/dt + constant``, with the distance ``d`` of the
speed sensor ahead of the rear axle, the compliance ``K`` of that axle, and what turns the car with
its side force. Where the car hardly slides the change of ``vy`` drowns in gravity by roll and by
roads that lean; this law holds all the same.
"""

from __future__ import annotations

import numpy as np

from .laws import EXCITED, LINEAR_MPS2, Drive, fit, ones, spread_of, wrong_sign

_CLOSELY = 0.5  # coherence
_MANY = 60  # windows: in one corner a curvature and an acceleration say the same
_SURE = 5.0  # standard errors


def check_rear_axle(drive: Drive) -> None:
    """Refuse a `vy_mps` that has the sign of a car driven on rear tyres that pull it outwards.

    A sensor behind the rear axle turns the sign of the distance, rear wheels that steer may turn
    that of the compliance; both together are no car.

    Raises
    ------
    Implausible
        If both are turned round.
    """
    c = drive.motion.channels
    linear = np.abs(drive.motion.mean(c["ay_mps2"])) < LINEAR_MPS2
    drive = Drive(drive.motion, drive.rows & linear)
    if np.count_nonzero(drive.rows) < _MANY:
        return
    ay, speed = drive.mean(c["ay_mps2"]), drive.mean(c["vx_mps"])
    if spread_of(ay) < EXCITED:
        return
    curvature, side = drive.mean(c["yaw_rate_radps"]) / speed, drive.mean(c["vy_mps"]) / speed
    turning = drive.change(c["yaw_rate_radps"])
    found = fit(side, [curvature, ay, turning, ones(drive)], [np.inf] * 4)
    (ahead, compliance), sure = found.coefficients[:2], _SURE * found.deviations[:2]
    if found.coherence > _CLOSELY and ahead < -sure[0] and compliance > sure[1]:
        text = "goes against the yaw rate in slow corners and with ay_mps2 in quick ones"
        raise wrong_sign("vy_mps", text, drive.mean(c["vy_mps"]), drive)
