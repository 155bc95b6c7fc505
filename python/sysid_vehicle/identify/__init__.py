"""Identification of parameters and noise from driving."""

from .fit import Estimate, Fit, Start
from .identify import free_box, identify, refine, refit, settle
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
    "free_box",
    "identify",
    "predict",
    "refine",
    "refit",
    "settle",
]
