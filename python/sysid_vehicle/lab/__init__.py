"""The closed-loop laboratory: drive, observe, learn the noise, identify the tyres."""

from . import excitation
from .design import Design, Limits, design_excitation
from .em import EMResult, NoiseStructure, learn_observer_noise
from .hold import HeldValue, hold_value
from .information import information
from .loop import ClosedLoop, run_closed_loop
from .motion import TyreMotion
from .observed import READINGS, STATES, StateEstimate
from .observer import Observer, ObserverForm, ObserverNoise
from .parts import Actuator, Controller, Nominal, Online, Sensor, Sensors, Simulator
from .pictures import overview
from .preview import Coverage, Expected, Preview, preview
from .record import ObserverCar, ObserverRecord
from .saturation import Saturation
from .setup import Setup
from .tyre_data import GreyBoxVehicle, TyreLog
from .tyre_drive import drive_tyres
from .tyre_fit import TyreFit
from .tyres import identify_tyres
from .validate import IdentifiedCar, Validation, validate_tyres

__all__ = [
    "READINGS",
    "STATES",
    "Actuator",
    "ClosedLoop",
    "Controller",
    "Coverage",
    "Design",
    "EMResult",
    "Expected",
    "GreyBoxVehicle",
    "HeldValue",
    "IdentifiedCar",
    "Limits",
    "NoiseStructure",
    "Nominal",
    "Observer",
    "ObserverCar",
    "ObserverForm",
    "ObserverNoise",
    "ObserverRecord",
    "Online",
    "Preview",
    "Saturation",
    "Sensor",
    "Sensors",
    "Setup",
    "Simulator",
    "StateEstimate",
    "TyreFit",
    "TyreLog",
    "TyreMotion",
    "Validation",
    "design_excitation",
    "drive_tyres",
    "excitation",
    "hold_value",
    "identify_tyres",
    "information",
    "learn_observer_noise",
    "overview",
    "preview",
    "run_closed_loop",
    "validate_tyres",
]
