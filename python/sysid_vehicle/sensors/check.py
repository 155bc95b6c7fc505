"""Data compatibility: whether the channels of a log are readings of one and the same motion."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import cache, partial

import numpy as np

from .._common.arguments import expect, whole
from .._common.progress import doing
from .._common.typed import typed
from ..errors import SysidError
from ..log import Log, several_logs
from ..vehicle import Vehicle
from .condition import Conditioning
from .faults import FALSE_CLAIMS, Rival, SensorFault, doubted, faults_of
from .kinematics.equations import FAULTS, SLIPS, SWINGS, Readings
from .kinematics.estimate import Estimate, estimate, misfit, noise_of, preferred
from .kinematics.motion import Grid, Stretch
from .kinematics.parts import cut
from .kinematics.slip import with_slips
from .kinematics.swing import swings_as, with_swings
from .moments import Moment, measured, moments_of, without
from .result import SensorCheck
from .signals import MOVING, Signal, averaged, pieces, readings_of, refuse_mixed_up, signals

_MEAN_S = 0.03  # quick channels enter as means over so long
# Knots of the motion, in sampling periods. No simple ratio: were the samples always at the same
# places between the knots, a delay that moves them to better places would seem to be there.
_STEP_MEANS = 2.3607
_STEP_SAMPLES = 1.618  # of a channel that is slower than that
_MOMENTS = 3  # that are left out
_SEARCHES = 1  # for a better explanation, from one that does without a fault
# Nats by which a body that swings or wheels that slip have to be likelier. By two parameters more a
# likelihood gains as much by chance as often as a fault is claimed by chance.
_LIKELIER = -math.log(FALSE_CLAIMS)
_FLOOR = 1e-3  # least noise, of the channel's standard deviation

Told = Callable[[Estimate, Sequence[SensorFault]], bool]
Faults = tuple[SensorFault, ...]


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
    this estimate and the faults that it tells. Parts of the driving only take claims back;
    explanations without a fault do too, unless one of them is the better one. So do a body that
    swings and wheels that slip: in the place of one fault, or of all, where that is likelier. What
    `moments` hold is left out.
    """
    stretches = pieces(together)
    every = readings_of(together, stretches)
    readings = without(every, stretches, moments)
    refuse_mixed_up(together, readings)
    have = {r.channel for r in readings}
    lacking = [c for c in MOVING if c not in have]
    if told is None:
        told = tuple(signal for log in together for signal in signals(log))
    floors = {r.channel: _floor(r, told) for r in readings}
    step_s = _step(readings)
    told_of = partial(
        faults_of,
        absent=lacking,
        wheelbase_m=None if vehicle is None else vehicle.wheelbase_m,
        level=level,
    )

    def of(
        slow: Sequence[Readings],
        where: Sequence[Stretch],
        without: Collection[str],
        begin: dict[str, float] | None = None,
    ) -> Estimate:
        names = [name for name in _names(have) if name not in without]
        return estimate(slow, Grid(where, step_s), names, floors=floors, begin=begin, seed=seed)

    lacks = frozenset((*SWINGS, *SLIPS))
    found = of([averaged(r, _MEAN_S) for r in readings], stretches, lacks)
    others = [frozenset(kind) for kind in (SLIPS, SWINGS) if {*kind} <= {*_names(have)}]
    if frozenset(SWINGS) in others:
        readings = [with_swings(r, found) if r.channel == "ay_mps2" else r for r in readings]
    readings = _slipping(readings)
    means = [averaged(r, _MEAN_S) for r in readings]

    def part(some: Sequence[Stretch]) -> list[Readings]:
        own = _slipping(without(readings_of(together, some), some, moments))
        swung = [swings_as(r, some, of, stretches) for r, of in zip(own, readings, strict=True)]
        return [averaged(r, _MEAN_S) for r in swung]

    @cache  # a second search asks for most of them again
    def of_all(lacks: frozenset[str]) -> Estimate:
        return of(means, stretches, lacks)

    @cache  # that of one explanation is asked for against each of its rivals
    def misfit_of(found: Estimate, noise: Estimate) -> float:
        return misfit(means, found, noise)

    def against(found: Estimate, lacks: frozenset[str]) -> Rival:
        other = of_all(lacks)
        return Rival(other, preferred(misfit_of, found, other))

    def explained(found: Estimate, lacks: frozenset[str]) -> tuple[Estimate, Faults]:
        parts = []
        for some in cut(stretches):
            with suppress(SysidError):  # a part may hold too little
                parts.append(of(part(some), some, lacks))
        faults = told_of(found, parts=parts)
        for left in range(_SEARCHES, -1, -1):
            names = [fault.name for fault in faults if fault.found]
            rivals = {without: against(found, lacks.union(without)) for without in doubted(names)}
            doubts = dict(rivals)
            # What is no fault takes the place of one, too, where it is likelier.
            for kind in others:
                beside = {w: against(found, (lacks - kind).union(w)) for w in rivals}
                doubts |= {
                    w: rival
                    for w, rival in beside.items()
                    if rival.worse < min(0.0, doubts[w].worse) and _may_be(rival.estimate)
                }
            faults = told_of(found, parts=parts, rivals=doubts)
            best = min(rivals.values(), key=lambda rival: rival.worse, default=None)
            if not left or best is None or best.worse >= 0.0:
                break
            better = of(means, stretches, lacks, best.estimate.faults)
            if preferred(misfit_of, better, found) <= 0.0:
                break
            found = better
            faults = told_of(found, parts=parts)
        return found, faults

    faults = told_of(found)
    if not enough(found, faults):
        # Wheels that slip look like hills as well.
        claimed = {fault.name for fault in told_of(found, level=True) if fault.found}
        found, faults = explained(found, lacks)
        for kind in others:
            # A speed of wheels is only asked for where something is off: most cars have one.
            if kind <= {*SLIPS} and not claimed:
                continue
            other = of_all(lacks - kind)
            # On hills the speed of any car reads as that of wheels.
            if kind <= {*SLIPS} and not level and other.hilly:
                continue
            if preferred(misfit_of, other, found) > _LIKELIER and _may_be(other):
                instead, left = explained(other, lacks - kind)
                # Wheels that slip take the place of faults, and bring none.
                if kind <= {*SLIPS} and not claimed.issuperset(f.name for f in left if f.found):
                    continue
                lacks, found, faults = lacks - kind, instead, left
    noise = noise_of(readings, found, floors)
    return SensorCheck(
        logs=tuple(together),
        faults=faults,
        signals=told,
        estimate=found,
        noise=noise,
        readings=tuple(readings),
        stretches=tuple(stretches),
        vehicle=vehicle,
        moments=tuple(measured(m, every, stretches, found, noise) for m in moments),
    )


