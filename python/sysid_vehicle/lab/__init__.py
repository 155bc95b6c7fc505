"""The closed-loop laboratory: drive, observe, learn the noise, identify the tyres."""

from .em import EMResult, NoiseStructure, learn_observer_noise
from .observed import READINGS, STATES, StateEstimate
from .observer import Observer, ObserverCar, ObserverForm, ObserverNoise, ObserverRecord

__all__ = [
    "READINGS",
    "STATES",
    "EMResult",
    "NoiseStructure",
    "Observer",
    "ObserverCar",
    "ObserverForm",
    "ObserverNoise",
    "ObserverRecord",
    "StateEstimate",
    "learn_observer_noise",
]
