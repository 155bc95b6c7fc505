"""What can be driven, and the manoeuvres of the library within it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from ... import manoeuvres
from ..._common.arguments import check_positive
from ..._common.typed import typed_fields
from ...effects import length_beyond
from ...errors import InvalidInput
from ...manoeuvres import Manoeuvre, peak_lateral_mps2
from ...simulate import Drive
from ...vehicle import GRAVITY_MPS2, Vehicle
from .suggestion import ground_m

_SLOWER = (1.0, 0.7, 0.5, 0.35)  # of the speed, where the ground is too small
_LORRY_KG, _LORRY_MPS = 3500.0, 25.0  # by law
_BELOW_TIPPING = 0.6  # no claim depends on it: what is proposed to a driver
_EASIER = (1.0, 0.8, 0.6)  # of the lateral acceleration, where a manoeuvre asks too much


@dataclass(frozen=True)
class DriveLimits:
    """What can be driven.

    Parameters
    ----------
    speed_mps : float
        Highest speed.
    lateral_mps2 : float
        Highest lateral acceleration, either side.
    area_m : tuple of 2 floats, optional
        Longer and shorter side of the ground there is.
    duration_s : float
        Longest drive.
    """

    speed_mps: float = 36.0
    lateral_mps2: float = 8.5
    area_m: tuple[float, float] | None = None
    duration_s: float = 120.0

    @typed_fields
    def __post_init__(self) -> None:
        limits = {"speed_mps": self.speed_mps, "lateral_mps2": self.lateral_mps2}
        check_positive("DriveLimits", **limits, duration_s=self.duration_s)
        if self.area_m is not None and not min(self.area_m) > 0.0:
            raise InvalidInput(f"area_m is {self.area_m}; give two positive lengths")

    @classmethod
    def usual(cls, vehicle: Vehicle, **others: Any) -> DriveLimits:
        """Limits that a car may have, known from its size.

        The top speed of a small one goes as the root of its length. Above 3.5 t it is 25 m/s, for
        lorries are limited to that (Council Directive 92/6/EEC). The lateral acceleration is at
        most 0.6 of that at which a rigid body on this track would tip over: springs and tyres
        give way, and the load may sway.

        Parameters
        ----------
        vehicle : Vehicle
            An ordinary one drives up to 36 m/s, and one that is larger is no faster.
        **others
            Limits that are known.
        """
        length = min(length_beyond(vehicle.wheelbase_m), 1.0)
        speed = length**0.5 * cls.speed_mps
        if vehicle.mass_kg > _LORRY_KG:
            speed = min(speed, _LORRY_MPS)
        lateral = cls.lateral_mps2
        if vehicle.cg_height_m > 0.0:
            track = min(vehicle.track_front_m, vehicle.track_rear_m)
            tips_mps2 = 0.5 * GRAVITY_MPS2 * track / vehicle.cg_height_m
            lateral = min(lateral, _BELOW_TIPPING * tips_mps2)
        return cls(**{"speed_mps": speed, "lateral_mps2": lateral, **others})

    @property
    def farthest_m(self) -> float:
        """What no two places of a drive within them are apart by more."""
        return np.inf if self.area_m is None else float(np.hypot(*self.area_m))

    def hold(self, drive: Drive) -> bool:
        """Whether a drive stayed within them."""
        speed, lateral = drive.states[:, 0], drive.outputs[:, 4]
        inside = (
            speed.max() <= 1.02 * self.speed_mps
            and np.abs(lateral).max() <= 1.05 * self.lateral_mps2
            and drive.log.duration_s <= self.duration_s
        )
        if self.area_m is None or not inside:
            return bool(inside)
        long, short = ground_m(drive)
        return long <= max(self.area_m) and short <= min(self.area_m)


def menu(limits: DriveLimits, car: Vehicle) -> list[tuple[Manoeuvre, ...]]:
    """Manoeuvres of the library at several speeds and strengths within the limits.

    Circles and rows of cones are as many times those of ordinary cars as the car is. Steps of a
    long one last longer, as the root of its length: it answers so much later.

    Parameters
    ----------
    limits : DriveLimits
    car : Vehicle
        Its tyres tell what can be asked of it.

    Returns
    -------
    list of tuple of Manoeuvre
        Each with gentler ones, for a car that does not survive it, or exceeds a limit, and where
        the ground is limited with slower ones on circles that are smaller accordingly.
    """
    lateral = min(limits.lateral_mps2, peak_lateral_mps2(car))
    length = length_beyond(car.wheelbase_m)
    several = (
        _menu(slow * limits.speed_mps, gentle * lateral, slow**2 * length, max(length, 1.0) ** 0.5)
        for slow in (_SLOWER if limits.area_m is not None else _SLOWER[:1])
        for gentle in _EASIER
    )
    return [tuple(dict.fromkeys(alternatives)) for alternatives in zip(*several, strict=True)]


def _menu(top: float, lateral: float, length: float, time: float) -> list[Manoeuvre]:
    slow, fast = 0.5 * top, 0.8 * top

    def steps(speeds: tuple[float, ...], sizes: tuple[float, ...]) -> Manoeuvre:
        rise_s, hold_s = (time * s for s in manoeuvres.STEP_S)
        return manoeuvres.step_steer(speeds, sizes, rise_s, hold_s)

    found = [
        manoeuvres.sine_sweep(speed_mps=v, lateral_mps2=share * lateral, duration_s=t)
        for v in (slow, fast)
        for share in (0.35, 0.6)
        for t in (20.0, 40.0)
    ]
    found += [
        steps((0.45 * top, 0.65 * top, 0.85 * top), (0.3 * lateral, 0.6 * lateral)),
        steps((0.45 * top,), (0.4 * lateral, 0.7 * lateral)),
        steps((0.85 * top,), (0.4 * lateral, 0.7 * lateral)),
        manoeuvres.ramp_steer((slow,), 0.95 * lateral),
        manoeuvres.ramp_steer((slow, fast), 0.95 * lateral),
        manoeuvres.sine_with_dwell(0.6 * top, (0.3 * lateral, 0.5 * lateral, 0.7 * lateral)),
        manoeuvres.slalom(speed_mps=slow, lateral_mps2=0.65 * lateral, spacing_m=30.0 * length),
        manoeuvres.brake_in_turn(100.0 * length, 0.6 * lateral),
        manoeuvres.straight_acceleration(top_speed_mps=top, low_speed_mps=0.3 * top),
        manoeuvres.lap(lateral_mps2=0.95 * lateral, top_speed_mps=0.95 * top),
        manoeuvres.handling_course(lateral_mps2=0.95 * lateral, top_speed_mps=0.95 * top),
    ]
    # A circle that is too wide for the top speed is driven at that.
    found += [
        manoeuvres.constant_radius(radius, min(0.95 * lateral, top**2 / radius), 40.0)
        for radius in (30.0 * length, 60.0 * length, 100.0 * length)
    ]
    return found
