"""Sensors: whether the channels of a log agree, before any tyre is assumed."""

from ._check import check
from ._faults import SensorFault
from ._result import SensorCheck, put_right

__all__ = ["SensorCheck", "SensorFault", "check", "put_right"]
