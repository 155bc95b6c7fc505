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
    sideslip_and_mass_cost,
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
from .double_track import DoubleTrackObserver, DoubleTrackRun
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
from .experiments import (
    LoadExperiment,
    estimate_mass,
    estimate_pitch,
    estimate_roll_yaw,
)
from .fmu import FMUTwin, FMUVariables
from .joint import JointExperiment, mass_and_sideslip
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
from .schedule import ScheduleRun, run_schedule

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
    "DoubleTrackObserver",
    "DoubleTrackRun",
    "Drive14",
    "FMUTwin",
    "FMUVariables",
    "JointExperiment",
    "Load",
    "LoadExperiment",
    "NativeTwin",
    "Observation",
    "Observer",
    "Optimiser",
    "ParameterLaw",
    "PointMass",
    "Readings",
    "Schedule",
    "ScheduleRun",
    "SideBySide",
    "StateGain",
    "Twin",
    "TwinCar",
    "Unknown",
    "calibrate",
    "drive14",
    "estimate_mass",
    "estimate_pitch",
    "estimate_roll_yaw",
    "inertia_law",
    "mass_and_sideslip",
    "mass_law",
    "measure",
    "noisy_road",
    "observe",
    "observe_with",
    "on_manoeuvre",
    "rough_road",
    "run_schedule",
    "sideslip_and_mass_cost",
    "single_track",
    "swept_steer",
    "to_log",
    "unknowns",
    "urban_cycle",
]
