"""How late the steering angle comes: the slip that it makes against the force of the front axle."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ..._common.arrays import FloatArray
from .motion import Motion
from .regression import Lag, coarse_lags, find_lag, fitted, in_changes

_LEAST_MPS = 3.0  # below, slip angles mean nothing
_FRONT_M = 1.25  # from centre of gravity to front axle; corrected by a coefficient
_KNEES_RAD = np.array([0.03, 0.06, 0.12])  # slip angles at which tyres bend
_LOADED_RAD = 0.08
_LEAST_SLOPE = 10.0  # m/s2 per rad, which an axle keeps where it slides

# Of each tanh, of slip, yaw acceleration, one, and longitudinal acceleration; all per mass that
# the front axle carries. Yaw inertia over mass and distance of the rear axle is about the distance
# of the front one.
_CURVE_PRIOR = np.array([0.0, 0.0, 0.0, 100.0, 1.2, 0.0, 0.0])
_CURVE_SPREAD = np.array([30.0, 30.0, 30.0, 1000.0, 0.3, np.inf, 0.5])
# Of errors of the distance to the front axle [m], of the scales of steering angle and lateral
# speed, and of the steering angle's zero [rad].
_ERROR_SPREAD = np.array([0.3, 0.1, 0.1, 0.02])

_AGO_S = np.array([-0.3, -0.15, 0.0, 0.15, 0.3, 0.45, 0.6, 0.9])  # a late angle is ahead of itself

_HIGHEST_HZ = 2.5
_NARROW = 0.3  # spread of the frequencies over their mean; a slalom has 0.1, other driving 0.4


def several_frequencies(m: Motion) -> bool:
    """Whether the steering moves at more than one frequency.

    At one a lag is a phase, and errors of the distance to the axle and of the yaw inertia are
    phases too.
    """
    steer = m.channels["steer_rad"]
    level = steer - np.linspace(steer[0], steer[-1], steer.size)
    f = np.fft.rfftfreq(level.size, 1.0 / m.rate_hz)
    power = np.abs(np.fft.rfft(level * np.hanning(level.size))) ** 2
    share = np.where(f < _HIGHEST_HZ, f * power, 0.0)
    whole = float(share.sum())
    if whole <= 0.0:
        return False
    mean = float(share @ f) / whole
    return float(share @ (f - mean) ** 2) / whole > (_NARROW * mean) ** 2


def steering_lag(m: Motion, usable: np.ndarray, enough: Callable[[Lag], bool]) -> Lag | None:
    """Return the lag of `steer_rad` behind the force of the front axle; None if it does not last.

    Parameters
    ----------
    m : Motion
        With `vy_mps`.
    usable : ndarray of bool, shape (count,)
        Windows to use.
    enough : callable
        As in :func:`.regression.find_lag`.

    Notes
    -----
    With moments about the rear axle the front force, per mass that the front carries, is
    ``ay + Iz / (m lr) d(yaw_rate)/dt``. It must be one curve of the slip angle
    ``steer - (vy + lf yaw_rate) / vx``, here of straight and bent parts, whatever the tyres. The
    force, which has little noise, is the side that stays: taken the other way round, the noise of
    ``vy`` would hide behind combinations of the other channels.
    """
    c = m.channels
    speed = np.maximum(c["vx_mps"], _LEAST_MPS)
    turn, side = c["yaw_rate_radps"] / speed, c["vy_mps"] / speed
    pull = c.get("ax_mps2", np.zeros_like(speed))
    felt = m.mean(c["ay_mps2"])
    rest = [-m.change(c["yaw_rate_radps"]), np.ones(m.count)]

    def slip(lag: float) -> FloatArray:
        result: FloatArray = m.at("steer_rad", lag) - side - _FRONT_M * turn
        return result

    def curve(angle: FloatArray) -> list[FloatArray]:
        bent = [m.mean(np.tanh(angle / knee)) for knee in _KNEES_RAD]
        return [*bent, m.mean(angle), *rest, m.mean(pull * np.tanh(angle / _LOADED_RAD))]

    # The slope of the curve tells what errors of the slip angle do. A late angle would flatten it.
    first = (
        fitted(felt[usable], np.column_stack(curve(slip(lag)))[usable], _CURVE_PRIOR, _CURVE_SPREAD)
        for lag in coarse_lags()
    )
    b, _, _ = min(first, key=lambda found: found[2])

    def slope(angle: FloatArray) -> FloatArray:
        near = np.clip(angle[:, None] / _KNEES_RAD, -20.0, 20.0)
        bent = (b[:3] / _KNEES_RAD / np.cosh(near) ** 2).sum(axis=1)
        result: FloatArray = np.maximum(bent + b[3], _LEAST_SLOPE)
        return result

    def sides(lag: float) -> tuple[FloatArray, FloatArray]:
        angle = slip(lag)
        steep = slope(angle)
        errors = (turn, m.at("steer_rad", lag), side, np.ones_like(angle))
        columns = [*curve(angle), *(m.mean(steep * e) for e in errors)]
        return felt, np.column_stack(columns)

    mean = np.concatenate([_CURVE_PRIOR, np.zeros(4)])
    spread = np.concatenate([_CURVE_SPREAD, _ERROR_SPREAD])
    moved = _steered(m, pull)
    lag = find_lag(sides, mean, spread, usable, moved, enough)
    return in_changes(lag, sides, mean, spread, usable, moved) if enough(lag) else lag


def _steered(m: Motion, pull: FloatArray) -> FloatArray:
    """What the driver does, over the time in which a car answers, shape (count, columns).

    A gust or a bump pushes the axle and, a little later, turns the car, so that slip and force
    have a part in common that no tyre made: with it, braking in a turn looks like late steering.
    What follows the steering has no such part.
    """
    steer = m.channels["steer_rad"]
    speed = m.channels["vx_mps"]
    columns = [np.ones(m.count), m.mean(pull), m.mean(pull * np.tanh(steer / _KNEES_RAD[0]))]
    for ago_s in _AGO_S:
        then = m.shifted(steer, -ago_s)
        bent = [m.mean(np.tanh(then / knee)) for knee in _KNEES_RAD[[0, 2]]]
        columns += [*bent, m.mean(then * speed)]
    return np.column_stack(columns)
