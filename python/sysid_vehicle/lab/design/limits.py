"""What a designed excitation must keep to."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..._common.typed import typed, typed_fields
from ...diagnose import DriveLimits
from ...effects import length_beyond
from ...errors import InvalidInput
from ...vehicle import Vehicle
from ..excitation.weaving import LEAST_MPS
from .preview import Preview


@dataclass(frozen=True)
class Limits:
    """What the drive must keep to.

    Parameters
    ----------
    slowest_mps, fastest_mps : float
        Speed.
    road_width_m : float
        Width of the strip that the car's centre may use.
    lateral_mps2 : float
        Lateral acceleration.
    slip_share : float
        Largest slip angle of either axle, in multiples of that at its peak.

    Raises
    ------
    InvalidInput
        If one is not positive, or the fastest speed is not above the slowest.
    """

    slowest_mps: float = 8.0
    fastest_mps: float = 45.0
    road_width_m: float = 40.0
    lateral_mps2: float = 20.0
    slip_share: float = 3.0

    @typed_fields
    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            if not value > 0.0:
                raise InvalidInput(f"Limits: {name} = {value!r}; give a positive number")
        if not self.fastest_mps > self.slowest_mps + 2.0:
            raise InvalidInput(
                f"Limits: fastest_mps = {self.fastest_mps:g} leaves no room above slowest_mps = "
                f"{self.slowest_mps:g}; 2 m/s and more are needed"
            )

    @classmethod
    @typed
    def usual(cls, vehicle: Vehicle, **others: float) -> Limits:
        """Limits that suit a car: what a driver could drive (`DriveLimits.usual`), and more speed.

        Speeds are in proportion to a driver's top speed, widths to the length of the car. The
        lateral acceleration is a driver's only where the car would tip over.

        Parameters
        ----------
        vehicle : Vehicle
        **others
            Limits that are known.
        """
        driver = DriveLimits.usual(vehicle)
        share = driver.speed_mps / DriveLimits.speed_mps
        tips = driver.lateral_mps2 < DriveLimits.lateral_mps2
        found = {
            "slowest_mps": max(share * cls.slowest_mps, LEAST_MPS),
            "fastest_mps": share * cls.fastest_mps,
            "road_width_m": length_beyond(vehicle.wheelbase_m) * cls.road_width_m,
            "lateral_mps2": driver.lateral_mps2 if tips else cls.lateral_mps2,
        }
        return cls(**{**found, **others})

    @typed
    def broken(self, seen: Preview) -> list[tuple[str, float]]:
        """Name each limit that a drive breaks, and by what share."""
        t = seen.drive.truth
        lateral = float(np.abs(t["ay_mps2"]).max())
        found = [
            ("speed", self.slowest_mps / max(float(t["vx_mps"].min()), 1e-3)),
            ("speed", float(t["vx_mps"].max()) / self.fastest_mps),
            ("road width", seen.road_width_m / self.road_width_m),
            ("lateral acceleration", lateral / self.lateral_mps2),
            *((f"{c.axle} slip angle", c.reached / self.slip_share) for c in seen.coverage),
        ]
        return [(what, share - 1.0) for what, share in found if share > 1.0]
