"""What the laws of motion say of a drive: the windows, the fits, and how a misfit is told."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ..._common.arrays import FloatArray
from ...errors import InvalidInput
from ...vehicle import GRAVITY_MPS2
from .motion import Motion
from .regression import Regression, regress, size_of

WINDOW_S = 1.0
MIN_WINDOWS = 8
EXCITED = 0.5  # m/s2 that one side must reach before anything is compared
CLEARLY = 1.5  # m/s2 that it must reach before channels are called unrelated
# Scale errors of good sensors, gravity through roll, and geometry that is not known.
SCALE_STD = 0.12
LINEAR_MPS2 = 5.0  # lateral acceleration up to which tyres are nearly linear
LATERAL = ("yaw_rate_radps", "ay_mps2", "vy_mps", "steer_rad")
OFFSET = 0.3  # of the steering angle, as a share of its size

_NOT_ONE = 5.0  # deviations from the right unit before another is looked for
_FITS = 3.0  # deviations within which another unit fits
UNNAMED = math.log(2.5)  # a scale that is farther off is refused although no unit explains it

SPEED_UNITS = {"knots": 1.0 / 0.5144444, "mph": 1.0 / 0.44704, "ft/s": 1.0 / 0.3048, "km/h": 3.6}
"""Units of speeds in logs, and how many of them are one metre per second."""

Slip = tuple[str, str, str]
Slipped = tuple[float, tuple[Slip, ...]]
# What is named where it explains the coefficient best, and what else looks so; that is named beside
# it where it is nearer.
Slips = tuple[Slipped | tuple[float, tuple[Slip, ...], tuple[Slipped, ...]], ...]
AY_G: Slip = ("ay_mps2", "g", "factor = 9.80665")
VX_KMH: Slip = ("vx_mps", "km/h", "factor = 0.2777778")
VX_MPH: Slip = ("vx_mps", "miles per hour", "factor = 0.44704")
_VX_KNOTS: Slip = ("vx_mps", "knots", "factor = 0.5144444")
_VX_FEET: Slip = ("vx_mps", "feet per second", "factor = 0.3048")
_VX_WHEEL: Slip = ("vx_mps", "rad/s of a wheel", "factor = the radius of the tyre [m]")
_TOGETHER = 0.5  # cosine
_RADIUS_M = 0.31  # of a usual car's tyre
_RPM = 2.0 * math.pi / 60.0
_VX_RPM: Slip = ("vx_mps", "rpm of a wheel", "factor = 0.1047198 times the radius of the tyre [m]")
_LORRY_RADIUS_M = 0.48
# Beside km/h, beside miles per hour, and beside an acceleration in g and a speed in either.
LIKE_KMH: tuple[Slipped, ...] = ((0.3048, (_VX_FEET,)), (_RADIUS_M, (_VX_WHEEL,)))
LIKE_MPH: tuple[Slipped, ...] = ((0.5144444, (_VX_KNOTS,)),)
LIKE_G_KMH: tuple[Slipped, ...] = ((_RPM * _RADIUS_M, (_VX_RPM,)),)
LIKE_G_MPH: tuple[Slipped, ...] = (
    (0.5144444 / GRAVITY_MPS2, (AY_G, _VX_KNOTS)),
    (_RPM * _LORRY_RADIUS_M, (_VX_RPM,)),
)


@dataclass(frozen=True)
class Drive:
    """Windows of a drive in which the car moves, and what the laws of motion say there."""

    motion: Motion
    rows: np.ndarray

    def mean(self, values: FloatArray) -> FloatArray:
        """Means over the windows in use."""
        result: FloatArray = self.motion.mean(values)[self.rows]
        return result

    def change(self, values: FloatArray) -> FloatArray:
        """Mean rates of change over the windows in use [1/s]."""
        result: FloatArray = self.motion.change(values)[self.rows]
        return result

    def place(self, driver: FloatArray) -> str:
        """Return where the driver is largest, for messages."""
        where = self.motion.times_s[self.rows][int(np.argmax(np.abs(driver)))]
        return f"most clearly around t = {where:.6g} s"


@dataclass(frozen=True)
class Contradiction:
    """What a channel says against the others.

    Attributes
    ----------
    channel : str
        That is wrong, or the first of several that may be.
    text : str
        What is wrong, where, and the likely remedy.
    late_s : float
        By how much the channel comes late; negative where it comes early, zero where the time is
        not what is wrong.
    on_the_level : bool
        Whether a road that climbs or falls would explain it.
    by_the_car : bool
        Whether the car's own numbers settle it.
    """

    channel: str
    text: str
    late_s: float = 0.0
    on_the_level: bool = False
    by_the_car: bool = False


class Implausible(InvalidInput):
    """A log is refused for the contradiction that it holds."""

    def __init__(self, channel: str, text: str) -> None:
        super().__init__(text)
        self.contradiction = Contradiction(channel, text)


class KnownUnit(Implausible):
    """A unit that explains what does not fit."""


def ones(drive: Drive) -> FloatArray:
    """The column of a constant."""
    return np.ones(np.count_nonzero(drive.rows))


def fit(
    y: FloatArray, columns: list[FloatArray], spread: list[float], mean: list[float] | None = None
) -> Regression:
    """Regress with normal priors of these standard deviations on the coefficients."""
    prior = np.zeros(len(columns)) if mean is None else np.array(mean)
    return regress(y, np.column_stack(columns), prior, np.array(spread))


def spread_of(values: FloatArray) -> float:
    """The same about the median."""
    return size_of(values - np.median(values))


def cosine(x: FloatArray, y: FloatArray) -> float:
    """Cosine of the angle between two signals, 0 where one is nothing."""
    size = float(np.linalg.norm(x) * np.linalg.norm(y))
    return float(x @ y) / size if size > 0.0 else 0.0


def turns_as_steered(speed: FloatArray, steer: FloatArray, yaw_rate: FloatArray) -> bool:
    """Whether the signs of the three are those of one car, be it one that reverses."""
    return cosine(steer * speed, yaw_rate) > _TOGETHER


def wrong_sign(channel: str, what: str, values: FloatArray, drive: Drive) -> Implausible:
    """What is said of a channel with the opposite sign."""
    others = [name for name in LATERAL if name in drive.motion.channels and name != channel]
    mirrored = ""
    if channel in LATERAL:  # a log of which all are turned round is that of a car in a mirror
        mirrored = (
            f", or for {', '.join(others[:-1])} and {others[-1]} instead if these are positive to "
            f"the right (axes with z down, SAE J670)"
        )
    return Implausible(
        channel,
        f"{channel}: wrong sign: it {what}, {drive.place(values)} (ISO 8855: x forward, y and yaw "
        f"to the left); put factor = -1 for it in the channel map{mirrored}",
    )


def check_scale(
    ratio: float,
    deviation: float,
    usual: float,
    slips: Slips,
    channel: str,
    formula: str,
    driver: FloatArray,
    drive: Drive,
    inverse: bool = False,
) -> None:
    """Refuse a coefficient that is far from one, by the unit that explains it best.

    Where no unit explains it, `channel` is told.

    The logarithm of the ratio is taken as normal about that of each unit, with the deviation of
    the fit and the `usual` one of sensors; compared are the likelihoods.
    """
    deviation = math.hypot(usual, deviation / ratio)
    off = abs(math.log(ratio)) / deviation
    slip = min(slips, key=lambda slip: abs(math.log(ratio / slip[0])))
    best, channels = slip[:2]
    miss = abs(math.log(ratio / best)) / deviation
    shown = 1.0 / ratio if inverse else ratio
    if off > _NOT_ONE and miss < _FITS and off**2 - miss**2 > _NOT_ONE**2:
        nearer = sorted(
            (far, others)
            for factor, others in (slip[2] if len(slip) > 2 else ())
            if (far := abs(math.log(ratio / factor)) / deviation) < miss
        )
        likely = [*(others for _, others in nearer), channels]
        units, remedies = zip(*(_told(one) for one in _together(likely)), strict=True)
        raise KnownUnit(
            channels[0][0],
            f"{', or '.join(units)}: {formula} is {shown:.3g} instead of about 1, "
            f"{drive.place(driver)}; put {', or '.join(remedies)} in the channel map",
        )
    if off > _NOT_ONE and abs(math.log(ratio)) > UNNAMED:
        raise Implausible(
            channel,
            f"{formula} is {shown:.3g} instead of about 1, {drive.place(driver)}; check the units "
            f"of these channels and put their factors in the channel map",
        )


def _together(likely: list[tuple[Slip, ...]]) -> list[tuple[Slip, ...]]:
    """Ways to explain a coefficient, those by a unit of one channel as one."""
    if {len(way) for way in likely} != {1} or len({way[0][0] for way in likely}) > 1:
        return likely
    units, factors = ([way[0][k] for way in likely] for k in (1, 2))
    return [((likely[0][0][0], " or ".join(units), " or ".join(factors)),)]


def _told(way: tuple[Slip, ...]) -> tuple[str, str]:
    """What seems to be wrong, and the remedy."""
    return (
        " and ".join(f"{name}: seems to be in {unit}" for name, unit, _ in way),
        " and ".join(f"{factor} for {name}" for name, _, factor in way),
    )
