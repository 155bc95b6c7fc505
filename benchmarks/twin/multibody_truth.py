"""Does the diagnosis name what is physically in the multi-body car of another package?

python benchmarks/twin/multibody_truth.py [HIDDEN ...] [--driving SET ...] [--seeds 1] [--first 0]
    [--keep FILE]

The car is one of `commonroad-vehicle-models` (29 states; `benchmarks/online/multibody.py`), another
one by seed, driven in closed loop; claims are counted as in `diagnosis_truth.py`. What is in the
car follows from its equations. Every tyre force and stiffness is in proportion to the wheel's load,
so load sensitivity, and grip lost by lateral load transfer, are not in it. Nor are drag, rolling
resistance, lift, aligning moment, or compliance of the steering. The vehicle file has the height of
the sprung mass, by which the springs take the load transfer. Wheels lean with the body, which gives
side force: a part of it grows with the camber (`p_hy3`, `p_vy3`), and one jumps with its sign
(`p_hy1`, `p_vy1`), for which the catalogue has no name.
"""

import sys
from dataclasses import dataclass, field, fields
from functools import cache
from pathlib import Path
from types import SimpleNamespace

import numpy as np
from diagnosis_truth import Hidden, Truth, run

import sysid_vehicle as sv
from sysid_vehicle import manoeuvres

sys.path.append(str(Path(__file__).resolve().parents[1] / "online"))
import multibody

ALWAYS = {
    "accelerometer_scale": "the accelerometer leans with the body: a_y + g roll, roll about a_y",
    "body_attitude": "the sprung mass rolls and pitches, and the accelerometer with it",
    "body_roll": "the sprung mass rolls about an axis below it",
    **dict.fromkeys(
        ("front_roll_steer", "rear_roll_steer"),
        "wheels lean with the body: p_hy3, p_vy3, and D_f, D_r of the suspension",
    ),
    "combined_slip": "Magic Formula with combined slip, r_bx1 to r_vy6",
    "drive_yaw_moment": "a driven tyre pushes sideways, r_vy1 r_vy5 r_vy6 / p_kx1 = 0.025 N per N",
    **dict.fromkeys(
        ("tyre_relaxation", "front_tyre_relaxation", "rear_tyre_relaxation"),
        "camber and its side force wait for the body to roll, about 0.1 s",
    ),
}


@dataclass(frozen=True)
class Other(Hidden):
    """What is changed in the car, and in the log.

    `payload_kg` lies 0.8 m behind the centre of mass; `values` are numbers of the car,
    `factors` multiply some; the logged steering is `ratio` times the wheels'.
    """

    ratio: float = 1.0
    factors: dict[str, float] = field(default_factory=dict)


CASES = {
    "nothing": Other(set()),
    "drag": Other({"aero_drag"}, {"drag_area_m2": 1.0}),
    "payload": Other({"mass", "cg_position", "yaw_inertia"}, payload_kg=200.0),
    "yaw inertia": Other({"yaw_inertia"}, factors={"I_z": 1.3}),
    "steering ratio": Other({"steer_ratio"}, ratio=1.1),
    "steering lag": Other({"steer_lag"}, lag_s=0.06),
}
_STEPS, _RAMPS = (
    manoeuvres.step_steer((18.0, 28.0), (3.0, 6.5)),
    manoeuvres.ramp_steer((18.0, 27.0), 7.5, 4.0),
)
_SWEEP, _LANES = (
    manoeuvres.sine_sweep(30.0, 25.0, 5.0),
    manoeuvres.double_lane_change((20.0, 26.0)),
)
_COURSE, _LAP = manoeuvres.handling_course(40.0, 7.5), manoeuvres.lap(40.0, 7.5)
# What is fitted, and what judges.
SETS = {
    "steps and ramps, course": ((_STEPS, _RAMPS), (_COURSE,)),
    "sweep and lanes, lap": ((_SWEEP, _LANES), (_LAP,)),
    "all of these": ((_STEPS, _RAMPS, _SWEEP, _LANES), (_COURSE, _LAP)),
}
# Of the lateral acceleration of a drive; the van spins where it brakes into a corner at more.
CARS = {2: 1.0, 1: 1.0, 3: 0.75}
_RATE_HZ = 100.0
_MOST_SLIP_RAD = 0.1
_BEHIND_M = 0.8


def car_of(case: Other, number: int) -> SimpleNamespace:
    """One of the package's cars with what is hidden in it."""
    p = multibody.base_car(number)
    for name, value in case.values.items():
        setattr(p, name, value)
    for name, factor in case.factors.items():
        setattr(p, name, factor * getattr(p, name))
    if case.payload_kg:
        share = case.payload_kg / (p.m_s + case.payload_kg)
        p.I_z += (1.0 - share) * case.payload_kg * _BEHIND_M**2
        p.I_y_s += (1.0 - share) * case.payload_kg * _BEHIND_M**2
        p.a, p.b = p.a + share * _BEHIND_M, p.b - share * _BEHIND_M
        p.m, p.m_s = p.m + case.payload_kg, p.m_s + case.payload_kg
    return p


