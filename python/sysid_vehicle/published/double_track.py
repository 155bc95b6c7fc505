"""The observer to compare with: a planar double track with constant gains.

Equations: `cpp/include/sysid/published/double_track.hpp`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from .. import _core
from .._common.arrays import FloatArray, as_float64
from ..errors import InvalidInput, NumericalError
from ..twin.car import TwinCar
from ..twin.readings import Readings
from ..vehicle import AXLES, static_loads


@dataclass(frozen=True, eq=False)
class DoubleTrackRun:
    """What the double track found, at every sample.

    Attributes
    ----------
    vx_mps, vy_mps, yaw_rate_radps, mass_kg : ndarray, shape (n,)
        Its states.
    sideslip_rad : ndarray, shape (n,)
        From the velocities.
    """

    vx_mps: FloatArray
    vy_mps: FloatArray
    yaw_rate_radps: FloatArray
    mass_kg: FloatArray
    sideslip_rad: FloatArray


@dataclass(frozen=True)
class DoubleTrackObserver:
    """A double track of a car and its gains, eqs. (27) to (32).

    Parameters
    ----------
    car : TwinCar
        Whose mass, geometry, drag and tyres it takes; the tyres at the load they carry at rest,
        which is as near as a planar model with one magic formula per axle comes to them.
    ax_vx_ps, yaw_yaw_ps, ax_mass, ay_vy_ps : float
        Gains per second; `ax_mass` in kg/s per m/s2.
    yaw_rate_below_radps : float
        Gate of the mass law.
    published_sign : bool
        True takes the sign of the mass law as printed.
    """

    car: TwinCar
    ax_vx_ps: float = 0.0
    yaw_yaw_ps: float = 5.0
    ax_mass: float = 100.0
    ay_vy_ps: float = 0.0
    yaw_rate_below_radps: float = 0.0523598775598298873
    published_sign: bool = False

    def run(
        self, inputs: FloatArray, readings: Readings, *, speed_mps: float, mass_error_kg: float
    ) -> DoubleTrackRun:
        """Observe a drive.

        Parameters
        ----------
        inputs : ndarray, shape (n, 24)
            What the car was given; only the steering is used.
        readings : Readings
            Accelerations, yaw rate and wheel speeds of the car.
        speed_mps : float
            First speed.
        mass_error_kg : float
            First error of the mass, such as -350.

        Raises
        ------
        InvalidInput
            If a channel that it needs is not measured.
        NumericalError
            If it left the range of numbers.
        """
        for name in ("ax_mps2", "ay_mps2", "wheel_speed_fl_radps", "wheel_speed_rl_radps"):
            if name not in readings.noise:
                raise InvalidInput(f"the double track needs '{name}'; measure it too")
        mass = self.car.design.mass_kg
        data, front, rear = self._data()
        gains = [self.ax_vx_ps, self.yaw_yaw_ps, self.ax_mass, self.ay_vy_ps]
        try:
            states = _core.observe_double_track(
                data,
                front,
                rear,
                [*gains, self.yaw_rate_below_radps, -0.45 * mass, 0.45 * mass],
                [speed_mps, 0.0, 0.0, mass_error_kg],
                as_float64(inputs),
                as_float64(readings.values),
                readings.dt_s,
                self.published_sign,
            )
        except NumericalError as error:
            raise NumericalError(f"{error}; take smaller gains") from error
        vx, vy, r, extra = states.T
        return DoubleTrackRun(vx, vy, r, mass + extra, np.arctan2(vy, vx))

    def _data(self) -> tuple[list[float], list[float], list[float]]:
        n = self.car.numbers()
        load = self.car.design
        lf, base = -load.cg_x_m, n["wheelbase_m"]
        stiff = {
            a: n[f"{a}.track_m"] ** 2 * (0.5 * n[f"{a}.spring_npm"] + n[f"{a}.anti_roll_npm"])
            for a in AXLES
        }
        data = [
            *(load.mass_kg, load.jzz_kgm2, lf, base - lf),
            0.5 * (n["front.track_m"] + n["rear.track_m"]),
            load.cg_z_m,
            0.5 * (n["front.radius_m"] + n["rear.radius_m"]),
            *(n["drag_area_m2"], n["air_density_kgpm3"]),
            stiff["front"] / (stiff["front"] + stiff["rear"]),
        ]
        front, rear = static_loads(load.mass_kg, lf, base - lf)
        return data, _tyre(n, "front", 0.5 * front), _tyre(n, "rear", 0.5 * rear)


def _tyre(n: Mapping[str, float], axle: str, load_n: float) -> list[float]:
    """B, C, D, E of both directions of the twin's tyre at a load."""
    t = {k.removeprefix(f"{axle}.tyre."): v for k, v in n.items() if k.startswith(f"{axle}.tyre.")}
    ratio = load_n / t["nominal_load_n"]
    q = ratio / t["load_at_peak_stiffness"]
    lateral = t["cornering_stiffness"] * t["nominal_load_n"] * 2.0 * q / (1.0 + q * q) / load_n
    out = []
    for stiffness, friction in (
        (t["slip_stiffness"], t["friction_x"]),
        (lateral, t["friction_y"]),
    ):
        peak = friction + t["friction_slope"] * (ratio - 1.0)
        out += [stiffness / (t["shape"] * peak), t["shape"], peak, t["curvature"]]
    return out
