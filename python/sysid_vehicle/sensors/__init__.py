"""Sensors: whether the channels of a log agree, before any tyre is assumed."""

from .check import check
from .condition import Conditioning
from .faults import SensorFault
from .ready import made_ready
from .result import SensorCheck, put_right
from .signals import quantum

__all__ = [
    "Conditioning",
    "SensorCheck",
    "SensorFault",
    "check",
    "made_ready",
    "put_right",
    "quantum",
]