def read_ahead(columns: dict[str, np.ndarray], ahead_m: float) -> dict[str, np.ndarray]:
    """Channels of sensors so far ahead of the centre of mass: a payload moves it, not them."""
    r = columns["yaw_rate_radps"]
    moved = {
        "vy_mps": ahead_m * r,
        "ax_mps2": -ahead_m * r**2,
        "ay_mps2": ahead_m * np.gradient(r, 1.0 / _RATE_HZ),
    }
    return columns | {c: columns[c] + more for c, more in moved.items()}


def workshop(number: int) -> sv.Vehicle:
    """What is known of the car, with generic tyres."""
    p = multibody.base_car(number)
    return sv.Vehicle(
        name=f"multi-body {number}",
        mass_kg=p.m,
        yaw_inertia_kgm2=p.I_z,
        lf_m=p.a,
        lr_m=p.b,
        cg_height_m=p.h_s,
        track_front_m=p.T_f,
        track_rear_m=p.T_r,
        drag_area_m2=0.0,
        brake_front_share=p.T_sb,
        drive_front_share=float(p.T_se),
        tyre_front=sv.Tyre(),
        tyre_rear=sv.Tyre(),
    )


@cache
def driven(which: str) -> dict[tuple[int, str, int], dict[str, np.ndarray]]:
    """Channels without noise, by car, case and drive; all at once, which takes hardly longer.

    Raises
    ------
    RuntimeError
        A car was lost: what it does in a spin is no test of names.
    """
    drives = [m for some in SETS[which] for m in some]
    lanes = [(car, name, i) for car in CARS for name in CASES for i in range(len(drives))]
    n = round(max(m.duration_s for m in drives) * _RATE_HZ)
    time_s = np.arange(n) / _RATE_HZ
    speed = np.column_stack(
        [drives[i].speed_mps(np.minimum(time_s, drives[i].duration_s)) for _, _, i in lanes]
    )
    # After its end a drive goes straight on until the others have ended.
    lateral = np.column_stack(
        [
            CARS[car] * (time_s < drives[i].duration_s) * drives[i].lateral_mps2(time_s)
            for car, _, i in lanes
        ]
    )
    cars = [car_of(CASES[name], car) for car, name, _ in lanes]
    channels = multibody.drive(cars, speed, lateral / speed**2, np.zeros(len(cars)))
    found = {}
    for j, lane in enumerate(lanes):
        own = {c: v[: round(drives[lane[2]].duration_s * _RATE_HZ), j] for c, v in channels.items()}
        own = read_ahead(own, cars[j].a - multibody.base_car(lane[0]).a)
        slip = np.abs(np.arctan2(own["vy_mps"], own["vx_mps"]))
        if not slip.max() < _MOST_SLIP_RAD:
            raise RuntimeError(f"the car was lost: car {lane[0]}, {lane[1]}, {which}")
        found[lane] = own
    return found


def logged(
    case: Other, columns: dict[str, np.ndarray], name: str, rng: np.random.Generator
) -> sv.Log:
    """Channels with noise; the logged steering is ahead of the wheels, and times its ratio."""
    sensors, n = sv.SensorNoise(), len(columns["steer_rad"])
    columns = {c: values.copy() for c, values in columns.items()}
    steer = columns["steer_rad"]
    columns["steer_rad"] = case.ratio * (steer + case.lag_s * np.gradient(steer, 1 / _RATE_HZ))
    for f in fields(sensors):
        columns[f.name] += getattr(sensors, f.name) * rng.standard_normal(n)
    columns["time_s"] = np.arange(n) / _RATE_HZ
    return sv.Log.from_arrays(columns, name=name, check=False)


def improved(name: str, which: str, seed: int) -> sv.Study:
    """Improve the single track on the drives of a set that are fitted; the others judge."""
    case, number = CASES[name], list(CARS)[seed % len(CARS)]
    fitted, judging = SETS[which]
    logs = []
    first = list(CASES).index(name) * (len(fitted) + len(judging))
    for i, manoeuvre in enumerate((*fitted, *judging)):
        columns = driven(which)[number, name, i]
        logs.append(logged(case, columns, manoeuvre.name, np.random.default_rng([seed, first + i])))
    train, test = logs[: len(fitted)], logs[len(fitted) :]
    return sv.improve(sv.Model(workshop(number)), train, test, seed=seed)


if __name__ == "__main__":
    run(Truth(ALWAYS, CASES, tuple(SETS), improved), __doc__)
