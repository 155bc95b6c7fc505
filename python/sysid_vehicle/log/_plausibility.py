"""Wrong units, wrong signs and channels that do not belong together, by the laws of motion.

``d(vy)/dt = ay - vx yaw_rate`` and ``d(vx)/dt = ax + vy yaw_rate`` hold for every car. Each is
fitted robustly; the coefficient that should be one is compared, with its own uncertainty, with what
it would be in each unit that logs are written in. A unit is only called wrong if another one is
far likelier and fits.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from ..errors import InvalidInput
from ._channels import DEG, FloatArray
from ._lags import lag_notes, sideways
from ._motion import Motion
from ._ranges import WHITE, check_ranges
from ._regression import Regression, regress

_MOVING = 3.0  # in whatever unit vx has; only windows above are compared
_WINDOW_S = 1.0
_MIN_WINDOWS = 8
_EXCITED = 0.5  # m/s2 that one side must reach before anything is compared
_SLIDING = 0.2  # m/s2, the same for the change of vy, which is a small part of ay
_ABOVE_NOISE = 6.0  # noise of the regressor itself makes every coefficient too small
_CLEARLY = 1.5  # m/s2 that it must reach before channels are called unrelated
_LINEAR_MPS2 = 5.0
_DRIVEN_MPS, _LEAST_FORCE_N = 12.0, 30.0  # at that speed drag takes more
_HELD_MPS2 = 0.05  # a speed that falls no faster on average is held

# Scale errors of good sensors, gravity through roll, tyres and geometry that are not known.
_SCALE_DOUBT = 0.12
_SLIDE_DOUBT = 0.35
_NOT_ONE = 5.0  # deviations from the right unit before another is looked for
_FITS = 3.0  # deviations within which another unit fits
_UNNAMED = math.log(2.5)  # a scale that is farther off is refused although no unit explains it

# The wheelbase that answers, from karts to coaches [m], what understeer adds [m/(m/s)^2], how far
# they vary, and the deviations from them at which the steering angle is none of road wheels.
_WHEELBASE_M, _WHEELBASE_DOUBT = 2.9, 0.45
_UNDERSTEER, _UNDERSTEER_DOUBT = 0.002, 0.003
_NOT_A_WHEELBASE = 3.5

_YAW_DEG = ("yaw_rate_radps", "degrees per second", f"factor = {DEG}")
_AY_G = ("ay_mps2", "g", "factor = 9.80665")
_AX_G = ("ax_mps2", "g", "factor = 9.80665")
_VX_KMH = ("vx_mps", "km/h", "factor = 0.2777778")
_VX_MPH = ("vx_mps", "miles per hour", "factor = 0.44704")
_VY_KMH = ("vy_mps", "km/h", "factor = 0.2777778")
_VY_MPH = ("vy_mps", "miles per hour", "factor = 0.44704")
_FX_KN = ("fx_n", "kN", "factor = 1000")
_Slip = tuple[str, str, str]
_Slips = tuple[tuple[float, tuple[_Slip, ...]], ...]
_RAD, _G = math.pi / 180.0, 9.80665

_LATERAL_SLIPS: _Slips = (
    (_RAD, (_YAW_DEG,)),
    (1.0 / _G, (_AY_G,)),
    (1.0 / 3.6, (_VX_KMH,)),
    (0.44704, (_VX_MPH,)),
    (_RAD / _G, (_YAW_DEG, _AY_G)),
    (_RAD / 3.6, (_YAW_DEG, _VX_KMH)),
    (1.0 / _G / 3.6, (_AY_G, _VX_KMH)),
    (_RAD / _G / 3.6, (_YAW_DEG, _AY_G, _VX_KMH)),
)
_LONGITUDINAL_SLIPS: _Slips = (
    (_G, (_AX_G,)),
    (3.6, (_VX_KMH,)),
    (1.0 / 0.44704, (_VX_MPH,)),
    (3.6 * _G, (_AX_G, _VX_KMH)),
)
_SLIDING_SLIPS: _Slips = ((3.6, (_VY_KMH,)), (1.0 / 0.44704, (_VY_MPH,)))


@dataclass(frozen=True)
class _Drive:
    """Windows of a drive in which the car moves, and what the laws of motion say there."""

    motion: Motion
    rows: np.ndarray

    def mean(self, values: FloatArray) -> FloatArray:
        result: FloatArray = self.motion.mean(values)[self.rows]
        return result

    def change(self, values: FloatArray) -> FloatArray:
        result: FloatArray = self.motion.change(values)[self.rows]
        return result

    def place(self, driver: FloatArray) -> str:
        """Return where the driver is largest, for messages."""
        where = self.motion.times_s[self.rows][int(np.argmax(np.abs(driver)))]
        return f"most clearly around t = {where:.6g} s"


def check_coherence(columns: Mapping[str, FloatArray], rate_hz: float) -> list[str]:
    """Refuse channels in a wrong unit, with a wrong sign, or that belong to another drive.

    Parameters
    ----------
    columns : mapping of ndarray, shape (n,)
        Canonical channels on a uniform grid, `time_s` among them.
    rate_hz : float
        Rate of the grid.

    Returns
    -------
    list of str
        What is doubtful, in words.

    Raises
    ------
    InvalidInput
        For the first channel that cannot be right; the message names channel, time and remedy.
    """
    notes: list[str] = []
    motion = Motion(columns, rate_hz)
    motion.windows(_WINDOW_S)
    speed = motion.mean(motion.channels["vx_mps"])
    rows = motion.usable & (np.abs(speed) > _MOVING)
    if np.count_nonzero(rows) < _MIN_WINDOWS:
        return check_ranges(columns, rate_hz)
    drive = _Drive(motion, rows)
    problem: InvalidInput | None = None
    try:
        notes = check_ranges(columns, rate_hz)
    except InvalidInput as error:
        problem = error  # the unit, if it can be told, says more
    try:
        _check_laws(drive)
    except _KnownUnit:
        raise
    except InvalidInput as error:
        raise problem or error from None
    if problem is not None:
        raise problem
    if "fx_n" in columns:
        notes += _held_speed_note(drive)
    return notes + lag_notes(motion)


class _KnownUnit(InvalidInput):
    """A unit that explains what does not fit."""


def _check_laws(drive: _Drive) -> None:
    channels = drive.motion.channels
    speed = drive.mean(channels["vx_mps"])
    if np.median(speed) < 0.0:
        raise InvalidInput(_wrong_sign("vx_mps", "is negative for most of the drive", speed, drive))
    _check_lateral(drive)
    _check_steer(drive)
    if "vy_mps" in channels:
        _check_sliding(drive)
    if "ax_mps2" in channels:
        _check_longitudinal(drive)
    if "fx_n" in channels:
        _check_force(drive)


def _held_speed_note(drive: _Drive) -> list[str]:
    """Return a note if the speed is held by a force that brakes."""
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
    return [text]


def _ones(drive: _Drive) -> FloatArray:
    return np.ones(np.count_nonzero(drive.rows))


def _fit(
    y: FloatArray, columns: list[FloatArray], spread: list[float], mean: list[float] | None = None
) -> Regression:
    prior = np.zeros(len(columns)) if mean is None else np.array(mean)
    return regress(y, np.column_stack(columns), prior, np.array(spread))


def _size(values: FloatArray) -> float:
    return float(np.percentile(np.abs(values), 95))


def _spread(values: FloatArray) -> float:
    return _size(values - np.median(values))


def _check_lateral(drive: _Drive) -> None:
    c = drive.motion.channels
    turn, ay = drive.mean(c["vx_mps"] * c["yaw_rate_radps"]), drive.mean(c["ay_mps2"])
    if max(_size(turn), _size(ay)) < _EXCITED:
        return
    slide = (
        [drive.change(c["vy_mps"])]
        if "vy_mps" in c
        else [drive.change(c["yaw_rate_radps"]), drive.change(c["vx_mps"] * c["ay_mps2"])]
    )
    spread = [np.inf, *[np.inf] * len(slide), 0.5]
    both = _fit(ay, [turn, *slide, _ones(drive)], spread)
    alone = _cosine(turn, ay)
    if both.coherence < 0.3 and abs(alone) < 0.6 and max(_spread(turn), _spread(ay)) > _CLEARLY:
        _refuse_lateral(drive, turn, ay)
    ratio, doubt = float(both.coefficients[0]), float(both.deviations[0])
    if alone < -0.5 and ratio < -3.0 * doubt and both.coherence > 0.3:
        # Two of the three channels agree; the third is the odd one out.
        steer = drive.mean(c["steer_rad"])
        odd = "ay_mps2" if _cosine(steer, turn) > 0.0 else "yaw_rate_radps"
        other = "yaw_rate_radps * vx_mps" if odd == "ay_mps2" else "ay_mps2"
        text = f"moves against both {other} and steer_rad"
        raise InvalidInput(_wrong_sign(odd, text, drive.mean(c[odd]), drive))
    if both.coherence > 0.6 and ratio > 0.0:
        formula = "ay_mps2 / (vx_mps * yaw_rate_radps)"
        _check_scale(ratio, doubt, _SCALE_DOUBT, _LATERAL_SLIPS, formula, turn, drive)


def _refuse_lateral(drive: _Drive, turn: FloatArray, ay: FloatArray) -> None:
    """Say which of the channels does not follow the others, by what the steering asks for."""
    c = drive.motion.channels
    if "ax_mps2" in c:
        ax, ramp = drive.mean(c["ax_mps2"]), drive.change(c["vx_mps"])
        if _cosine(turn, ax) > 0.8 and (_spread(ay) < _EXCITED or _cosine(ramp, ay) > 0.3):
            raise InvalidInput(
                f"ax_mps2 and ay_mps2: seem to be swapped: ax_mps2 follows vx_mps * yaw_rate_radps "
                f"and ay_mps2 does not, {drive.place(turn)}; swap the two columns in the channel "
                f"map"
            )
    steer = drive.mean(c["steer_rad"])
    speed = drive.mean(c["vx_mps"])
    answers = {
        "yaw_rate_radps": abs(_cosine(steer * speed, drive.mean(c["yaw_rate_radps"]))),
        "ay_mps2": abs(_cosine(steer * speed**2, ay)),
    }
    odd = min(answers, key=lambda name: answers[name])
    other = "vx_mps * yaw_rate_radps" if odd == "ay_mps2" else "ay_mps2 / vx_mps"
    driver = turn if odd == "ay_mps2" else ay
    raise InvalidInput(
        f"{odd}: does not follow {other}, as it must in every corner, {drive.place(driver)}; check "
        f"that the column holds what it says, in the order of time"
    )


def _check_steer(drive: _Drive) -> None:
    """Compare the steering angle with the path curvature: the wheelbase that would answer so."""
    c = drive.motion.channels
    ay = drive.mean(c["ay_mps2"])
    speed = np.maximum(np.abs(c["vx_mps"]), 1.0)
    curvature, steer = drive.mean(c["yaw_rate_radps"] / speed), drive.mean(c["steer_rad"])
    if _size(ay) < _EXCITED:
        return
    gentle = np.abs(ay) < _LINEAR_MPS2
    if np.count_nonzero(gentle) > max(_MIN_WINDOWS, 0.2 * ay.size) and _size(ay[gentle]) > _EXCITED:
        rows = gentle
    else:
        rows = np.ones(ay.size, dtype=bool)
    yaw = drive.change(c["yaw_rate_radps"])
    columns = [curvature[rows], yaw[rows], np.ones(np.count_nonzero(rows))]
    answer = _fit(steer[rows], columns, [np.inf, np.inf, np.inf])
    alone = _cosine(curvature[rows], steer[rows])
    if answer.coherence < 0.15 and abs(alone) < 0.4 and _spread(ay[rows]) > _CLEARLY:
        raise InvalidInput(
            f"steer_rad: does not turn with yaw_rate_radps and ay_mps2, {drive.place(ay)}; check "
            f"that the column holds the steering angle, in the order of time"
        )
    base, doubt = float(answer.coefficients[0]), float(answer.deviations[0])
    if base < -3.0 * doubt and alone < -0.5 and answer.coherence > 0.3:
        text = "moves against both yaw_rate_radps and ay_mps2"
        raise InvalidInput(_wrong_sign("steer_rad", text, steer, drive))
    if base <= 0.0 or answer.coherence < 0.5:
        return
    speed_2 = float(np.median(drive.mean(c["vx_mps"]))) ** 2
    expected = _WHEELBASE_M + _UNDERSTEER * speed_2
    spread = math.hypot(_WHEELBASE_DOUBT * _WHEELBASE_M, _UNDERSTEER_DOUBT * speed_2) / expected
    off = abs(math.log(base / expected)) / math.hypot(spread, doubt / base)
    if off < _NOT_A_WHEELBASE or 0.2 < base / expected < 5.0:
        return
    ratio = base / expected
    i = int(np.argmax(np.abs(steer)))
    what = (
        f"if it is the angle of the steering wheel, put factor = 1 / steering ratio (about "
        f"{1.0 / ratio:.2g}) in the channel map"
        if ratio < 32.0
        else f"if it is in degrees, put factor = {DEG} in the channel map"
        if ratio < 200.0
        else f"if it is the angle of the steering wheel in degrees, put factor = {DEG} / steering "
        f"ratio in the channel map"
    )
    size = "large" if ratio > 1.0 else "small"
    if ratio < 1.0:
        what = f"check its unit; factor = {1.0 / ratio:.2g} would make it fit"
    raise InvalidInput(
        f"steer_rad: {steer[i]:.4g} at t = {drive.motion.times_s[drive.rows][i]:.6g} s is too "
        f"{size} for the yaw rate (a wheelbase of {base:.3g} m would answer so); {what}"
    )


def _check_sliding(drive: _Drive) -> None:
    c = drive.motion.channels
    slide = drive.change(c["vy_mps"])
    ay, turn = drive.mean(c["ay_mps2"]), drive.mean(c["vx_mps"] * c["yaw_rate_radps"])
    expected = ay - turn
    noise = drive.motion.noise
    speed = float(np.median(drive.mean(c["vx_mps"])))
    own = math.hypot(noise["ay_mps2"], speed * noise["yaw_rate_radps"]) / _WINDOW_S**0.5
    if _size(expected) < max(_SLIDING, _ABOVE_NOISE * own):
        return
    # The expected change is the small difference of two large readings, each with an own scale;
    # and where the speed is not measured at the centre of gravity the yaw rate adds to it.
    columns = [expected, turn, drive.change(c["yaw_rate_radps"]), _ones(drive)]
    found = _fit(slide, columns, [np.inf, 0.06, 1.0, np.inf])
    ratio, doubt = float(found.coefficients[0]), float(found.deviations[0])
    if ratio < -4.0 * doubt and found.coherence > 0.3:
        text = "changes against what ay_mps2 - vx_mps * yaw_rate_radps demands"
        raise InvalidInput(_wrong_sign("vy_mps", text, drive.mean(c["vy_mps"]), drive))
    # Of a channel in disorder nothing of the change is left, and it is white.
    lost = found.coherence < 0.1 and ratio + 5.0 * doubt < 0.8 and ratio < 0.3
    clear = _spread(expected - found.coefficients[1] * turn) > _CLEARLY
    if lost and (clear or drive.motion.disorder["vy_mps"] > WHITE):
        raise InvalidInput(
            f"vy_mps: does not change as ay_mps2 - vx_mps * yaw_rate_radps demands, "
            f"{drive.place(expected)}; check that the column holds the lateral speed, in the "
            f"order of time, or leave it out"
        )
    if found.coherence > 0.5 and ratio > 0.0:
        formula = "(d vy_mps / dt) / (ay_mps2 - vx_mps * yaw_rate_radps)"
        _check_scale(ratio, doubt, _SLIDE_DOUBT, _SLIDING_SLIPS, formula, slide, drive)


def _check_longitudinal(drive: _Drive) -> None:
    ramp, ax, found = _ramp_on(drive, "ax_mps2")
    if max(_size(ramp), _size(ax)) < _EXCITED:
        return
    ratio, doubt = float(found.coefficients[0]), float(found.deviations[0])
    if ratio < -4.0 * doubt and found.coherence > 0.3 and _cosine(ramp, ax) < -0.3:
        text = "moves against the change of vx_mps"
        raise InvalidInput(_wrong_sign("ax_mps2", text, ax, drive))
    if found.coherence < 0.15 and (_spread(ramp) > 0.8 or _spread(ax) > 2.0):
        raise InvalidInput(
            f"ax_mps2: does not follow the change of vx_mps, {drive.place(ramp)}; check both "
            f"columns, and that their rows are in the order of time"
        )
    if found.coherence > 0.6 and ratio > 0.0 and _size(ramp) > _EXCITED:
        formula = "(d vx_mps / dt) / ax_mps2"
        _check_scale(ratio, doubt, _SCALE_DOUBT, _LONGITUDINAL_SLIPS, formula, ramp, drive, True)


def _ramp_on(drive: _Drive, name: str) -> tuple[FloatArray, FloatArray, Regression]:
    """Regress the change of speed on a channel, what turning adds to it taken out."""
    c = drive.motion.channels
    yaw, ramp = c["yaw_rate_radps"], drive.change(c["vx_mps"])
    if "vy_mps" in c:
        ramp = ramp - drive.mean(c["vy_mps"] * yaw)
        across: list[FloatArray] = []
    else:
        across = [values[drive.rows] for values in sideways(drive.motion)]
    driver = drive.mean(c[name])
    columns = [driver, *across, drive.change(yaw), _ones(drive)]
    found = _fit(ramp, columns, [np.inf, *[np.inf] * len(across), 0.6, np.inf])
    return ramp, driver, found


def _check_force(drive: _Drive) -> None:
    ramp, force, found = _ramp_on(drive, "fx_n")
    if _spread(ramp) < _EXCITED or np.ptp(force) == 0.0:
        return
    inverse, doubt = float(found.coefficients[0]), float(found.deviations[0])
    if inverse < -4.0 * doubt and found.coherence > 0.3 and _cosine(ramp, force) < -0.3:
        text = "moves against the change of vx_mps"
        raise InvalidInput(_wrong_sign("fx_n", text, force, drive))
    if found.coherence < 0.15 and _spread(ramp) > 1.0:
        raise InvalidInput(
            f"fx_n: does not follow the acceleration, {drive.place(ramp)}; check that the column "
            f"holds the force of all wheels, in the order of time, or leave it out"
        )
    if found.coherence < 0.6 or inverse <= 0.0:
        return
    mass = 1.0 / inverse
    i = int(np.argmax(np.abs(force)))
    if not 50.0 < mass < 1e5:
        what = "kN, put factor = 1000" if mass < 50.0 else "mN, put factor = 0.001"
        raise InvalidInput(
            f"fx_n: {force[i]:.4g} at t = {drive.motion.times_s[drive.rows][i]:.6g} s gives the "
            f"car a mass of {mass:.3g} kg; if it is in {what} in the channel map"
        )


def _check_scale(
    ratio: float,
    doubt: float,
    usual: float,
    slips: _Slips,
    formula: str,
    driver: FloatArray,
    drive: _Drive,
    inverse: bool = False,
) -> None:
    """Refuse a coefficient that is far from one, by the unit that explains it best.

    The logarithm of the ratio is taken as normal about that of each unit, with the deviation of
    the fit and the `usual` one of sensors; compared are the likelihoods.
    """
    deviation = math.hypot(usual, doubt / ratio)
    off = abs(math.log(ratio)) / deviation
    best, channels = min(slips, key=lambda slip: abs(math.log(ratio / slip[0])))
    miss = abs(math.log(ratio / best)) / deviation
    shown = 1.0 / ratio if inverse else ratio
    if inverse:
        numerator, denominator = "ax_mps2", "(d vx_mps / dt)"
        formula = f"{numerator} / {denominator}"
    if off > _NOT_ONE and miss < _FITS and off**2 - miss**2 > _NOT_ONE**2:
        units = " and ".join(f"{channel}: seems to be in {unit}" for channel, unit, _ in channels)
        remedy = " and ".join(f"{factor} for {channel}" for channel, _, factor in channels)
        raise _KnownUnit(
            f"{units}: {formula} is {shown:.3g} instead of about 1, {drive.place(driver)}; put "
            f"{remedy} in the channel map"
        )
    if off > _NOT_ONE and abs(math.log(ratio)) > _UNNAMED:
        raise InvalidInput(
            f"{formula} is {shown:.3g} instead of about 1, {drive.place(driver)}; check the units "
            f"of these channels and put their factors in the channel map"
        )


def _cosine(x: FloatArray, y: FloatArray) -> float:
    size = float(np.linalg.norm(x) * np.linalg.norm(y))
    return float(x @ y) / size if size > 0.0 else 0.0


def _wrong_sign(channel: str, what: str, values: FloatArray, drive: _Drive) -> str:
    return (
        f"{channel}: wrong sign: it {what}, {drive.place(values)} "
        f"(ISO 8855: x forward, y and yaw to the left); put factor = -1 in the channel map"
    )
