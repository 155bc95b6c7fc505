"""Identification of parameters and noise from driving."""

from .fit import Estimate, Fit, Start
from .identify import identify, refine, refit
from .predictive import Prediction, predict
from .search import METHODS
from .suspects import explaining

__all__ = [
    "METHODS",
    "Estimate",
    "Fit",
    "Prediction",
    "Start",
    "explaining",
    "identify",
    "predict",
    "refine",
    "refit",
]
