"""Logs made ready for the likelihood without being asked: noise white, channels in time."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from ..errors import SysidError
from ..log import Log
from .apply import corrected, retimed
from .check import checked
from .condition import conditioned
from .faults import SensorFault, to_put_right
from .kinematics.estimate import LEVEL_MPS2, Estimate

_DELAYS = ("delay_vx_s", "delay_vy_s", "delay_ay_s")


@dataclass(frozen=True)
class Kinematics:
    """What readings say of each other, before any tyre.

    Attributes
    ----------
    settles : tuple of str
        Effects that have been dealt with, or are not there.
    left : tuple of SensorFault
        Faults that are still in the readings.
    """

    settles: tuple[str, ...] = ()
    left: tuple[SensorFault, ...] = ()


def made_ready(
    logs: Sequence[Log], others: Sequence[Log], *, level: bool = False
) -> tuple[list[Log], list[Log], Kinematics]:
    """Logs with white noise, whose channels were read at the same moment.

    Biases, scales and places of sensors stay as they are: they are effects of the catalogue, which
    says more of them. Delays of one channel against another are told by kinematics alone, better
    than by any model with tyres. So is the slip of wheels whose speed is logged.

    Parameters
    ----------
    logs, others : sequence of Log
        Of the same sensors; the first ones tell the delays.
    level : bool
        Whether the ground is level.

    Returns
    -------
    logs, others : list of Log
    Kinematics
        A delay that was found is taken out, and settled; slip is taken out.
    """
    ready = conditioned([*logs, *others])
    own, rest = ready[: len(logs)], ready[len(logs) :]
    try:
        found = checked(own, enough=_nothing, level=level)
    except SysidError:
        return own, rest, Kinematics()
    # A driver who steers, brakes and drives against a road that is not level makes speeds and
    # accelerations seem to come at other times.
    if max(found.estimate.road_mps2.values()) > LEVEL_MPS2:
        return own, rest, Kinematics()
    left = tuple(fault for fault in found.faults if fault.name not in _DELAYS)
    late = to_put_right([found[name] for name in _DELAYS])
    off = late | found.estimate.slips
    if not off:
        return own, rest, Kinematics((), left)
    done = [log.corrected(*corrected(log, off), retimed(log, late, found.faults)) for log in ready]
    settles = ("sensor_delay",) if late else ()
    return done[: len(logs)], done[len(logs) :], Kinematics(settles, left)


def _nothing(_: Estimate, faults: Sequence[SensorFault]) -> bool:
    """Whether no fault is told: a delay may come out of what explains another one away."""
    return not any(fault.found for fault in faults)
