"""What tyre identification starts from: a log of one drive, and what is known of the car."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import numpy.typing as npt

from ... import _core
from ..._common.arguments import check_positive_fields
from ..._common.arrays import FloatArray, as_float64, filled
from ..._common.typed import typed, typed_fields
from ...errors import InvalidInput
from ...log import Log
from ...vehicle import Vehicle, static_loads
from ..observer.observed import READINGS, refuse

_INPUTS = ("fx_n", "steer_rad", "fz_front_n", "fz_rear_n")
SHORTEST = 100
_LONGEST_STEP_S = 0.2


@dataclass(frozen=True)
class GreyBoxVehicle:
    """What is known of the car besides its tyres, and how well.

    Parameters
    ----------
    mass_kg, yaw_inertia_kgm2, lf_m, lr_m : float
        Mass, yaw inertia, distances of the axles from the centre of gravity.
    air_density_kgpm3 : float
    cg_height_m : float
        Height of the centre of gravity, by which load moves between the axles within a sample; 0
        where loads are held from sample to sample.
    mass_tolerance, yaw_inertia_tolerance : float
        Relative standard deviation of the mass and of the yaw inertia; 0 where they are exact. A
        tolerance makes them unknowns with that prior, and every interval includes it.
    brake_front_share, drive_front_share : float
        The front axle's share of the wheel force, 0 to 1; it turns with the front wheels.
    """

    mass_kg: float
    yaw_inertia_kgm2: float
    lf_m: float
    lr_m: float
    air_density_kgpm3: float = 1.225
    cg_height_m: float = 0.0
    mass_tolerance: float = 0.0
    yaw_inertia_tolerance: float = 0.0
    brake_front_share: float = 0.0
    drive_front_share: float = 0.0

    @typed_fields
    def __post_init__(self) -> None:
        check_positive_fields(
            self, "mass_kg", "yaw_inertia_kgm2", "lf_m", "lr_m", "air_density_kgpm3"
        )
        if not 0.0 <= self.cg_height_m < 3.0:
            raise InvalidInput(f"cg_height_m is {self.cg_height_m}; give 0 to 3 m above the road")
        for name in ("mass_tolerance", "yaw_inertia_tolerance"):
            value = getattr(self, name)
            if not 0.0 <= value < 0.5:
                raise InvalidInput(
                    f"{name} is {value}; give a relative standard deviation from 0 to below 0.5"
                )
        for name in ("brake_front_share", "drive_front_share"):
            if not 0.0 <= getattr(self, name) <= 1.0:
                raise InvalidInput(f"{name} is {getattr(self, name)}; give a share from 0 to 1")

    @classmethod
    @typed
    def of(cls, vehicle: Vehicle, *, mass_tolerance: float = 0.0) -> GreyBoxVehicle:
        """Take what a vehicle file says.

        A yaw inertia that it does not say is taken as m l_f l_r, good to a tenth for most cars.
        """
        known = vehicle.yaw_inertia_kgm2
        return cls(
            vehicle.mass_kg,
            vehicle.usual_inertia_kgm2 if known is None else known,
            vehicle.lf_m,
            vehicle.lr_m,
            vehicle.air_density_kgpm3,
            vehicle.cg_height_m,
            mass_tolerance,
            0.1 if known is None else 0.0,
            vehicle.brake_front_share,
            vehicle.drive_front_share,
        )

    def core(self) -> _core.VehicleData:
        """For the compiled core."""
        car = _core.VehicleData()
        for name in (
            *("mass_kg", "lf_m", "lr_m", "air_density_kgpm3", "cg_height_m"),
            *("brake_front_share", "drive_front_share"),
        ):
            setattr(car, name, getattr(self, name))
        return car


@dataclass(frozen=True, eq=False)
class TyreLog:
    """One uninterrupted drive.

    Parameters
    ----------
    step_s : float
        Sampling interval.
    measurements : array, shape (n, 4)
        v_x, v_y [m/s], yaw rate [rad/s], a_y [m/s2]; NaN where missing. v_y may be missing
        throughout.
    inputs : array, shape (n, 4)
        Longitudinal force [N], or acceleration [m/s2] if `force_known` is false; road-wheel angle
        [rad], axle loads front and rear [N].
    name : str
    inputs_held : bool, optional
        Whether each input is held from its sample to the next, as a digital controller holds it,
        or goes there in a straight line, as a driver turns the wheel. If left out, the likelihood
        of all logs together decides.
    force_known : bool
        Whether the first input is the force of the wheels. Otherwise it is the acceleration that
        was measured, which drag and the side force of turned wheels are in already: then no drag
        is identified.

    Raises
    ------
    InvalidInput
        Wrong shape, too short, an input that is not finite, a load below zero, or no yaw rate or
        lateral acceleration at all.
    """

    step_s: float
    measurements: FloatArray
    inputs: FloatArray
    name: str = "log"
    inputs_held: bool | None = None
    force_known: bool = True

    @typed_fields
    def __post_init__(self) -> None:
        y, u = as_float64(self.measurements), as_float64(self.inputs)
        object.__setattr__(self, "measurements", y)
        object.__setattr__(self, "inputs", u)
        if not 0.0 < self.step_s <= _LONGEST_STEP_S:
            raise InvalidInput(
                f"{self.name}: step_s is {self.step_s}; give seconds per sample, at most "
                f"{_LONGEST_STEP_S:g}: a car answers to steering within 0.1 to 0.3 s"
            )
        for what, a in (("measurements", y), ("inputs", u)):
            if a.ndim != 2 or a.shape[1] != 4 or len(a) != len(y):
                raise InvalidInput(f"{self.name}: {what} has shape {a.shape}; expected (n, 4)")
        if len(y) < SHORTEST:
            raise InvalidInput(f"{self.name}: {len(y)} samples; {SHORTEST} or more are needed")
        bad = ~np.isfinite(u)
        bad[:, 2:] |= u[:, 2:] < 0.0
        remedies = ("cut the log there or fill the gap", "put NaN where a reading is missing")
        for names, a, wrong, remedy in zip(
            (_INPUTS, READINGS), (u, y), (bad, np.isinf(y)), remedies, strict=True
        ):
            for i, channel in enumerate(names):
                refuse(wrong[:, i], a[:, i], f"{self.name}: {channel}", self.step_s, remedy)
        steered = float(np.abs(u[:, 1]).max())
        if steered >= 0.5 * np.pi:
            raise InvalidInput(
                f"{self.name}: steer_rad reaches {steered:.3g}, and road wheels do not turn by a "
                f"right angle; give radians, of the road wheels and not of the steering wheel"
            )
        there = np.asarray(np.isfinite(y).any(axis=0))
        for i in (0, 2, 3):
            if not there[i]:
                raise InvalidInput(
                    f"{self.name}: {READINGS[i]} is missing throughout; tyre forces cannot be told "
                    "without it"
                )

    @classmethod
    @typed
    def of(
        cls,
        step_s: float,
        measurements: npt.ArrayLike,
        force_and_steer: npt.ArrayLike,
        loads: npt.ArrayLike,
        *,
        load_delay_samples: int = 0,
        name: str = "log",
        inputs_held: bool | None = True,
    ) -> TyreLog:
        """From arrays as a simulation logs them, with inputs that a controller holds.

        Parameters
        ----------
        step_s : float
        measurements : array, shape (n, 4)
        force_and_steer : array, shape (n, 2)
            Longitudinal force [N] and road-wheel angle [rad].
        loads : array, shape (n, 2)
            Axle loads [N], front and rear.
        load_delay_samples : int
            Samples by which the loads act later than they are logged.
        name : str
        inputs_held : bool, optional
            As in `TyreLog`.
        """
        u, f = as_float64(force_and_steer), as_float64(loads)
        for what, a in (("force_and_steer", u), ("loads", f)):
            if a.ndim != 2 or a.shape[1] != 2 or len(a) != len(u):
                raise InvalidInput(f"{name}: {what} has shape {a.shape}; expected ({len(u)}, 2)")
        if not 0 <= load_delay_samples < max(len(f), 1):
            raise InvalidInput(
                f"{name}: load_delay_samples = {load_delay_samples}; give a number from 0 to less "
                f"than the {len(f)} samples"
            )
        if load_delay_samples > 0:
            f = np.vstack([np.repeat(f[:1], load_delay_samples, axis=0), f[:-load_delay_samples]])
        inputs = as_float64(np.column_stack([u, f]))
        return cls(step_s, as_float64(measurements), inputs, name, inputs_held)

    @classmethod
    @typed
    def from_log(cls, log: Log, vehicle: GreyBoxVehicle) -> tuple[TyreLog, ...]:
        """From a driving log: one for each stretch in which the car drives, its inputs known.

        Where the log has no wheel force, the longitudinal acceleration stands for it. Axle loads
        are the columns ``fz_front_n`` and ``fz_rear_n`` where the log has them, else those at rest
        with what the height of the centre of gravity and the longitudinal acceleration move
        between them.

        Raises
        ------
        InvalidInput
            No stretch is long enough.
        """
        a_x = log["ax_mps2"] if log.has("ax_mps2") else np.zeros(log.n)
        known = log.has("fx_n")
        along = log["fx_n"] if known else a_x
        v_y = log["vy_mps"] if log.has("vy_mps") else np.full(log.n, np.nan)
        if log.has("fz_front_n") and log.has("fz_rear_n"):
            loads = [np.maximum(log[n], 0.0) for n in ("fz_front_n", "fz_rear_n")]
        else:
            base = vehicle.lf_m + vehicle.lr_m
            shift = vehicle.mass_kg * np.nan_to_num(a_x) * vehicle.cg_height_m / base
            front, rear = static_loads(vehicle.mass_kg, vehicle.lf_m, vehicle.lr_m)
            loads = [np.maximum(front - shift, 0.0), np.maximum(rear + shift, 0.0)]
        y = np.column_stack([log["vx_mps"], v_y, log["yaw_rate_radps"], log["ay_mps2"]])
        u = np.column_stack([along, log["steer_rad"], *loads])
        # A car at walking pace tells nothing of its tyres, and its slip angles are ill-defined.
        parts = [s for s in log.stretches() if s.stop - s.start >= SHORTEST]
        if not parts:
            raise InvalidInput(
                f"{log.name}: no stretch of {SHORTEST} samples in which the car drives and its "
                "steering and force are known; give a longer log"
            )
        step = 1.0 / log.rate_hz
        several = len(parts) > 1
        return tuple(
            cls(step, y[s], u[s], _part(log.name, i, several), force_known=known)
            for i, s in enumerate(parts, 1)
        )

    @property
    def n(self) -> int:
        """Number of samples."""
        return len(self.measurements)

    @cached_property
    def time_s(self) -> FloatArray:
        """Time of each sample."""
        return as_float64(np.arange(self.n) * self.step_s)

    @property
    def sideslip_measured(self) -> bool:
        """Whether there is any v_y."""
        return bool(np.isfinite(self.measurements[:, 1]).any())

    def without_sideslip(self) -> TyreLog:
        """The same drive without its v_y."""
        y = self.measurements.copy()
        y[:, 1] = np.nan
        return replace(self, measurements=y)

    @typed
    def with_kinematic_sideslip(self, window_s: float = 10.0) -> TyreLog:
        """The same drive with v_y from integrating a_y - v_x r, without what drifts.

        Good enough to begin a search with, where v_y was not measured.
        """
        y = self.measurements.copy()
        v_x, r, a_y = (filled(y[:, i]) for i in (0, 2, 3))
        v_y = np.cumsum(a_y - v_x * r) * self.step_s
        half = min(int(0.5 * window_s / self.step_s), (self.n - 1) // 2)
        window = np.ones(2 * half + 1)
        drift = np.convolve(v_y, window, "same") / np.convolve(np.ones(self.n), window, "same")
        y[:, 1] = v_y - drift
        return replace(self, measurements=y)

    @typed
    def cut(self, first: int, last: int) -> TyreLog:
        """Samples `first` up to, not including, `last`."""
        return replace(
            self, measurements=self.measurements[first:last], inputs=self.inputs[first:last]
        )

    def __str__(self) -> str:
        v_x, a_y = self.measurements[:, 0], self.measurements[:, 3]
        return (
            f"{self.name}: {self.n * self.step_s:.1f} s at {1.0 / self.step_s:g} Hz, "
            f"{np.nanmin(v_x):.0f} to {np.nanmax(v_x):.0f} m/s, lateral acceleration up to "
            f"{np.nanmax(np.abs(a_y)):.1f} m/s2"
            + ("" if self.sideslip_measured else ", v_y not measured")
        )


def _part(name: str, number: int, several: bool) -> str:
    return f"{name}, part {number}" if several else name
