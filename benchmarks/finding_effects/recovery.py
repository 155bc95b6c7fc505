"""Is a hidden effect found, how well is its size known, does the error fall to the noise floor?

    python benchmarks/finding_effects/recovery.py [EFFECT ...] [--seeds N]

Each effect is hidden in a simulated car that drives a lap with braking in corners (60 s at 100 Hz,
training) and a handling course (validation data), then sought from a baseline with other tyres.
"""

from __future__ import annotations

import argparse
from dataclasses import replace

import numpy as np

import sysid_vehicle as sv

HIDDEN: dict[str, tuple[float, ...]] = {
    "aero_downforce": (0.9, 1.3),
    "aero_drag": (0.45,),
    "tyre_load_sensitivity": (0.25,),
    "combined_slip": (1.0,),
    "tyre_relaxation": (0.45,),
    "front_tyre_relaxation": (0.45,),
    "rear_tyre_relaxation": (0.45,),
    "force_lag": (0.15,),
    "wheel_inertia": (0.06,),
    "steer_lag": (0.06,),
    "steer_offset": (0.006,),
    "road_bank": (0.05,),
    "road_grade": (0.03,),
    "side_wind": (450.0, 250.0),
    "mass": (0.12,),
    "yaw_inertia": (0.25,),
    "cg_position": (0.08,),
    "imu_lever_arm": (0.5, 0.0),
    "body_roll": (0.06, 2.0),
    "front_roll_steer": (0.02, 2.0),
    "rear_roll_steer": (0.02, 2.0),
    "accelerometer_bias": (0.0, 0.25),
}
SENSORS = sv.SensorNoise(
    vx_mps=0.03,
    vy_mps=0.03,
    yaw_rate_radps=0.0025,
    ax_mps2=0.06,
    ay_mps2=0.06,
    steer_rad=2e-4,
)
OTHER_TYRES = {
    "tyre_front": sv.Tyre(B=9.0, C=1.3, D=0.9, E=0.0),
    "tyre_rear": sv.Tyre(B=11.0, C=1.5, D=1.1, E=-0.2),
}
HEAD = (
    f"{'effect':<22} {'seed':>4} {'place':<28} {'z of its parameters':<20} "
    f"{'validation error':>22} {'to true car':>11} {'verdict':<17} {'s':>4}"
)


def place_of(name: str, dx: sv.Diagnosis) -> tuple[str, bool]:
    """Say where the effect stands in a ranking, and whether that is good enough."""
    ids = [c.id for c in dx.ranking]
    first = dx.ranking[0]
    if first.id == name:
        return "1", True
    if name in first.indistinguishable_from:
        return f"indistinguishable from {first.id}", True
    return str(ids.index(name) + 1) if name in ids else "not tested", False


def run(name: str, seed: int) -> bool:
    car = sv.example_vehicle()
    effect = sv.effect(name)
    values = {f"{name}.{p.name}": v for p, v in zip(effect.parameters, HIDDEN[name], strict=True)}
    truth = sv.Model(car).add(name).with_values(values)
    train = sv.drive(truth, sv.manoeuvres.lap(), seed=2 * seed + 1, noise=SENSORS)
    test = sv.drive(truth, sv.manoeuvres.handling_course(), seed=2 * seed + 2, noise=SENSORS)
    known = [e.id for e in sv.catalogue()]
    other = sv.Model(car.replace(**OTHER_TYRES))
    study = sv.improve(other, train, test, candidates=known, seed=seed)
    place, good = place_of(name, study.diagnoses[0])
    candidate = next(c for c in study.diagnoses[0].ranking if c.id == name)
    found = next((a for a in study.added if a.id == name), None)
    sizes = (
        [(e.value, e.std) for e in found.parameters]
        if found is not None
        else list(zip(candidate.value, candidate.std, strict=True))
    )
    z = [(value - true) / std for (value, std), true in zip(sizes, HIDDEN[name], strict=True)]
    before, after = study.test[0].error, study.test[-1].error
    true_car = sv.compare(replace(study.fit, model=truth), test, noise=study.fit.noise).error
    ok = good and max(map(abs, z)) <= 3.0 and after <= 1.05
    others = [a.id for a in study.added if a.id != name]
    print(
        f"{name:<22} {seed:>4} {place:<28} {' '.join(f'{v:+.2f}' for v in z):<20} "
        f"{before:>8.3f} -> {after:>7.3f}/1 {after / true_car:>11.3f} {study.verdict:<17} "
        f"{study.seconds:>4.0f}{'' if ok else '  MISSED'}"
        + (f"  also added: {', '.join(others)}" if others else ""),
        flush=True,
    )
    return ok


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("effects", nargs="*", metavar="EFFECT", help="all if left out")
    parser.add_argument("--seeds", type=int, default=1)
    args = parser.parse_args()
    print(HEAD)
    met = [run(name, seed) for name in args.effects or HIDDEN for seed in range(args.seeds)]
    print(
        f"{sum(met)} of {len(met)} met: ranked first or indistinguishable from it, parameters "
        "within 3 standard errors, validation error at most 1.05 of the noise floor"
    )
    print(f"largest number of standard errors allowed: 3; numpy {np.__version__}")


if __name__ == "__main__":
    main()
