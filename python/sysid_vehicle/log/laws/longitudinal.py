"""The longitudinal law, ``d(vx)/dt = ax + vy yaw_rate``: speed, acceleration and wheel force."""

from __future__ import annotations

import numpy as np

from ..._common.arrays import FloatArray
from ...vehicle import GRAVITY_MPS2
from .lags import sideways
from .laws import (
    EXCITED,
    LIKE_G_KMH,
    LIKE_KMH,
    LIKE_MPH,
    SCALE_STD,
    VX_KMH,
    VX_MPH,
    Contradiction,
    Drive,
    Implausible,
    Slips,
    check_scale,
    cosine,
    fit,
    ones,
    spread_of,
    wrong_sign,
)
from .regression import Regression, size_of

_CLEARLY_RAMP, _CLEARLY_DRIVEN, _CLEARLY_FELT = (
    0.8,
    1.0,
    2.0,
)  # m/s2 beyond which channels must follow each other
_DRIVEN_MPS, _LEAST_FORCE_N = 12.0, 30.0  # at that speed drag takes more
_LIGHTEST_KG, _HEAVIEST_KG = 50.0, 1e5  # of cars that carry a driver
_HELD_MPS2 = 0.05  # a speed that falls no faster on average is held
_FRONT_SHARE, _FRONT_SPREAD = 0.5, 0.2  # of the lateral force: what the front axle bears
DRAG_PER_M = 0.003  # half the air's density times a large drag area, over the mass of a light car

_AX_G = ("ax_mps2", "g", "factor = 9.80665")
_AX_FEET = ("ax_mps2", "ft/s2", "factor = 0.3048")
_LONGITUDINAL_SLIPS: Slips = (
    (GRAVITY_MPS2, (_AX_G,)),
    (0.3048, (_AX_FEET,)),
    (3.6, (VX_KMH,), tuple((1.0 / factor, one) for factor, one in LIKE_KMH)),
    (1.0 / 0.44704, (VX_MPH,), tuple((1.0 / factor, one) for factor, one in LIKE_MPH)),
    (3.6 * GRAVITY_MPS2, (_AX_G, VX_KMH), tuple((1.0 / factor, one) for factor, one in LIKE_G_KMH)),
)


def check_longitudinal(drive: Drive) -> None:
    """Refuse a longitudinal acceleration that the speed contradicts."""
    ramp, ax, found = ramp_on(drive, "ax_mps2")
    if max(size_of(ramp), size_of(ax)) < EXCITED:
        return
    ratio, deviation = float(found.coefficients[0]), float(found.deviations[0])
    if ratio < -4.0 * deviation and found.coherence > 0.3 and cosine(ramp, ax) < -0.3:
        text = "moves against the change of vx_mps"
        raise wrong_sign("ax_mps2", text, ax, drive)
    # What corners explain of either is no sign that the other must follow.
    if found.coherence < 0.15 and (
        found.remaining > _CLEARLY_RAMP or found.driving > _CLEARLY_FELT
    ):
        raise Implausible(
            "ax_mps2",
            f"ax_mps2: does not follow the change of vx_mps, {drive.place(ramp)}; check both "
            f"columns, and that their rows are in the order of time",
        )
    if found.coherence > 0.6 and ratio > 0.0 and size_of(ramp) > EXCITED:
        formula = "ax_mps2 / (d vx_mps / dt)"
        slips = _LONGITUDINAL_SLIPS
        check_scale(ratio, deviation, SCALE_STD, slips, "ax_mps2", formula, ramp, drive, True)


