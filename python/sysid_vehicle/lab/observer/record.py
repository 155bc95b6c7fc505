"""What the observer is given: the car as it believes it to be, and a log made ready."""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from ..._common.arrays import FloatArray, as_float64
from ..._common.typed import typed, typed_fields
from ...errors import InvalidInput
from ...log import Log
from ...tyre import TYRE_RANGES
from ...vehicle import AXLES, Vehicle, static_loads
from .observed import READINGS, refuse

_STIFFEST = math.prod(TYRE_RANGES[letter].high for letter in "BCD")  # per load [1/rad]


@dataclass(frozen=True)
class ObserverCar:
    """What the observer believes of the car.

    Attributes
    ----------
    mass_kg, yaw_inertia_kgm2, lf_m, lr_m : float
        Mass, yaw inertia, distances from the centre of gravity to the axles.
    drag_nspm : float
        Drag force per speed [N s/m].
    """

    mass_kg: float
    yaw_inertia_kgm2: float
    lf_m: float
    lr_m: float
    drag_nspm: float = 0.0

    @typed_fields
    def __post_init__(self) -> None:
        for name in ("mass_kg", "yaw_inertia_kgm2", "lf_m", "lr_m"):
            if not getattr(self, name) > 0.0:
                raise InvalidInput(f"{name} = {getattr(self, name)} must be a number above zero")
        if not 0.0 <= self.drag_nspm < self.mass_kg:  # that much would stop it within a second
            raise InvalidInput(
                f"drag_nspm = {self.drag_nspm}: give newtons per m/s, from 0 to below the "
                f"{self.mass_kg:g} that would stop the car within a second; cars have 10 to 50"
            )

    @classmethod
    @typed
    def of(cls, vehicle: Vehicle, *, drag_nspm: float = 0.0) -> ObserverCar:
        """Take the numbers of a vehicle.

        Raises
        ------
        InvalidInput
            The vehicle's yaw inertia is not known.
        """
        inertia = vehicle.yaw_inertia_kgm2
        if inertia is None:
            raise InvalidInput("yaw_inertia_kgm2 is not known; set it in the vehicle first")
        return cls(vehicle.mass_kg, inertia, vehicle.lf_m, vehicle.lr_m, drag_nspm)

    def vector(self) -> FloatArray:
        """In the core's order."""
        return as_float64(dataclasses.astuple(self))

    def static_loads_n(self) -> tuple[float, float]:
        """Axle loads at rest, front and rear [N]."""
        return static_loads(self.mass_kg, self.lf_m, self.lr_m)