def _contradicting(found: SensorCheck, moments: Sequence[Moment]) -> Moment:
    """Of channels that contradict each other the one without which they do not."""

    def left(moment: Moment) -> float:
        kept = without(found.readings, found.stretches, [moment])
        return misfit([averaged(r, _MEAN_S) for r in kept], found.estimate, found.estimate)

    return min(moments, key=left) if len(moments) > 1 else moments[0]


def _slipping(readings: Sequence[Readings]) -> list[Readings]:
    """The readings, those of the longitudinal speed as of wheels that may slip."""
    along = next((r for r in readings if r.channel == "ax_mps2"), None)
    if along is None:
        return list(readings)
    return [with_slips(r, along) if r.channel == "vx_mps" else r for r in readings]


def _may_be(found: Estimate) -> bool:
    """Whether wheels slip forwards where they are driven: if not, the speed comes late."""
    return (
        all(name not in found.faults for name in SLIPS)
        or sum(found.faults[name] for name in SLIPS) > 0.0
    )


def _names(have: set[str]) -> list[str]:
    """Faults that these channels can show; without both speeds there is little."""
    hidden: set[str] = set()
    if "vy_mps" not in have:
        # The lateral speed is then whatever a_y asks for: that of the place of the IMU, in its
        # direction, of a body that swings. What moves a_x beside that is left, and would be taken
        # for a scale of a_x if it were not estimated.
        hidden |= {"delay.speeds", "arm_x", "turn", "gain.yaw_rate_radps", *SWINGS}
    if "ax_mps2" not in have:
        hidden |= {"arm_y", "delay.vx_mps", "turn", *SLIPS}
        if "vy_mps" not in have:
            hidden |= {"delay.ay_mps2", "lean.ay_mps2"}  # nothing holds the lateral speed
    return [n for n, kind in FAULTS.items() if kind.channel in have and n not in hidden]


def _floor(readings: Readings, told: Sequence[Signal]) -> float:
    quanta = [s.quantum for s in told if s.channel == readings.channel]
    # A channel that never changes, as in a simulated drive on a straight, has a floor too.
    spread = float(np.std(readings.values)) or 1.0
    return float(max(_FLOOR * spread, max(quanta, default=0.0) / np.sqrt(12.0)))


def _step(readings: Sequence[Readings]) -> float:
    """Knots no closer than the samples of the slowest channel bear."""
    periods = [float(np.median(np.diff(r.time_s)[np.diff(r.stretch) == 0])) for r in readings]
    return max(_STEP_MEANS * _MEAN_S, _STEP_SAMPLES * max(periods))
