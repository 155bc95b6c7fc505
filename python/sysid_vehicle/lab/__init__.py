"""The closed-loop laboratory: drive, observe, learn the noise, identify the tyres."""

from . import excitation
from .em import EMResult, NoiseStructure, learn_observer_noise
from .loop import ClosedLoop, run_closed_loop
from .observed import READINGS, STATES, StateEstimate
from .observer import Observer, ObserverCar, ObserverForm, ObserverNoise, ObserverRecord
from .parts import Actuator, Controller, Nominal, Online, Sensor, Sensors, Simulator
from .saturation import Saturation
from .setup import Setup

__all__ = [
    "READINGS",
    "STATES",
    "Actuator",
    "ClosedLoop",
    "Controller",
    "EMResult",
    "NoiseStructure",
    "Nominal",
    "Observer",
    "ObserverCar",
    "ObserverForm",
    "ObserverNoise",
    "ObserverRecord",
    "Online",
    "Saturation",
    "Sensor",
    "Sensors",
    "Setup",
    "Simulator",
    "StateEstimate",
    "excitation",
    "learn_observer_noise",
    "run_closed_loop",
]
