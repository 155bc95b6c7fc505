"""Are the tyres of a designed drive found, and inside their intervals?

    python benchmarks/closed_loop/designed_tyres.py [--seeds 40] [--first 0] [--duration 60]

What `sysid-vehicle lab run --excitation designed` and `lab identify --unchecked` do, with other
sensor noise and another design each time. The closed loop sees readings only, and so does the
identification, which begins at the middle of its box. The design uses the true tyres: it
believes the car that is then driven. A drive designed for other tyres may teach less.
"""

import argparse

import numpy as np
from scipy.stats import binomtest

from sysid_vehicle.lab import Setup, design_excitation, run_closed_loop
from sysid_vehicle.lab.design.information import TYRES
from sysid_vehicle.lab.tyres.data import GreyBoxVehicle, TyreLog
from sysid_vehicle.lab.tyres.identify import identify_tyres


def main() -> None:
    """Run the study and print the table."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--seeds", type=int, default=40)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--duration", type=float, default=60.0, help="of a drive [s]")
    args = parser.parse_args()
    setup = Setup.default()
    vehicle = setup.plant.vehicle
    truth = {n: setup.plant.value(n) for n in TYRES} | {"drag_area_m2": vehicle.drag_area_m2}
    inside: dict[str, list[bool]] = {n: [] for n in truth}
    off: dict[str, list[float]] = {n: [] for n in truth}
    for seed in range(args.first, args.first + args.seeds):
        design = design_excitation(setup, seed=seed, duration_s=args.duration)
        drive = run_closed_loop(design.excitation, design.setup, seed=seed)
        car = GreyBoxVehicle.of(vehicle)
        fit = identify_tyres(car, TyreLog.from_log(drive.to_log(), car))
        missed = []
        for name, true in truth.items():
            low, high = fit.interval(name)
            inside[name].append(low <= true <= high)
            off[name].append(100.0 * (fit[name].value / true - 1.0))
            if not inside[name][-1]:
                missed.append(name)
        worst = max(abs(o[-1]) for o in off.values())
        print(
            f"seed {seed}: at worst {worst:.3f} % off; outside: {', '.join(missed) or 'none'}",
            flush=True,
        )
    print("\nDrives designed with the true tyres; identification does not see them.")
    print(f"{'':14s} {'rms error':>10s} {'worst':>9s}  in its 95 % interval")
    for name in truth:
        hits = inside[name]
        low, high = binomtest(sum(hits), len(hits)).proportion_ci(method="wilson")
        print(
            f"{name:14s} {np.sqrt(np.mean(np.square(off[name]))):8.4f} % "
            f"{np.max(np.abs(off[name])):7.4f} %  {sum(hits)} of {len(hits)} "
            f"({100 * low:.0f} .. {100 * high:.0f} %)"
        )


if __name__ == "__main__":
    main()
