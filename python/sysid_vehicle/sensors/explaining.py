"""What explains the readings: faults of sensors, and what looks like them and is none.

A body that swings and wheels that slip are no faults, and take the place of one, or of all, where
that is likelier.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Mapping, Sequence
from contextlib import suppress
from functools import cache, partial

from ..errors import SysidError
from ..log import Log
from .faults import FALSE_CLAIMS, Rival, SensorFault, doubted, faults_of
from .kinematics.equations import FAULTS, SLIPS, SWINGS, Readings
from .kinematics.estimate import Estimate, estimate, misfit, preferred
from .kinematics.motion import Grid, Stretch
from .kinematics.parts import cut
from .kinematics.slip import with_slips
from .kinematics.swing import swings_as, with_swings
from .moments import Moment, without
from .signals import MOVING, averaged, readings_of

MEAN_S = 0.03
"""Quick channels enter as means over so long."""

_SEARCHES = 1  # for a better explanation, from one that does without a fault
# Nats by which a body that swings or wheels that slip have to be likelier. By two parameters more a
# likelihood gains as much by chance as often as a fault is claimed by chance.
_LIKELIER = -math.log(FALSE_CLAIMS)
_LACKS = frozenset((*SWINGS, *SLIPS))  # of the first explanation

Told = Callable[[Estimate, Sequence[SensorFault]], bool]
Faults = tuple[SensorFault, ...]


class Explaining:
    """The readings of some logs, and how well what may be wrong with them explains them.

    Parameters
    ----------
    logs, stretches, readings
        The driving, where it is usable, and what was read there.
    moments : sequence of Moment
        What they hold is left out.
    floors : dict of str to float
        Least noise by channel.
    step_s : float
        From knot to knot of the motion.
    wheelbase_m : float, optional
        Of the car.
    level : bool
        Whether the ground is level.
    seed : int
        Of the draws that teach the noise.
    """

    def __init__(
        self,
        logs: Sequence[Log],
        stretches: Sequence[Stretch],
        readings: Sequence[Readings],
        moments: Sequence[Moment],
        *,
        floors: dict[str, float],
        step_s: float,
        wheelbase_m: float | None,
        level: bool,
        seed: int,
    ) -> None:
        self.floors = floors
        self._logs, self._stretches, self._moments = logs, stretches, moments
        self._step_s, self._level, self._seed = step_s, level, seed
        have = {r.channel for r in readings}
        self._names = _names(have)
        self._told = partial(
            faults_of,
            absent=[c for c in MOVING if c not in have],
            wheelbase_m=wheelbase_m,
            level=level,
        )
        # What is no fault, of what these channels can show.
        kinds = (frozenset(SLIPS), frozenset(SWINGS))
        self._others = [kind for kind in kinds if kind <= {*self._names}]
        self._first = self._of([averaged(r, MEAN_S) for r in readings], stretches, _LACKS)
        swing = frozenset(SWINGS) in self._others
        self.readings = _slipping(
            [
                with_swings(r, self._first) if swing and r.channel == "ay_mps2" else r
                for r in readings
            ]
        )
        self._means = [averaged(r, MEAN_S) for r in self.readings]
        # A second search asks for most of them again; one is compared with each of its rivals.
        self._without = cache(lambda lacks: self._of(self._means, stretches, lacks))
        self._misfit = cache(lambda found, noise: misfit(self._means, found, noise))

    def best(self, enough: Told) -> tuple[Estimate, Faults]:
        """The motion and the faults that explain the readings best.

        `enough` is asked with a first estimate and the faults that it tells.
        """
        found, lacks = self._first, _LACKS
        faults = self._told(found)
        if enough(found, faults):
            return found, faults
        # Wheels that slip look like hills as well.
        claimed = {fault.name for fault in self._told(found, level=True) if fault.found}
        found, faults = self._explained(found, lacks)
        for kind in self._others:
            slips = kind <= {*SLIPS}
            # A speed of wheels is only asked for where something is off: most cars have one.
            if slips and not claimed:
                continue
            other = self._without(lacks - kind)
            # On hills the speed of any car reads as that of wheels.
            if slips and not self._level and other.hilly:
                continue
            if preferred(self._misfit, other, found) > _LIKELIER and _may_be(other):
                instead, left = self._explained(other, lacks - kind)
                # Wheels that slip take the place of faults, and bring none.
                if slips and not claimed.issuperset(f.name for f in left if f.found):
                    continue
                lacks, found, faults = lacks - kind, instead, left
        return found, faults

    def _of(
        self,
        slow: Sequence[Readings],
        where: Sequence[Stretch],
        lacks: Collection[str],
        begin: dict[str, float] | None = None,
    ) -> Estimate:
        """The motion and all faults but those that are lacking."""
        names = [name for name in self._names if name not in lacks]
        grid = Grid(where, self._step_s)
        return estimate(slow, grid, names, floors=self.floors, begin=begin, seed=self._seed)

    def _part(self, some: Sequence[Stretch]) -> list[Readings]:
        """Readings of a part of the driving, as those of all of it are taken."""
        own = _slipping(without(readings_of(self._logs, some), some, self._moments))
        pairs = zip(own, self.readings, strict=True)
        return [averaged(swings_as(r, some, of, self._stretches), MEAN_S) for r, of in pairs]

    def _against(self, found: Estimate, lacks: frozenset[str]) -> Rival:
        other = self._without(lacks)
        return Rival(other, preferred(self._misfit, found, other))

    def _explained(self, found: Estimate, lacks: frozenset[str]) -> tuple[Estimate, Faults]:
        """An estimate and its faults, or a better one that does without one of them.

        Parts of the driving only take claims back; explanations without a fault do too, unless one
        of them is the better one.
        """
        parts = []
        for some in cut(self._stretches):
            with suppress(SysidError):  # a part may hold too little
                parts.append(self._of(self._part(some), some, lacks))
        faults = self._told(found, parts=parts)
        for left in range(_SEARCHES, -1, -1):
            names = [fault.name for fault in faults if fault.found]
            rivals = {w: self._against(found, lacks.union(w)) for w in doubted(names)}
            faults = self._told(found, parts=parts, rivals=self._doubts(found, lacks, rivals))
            best = min(rivals.values(), key=lambda rival: rival.worse, default=None)
            if not left or best is None or best.worse >= 0.0:
                break
            better = self._of(self._means, self._stretches, lacks, best.estimate.faults)
            if preferred(self._misfit, better, found) <= 0.0:
                break
            found = better
            faults = self._told(found, parts=parts)
        return found, faults

    def _doubts(
        self, found: Estimate, lacks: frozenset[str], rivals: Mapping[tuple[str, ...], Rival]
    ) -> dict[tuple[str, ...], Rival]:
        """The rivals, and what is no fault in the place of one, where it is likelier."""
        doubts = dict(rivals)
        for kind in self._others:
            beside = {w: self._against(found, (lacks - kind).union(w)) for w in rivals}
            doubts |= {
                w: rival
                for w, rival in beside.items()
                if rival.worse < min(0.0, doubts[w].worse) and _may_be(rival.estimate)
            }
        return doubts


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
