"""Axle forces from the motion, before any tyre is assumed."""

from .axles import axle_forces
from .result import COLOURS, AxleForces

__all__ = ["COLOURS", "AxleForces", "axle_forces"]
