"""A car to try things with."""

from __future__ import annotations

from ..tyre import Tyre
from ..vehicle import Vehicle


def example_vehicle() -> Vehicle:
    """Make a plausible sports saloon with rear-wheel drive that understeers."""
    return Vehicle(
        name="sports saloon",
        mass_kg=1250.0,
        yaw_inertia_kgm2=1750.0,
        lf_m=1.25,
        lr_m=1.35,
        cg_height_m=0.5,
        track_front_m=1.52,
        track_rear_m=1.50,
        drag_area_m2=0.65,
        brake_front_share=0.65,
        drive_front_share=0.0,
        tyre_front=Tyre(B=10.5, C=1.4, D=1.03, E=0.1),
        tyre_rear=Tyre(B=12.0, C=1.4, D=1.08, E=0.05),
    )
