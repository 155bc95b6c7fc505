"""State estimation on logs: prepared driving and the noise model."""

from .driving import MEASURED, UNITS, Driving
from .noise import NoiseModel, first_guess, learn_noise

__all__ = ["MEASURED", "UNITS", "Driving", "NoiseModel", "first_guess", "learn_noise"]
