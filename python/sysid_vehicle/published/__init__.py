"""Published experiments repeated as published, to compare with.

- The closed-loop experiment: `setup`, `Identification` and `Oval`, `observer`, `regress_tyres` with
  the losses, the start and the box of its identification.
- Dettu, Formentin and Savaresi, Joint vehicle state and parameters estimation via
  Twin-in-the-Loop observers (2023): `estimate_mass`, `estimate_roll_yaw`, `estimate_pitch`,
  `run_schedule`, `mass_and_sideslip`, and the double track that they compare with.
- The dual sideslip observer of Cl4y3R/VehicleStateEstimation (2024): `estimate_sideslip`.
"""

from .closed_loop import OBSERVER_FORM, OBSERVER_NOISE, observer, setup
from .double_track import DoubleTrackObserver, DoubleTrackRun
from .excitation import Identification, Oval, excitations
from .joint import JointExperiment, mass_and_sideslip, sideslip_and_mass_cost
from .load import LoadExperiment, estimate_mass, estimate_pitch, estimate_roll_yaw
from .schedule import ScheduleRun, run_schedule
from .sideslip import PublishedSideslipObserver, estimate_sideslip
from .tyres import LOSSES, TYRE_BOX, TYRE_START, TyreRegression, regress_tyres

__all__ = [
    "LOSSES",
    "OBSERVER_FORM",
    "OBSERVER_NOISE",
    "TYRE_BOX",
    "TYRE_START",
    "DoubleTrackObserver",
    "DoubleTrackRun",
    "Identification",
    "JointExperiment",
    "LoadExperiment",
    "Oval",
    "PublishedSideslipObserver",
    "ScheduleRun",
    "TyreRegression",
    "estimate_mass",
    "estimate_pitch",
    "estimate_roll_yaw",
    "estimate_sideslip",
    "excitations",
    "mass_and_sideslip",
    "observer",
    "regress_tyres",
    "run_schedule",
    "setup",
    "sideslip_and_mass_cost",
]
