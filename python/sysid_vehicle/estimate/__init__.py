"""State estimation: prepared driving, the noise model, filters for models of one's own."""

from ..log import MEASURED
from .alike import alike_in_force, without_force, without_unlearned
from .consistency import Consistency, nees_check, nis_check, whiteness_check
from .driving import UNITS, Driving
from .filters import FilterRun, FilterState, StateFilter, StateModel
from .input_noise import again, noisier
from .late import LateMeasurements
from .learn_noise import Learned, learn_noise, maximise_noise, promised_by_noise
from .noise import NoiseModel, first_guess, generous, noise_range
from .samples import steering_reach
from .turning import equal_blocks, moving, turning, turning_blocks

__all__ = [
    "MEASURED",
    "UNITS",
    "Consistency",
    "Driving",
    "FilterRun",
    "FilterState",
    "LateMeasurements",
    "Learned",
    "NoiseModel",
    "StateFilter",
    "StateModel",
    "again",
    "alike_in_force",
    "equal_blocks",
    "first_guess",
    "generous",
    "learn_noise",
    "maximise_noise",
    "moving",
    "nees_check",
    "nis_check",
    "noise_range",
    "noisier",
    "promised_by_noise",
    "steering_reach",
    "turning",
    "turning_blocks",
    "whiteness_check",
    "without_force",
    "without_unlearned",
]
