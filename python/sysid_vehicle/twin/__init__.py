"""The twin: observers around a vehicle simulator whose equations nobody needs to know.

A simulator runs beside the car with the same inputs; where the two read differently, its states
and its load are corrected. Dettu, Formentin and Savaresi, Joint vehicle state and parameters
estimation via Twin-in-the-Loop observers (2023), and a better parameter law on the same interface.
"""

from .adapters import CallableTwin, NativeTwin
from .calibrate import (
    BayesianSearch,
    Box,
    Calibration,
    Candidate,
    Optimiser,
    calibrate,
)
from .car import (
    LOAD_NAMES,
    LOADED_SUV,
    NOMINAL_SUV,
    SPORTS_CAR,
    SPORTS_CAR_LOAD,
    Load,
    PointMass,
    TwinCar,
)
from .drives import (
    INPUTS,
    OUTPUTS,
    Drive14,
    drive14,
    on_manoeuvre,
    rough_road,
    swept_steer,
    urban_cycle,
)
from .fmu import FMUTwin, FMUVariables
from .laws import (
    ParameterLaw,
    Schedule,
    SideBySide,
    Unknown,
    inertia_law,
    mass_law,
    unknowns,
)
from .logs import single_track, to_log
from .observer import STATES, Observation, Observer, StateGain, observe
from .protocol import Twin, observe_with
from .readings import READINGS, Readings, measure, noisy_road
from .residuals import ChannelResidual

__all__ = [
    "INPUTS",
    "LOADED_SUV",
    "LOAD_NAMES",
    "NOMINAL_SUV",
    "OUTPUTS",
    "READINGS",
    "SPORTS_CAR",
    "SPORTS_CAR_LOAD",
    "STATES",
    "BayesianSearch",
    "Box",
    "Calibration",
    "CallableTwin",
    "Candidate",
    "ChannelResidual",
    "Drive14",
    "FMUTwin",
    "FMUVariables",
    "Load",
    "NativeTwin",
    "Observation",
    "Observer",
    "Optimiser",
    "ParameterLaw",
    "PointMass",
    "Readings",
    "Schedule",
    "SideBySide",
    "StateGain",
    "Twin",
    "TwinCar",
    "Unknown",
    "calibrate",
    "drive14",
    "inertia_law",
    "mass_law",
    "measure",
    "noisy_road",
    "observe",
    "observe_with",
    "on_manoeuvre",
    "rough_road",
    "single_track",
    "swept_steer",
    "to_log",
    "unknowns",
    "urban_cycle",
]
