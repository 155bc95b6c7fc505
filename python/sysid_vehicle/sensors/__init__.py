"""Sensors: whether the channels of a log agree, before any tyre is assumed."""

from .check import check
from .condition import Conditioning
from .faults import SensorFault
from .ready import Kinematics, made_ready
from .result import SensorCheck
from .settled import backed
from .signals import quantum

__all__ = [
    "Conditioning",
    "Kinematics",
    "SensorCheck",
    "SensorFault",
    "backed",
    "check",
    "made_ready",
    "quantum",
]
