"""Data compatibility: whether the channels of a log are readings of one and the same motion."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from .._common.arguments import expect, whole
from .._common.progress import doing
from .._common.typed import typed
from ..log import Log, several_logs
from ..vehicle import Vehicle
from .condition import Conditioning
from .explaining import MEAN_S, Explaining, Told
from .kinematics.equations import Readings
from .kinematics.estimate import misfit, noise_of
from .moments import Moment, measured, moments_of, without
from .result import SensorCheck
from .signals import Signal, averaged, pieces, readings_of, refuse_mixed_up, signals

# Knots of the motion, in sampling periods. No simple ratio: were the samples always at the same
# places between the knots, a delay that moves them to better places would seem to be there.
_STEP_MEANS = 2.3607
_STEP_SAMPLES = 1.618  # of a channel that is slower than that
_MOMENTS = 3  # that are left out
_FLOOR = 1e-3  # least noise, of the channel's standard deviation


@typed
def check(
    logs: Log | Sequence[Log],
    vehicle: Vehicle | None = None,
    *,
    level: bool = False,
    seed: int = 0,
) -> SensorCheck:
    """Check the sensors of a log against each other, before any tyre is assumed.

    The motion is free; speeds, yaw rate and accelerations must only be readings of the same one.
    What does not fit is laid to time offsets, scales, biases, the place and the direction of the
    IMU, gravity by roll and pitch, the road, and noise of any colour. Delays are against the yaw
    rate, places against the speed sensor. Low-passes of the sensors and vibration, which the noise
    shows, are taken out before.

    Parameters
    ----------
    logs : Log or sequence of Log
        Driving with the same sensors.
    vehicle : Vehicle, optional
        Says how far the IMU can be from the speed sensor, and which faults harm a car of its size.
    level : bool
        Whether the ground is level, as a test track: a road that leans with its turns reads as a
        scale of `ay_mps2`, or as gravity by roll, and one on which the car slows where it climbs as
        a scale of `ax_mps2` or as a delay of the speeds. By default less is told of these.
    seed : int
        Of the draws that teach the noise.

    Returns
    -------
    SensorCheck

    Raises
    ------
    InvalidInput
        If the logs hold no driving, or channels are mirrored, swapped or of another unit.
    NumericalError
        If the motion cannot be told.

    Notes
    -----
    Flight path reconstruction: V. Klein, E. A. Morelli, *Aircraft System Identification*, 2nd ed.,
    ch. 10; R. V. Jategaonkar, *Flight Vehicle System Identification*, ch. 10.
    """
    together = several_logs(logs, "check")
    if vehicle is not None:
        expect(vehicle, Vehicle, "check")
    conditioning = Conditioning.of(together)
    ready = [conditioning.apply(log) for log in together]
    told = tuple(signal for log in together for signal in signals(log))
    moments: list[Moment] = []
    while True:
        found = checked(
            *(ready, vehicle), seed=whole(seed, "seed"), told=told, moments=moments, level=level
        )
        expected = {channel: of for channel, (_, of) in found.noise.items()}
        more = moments_of(found.readings, expected, found.stretches, ready)
        # What several channels feel at once is a blow: it is told once.
        more = [m for m in more if not any(m.at_once_with(known) for known in moments)]
        if not more or len(moments) == _MOMENTS:
            break
        moments.append(_contradicting(found, more))
    return replace(found, logs=tuple(together), conditioning=conditioning)


@doing("check of the sensors")
def checked(
    together: Sequence[Log],
    vehicle: Vehicle | None = None,
    *,
    seed: int = 0,
    enough: Told = lambda *_: False,
    told: tuple[Signal, ...] | None = None,
    moments: Sequence[Moment] = (),
    level: bool = False,
) -> SensorCheck:
    """As `check` of logs whose noise is white, or no more than its first estimate.

    `told` are signals of the logs as they were read, by default of these. `enough` is asked with
    this estimate and the faults that it tells. What `moments` hold is left out.
    """
    stretches = pieces(together)
    every = readings_of(together, stretches)
    readings = without(every, stretches, moments)
    refuse_mixed_up(together, readings)
    if told is None:
        told = tuple(signal for log in together for signal in signals(log))
    case = Explaining(
        *(together, stretches, readings, moments),
        floors={r.channel: _floor(r, told) for r in readings},
        step_s=_step(readings),
        wheelbase_m=None if vehicle is None else vehicle.wheelbase_m,
        level=level,
        seed=seed,
    )
    found, faults = case.best(enough)
    noise = noise_of(case.readings, found, case.floors)
    return SensorCheck(
        logs=tuple(together),
        faults=faults,
        signals=told,
        estimate=found,
        noise=noise,
        readings=tuple(case.readings),
        stretches=tuple(stretches),
        vehicle=vehicle,
        moments=tuple(measured(m, every, stretches, found, noise) for m in moments),
    )


def _contradicting(found: SensorCheck, moments: Sequence[Moment]) -> Moment:
    """Of channels that contradict each other the one without which they do not."""

    def left(moment: Moment) -> float:
        kept = without(found.readings, found.stretches, [moment])
        return misfit([averaged(r, MEAN_S) for r in kept], found.estimate, found.estimate)

    return min(moments, key=left) if len(moments) > 1 else moments[0]


def _floor(readings: Readings, told: Sequence[Signal]) -> float:
    quanta = [s.quantum for s in told if s.channel == readings.channel]
    # A channel that never changes, as in a simulated drive on a straight, has a floor too.
    spread = float(np.std(readings.values)) or 1.0
    return float(max(_FLOOR * spread, max(quanta, default=0.0) / np.sqrt(12.0)))


def _step(readings: Sequence[Readings]) -> float:
    """Knots no closer than the samples of the slowest channel bear."""
    periods = [float(np.median(np.diff(r.time_s)[np.diff(r.stretch) == 0])) for r in readings]
    return max(_STEP_MEANS * MEAN_S, _STEP_SAMPLES * max(periods))
