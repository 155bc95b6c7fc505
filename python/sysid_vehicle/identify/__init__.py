"""Identification of parameters and noise from driving."""

from .fit import Estimate, Fit, Start
from .identify import identify, refine, refit
from .search import METHODS

__all__ = ["METHODS", "Estimate", "Fit", "Start", "identify", "refine", "refit"]
