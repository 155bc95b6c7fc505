"""Identification of parameters and noise from driving."""

from .ahead.ahead import predicting_ahead
from .beside_noise import beside_noise
from .fit import Fit
from .identify import identify, profile_fit, with_own_offsets
from .input_noise import lost_to_input_noise, with_exact_inputs
from .intervals.estimates import Estimate
from .intervals.posterior import Posterior
from .intervals.profile import Profile
from .maximum import (
    far_below,
    refine,
    refine_above,
    refine_beside,
    refine_while,
    refit,
    relearn,
    unmoved,
)
from .offsets import driving_beside, driving_of
from .predictive import Prediction, predict
from .runs.runs import Difference, RunsFit, identify_runs
from .search.box import free_box, objective_of
from .search.scanned import longest_s
from .search.search import METHODS
from .search.settle import settle
from .search.starts import Start, Starts
from .several_starts import refine_from
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
    "beside_noise",
    "driving_beside",
    "driving_of",
    "explaining",
    "far_below",
    "free_box",
    "identify",
    "identify_runs",
    "longest_s",
    "lost_to_input_noise",
    "objective_of",
    "predict",
    "predicting_ahead",
    "profile_fit",
    "refine",
    "refine_above",
    "refine_beside",
    "refine_from",
    "refine_while",
    "refit",
    "relearn",
    "settle",
    "unmoved",
    "with_exact_inputs",
    "with_own_offsets",
]
