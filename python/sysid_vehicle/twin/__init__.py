"""The twin: observers around a vehicle simulator whose equations nobody needs to know.

A simulator runs beside the car with the same inputs; where the two read differently, its states
and its load are corrected. Dettu, Formentin and Savaresi, Joint vehicle state and parameters
estimation via Twin-in-the-Loop observers (2023), and a better parameter law on the same interface.
"""

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
from .laws import (
    ParameterLaw,
    Schedule,
    SideBySide,
    Unknown,
    inertia_law,
    mass_law,
    unknowns,
)
from .observer import STATES, Observation, Observer, StateGain, observe
from .readings import READINGS, Readings, measure, noisy_road

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
    "Drive14",
    "Load",
    "Observation",
    "Observer",
    "ParameterLaw",
    "PointMass",
    "Readings",
    "Schedule",
    "SideBySide",
    "StateGain",
    "TwinCar",
    "Unknown",
    "drive14",
    "inertia_law",
    "mass_law",
    "measure",
    "noisy_road",
    "observe",
    "on_manoeuvre",
    "rough_road",
    "swept_steer",
    "unknowns",
    "urban_cycle",
]
