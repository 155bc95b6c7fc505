"""Axle forces from the motion, before any tyre is assumed."""

from ._axles import axle_forces
from ._result import COLOURS, AxleForces

__all__ = ["COLOURS", "AxleForces", "axle_forces"]