@dataclass(frozen=True, eq=False)
class ObserverRecord:
    """One log made ready for the observer.

    Attributes
    ----------
    rate_hz : float
        Sample rate.
    force_x_n, steer_rad : ndarray of shape (n,)
        Longitudinal force and road-wheel steering angle.
    stiffness_front_nprad, stiffness_rear_nprad : ndarray of shape (n,)
        Nominal cornering stiffness of the axles; a stiffness per load times the load.
    readings : ndarray of shape (n, 4)
        Speed ahead and sideways [m/s], yaw rate [rad/s], lateral acceleration [m/s2]; NaN where
        missing.
    name : str
        Name in messages.
    inputs_held : bool, optional
        Whether inputs are held from their sample to the next, as a digital controller holds them,
        or go there in a straight line, as a driver turns the wheel. None: what is likelier.
    """

    rate_hz: float
    force_x_n: FloatArray
    steer_rad: FloatArray
    stiffness_front_nprad: FloatArray
    stiffness_rear_nprad: FloatArray
    readings: FloatArray
    name: str = "log"
    inputs_held: bool | None = True

    @classmethod
    @typed
    def from_arrays(
        cls,
        *,
        rate_hz: float,
        force_x_n: npt.ArrayLike,
        steer_rad: npt.ArrayLike,
        stiffness_front_nprad: npt.ArrayLike,
        stiffness_rear_nprad: npt.ArrayLike,
        readings: npt.ArrayLike,
        name: str = "log",
        inputs_held: bool | None = True,
    ) -> ObserverRecord:
        """Check and convert; a single number stands for a constant input.

        Raises
        ------
        InvalidInput
            Shapes that do not fit, an input that is not finite, a stiffness not above zero, an
            infinite reading, or no reading of the speed.
        """
        y = as_float64(readings)
        if y.ndim != 2 or y.shape[1] != len(READINGS) or len(y) < 2:
            raise InvalidInput(
                f"{name}: readings have shape {y.shape}; give samples x 4: {', '.join(READINGS)}"
            )
        if not (np.isfinite(rate_hz) and rate_hz > 0.0):
            raise InvalidInput(f"{name}: rate_hz = {rate_hz} must be a number above zero")
        given = {
            "force_x_n": force_x_n,
            "steer_rad": steer_rad,
            "stiffness_front_nprad": stiffness_front_nprad,
            "stiffness_rear_nprad": stiffness_rear_nprad,
        }
        inputs = {}
        for key, values in given.items():
            u = np.asarray(values, dtype=np.float64)
            if u.shape not in ((), (len(y),)):
                raise InvalidInput(f"{name}: {key} has shape {u.shape}; give {len(y)} values")
            inputs[key] = u = as_float64(np.broadcast_to(u, len(y)))
            bad = ~np.isfinite(u)
            if key.startswith("stiffness"):
                bad |= ~(u > 0.0)
            remedy = "fill or cut it: the observer needs every input"
            refuse(bad, u, f"{name}: {key}", 1.0 / rate_hz, remedy)
        for i, key in enumerate(READINGS):
            remedy = "mark a missing reading by NaN"
            refuse(np.isinf(y[:, i]), y[:, i], f"{name}: {key}", 1.0 / rate_hz, remedy)
        if not np.isfinite(y[:, 0]).any():
            raise InvalidInput(f"{name}: no reading of vx_mps; the observer needs the speed")
        return cls(rate_hz=float(rate_hz), readings=y, name=name, inputs_held=inputs_held, **inputs)

    @classmethod
    @typed
    def from_log(
        cls,
        log: Log,
        car: ObserverCar,
        stiffness_prad: tuple[float, float],
        *,
        inputs_held: bool | None = None,
    ) -> ObserverRecord:
        """Take readings and inputs of a log.

        Parameters
        ----------
        log : Log
            With ``fx_n``; the axle loads ``fz_front_n`` and ``fz_rear_n`` are used if they are
            there, else those at rest.
        car : ObserverCar
            For the loads at rest.
        stiffness_prad : (float, float)
            Nominal cornering stiffness per load of the front and the rear axle [1/rad].
        inputs_held : bool, optional
            As in `ObserverRecord`; if left out, what is likelier.

        Raises
        ------
        InvalidInput
            No wheel force in the log, a stiffness that is none per load, or what `from_arrays`
            refuses.
        """
        if not log.has("fx_n"):
            raise InvalidInput(
                f"{log.name}: no fx_n; the observer needs the wheel force, add that column"
            )
        for axle, value in zip(AXLES, stiffness_prad, strict=True):
            if not 0.0 < value <= _STIFFEST:
                raise InvalidInput(
                    f"cornering stiffness, {axle} = {value:g}: give that per axle load in 1/rad; "
                    "cars have 8 to 30, and newtons per radian are to be divided by the load"
                )
        missing = np.full(log.n, np.nan)
        loads = [
            log[name] if log.has(name) else np.full(log.n, at_rest)
            for name, at_rest in zip(("fz_front_n", "fz_rear_n"), car.static_loads_n(), strict=True)
        ]
        return cls.from_arrays(
            rate_hz=log.rate_hz,
            force_x_n=log["fx_n"],
            steer_rad=log["steer_rad"],
            stiffness_front_nprad=stiffness_prad[0] * loads[0],
            stiffness_rear_nprad=stiffness_prad[1] * loads[1],
            readings=np.column_stack([log[c] if log.has(c) else missing for c in READINGS]),
            name=log.name,
            inputs_held=inputs_held,
        )

    @property
    def time_s(self) -> FloatArray:
        """Time of each sample [s]."""
        return np.arange(len(self.readings), dtype=np.float64) / self.rate_hz

    def inputs(self) -> FloatArray:
        """In the core's order, samples x 4."""
        return np.column_stack(
            [
                self.force_x_n,
                self.steer_rad,
                self.stiffness_front_nprad,
                self.stiffness_rear_nprad,
            ]
        )

    def kinds(self) -> tuple[ObserverRecord, ...]:
        """The record itself, or where `inputs_held` is not said, with either."""
        if self.inputs_held is not None:
            return (self,)
        return tuple(dataclasses.replace(self, inputs_held=held) for held in (True, False))

    @typed
    def without(self, *channels: str) -> ObserverRecord:
        """Give the same record with the readings of some channels missing."""
        y = self.readings.copy()
        for channel in channels:
            if channel not in READINGS:
                raise InvalidInput(f"no reading {channel!r}; there are {', '.join(READINGS)}")
            y[:, READINGS.index(channel)] = np.nan
        return dataclasses.replace(self, readings=y)
