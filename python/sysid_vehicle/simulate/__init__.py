"""Simulated drives: a model in the hands of a driver, with sensor noise and an uneven road."""

from .drive import Drive, drive, drive_truth
from .example import example_vehicle
from .noise import RoadDisturbance, SensorNoise

__all__ = ["Drive", "RoadDisturbance", "SensorNoise", "drive", "drive_truth", "example_vehicle"]
