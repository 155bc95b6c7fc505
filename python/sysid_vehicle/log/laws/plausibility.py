"""Wrong units, wrong signs and channels that do not belong together, by the laws of motion.

``d(vy)/dt = ay - vx yaw_rate`` and ``d(vx)/dt = ax + vy yaw_rate`` hold for every car. Each is
fitted robustly; the coefficient that should be one is compared, with its own uncertainty, with what
it would be in each unit that logs are written in. A unit is only called wrong if another one is
far likelier and fits.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from ..._common.arrays import FloatArray
from ...vehicle import GRAVITY_MPS2
from ..channels import DEG
from ..signals import least_speed_mps
from .bank import leans_deg, wanders_deg
from .clock import clock_notes
from .lags import lag_notes
from .laws import (
    AY_G,
    CLEARLY,
    EXCITED,
    LATERAL,
    LIKE_G_KMH,
    LIKE_G_MPH,
    LIKE_KMH,
    LIKE_MPH,
    MIN_WINDOWS,
    SCALE_STD,
    SPEED_UNITS,
    VX_KMH,
    VX_MPH,
    WINDOW_S,
    Contradiction,
    Drive,
    Implausible,
    KnownUnit,
    Slips,
    check_scale,
    cosine,
    fit,
    ones,
    spread_of,
    turns_as_steered,
    wrong_sign,
)
from .longitudinal import check_force, check_longitudinal, held_speed_note
from .motion import Motion
from .over_ground import check_over_ground
from .ranges import WHITE, blank, check_lost, check_ranges, dropouts
from .rear_axle import check_rear_axle
from .regression import in_most, size_of
from .sizes import check_sizes
from .swapped_speeds import check_swapped_speeds
from .wheelbase import check_steering, gripping, is_model_car

_REVERSES = (
    "vx_mps: the car reverses for most of the drive, and turns as it is steered; slip angles of a "
    "single-track model mean nothing backwards: give a log of driving forwards"
)
_SLIDING = 0.2  # m/s2, the same for the change of vy, which is a small part of ay
_ABOVE_NOISE = 6.0  # noise of the regressor itself makes every coefficient too small
_HOLDS = 0.2  # of what it demands: a law that holds this closely needs no regression

# Lever arms and roll bend the lateral speed more than the accelerations.
_SLIDE_STD = 0.35

_YAW_DEG = ("yaw_rate_radps", "degrees per second", f"factor = {DEG}")
_YAW_RPM = ("yaw_rate_radps", "rpm", "factor = 0.1047198")
_YAW_TURNS = ("yaw_rate_radps", "turns per second", "factor = 6.283185")
_AY_FEET = ("ay_mps2", "ft/s2", "factor = 0.3048")
_VY_KMH = ("vy_mps", "km/h", "factor = 0.2777778")
_VY_MPH = ("vy_mps", "miles per hour", "factor = 0.44704")
_VY_KNOTS = ("vy_mps", "knots", "factor = 0.5144444")
_VY_FEET = ("vy_mps", "feet per second", "factor = 0.3048")
_RAD, _G = math.pi / 180.0, GRAVITY_MPS2

_LATERAL_SLIPS: Slips = (
    (_RAD, (_YAW_DEG,)),
    (1.0 / _G, (AY_G,), ((math.pi / 30.0, (_YAW_RPM,)),)),
    (1.0 / 0.3048, (_AY_FEET,)),
    (2.0 * math.pi, (_YAW_TURNS,)),
    (1.0 / 3.6, (VX_KMH,), LIKE_KMH),
    (0.44704, (VX_MPH,), LIKE_MPH),
    (_RAD / _G, (_YAW_DEG, AY_G)),
    (_RAD / 3.6, (_YAW_DEG, VX_KMH)),
    (1.0 / _G / 3.6, (AY_G, VX_KMH), LIKE_G_KMH),
    (_RAD / _G / 3.6, (_YAW_DEG, AY_G, VX_KMH)),
    (0.44704 / _G, (AY_G, VX_MPH), LIKE_G_MPH),
)
_SLIDING_SLIPS: Slips = (
    (SPEED_UNITS["km/h"], (_VY_KMH,), ((SPEED_UNITS["ft/s"], (_VY_FEET,)),)),
    (SPEED_UNITS["mph"], (_VY_MPH,), ((SPEED_UNITS["knots"], (_VY_KNOTS,)),)),
)


def check_coherence(
    columns: Mapping[str, FloatArray], rate_hz: float, *, wheelbase_m: float | None = None
) -> list[Contradiction]:
    """Refuse channels in a wrong unit, with a wrong sign, or that belong to another drive.

    Parameters
    ----------
    columns : mapping of ndarray, shape (n,)
        Canonical channels on a uniform grid, `time_s` among them.
    rate_hz : float
        Rate of the grid.
    wheelbase_m : float, optional
        Of the car, where it is known: a model car needs little force.

    Returns
    -------
    list of Contradiction
        What looks implausible.

    Raises
    ------
    InvalidInput
        For the first channel that cannot be right; the message names channel, time and remedy.
    """
    implausible: list[Contradiction] = []
    clock: list[Contradiction] = []
    lost = {name: dropouts(name, values) for name, values in columns.items()}
    given, columns = columns, blank(columns, lost)
    motion = Motion(columns, rate_hz)
    motion.windows(WINDOW_S)
    check_swapped_speeds(motion)
    speed = motion.mean(motion.channels["vx_mps"])
    # In whatever unit it has.
    rows = motion.usable & (np.abs(speed) > least_speed_mps(np.abs(speed)))
    if np.count_nonzero(rows) < MIN_WINDOWS:
        return check_ranges(columns, rate_hz) + check_lost(given, lost)
    drive = Drive(motion, rows)
    model_car = is_model_car(drive, wheelbase_m)
    problem: Implausible | None = None
    try:
        implausible = check_ranges(columns, rate_hz, model_car=model_car)
    except Implausible as error:
        problem = error  # the unit, if it can be told, says more
    try:
        clock, doubtful = _check_laws(drive, model_car)
    except KnownUnit:
        raise
    except Implausible as error:
        raise problem or error from None
    if problem is not None:
        raise problem
    implausible += doubtful + check_lost(given, lost)
    if "fx_n" in columns:
        implausible += held_speed_note(drive)
    # Before lags are sought in shorter windows.
    bank_deg = leans_deg(drive) if "vy_mps" in columns else None
    return implausible + (clock or _beside_a_bank(lag_notes(motion), bank_deg))


def _beside_a_bank(notes: list[Contradiction], bank_deg: float | None) -> list[Contradiction]:
    """Notes on lags, which a road that leans into its turns brings about as well."""
    if bank_deg is None:
        return notes
    told = f"; a road that leans by up to {bank_deg:.2g} deg into its turns looks like that, too"
    return [
        replace(n, text=f"{n.text}{told}", on_the_level=True) if n.channel in LATERAL else n
        for n in notes
    ]


def contradictions(columns: Mapping[str, FloatArray], rate_hz: float) -> tuple[Contradiction, ...]:
    """Return what :func:`check_coherence` refuses or doubts, whatever car it was."""
    try:
        return tuple(c for c in check_coherence(columns, rate_hz) if not c.by_the_car)
    except Implausible as error:
        return (error.contradiction,)


def _check_laws(drive: Drive, model_car: bool) -> tuple[list[Contradiction], list[Contradiction]]:
    """Refuse what breaks a law; return notes on the clock of the steering, and on sizes."""
    channels = drive.motion.channels
    if "vy_mps" in channels:
        check_over_ground(drive)
    speed = drive.mean(channels["vx_mps"])
    if np.median(speed) < 0.0:
        steer, yaw_rate = drive.mean(channels["steer_rad"]), drive.mean(channels["yaw_rate_radps"])
        if turns_as_steered(speed, steer, yaw_rate):
            raise Implausible("vx_mps", _REVERSES)
        raise wrong_sign("vx_mps", "is negative for most of the drive", speed, drive)
    check_sizes(drive)
    _check_lateral(drive)
    clock = clock_notes(drive.motion)
    doubtful = [] if clock else check_steering(drive)
    if "vy_mps" in channels:
        doubtful += _check_sliding(drive)
        check_rear_axle(drive)
    # Without the lateral speed nothing tells what a slide takes from the speed.
    driven = drive if "vy_mps" in channels else gripping(drive)
    if driven is not None and "ax_mps2" in channels:
        check_longitudinal(driven)
    if driven is not None and "fx_n" in channels:
        doubtful += check_force(driven, model_car=model_car)
    return clock, doubtful


def _check_lateral(drive: Drive) -> None:
    c = drive.motion.channels
    turn, ay = drive.mean(c["vx_mps"] * c["yaw_rate_radps"]), drive.mean(c["ay_mps2"])
    if max(size_of(turn), size_of(ay)) < EXCITED:
        return
    slide = (
        [drive.change(c["vy_mps"])]
        if "vy_mps" in c
        else [drive.change(c["yaw_rate_radps"]), drive.change(c["vx_mps"] * c["ay_mps2"])]
    )
    spread = [np.inf, *[np.inf] * len(slide), 0.5]
    both = fit(ay, [turn, *slide, ones(drive)], spread)
    alone = cosine(turn, ay)
    if both.coherence < 0.3 and abs(alone) < 0.6 and max(spread_of(turn), spread_of(ay)) > CLEARLY:
        _refuse_lateral(drive, turn, ay)
    ratio, deviation = float(both.coefficients[0]), float(both.deviations[0])
    if alone < -0.5 and ratio < -3.0 * deviation and both.coherence > 0.3:
        # Two of the three channels agree; the third is the odd one out.
        steer = drive.mean(c["steer_rad"])
        odd = "ay_mps2" if cosine(steer, turn) > 0.0 else "yaw_rate_radps"
        other = "yaw_rate_radps * vx_mps" if odd == "ay_mps2" else "ay_mps2"
        text = f"moves against both {other} and steer_rad"
        raise wrong_sign(odd, text, drive.mean(c[odd]), drive)
    if (
        both.coherence > 0.6
        and ratio > 0.0
        and ("vy_mps" in c or in_most(ratio, turn, ay, 2.0 * EXCITED))
    ):
        formula = "ay_mps2 / (vx_mps * yaw_rate_radps)"
        slips = _LATERAL_SLIPS
        check_scale(ratio, deviation, SCALE_STD, slips, "ay_mps2", formula, turn, drive)


def _refuse_lateral(drive: Drive, turn: FloatArray, ay: FloatArray) -> None:
    """Say which of the channels does not follow the others, by what the steering asks for."""
    c = drive.motion.channels
    if "ax_mps2" in c:
        ax, ramp = drive.mean(c["ax_mps2"]), drive.change(c["vx_mps"])
        if cosine(turn, ax) > 0.8 and (spread_of(ay) < EXCITED or cosine(ramp, ay) > 0.3):
            raise Implausible(
                "ax_mps2",
                f"ax_mps2 and ay_mps2: seem to be swapped: ax_mps2 follows vx_mps * yaw_rate_radps "
                f"and ay_mps2 does not, {drive.place(turn)}; swap the two columns in the channel "
                f"map",
            )
    steer = drive.mean(c["steer_rad"])
    speed = drive.mean(c["vx_mps"])
    answers = {
        "yaw_rate_radps": abs(cosine(steer * speed, drive.mean(c["yaw_rate_radps"]))),
        "ay_mps2": abs(cosine(steer * speed**2, ay)),
    }
    odd = min(answers, key=lambda name: answers[name])
    other = "vx_mps * yaw_rate_radps" if odd == "ay_mps2" else "ay_mps2 / vx_mps"
    driver = turn if odd == "ay_mps2" else ay
    raise Implausible(
        odd,
        f"{odd}: does not follow {other}, as it must in every corner, {drive.place(driver)}; check "
        f"that the column holds what it says, in the order of time",
    )


def _check_sliding(drive: Drive) -> list[Contradiction]:
    c = drive.motion.channels
    slide = drive.change(c["vy_mps"])
    ay, turn = drive.mean(c["ay_mps2"]), drive.mean(c["vx_mps"] * c["yaw_rate_radps"])
    expected = ay - turn
    noise = drive.motion.noise
    speed = float(np.median(drive.mean(c["vx_mps"])))
    own = math.hypot(noise["ay_mps2"], speed * noise["yaw_rate_radps"]) / WINDOW_S**0.5
    if size_of(expected) < max(_SLIDING, _ABOVE_NOISE * own):
        return []
    # At one speed the change of yaw rate has the same shape, and a regression would have to choose.
    if spread_of(slide - expected) < _HOLDS * spread_of(expected):
        return []
    # The expected change is the small difference of two large readings, each with an own scale;
    # and where the speed is not measured at the centre of gravity the yaw rate adds to it.
    columns = [expected, turn, drive.change(c["yaw_rate_radps"]), ones(drive)]
    found = fit(slide, columns, [np.inf, 0.06, 1.0, np.inf])
    ratio, deviation = float(found.coefficients[0]), float(found.deviations[0])
    if ratio < -4.0 * deviation and found.coherence > 0.3:
        text = "changes against what ay_mps2 - vx_mps * yaw_rate_radps demands"
        raise wrong_sign("vy_mps", text, drive.mean(c["vy_mps"]), drive)
    # Of a channel in disorder nothing of the change is left, and it is white.
    lost = found.coherence < 0.1 and ratio + 5.0 * deviation < 0.8 and ratio < 0.3
    clear = spread_of(expected - found.coefficients[1] * turn) > CLEARLY
    if lost and (clear or drive.motion.disorder["vy_mps"] > WHITE):
        into_turns = leans_deg(drive)
        where = "into its turns" if into_turns is not None else "to either side"
        bank_deg = into_turns or wanders_deg(drive)
        if bank_deg is not None:
            text = (
                f"vy_mps: changes as on a road that leans by up to {bank_deg:.2g} deg {where}, "
                f"{drive.place(expected)}; if it does not, check that the column holds the lateral "
                f"speed, in the order of time"
            )
            return [Contradiction("vy_mps", text, on_the_level=True)]
        raise Implausible(
            "vy_mps",
            f"vy_mps: does not change as ay_mps2 - vx_mps * yaw_rate_radps demands, "
            f"{drive.place(expected)}; check that the column holds the lateral speed, in the "
            f"order of time, or leave it out",
        )
    if found.coherence > 0.5 and ratio > 0.0:
        formula = "(d vy_mps / dt) / (ay_mps2 - vx_mps * yaw_rate_radps)"
        slips = _SLIDING_SLIPS
        check_scale(ratio, deviation, _SLIDE_STD, slips, "vy_mps", formula, slide, drive)
    return []
