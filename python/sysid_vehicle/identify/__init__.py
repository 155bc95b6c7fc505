"""Identification of parameters and noise from driving."""

from .fit import Estimate, Fit, Start
from .identify import identify, refine, refit
from .predictive import Prediction, predict
from .search import METHODS

__all__ = [
    "METHODS",
    "Estimate",
    "Fit",
    "Prediction",
    "Start",
    "identify",
    "predict",
    "refine",
    "refit",
]