def ramp_on(drive: Drive, name: str) -> tuple[FloatArray, FloatArray, Regression]:
    """Regress the change of speed on a channel, what turning adds to it taken out.

    Returns that change of speed, the means of the channel, and the regression.
    """
    c = drive.motion.channels
    yaw, ramp = c["yaw_rate_radps"], drive.change(c["vx_mps"])
    if "vy_mps" in c:
        ramp = ramp - drive.mean(c["vy_mps"] * yaw)
        across: list[FloatArray] = []
    else:
        across = [values[drive.rows] for values in sideways(drive.motion)]
    driver = drive.mean(c[name])
    columns = [driver, *across, drive.change(yaw), ones(drive)]
    spread = [np.inf, *[np.inf] * len(across), 0.6, np.inf]
    mean = [0.0] * len(spread)
    if name == "fx_n":
        # Steered wheels pull back with their side force, which an accelerometer feels: in tight
        # corners most of the force goes into that, and the two look alike.
        corner = drive.mean(c["ay_mps2"] * np.sin(c["steer_rad"]))
        columns.append(corner)
        mean.append(-_FRONT_SHARE)
        spread.append(_FRONT_SPREAD)
    found = fit(ramp, columns, spread, mean)
    if name == "fx_n":
        # The force of the wheels is told before drag, which an accelerometer feels. In few windows
        # drag and acceleration cannot be told apart: the law that explains more counts.
        drag = drive.mean(c["vx_mps"] ** 2)
        dragged = fit(ramp, [*columns, drag], [*spread, DRAG_PER_M], [*mean, 0.0])
        found = max(found, dragged, key=lambda law: law.coherence)
        ramp = ramp - found.coefficients[len(columns) - 1] * corner
    return ramp, driver, found


def check_force(drive: Drive, *, model_car: bool) -> list[Contradiction]:
    """Refuse a wheel force that the speed contradicts; doubt one that moves a model car.

    Parameters
    ----------
    drive : Drive
    model_car : bool
        Whether the steering is that of so short a car.
    """
    ramp, force, found = ramp_on(drive, "fx_n")
    if spread_of(ramp) < EXCITED or np.ptp(force) == 0.0:
        return []
    inverse, deviation = float(found.coefficients[0]), float(found.deviations[0])
    if inverse < -4.0 * deviation and found.coherence > 0.3 and cosine(ramp, force) < -0.3:
        text = "moves against the change of vx_mps"
        raise wrong_sign("fx_n", text, force, drive)
    if found.coherence < 0.15 and found.remaining > _CLEARLY_DRIVEN:
        raise Implausible(
            "fx_n",
            f"fx_n: does not follow the acceleration, {drive.place(ramp)}; check that the column "
            f"holds the force of all wheels, in the order of time, or leave it out",
        )
    if found.coherence < 0.6 or inverse <= 0.0:
        return []
    mass = 1.0 / inverse
    if _LIGHTEST_KG < mass < _HEAVIEST_KG:
        return []
    i = int(np.argmax(np.abs(force)))
    told = (
        f"fx_n: {force[i]:.4g} at t = {drive.motion.times_s[drive.rows][i]:.6g} s gives the car a "
        f"mass of {mass:.3g} kg"
    )
    if mass > _HEAVIEST_KG:
        what = "if it is in mN, put factor = 0.001 in the channel map"
        raise Implausible("fx_n", f"{told}; {what}")
    what = "it is in kN, put factor = 1000 in the channel map"
    if model_car:
        text = f"{told}; if this is no model car, and {what}"
        return [Contradiction("fx_n", text, by_the_car=True)]
    small = "of a model car, give its own vehicle file"
    raise Implausible("fx_n", f"{told}; if {what}; {small}")


def held_speed_note(drive: Drive) -> list[Contradiction]:
    """Tell if the speed is held by a force that brakes."""
    c = drive.motion.channels
    force = drive.mean(c["fx_n"])
    if "ax_mps2" in c:
        felt = drive.mean(c["ax_mps2"])
    elif "vy_mps" in c:
        felt = drive.change(c["vx_mps"]) - drive.mean(c["vy_mps"] * c["yaw_rate_radps"])
    else:
        felt = drive.change(c["vx_mps"])
    speed = float(np.mean(drive.mean(c["vx_mps"])))
    mean = float(np.mean(force))
    if speed < _DRIVEN_MPS or mean > -_LEAST_FORCE_N or float(np.mean(felt)) < -_HELD_MPS2:
        return []
    text = (
        f"fx_n: brakes with {-mean:.3g} N on average while the speed is held at {speed:.3g} m/s, "
        f"{drive.place(force)}: unless the road leads downhill the sign is wrong; put factor = -1 "
        f"for fx_n in the channel map"
    )
    return [Contradiction("fx_n", text, on_the_level=True)]
