"""Simulated drives: a model in the hands of a driver, with sensor noise and an uneven road."""

from ._drive import Drive, drive, drive_truth
from ._example import example_vehicle
from ._noise import RoadDisturbance, SensorNoise

__all__ = ["Drive", "RoadDisturbance", "SensorNoise", "drive", "drive_truth", "example_vehicle"]
