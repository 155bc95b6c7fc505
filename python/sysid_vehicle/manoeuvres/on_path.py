"""Manoeuvres on a prescribed path, with a driver who follows it."""

from __future__ import annotations

import math
from collections.abc import Sequence

from .._common.arguments import check_positive
from .._common.typed import typed
from ..errors import InvalidInput
from .curves import Curvature, Knots, Pulse, Pulses, Sweep, constant
from .manoeuvre import Manoeuvre


@typed
def slalom(
    duration_s: float = 30.0,
    speed_mps: float = 18.0,
    lateral_mps2: float = 5.5,
    spacing_m: float = 30.0,
) -> Manoeuvre:
    """Around cones in a row.

    Parameters
    ----------
    duration_s : float
        Length, a second or more of straight running at either end included.
    speed_mps : float
        Speed.
    lateral_mps2 : float
        Highest lateral acceleration.
    spacing_m : float
        Distance between the cones, half a period of the path.
    """
    check_positive("slalom", speed_mps=speed_mps, lateral_mps2=lateral_mps2, spacing_m=spacing_m)
    frequency = speed_mps / (2.0 * spacing_m)
    return Manoeuvre(
        name="slalom",
        purpose="around cones in a row",
        duration_s=duration_s,
        speed_mps=constant(speed_mps, duration_s),
        lateral_mps2=Sweep.of_whole_periods(
            lateral_mps2, 1.0, duration_s - 2.0, frequency, frequency
        ),
    )


@typed
def double_lane_change(
    speeds_mps: Sequence[float] = (17.0, 21.0, 25.0),
    offset_m: float = 3.5,
    change_m: float = 46.0,
    between_m: float = 25.0,
) -> Manoeuvre:
    """To the next lane and back, in the manner of ISO 3888-1; at each speed first left, then right.

    Parameters
    ----------
    speeds_mps : sequence of float
        Speeds, one after the other.
    offset_m : float
        Distance between the lanes.
    change_m, between_m : float
        Length of a lane change, and of the straight between the two.

    Notes
    -----
    A full sine of the lateral acceleration with peak ``A`` and period ``T`` ends
    ``A T^2 / (2 pi)`` beside the old lane, parallel to it.
    """
    check_positive(
        "double_lane_change",
        speeds_mps=speeds_mps,
        offset_m=offset_m,
        change_m=change_m,
        between_m=between_m,
    )
    now, pulses = 1.0, []
    speed = [(0.0, speeds_mps[0])]
    for v in speeds_mps:
        if v != speed[-1][1]:
            old = speed[-1][1]
            speed.append((now, old))
            now += max(2.0, abs(v - old) / 2.0)
            speed.append((now, v))
            now += 1.0
        period = change_m / v
        size = 2.0 * math.pi * offset_m / period**2
        for side in (1.0, -1.0):
            for direction in (side, -side):
                pulses.append(Pulse(now, direction * size, 1.0 / period))
                now += period + between_m / v
            now += 1.0
    speed.append((now, speed[-1][1]))
    speed_t, speed_v = zip(*speed, strict=True)
    return Manoeuvre(
        name="double_lane_change",
        purpose="to the next lane and back",
        duration_s=now,
        speed_mps=Knots(speed_t, speed_v, smooth=True),
        lateral_mps2=Pulses(tuple(pulses)),
    )


