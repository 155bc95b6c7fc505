"""A car on a scale of one to eight, which moves as the example car does, and its drives."""

from dataclasses import replace

import sysid_vehicle as sv

LENGTH = 0.1222
MASS, TIME = LENGTH**3, LENGTH**0.5
SPEED = LENGTH / TIME


def car() -> sv.Vehicle:
    whole = sv.example_vehicle()
    assert whole.yaw_inertia_kgm2 is not None
    return replace(
        whole,
        name="one to eight",
        mass_kg=whole.mass_kg * MASS,
        yaw_inertia_kgm2=whole.yaw_inertia_kgm2 * MASS * LENGTH**2,
        lf_m=whole.lf_m * LENGTH,
        lr_m=whole.lr_m * LENGTH,
        cg_height_m=whole.cg_height_m * LENGTH,
        track_front_m=whole.track_front_m * LENGTH,
        track_rear_m=whole.track_rear_m * LENGTH,
        drag_area_m2=whole.drag_area_m2 * LENGTH**2,
    )


def drives(truth: sv.Model, seed: int) -> list[sv.Log]:
    """A lap and a course at 3 to 12 m/s, by sensors as good as those of an ordinary car."""
    usual = sv.SensorNoise()
    noise = replace(
        usual,
        vx_mps=usual.vx_mps * SPEED,
        vy_mps=usual.vy_mps * SPEED,
        yaw_rate_radps=usual.yaw_rate_radps / TIME,
    )
    rate_hz = round(50.0 / TIME)
    return [
        sv.drive(truth, manoeuvre, seed=seed + i, noise=noise, rate_hz=rate_hz)
        for i, manoeuvre in enumerate(
            (
                sv.manoeuvres.lap(60.0 * TIME, 8.6, 34.0 * SPEED),
                sv.manoeuvres.handling_course(60.0 * TIME, 8.5, 34.5 * SPEED),
            )
        )
    ]
