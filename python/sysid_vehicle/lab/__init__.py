"""The closed-loop laboratory: drive, observe, learn the noise, identify the tyres."""

from . import excitation
from .design.design import Design, design_excitation
from .design.information import information
from .design.limits import Limits
from .design.preview import Coverage, Expected, Preview, preview
from .drive.loop import ClosedLoop, run_closed_loop
from .drive.pictures import overview
from .drive.saturation import Saturation
from .observer.em import EMResult, NoiseStructure, learn_observer_noise
from .observer.observed import READINGS, STATES, StateEstimate
from .observer.observer import Observer, ObserverForm, ObserverNoise
from .observer.record import ObserverCar, ObserverRecord
from .parts import Actuator, Controller, Nominal, Online, Sensor, Sensors, Simulator
from .setup import Setup
from .tyres.data import GreyBoxVehicle, TyreLog
from .tyres.drive import drive_tyres
from .tyres.fit import TyreFit
from .tyres.hold import HeldValue, hold_value
from .tyres.identify import identify_tyres
from .tyres.motion import TyreMotion
from .tyres.validate import IdentifiedCar, Validation, validate_tyres

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
