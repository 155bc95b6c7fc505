"""Sensors: whether the channels of a log agree, before any tyre is assumed."""

from ._check import check
from ._condition import low_passes
from ._faults import SensorFault
from ._ready import made_ready
from ._result import SensorCheck, put_right
from ._signals import quantum

__all__ = [
    "SensorCheck",
    "SensorFault",
    "check",
    "low_passes",
    "made_ready",
    "put_right",
    "quantum",
]
