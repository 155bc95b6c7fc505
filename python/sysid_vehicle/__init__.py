"""From a driving log to a better car model.

Compare a single-track model with what was measured, see where it fails, learn which physical effect
is missing, add it, and watch the error fall on validation data.
"""

from ._common import starting as _starting  # noqa: F401  first: the others take a while

# isort: split
from . import manoeuvres
from ._core import __version__
from .compare import Comparison, compare
from .diagnose import (
    Change,
    Diagnosis,
    DriveLimits,
    bias_report,
    ceiling,
    changed,
    diagnose,
    suggest_manoeuvre,
    unknown,
    verdicts,
    where,
)
from .effects import (
    Effect,
    catalogue,
    define_effect,
    effect,
    forget_effect,
    installed_effects,
    load_effects,
    parameter,
    state,
)
from .errors import Interrupted, InvalidInput, NumericalError, SysidError, SysidWarning
from .estimate import Driving, NoiseModel
from .export import casadi_function, export
from .fleet import Fleet, improve_many
from .forces import AxleForces, axle_forces
from .identify import Fit, RunsFit, identify, identify_runs
from .log import Log, check_excitation
from .model import Model
from .read import ChannelMap, propose_channels, read_log
from .rules import Rules
from .saved import load
from .sensors import SensorCheck, check
from .simulate import RoadDisturbance, SensorNoise, drive, example_vehicle
from .study import Study, improve, next_drive
from .tyre import Tyre
from .vehicle import Vehicle

__all__ = [
    "AxleForces",
    "Change",
    "ChannelMap",
    "Comparison",
    "Diagnosis",
    "DriveLimits",
    "Driving",
    "Effect",
    "Fit",
    "Fleet",
    "Interrupted",
    "InvalidInput",
    "Log",
    "Model",
    "NoiseModel",
    "NumericalError",
    "RoadDisturbance",
    "Rules",
    "RunsFit",
    "SensorCheck",
    "SensorNoise",
    "Study",
    "SysidError",
    "SysidWarning",
    "Tyre",
    "Vehicle",
    "__version__",
    "axle_forces",
    "bias_report",
    "casadi_function",
    "catalogue",
    "ceiling",
    "changed",
    "check",
    "check_excitation",
    "compare",
    "define_effect",
    "diagnose",
    "drive",
    "effect",
    "example_vehicle",
    "export",
    "forget_effect",
    "identify",
    "identify_runs",
    "improve",
    "improve_many",
    "installed_effects",
    "load",
    "load_effects",
    "manoeuvres",
    "next_drive",
    "parameter",
    "propose_channels",
    "read_log",
    "state",
    "suggest_manoeuvre",
    "unknown",
    "verdicts",
    "where",
]