@typed
def constant_radius(
    radius_m: float = 60.0, lateral_mps2: float = 8.4, duration_s: float = 60.0
) -> Manoeuvre:
    """Go round to the left, then to the right, each with slowly rising speed, as in ISO 4138.

    Parameters
    ----------
    radius_m : float
        Radius of the circles.
    lateral_mps2 : float
        Lateral acceleration at the end of each circle.
    duration_s : float
        Length of both together.
    """
    check_positive("constant_radius", radius_m=radius_m, lateral_mps2=lateral_mps2)
    if not duration_s > 24.0:
        raise InvalidInput(
            f"constant_radius: duration_s = {duration_s!r} is too short for slowly rising speed; "
            f"give more than 24 s"
        )
    top = math.sqrt(lateral_mps2 * radius_m)
    half = 0.5 * duration_s
    # At the limit the car leaves the circle before it brakes.
    rise_end, brakes, slowed = half - 7.0, half - 4.5, half - 0.5
    slow = max(4.0, 0.35 * top)
    bend = 1.0 / radius_m
    speed = ((0.0, slow), (3.0, slow), (rise_end, top), (brakes, top), (slowed, slow))
    curvature = ((0.0, 0.0), (0.5, 0.0), (3.0, bend), (rise_end + 0.5, bend), (brakes, 0.0))
    times = tuple(start + t for start in (0.0, half) for t, _ in speed)
    bends = tuple(start + t for start in (0.0, half) for t, _ in curvature)
    wanted = Knots(times, tuple(v for _ in range(2) for _, v in speed), smooth=True)
    path = Knots(bends, tuple(side * c for side in (1.0, -1.0) for _, c in curvature), smooth=True)
    return Manoeuvre(
        name="constant_radius",
        purpose="circles to both sides with slowly rising speed",
        duration_s=duration_s,
        speed_mps=wanted,
        lateral_mps2=Curvature(wanted, path),
    )


@typed
def brake_in_turn(
    radius_m: float = 100.0,
    lateral_mps2: float = 5.5,
    brake_mps2: Sequence[float] = (2.0, 3.5, 5.0),
) -> Manoeuvre:
    """Braking on a circle, in the manner of ISO 7975; each deceleration to both sides.

    Parameters
    ----------
    radius_m : float
        Radius of the circle.
    lateral_mps2 : float
        Lateral acceleration before braking.
    brake_mps2 : sequence of float
        Decelerations, one after the other.
    """
    check_positive(
        "brake_in_turn", radius_m=radius_m, lateral_mps2=lateral_mps2, brake_mps2=brake_mps2
    )
    fast = math.sqrt(lateral_mps2 * radius_m)
    slow = 0.6 * fast
    bend = 1.0 / radius_m
    now = 0.5
    speed, curvature = [(0.0, fast)], [(0.0, 0.0)]
    for brake in brake_mps2:
        for side in (1.0, -1.0):
            brakes = now + 3.0
            slowed = brakes + (fast - slow) / brake
            away = slowed + 1.5
            curvature += [(now, 0.0), (now + 1.5, side * bend), (slowed + 0.3, side * bend)]
            curvature += [(away, 0.0)]
            speed += [(brakes, fast), (slowed, slow), (away, slow)]
            now = away + (fast - slow) / 2.5
            speed += [(now, fast)]
            now += 0.5
    curvature.append((now, 0.0))
    speed_t, speed_v = zip(*speed, strict=True)
    curvature_t, curvature_v = zip(*curvature, strict=True)
    wanted = Knots(speed_t, speed_v)
    return Manoeuvre(
        name="brake_in_turn",
        purpose="braking on a circle",
        duration_s=now,
        speed_mps=wanted,
        lateral_mps2=Curvature(wanted, Knots(curvature_t, curvature_v, smooth=True)),
    )


@typed
def straight_acceleration(
    duration_s: float = 40.0, low_speed_mps: float = 10.0, top_speed_mps: float = 36.0
) -> Manoeuvre:
    """Straight on: full power, a rest at speed, a slow loss of speed, braking, and once more.

    Parameters
    ----------
    duration_s : float
        Length.
    low_speed_mps, top_speed_mps : float
        Speeds between which the car goes.
    """
    check_positive("straight_acceleration", duration_s=duration_s)
    rows = (
        (0.0, 0.0),
        (0.025, 0.0),
        (0.275, 1.0),
        (0.325, 1.0),
        (0.475, 0.85),
        (0.60, 0.05),
        (0.65, 0.05),
        (0.825, 0.65),
        (0.90, 0.6),
        (0.98, 0.0),
        (1.0, 0.0),
    )
    spread = top_speed_mps - low_speed_mps
    return Manoeuvre(
        name="straight_acceleration",
        purpose="power, slow loss of speed and braking on a straight road",
        duration_s=duration_s,
        speed_mps=Knots(
            tuple(t * duration_s for t, _ in rows),
            tuple(low_speed_mps + part * spread for _, part in rows),
            smooth=True,
        ),
        lateral_mps2=constant(0.0, duration_s),
    )
