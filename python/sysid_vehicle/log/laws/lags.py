"""Channels that come late or early: the clock of one sensor against those of the others."""

from __future__ import annotations

import math

import numpy as np

from ..._common.arrays import FloatArray
from .laws import SPEED_UNITS, UNNAMED, Contradiction
from .motion import Motion
from .regression import SURE, Lag, Sides, find_lag, in_changes, regress
from .steering import several_frequencies, steering_lag

_MIN_RATE_HZ = 18.0
_MIN_WINDOWS = 60
_MOVING_MPS = 5.0

# Lags that sensors and lever arms of good logs have [s].
_USUAL_S = 0.055
# A lever arm of this length acts like a lag of length over speed [m].
_LEVER_M = 1.2
_STEER_LATE_S = 0.03
_STEER_EARLY_S = 0.12  # hydraulics, rubber and relaxing tyres delay the answer of a car
_MOST_SLIP_S2PM = 0.03  # of wheels, per acceleration
_FORCE_EARLY_S = 0.4  # brakes and engines take their time
# Of acceleration, squared speed, lateral acceleration times steering, and one; per mass.
_FORCE_PRIOR = np.array([1.0, 3e-4, 0.5, 0.0])
_FORCE_SPREAD = np.array([0.1, 7e-4, 1.0, np.inf])
# Below, a lag explains too little of the misfit. Gravity through roll bends ay_mps2 most, and
# what corners take of the force is only roughly known.
_MIN_GAIN = {
    "vy_mps": 1.35,
    "yaw_rate_radps": 1.35,
    "ay_mps2": 1.6,
    "fx_n": 2.0,
    "steer_rad": 1.1,
}
_MIN_GAIN_ELSE = 1.2
_COHERENT = 0.5
_SIDE = {"vy_mps": "vy", "yaw_rate_radps": "yaw", "ay_mps2": "ay"}
_MIN_EVIDENCE = 30.0
_EXCITED_MPS2 = 0.4
# Below, noise of the lateral speed makes lags of the steering up to 0.3 s, which none of the law's
# deviations hold; true ones were not told either.
_STEERED_MPS2 = 0.7


def lag_notes(motion: Motion) -> list[Contradiction]:
    """Return what is told of each channel that is not on the time of the others.

    The lateral channels must obey ``d(vy)/dt = ay - vx yaw_rate``, the longitudinal ones
    ``d(vx)/dt = ax + vy yaw_rate``; the force on the wheels follows the acceleration, and the
    force of the front axle the slip that the steering angle makes.
    """
    c = motion.channels
    motion.windows(0.4)
    usable = motion.usable & (motion.mean(c["vx_mps"]) > _MOVING_MPS)
    inside = motion.times_s
    usable &= (inside > motion.time_s[0] + 0.6) & (inside < motion.time_s[-1] - 0.6)
    if motion.rate_hz < _MIN_RATE_HZ or np.count_nonzero(usable) < _MIN_WINDOWS:
        return []
    notes: list[Contradiction] = []
    if "vy_mps" in c and _spread(motion.mean(c["ay_mps2"]), usable) > _EXCITED_MPS2:
        notes += _lateral(motion, usable)
    if "ax_mps2" in c and _spread(motion.mean(c["ax_mps2"]), usable) > _EXCITED_MPS2:
        notes += _speed(motion, usable)
        driven = _spread(motion.change(c["vx_mps"]), usable) > _EXCITED_MPS2
        if "fx_n" in c and driven and np.ptp(c["fx_n"]) > 0.0:
            notes += _force(motion, usable)
    steered = "vy_mps" in c and _spread(motion.mean(c["ay_mps2"]), usable) > _STEERED_MPS2
    if steered and not notes:
        notes += _steer(motion, usable)
    return notes


def _spread(values: FloatArray, usable: np.ndarray) -> float:
    return float(np.std(values[usable]))


