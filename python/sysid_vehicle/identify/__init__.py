"""Identification of parameters and noise from driving."""

from .ahead import predicting_ahead
from .box import free_box, objective_of
from .estimates import Estimate
from .fit import Fit
from .identify import identify, profile_fit
from .maximum import refine, refine_above, refine_while, refit, relearn, unmoved
from .offsets import driving_beside, driving_of
from .posterior import Posterior
from .predictive import Prediction, predict
from .profile import Profile
from .runs import Difference, RunsFit, identify_runs
from .search import METHODS
from .settle import settle
from .starts import Start, Starts
from .suspects import explaining

__all__ = [
    "METHODS",
    "Difference",
    "Estimate",
    "Fit",
    "Posterior",
    "Prediction",
    "Profile",
    "RunsFit",
    "Start",
    "Starts",
    "driving_beside",
    "driving_of",
    "explaining",
    "free_box",
    "identify",
    "identify_runs",
    "objective_of",
    "predict",
    "predicting_ahead",
    "profile_fit",
    "refine",
    "refine_above",
    "refine_while",
    "refit",
    "relearn",
    "settle",
    "unmoved",
]
