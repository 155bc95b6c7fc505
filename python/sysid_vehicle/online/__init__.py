"""Estimators that run while driving, one reading at a time."""

from .cornering import CorneringRls, CorneringRun, cornering_stiffness
from .mu_slip.compare import MuSlipComparison, compare_mu_slip
from .mu_slip.curve import (
    MAGIC_FORMULA,
    TWO_PARAMETER,
    MuSlipCurve,
    MuSlipPrior,
    magic_formula_coefficients,
)
from .mu_slip.data import MuSlipData, simulate_mu_slip, sinusoidal_slip
from .mu_slip.figures import (
    MuSlipFrame,
    animate_mu_slip,
    draw_mu_slip_convergence,
    draw_mu_slip_lissajous,
    draw_mu_slip_observability,
    draw_mu_slip_signal,
    mu_slip_overview,
    save_animation,
)
from .mu_slip.filter import MuSlipFilter, mu_slip_ekf, mu_slip_smooth
from .mu_slip.least_squares import mu_slip_cramer_rao, mu_slip_fit
from .mu_slip.noise import MuSlipNoiseStudy, mu_slip_over_noise
from .mu_slip.results import MuSlipEstimate, MuSlipRun, MuSlipSmoothed
from .sideslip import KINDS, SideslipEstimate, SideslipObserver, estimate_sideslip
from .sideslip_calibration import SideslipCalibration, calibrate_sideslip, fitted_vehicle
from .sideslip_error import SideslipError
from .sideslip_results import SideslipRun, sideslip_overview
from .sideslip_settings import SideslipSettings

__all__ = [
    "KINDS",
    "MAGIC_FORMULA",
    "TWO_PARAMETER",
    "CorneringRls",
    "CorneringRun",
    "MuSlipComparison",
    "MuSlipCurve",
    "MuSlipData",
    "MuSlipEstimate",
    "MuSlipFilter",
    "MuSlipFrame",
    "MuSlipNoiseStudy",
    "MuSlipPrior",
    "MuSlipRun",
    "MuSlipSmoothed",
    "SideslipCalibration",
    "SideslipError",
    "SideslipEstimate",
    "SideslipObserver",
    "SideslipRun",
    "SideslipSettings",
    "animate_mu_slip",
    "calibrate_sideslip",
    "compare_mu_slip",
    "cornering_stiffness",
    "draw_mu_slip_convergence",
    "draw_mu_slip_lissajous",
    "draw_mu_slip_observability",
    "draw_mu_slip_signal",
    "estimate_sideslip",
    "fitted_vehicle",
    "magic_formula_coefficients",
    "mu_slip_cramer_rao",
    "mu_slip_ekf",
    "mu_slip_fit",
    "mu_slip_over_noise",
    "mu_slip_overview",
    "mu_slip_smooth",
    "save_animation",
    "sideslip_overview",
    "simulate_mu_slip",
    "sinusoidal_slip",
]
