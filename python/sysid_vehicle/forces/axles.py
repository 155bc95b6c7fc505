"""Forces of both axles, from the smoothed motion and the car's own numbers.

Rigid body in the plane: no tyre stands in these equations. Estimation before modelling: H. W.
Sorenson's term in V. Klein, E. A. Morelli, *Aircraft System Identification*, 2nd ed., sec. 1.4.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np

from .._common.arguments import expect, real, whole
from .._common.arrays import FloatArray, as_float64
from .._common.progress import doing
from .._common.typed import typed
from ..errors import InvalidInput
from ..log import Log, check_car, several_logs
from ..sensors import SensorCheck, check
from ..vehicle import Vehicle, slip_angles
from .motion import Motion, Places, draws, smoothed
from .result import AxleForces


@dataclass(frozen=True, eq=False)
class _Forces:
    slip_rad: FloatArray
    lateral_n: FloatArray
    load_n: FloatArray
    longitudinal_n: FloatArray
    moment_nm: FloatArray


@typed
@doing("axle forces")
def axle_forces(
    logs: Log | Sequence[Log],
    vehicle: Vehicle,
    *,
    sensors: SensorCheck | None = None,
    level: bool = False,
    cg_ahead_m: float = 0.0,
    count: int = 60,
    seed: int = 0,
) -> AxleForces:
    """Find the forces of both axles from the motion, before any tyre is assumed.

    The motion is that of the check of the sensors (:func:`sysid_vehicle.check`): faults that it
    finds are taken out, and its uncertainty is that of the forces. Known beside it must be mass,
    yaw inertia and geometry.

    Parameters
    ----------
    logs : Log or sequence of Log
        With lateral speed and longitudinal acceleration, if slip angles and wheel forces are to be
        known well.
    vehicle : Vehicle
        Without a yaw inertia m l_f l_r is taken.
    sensors : SensorCheck, optional
        Check of these logs, where there is one already.
    level : bool
        Whether the ground is level, for the check where there is none yet.
    cg_ahead_m : float
        How far the centre of gravity lies ahead of the place whose speeds the log holds [m].
    count : int
        Draws of the motion that make the standard deviations.
    seed : int
        Of the draws.

    Raises
    ------
    InvalidInput
        If a log has no steering angle, its sensors cannot be checked, or its wheel force or its
        steering angle are not those of a car of this mass and wheelbase.
    NumericalError
        If the motion cannot be told.

    Notes
    -----
    With delta the steering angle, Y = m a_y, N = I_z dr/dt and the wheelbase L,

        F_yf cos(delta) + F_xf sin(delta) = (l_r Y + N) / L,    F_yr = (l_f Y - N) / L,
        m a_x + 1/2 rho C_dA v_x^2 = F_xf cos(delta) - F_yf sin(delta) + F_xr,

    where the vehicle file says how F_x is shared. An error dI of the yaw inertia moves the front
    force by dI dr/dt / L and the rear one by as much the other way; one of the mass moves both in
    proportion. Differences of F_x between left and right wheels are taken as none. Slip angles take
    the steering angle as it was read, and have no part of its noise.
    """
    together = several_logs(logs, "axle_forces")
    expect(vehicle, Vehicle, "axle_forces")
    if sensors is not None:
        expect(sensors, SensorCheck, "axle_forces")
    ahead = real(cg_ahead_m)
    if ahead is None or not np.isfinite(ahead):
        raise InvalidInput(f"cg_ahead_m = {cg_ahead_m!r}: give metres")
    count = max(whole(count, "count"), 2)
    if sensors is None:
        sensors = check(together, vehicle, level=level, seed=seed)
    elif sensors.logs != together:
        raise InvalidInput("axle_forces: sensors is a check of other logs; give that of these logs")
    # Who says where the sensors lie knows that they may lie far back.
    lf_m = vehicle.lf_m if ahead == 0.0 else None
    for log in together:
        if not np.isfinite(log["steer_rad"]).any():
            raise InvalidInput(f"{log.name}: steer_rad holds no value; map the steering angle")
        check_car(log, mass_kg=vehicle.mass_kg, wheelbase_m=vehicle.wheelbase_m, lf_m=lf_m)
    inertia = vehicle.yaw_inertia_kgm2 or vehicle.usual_inertia_kgm2
    places = Places.of(sensors)
    steer = places.values(sensors, "steer_rad")
    motion = smoothed(sensors, places)
    best = _forces(motion, steer, vehicle, inertia, ahead)
    squares = {f.name: np.zeros_like(getattr(best, f.name)) for f in fields(best)}
    for other in draws(sensors, places, count, seed):
        found = _forces(other, steer, vehicle, inertia, ahead)
        for name, total in squares.items():
            total += (getattr(found, name) - getattr(best, name)) ** 2
    std = {name: as_float64(np.sqrt(total / count)) for name, total in squares.items()}
    return AxleForces(
        log=places.log,
        stretch=places.stretch,
        time_s=places.time_s,
        vx_mps=motion.vx,
        ax_mps2=as_float64(motion.ax - ahead * motion.yaw**2),
        ay_mps2=as_float64(motion.ay + ahead * motion.yaw_dot),
        yaw_acceleration_radps2=motion.yaw_dot,
        steer_rad=steer,
        steer_rate_radps=places.slope(steer),
        slip_rad=best.slip_rad,
        slip_std_rad=std["slip_rad"],
        lateral_n=best.lateral_n,
        lateral_std_n=std["lateral_n"],
        load_n=best.load_n,
        longitudinal_n=best.longitudinal_n,
        longitudinal_std_n=std["longitudinal_n"],
        moment_nm=best.moment_nm,
        moment_std_nm=std["moment_nm"],
        yaw_inertia_kgm2=inertia,
        vehicle=vehicle,
        sensors=sensors,
    )


def _forces(
    motion: Motion, steer: FloatArray, car: Vehicle, inertia: float, ahead_m: float
) -> _Forces:
    """Equations of :func:`axle_forces` at every sample."""
    lf, lr, length, m = car.lf_m, car.lr_m, car.wheelbase_m, car.mass_kg
    v, r = motion.vx, motion.yaw
    vy = motion.vy + ahead_m * r
    ax = motion.ax - ahead_m * r**2
    side = m * (motion.ay + ahead_m * motion.yaw_dot)
    moment = inertia * motion.yaw_dot
    front, rear = (lr * side + moment) / length, (lf * side - moment) / length
    c, s = np.cos(steer), np.sin(steer)
    drag = 0.5 * car.air_density_kgpm3 * car.drag_area_m2 * v * np.abs(v)
    along = m * ax + drag + front * s / c
    share = np.where(along < 0.0, car.brake_front_share, car.drive_front_share)
    push = along / (share / c + 1.0 - share)
    shift = m * ax * car.cg_height_m / length
    load_f, load_r = car.static_loads_n
    return _Forces(
        as_float64(np.stack(slip_angles(lf, lr, steer, v, vy, r), axis=1)),
        as_float64(np.stack([(front - share * push * s) / c, rear], axis=1)),
        as_float64(np.stack([load_f - shift, load_r + shift], axis=1)),
        as_float64(push),
        as_float64(moment),
    )
