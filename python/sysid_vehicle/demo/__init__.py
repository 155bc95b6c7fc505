"""A demonstration: a simulated car with a hidden effect, which a study then finds."""

from .hidden import RANDOM, hide
from .run import DEFAULT, Demonstration, run_demo

__all__ = ["DEFAULT", "RANDOM", "Demonstration", "hide", "run_demo"]