def _lateral(m: Motion, usable: np.ndarray) -> list[Contradiction]:
    c, one = m.channels, np.ones(m.count)
    vx = c["vx_mps"]

    def sides(vy: float = 0.0, yaw: float = 0.0, ay: float = 0.0) -> Sides:
        def make(lag: float) -> tuple[FloatArray, FloatArray]:
            # Of the noisiest channel the others are shifted, which leaves its noise as it is.
            turn = m.shifted(vx * m.at("yaw_rate_radps", yaw * lag), -vy * lag)
            felt = m.at("ay_mps2", (ay - vy) * lag)
            return m.change(c["vy_mps"]), np.column_stack([m.mean(felt), -m.mean(turn), one])

        return make

    mean, spread = np.array([1.0, 1.0, 0.0]), np.array([0.1, 0.1, np.inf])
    lags = {
        "vy_mps": find_lag(sides(vy=1.0), mean, spread, usable),
        "yaw_rate_radps": find_lag(sides(yaw=1.0), mean, spread, usable),
        "ay_mps2": find_lag(sides(ay=1.0), mean, spread, usable),
    }
    name = max(lags, key=lambda key: lags[key].gain)
    speed = float(np.median(m.mean(vx)[usable]))
    usual = max(_USUAL_S, _LEVER_M / speed)
    there = [sides(**{_SIDE[name]: 1.0})(at) for at in (0.0, lags[name].seconds)]
    arm = m.change(c["yaw_rate_radps"])[usable]
    rows = [(y[usable], x[usable]) for y, x in there]
    scale = _scale(rows, arm, spread, _MIN_GAIN[name])
    if scale is not None:
        return [scale]
    if not _told(lags[name], usual, usual, _MIN_GAIN[name]):
        return []
    lag = in_changes(lags[name], sides(**{_SIDE[name]: 1.0}), mean, spread, usable)
    if lag is None:
        return []
    others = {
        "vy_mps": "ay_mps2 and yaw_rate_radps",
        "yaw_rate_radps": "ay_mps2",
        "ay_mps2": "yaw_rate_radps",
    }
    return [_note(name, others[name], lag)]


def _scale(
    there: list[tuple[FloatArray, FloatArray]], arm: FloatArray, spread: FloatArray, gain: float
) -> Contradiction | None:
    """Tell of a lateral speed in another unit: what it is nearer to than to metres per second.

    Parameters
    ----------
    there : list of ndarray, shape (n,), and ndarray, shape (n, 3)
        Change of the lateral speed; specific force, minus speed times yaw rate, one. As they are
        and moved in time.
    arm : ndarray, shape (n,)
        Change of the yaw rate, which a sensor ahead of the others adds.
    spread : ndarray, shape (3,)
        Of the prior for `x`.
    gain : float
        By which moving them in time has to lower the misfit: in the wrong unit a lag explains a
        part of it, and the factor is another one then.
    """
    nearer = math.sqrt(min(SPEED_UNITS.values()))
    # At one frequency an arm of the sensor looks like a unit, unless it would be too long.
    for columns, reach, limit in (([arm], [_LEVER_M], nearer), ([], [], math.exp(UNNAMED))):
        spreads = np.array([np.inf, *spread[1:], *reach])
        found, moved = (
            regress(
                y,
                np.column_stack([x[:, 0] + x[:, 1], x[:, 1:], *columns]),
                np.zeros(len(spreads)),
                spreads,
            )
            for y, x in there
        )
        if found.scale**2 > gain * moved.scale**2:
            found = moved
        times, sure = float(found.coefficients[0]), SURE * float(found.deviations[0])
        if found.coherence >= _COHERENT and times - sure > limit:
            break
    else:
        return None
    # Where accelerometer and gyro disagree, as on a body that rolls, either may be the right one.
    by_gyro = times + max(float(found.coefficients[1]), 0.0)
    near = [u for u, more in SPEED_UNITS.items() if times - sure <= more <= by_gyro + sure]
    near.sort(key=lambda u: min(abs(at - SPEED_UNITS[u]) for at in (times, by_gyro)))
    named = f"it seems to be in {' or '.join(near)}" if near else "check its unit"
    more = ", ".join(f"{1.0 / SPEED_UNITS[unit]:.4g} for {unit}" for unit in near or SPEED_UNITS)
    text = (
        f"vy_mps: changes {times:.3g} times ({times - sure:.3g} to {times + sure:.3g}) as much as "
        f"ay_mps2 - vx_mps * yaw_rate_radps demands; {named}: put its factor in the channel map "
        f"({more})"
    )
    return Contradiction("vy_mps", text)


