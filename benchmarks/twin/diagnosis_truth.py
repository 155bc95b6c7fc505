"""Does the diagnosis name what is physically in a car of fourteen degrees of freedom?

python benchmarks/twin/diagnosis_truth.py [HIDDEN ...] [--seeds 1]

A single track with the workshop's numbers against driving of the built-in sports car: as it is, and
with drag, downforce, payload or a steering lag that the baseline does not know of. Two sets of
manoeuvres. A claim is right if what it names is in the car.
"""

import argparse
from dataclasses import dataclass, field

import sysid_vehicle as sv
from sysid_vehicle import manoeuvres
from sysid_vehicle.twin import SPORTS_CAR, PointMass, on_manoeuvre, single_track, to_log

# Load transfer over load-sensitive tyres, combined slip, rolling resistance and the downforce of
# the built-in car; the body rolls and pitches, which an accelerometer reads as a larger scale, and
# the roll of the body and the turn of the wheels answer late, as a relaxation length does.
ALWAYS = {
    "aero_downforce",
    "accelerometer_scale",
    "combined_slip",
    "lateral_load_transfer",
    "rolling_resistance",
    "tyre_load_sensitivity",
    "tyre_relaxation",
}


@dataclass(frozen=True)
class Hidden:
    """What the car has and the baseline does not know."""

    named: set[str]
    values: dict[str, float] = field(default_factory=dict)
    payload_kg: float = 0.0
    lag_s: float = 0.0


CASES = {
    "nothing": Hidden(set()),
    "drag": Hidden({"aero_drag"}, {"drag_area_m2": 1.35}),
    "downforce": Hidden(
        {"aero_downforce"}, {"front.lift_area_m2": -1.0, "rear.lift_area_m2": -1.4}
    ),
    "payload": Hidden({"mass", "cg_position", "yaw_inertia"}, payload_kg=200.0),
    "steering lag": Hidden({"steer_lag"}, lag_s=0.06),
}
SETS = {
    "lap, course": (manoeuvres.lap(), manoeuvres.handling_course()),
    "lanes, lap": (
        manoeuvres.double_lane_change((20.0, 26.0, 31.0)),
        manoeuvres.lap(lateral_mps2=8.0),
    ),
}


def study(name: str, which: str, seed: int) -> sv.Study:
    """Improve the single track on one driving, judged on the other."""
    case = CASES[name]
    car = SPORTS_CAR.replace(case.values)
    load = car.design
    if case.payload_kg:
        load = load.with_masses([PointMass(case.payload_kg, -1.9, 0.0, 0.6)])
    logs = [
        to_log(car, on_manoeuvre(car, load, m), seed=2 * seed + i, steer_lag_s=case.lag_s)
        for i, m in enumerate(SETS[which])
    ]
    return sv.improve(sv.Model(single_track(SPORTS_CAR)), logs[0], logs[1], seed=seed)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("hidden", nargs="*", metavar="HIDDEN", help=f"of {', '.join(CASES)}")
    parser.add_argument("--seeds", type=int, default=1)
    args = parser.parse_args()
    claims = right = sought = found = 0
    for name in args.hidden or CASES:
        for which in SETS:
            for seed in range(args.seeds):
                done = study(name, which, seed)
                named = [a.id for a in done.added]
                good = [n in ALWAYS | CASES[name].named for n in named]
                claims, right = claims + len(named), right + sum(good)
                if CASES[name].named:
                    sought += 1
                    found += bool(CASES[name].named & set(named))
                print(
                    f"{name:14s} {which:12s} {seed:3d} {done.verdict:18s} "
                    f"{done.test[0].error:7.3f} -> {done.test[-1].error:6.3f}  "
                    + ", ".join(n if g else f"[{n}]" for n, g in zip(named, good, strict=True)),
                    flush=True,
                )
    print(f"{right} of {claims} claims are in the car; {found} of {sought} hidden effects found")


if __name__ == "__main__":
    main()
