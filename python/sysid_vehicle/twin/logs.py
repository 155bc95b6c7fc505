"""What a drive of the fourteen-degree-of-freedom car looks like to who has a single track.

The car then is a truth that no model of the catalogue can be: it rolls, pitches, shifts load, and
its tyres are of another kind.
"""

from __future__ import annotations

import numpy as np

from .._common.arguments import generator
from .._common.arrays import as_float64
from .._common.typed import typed
from ..errors import InvalidInput
from ..log import Log
from ..simulate import SensorNoise
from ..tyre import Tyre
from ..vehicle import Vehicle
from .car import Load, TwinCar
from .drives import WHEELS, Drive14


@typed
def single_track(
    car: TwinCar,
    load: Load | None = None,
    *,
    drive_front_share: float = 0.0,
    brake_front_share: float = 0.65,
    tyre: Tyre | None = None,
) -> Vehicle:
    """What a workshop knows of the car: mass, inertia, geometry and drag.

    Parameters
    ----------
    car, load : TwinCar, Load
        The car, and the load it is believed to have: the design's if left out.
    drive_front_share, brake_front_share : float
        As the car is driven.
    tyre : Tyre, optional
        Starting tyre of both axles.
    """
    n = car.numbers()
    weight = load or car.design
    start = tyre or Tyre()
    return Vehicle(
        mass_kg=weight.mass_kg,
        lf_m=-weight.cg_x_m,
        lr_m=n["wheelbase_m"] + weight.cg_x_m,
        cg_height_m=weight.cg_z_m,
        track_front_m=n["front.track_m"],
        track_rear_m=n["rear.track_m"],
        drag_area_m2=n["drag_area_m2"],
        brake_front_share=brake_front_share,
        drive_front_share=drive_front_share,
        tyre_front=start,
        tyre_rear=start,
        yaw_inertia_kgm2=weight.jzz_kgm2,
        air_density_kgpm3=n["air_density_kgpm3"],
        name=car.name,
    )


@typed
def to_log(
    car: TwinCar,
    drive: Drive14,
    *,
    seed: int | np.random.Generator,
    noise: SensorNoise | None = None,
    rate_hz: float = 100.0,
    steer_lag_s: float = 0.0,
) -> Log:
    """The log that the car's sensors would write.

    The wheel force is what the torques give, less what spins the wheels up.

    Parameters
    ----------
    car, drive : TwinCar, Drive14
        What was driven.
    seed : int or Generator
        Of the noise.
    noise : SensorNoise, optional
        The package's usual sensors if left out. The accelerometer is fixed to the body and feels
        gravity as it rolls and pitches.
    rate_hz : float
        Sample rate; the drive's must be a multiple of it.
    steer_lag_s : float
        The logged steering goes ahead of the wheels' by a first-order lag of this time constant.

    Raises
    ------
    InvalidInput
        If the rate is no divisor of the drive's.
    """
    every = round(1.0 / (rate_hz * drive.dt_s))
    if every < 1 or abs(every * rate_hz * drive.dt_s - 1.0) > 1e-9:
        raise InvalidInput(
            f"rate_hz = {rate_hz!r}: the drive has {1.0 / drive.dt_s:g} Hz; give a divisor of it"
        )
    rng = generator(seed)
    numbers = car.numbers()
    steer = drive["steer_rad"]
    if steer_lag_s > 0.0:
        steer = steer + steer_lag_s * np.gradient(steer, drive.dt_s)
    force = np.zeros(len(steer))
    for wheel in WHEELS:
        axle = "front" if wheel[0] == "f" else "rear"
        spin_up = np.gradient(drive[f"wheel_speed_{wheel}_radps"], drive.dt_s)
        torque = drive[f"drive_{wheel}_nm"] - drive[f"brake_{wheel}_nm"]
        torque = torque - numbers[f"{axle}.wheel_inertia_kgm2"] * spin_up
        force += torque / numbers[f"{axle}.radius_m"]
    # The car's own outputs are of first order in the angles of its body; a sensor's axes turn.
    roll, pitch, up = drive["roll_rad"], drive["pitch_rad"], drive["az_mps2"]
    columns = {
        "time_s": drive.time_s,
        **{name: drive[name] for name in ("vx_mps", "vy_mps", "yaw_rate_radps")},
        "ax_mps2": drive["plane_ax_mps2"] * np.cos(pitch) - up * np.sin(pitch),
        "ay_mps2": drive["plane_ay_mps2"] * np.cos(roll) + up * np.sin(roll),
        "steer_rad": steer,
        "fx_n": force,
    }
    columns = {name: as_float64(values[::every]) for name, values in columns.items()}
    (noise or SensorNoise()).add_to(columns, rng)
    return Log.from_arrays(columns, name=drive.name, check=False)