def _speed(m: Motion, usable: np.ndarray) -> list[Contradiction]:
    c, one = m.channels, np.ones(m.count)
    if "vy_mps" in c:
        across = [m.mean(c["vy_mps"] * c["yaw_rate_radps"])]
        mean, spread = [1.0, 1.0], [0.1, 0.1]
    else:
        across, mean, spread = sideways(m), [1.0, 0.0, 0.0], [0.1, np.inf, np.inf]

    def sides(lag: float) -> tuple[FloatArray, FloatArray]:
        felt = m.mean(m.at("ax_mps2", -lag))
        columns = [felt, *across, m.change(c["yaw_rate_radps"]), one]
        return m.change(c["vx_mps"]), np.column_stack(columns)

    lag = find_lag(sides, np.array([*mean, 0.0, 0.0]), np.array([*spread, 0.5, np.inf]), usable)
    if not _told(lag, _USUAL_S, _USUAL_S):
        return []
    # The speed of wheels is v (1 + s a): to first order a speed that comes early by s v.
    slip = -lag.seconds / float(np.median(m.mean(c["vx_mps"])[usable]))
    rival = (
        f"; slip of {100.0 * slip:.1g} % per m/s2 does the same where this is the speed of driven "
        "or braked wheels, and then no clock is wrong: the check of the sensors tells them apart"
    )
    return [_note("vx_mps", "ax_mps2", lag, rival if 0.0 < slip < _MOST_SLIP_S2PM else "")]


def sideways(m: Motion) -> list[FloatArray]:
    """Return what ``vy * yaw_rate`` is made of while ``vy`` is not measured.

    In steady corners ``vy = lr r - k vx ay``, with linear tyres.
    """
    c = m.channels
    r = c["yaw_rate_radps"]
    return [m.mean(r * r), m.mean(r * c["vx_mps"] * c["ay_mps2"])]


def _force(m: Motion, usable: np.ndarray) -> list[Contradiction]:
    c, one = m.channels, np.ones(m.count)

    def sides(lag: float) -> tuple[FloatArray, FloatArray]:
        drag, corner = c["vx_mps"] ** 2, c["ay_mps2"] * c["steer_rad"]
        columns = [m.mean(m.shifted(x, -lag)) for x in (c["ax_mps2"], drag, corner)]
        return m.mean(c["fx_n"]), np.column_stack([*columns, one])

    free, none = np.full(4, np.inf), np.zeros(4)
    y, x = sides(0.0)
    mass = abs(regress(y[usable], x[usable], none, free).coefficients[0])
    # Without priors for drag and for what corners take, a slow change of speed has any lag.
    mean, spread = mass * _FORCE_PRIOR, mass * _FORCE_SPREAD
    lag = find_lag(sides, mean, spread, usable)
    return (
        [_note("fx_n", "ax_mps2", lag)]
        if _told(lag, _USUAL_S, _FORCE_EARLY_S, _MIN_GAIN["fx_n"])
        else []
    )


def _steer(motion: Motion, usable: np.ndarray) -> list[Contradiction]:
    if not several_frequencies(motion):
        return []
    least = _MIN_GAIN["steer_rad"]
    lag = steering_lag(motion, usable, lambda found: _enough(found, least))
    # A car may answer late, and then its steering angle seems early; no car answers ahead of it.
    if lag is None or not _told(lag, _STEER_LATE_S, _STEER_EARLY_S, least):
        return []
    return [_note("steer_rad", "yaw_rate_radps and ay_mps2", lag)]


def _told(lag: Lag, late_s: float, early_s: float, least: float = _MIN_GAIN_ELSE) -> bool:
    return _enough(lag, least) and lag.beyond(late_s, early_s)


def _enough(lag: Lag, least: float) -> bool:
    return lag.gain > least and lag.evidence > _MIN_EVIDENCE


def _note(name: str, other: str, lag: Lag, rival: str = "") -> Contradiction:
    verb = "lags behind" if lag.seconds > 0.0 else "runs ahead of"
    deviation = max(2.0 * lag.deviation, 0.001)
    text = (
        f"{name}: {verb} {other} by {abs(lag.seconds):.2g} s (+- {deviation:.1g}) over the whole "
        f"log; a shift in time looks like a lag of the car: put delay_s = {lag.seconds:.2g} for "
        f"{name} in the channel map, or set the clocks right{rival}"
    )
    return Contradiction(name, text, lag.seconds)
