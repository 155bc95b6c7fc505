"""The dual sideslip observer of Cl4y3R/VehicleStateEstimation (2024) as published.

Equations and defects: `cpp/include/sysid/published/sideslip_observer.hpp`.
"""

from __future__ import annotations

from .. import _core
from ..log import Log
from ..online import SideslipObserver, SideslipRun, SideslipSettings
from ..online.sideslip import SENSORS, observed_car, run_over, static_stiffness
from ..vehicle import Vehicle


class PublishedSideslipObserver(SideslipObserver):
    """The published dual UKF, with its defects; it has no settings.

    It needs every reading: it raises `NumericalError` for one that is missing or that no car
    gives, and for a step of more than 1 s.

    Parameters
    ----------
    vehicle : Vehicle
        The car; its tyres are linear, with the cornering stiffness at the static load.
    """

    def __init__(self, vehicle: Vehicle) -> None:
        core = _core.PublishedDual(observed_car(vehicle), *static_stiffness(vehicle))
        self._begin(vehicle, "published", core)


def estimate_sideslip(vehicle: Vehicle, log: Log) -> SideslipRun:
    """Estimate sideslip over a whole log, as :func:`sysid_vehicle.online.estimate_sideslip` does.

    Raises
    ------
    InvalidInput
        If a channel is absent.
    NumericalError
        If a reading is missing or no car gives it, or the filter diverges.
    """
    for name in SENSORS:
        log[name]  # the observer of today does without some, this one does not
    return run_over(log, PublishedSideslipObserver(vehicle), SideslipSettings.of(log))
