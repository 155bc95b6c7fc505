"""Sideslip observers whose tyres are fixed, with other tyres and surfaces than they were told.

Run: python benchmarks/online/fixed_tyres.py [--cars 5] [--seed 307323]

Cars are those of `fleet.draw_car` on their three drives in the single track, on surfaces of full,
half and a third of the friction; the observers are told the tyres on the full one, or generic ones.
Printed is the share of samples that a band of 2 standard deviations holds: with the tyres taken as
exact, as the dual observer judges it, and in the worst drive.
"""

import argparse
import dataclasses
import sys
import warnings

import fleet
import numpy as np

import sysid_vehicle as sv
from sysid_vehicle.errors import SysidError, SysidWarning
from sysid_vehicle.online import SideslipRun, estimate_sideslip

KINDS = ("ukf", "linear-ukf")
GRIPS = (1.0, 0.5, 0.3)


def on_surface(car: sv.Vehicle, grip: float) -> sv.Vehicle:
    """The car with so much of its friction and all of its cornering stiffness."""
    tyres = {
        axle: getattr(car, axle).replace(
            D=grip * getattr(car, axle).D, B=getattr(car, axle).B / grip
        )
        for axle in ("tyre_front", "tyre_rear")
    }
    return dataclasses.replace(car, **tyres)


def held(run: SideslipRun, std_rad: np.ndarray) -> float:
    return dataclasses.replace(run, beta_std_rad=std_rad).error().covered


def rows_of(car: fleet.Car, key: list[int], grip: float) -> list[tuple[str, str, list[float]]]:
    """Tyres told, kind of observer, and shares held: as exact, judged, refuted."""
    true, rows = car.vehicle(), []
    slower = dataclasses.replace(car, friction=grip * car.friction)
    for j, manoeuvre in enumerate(slower.drives()):
        rng = np.random.default_rng([*key, j])
        try:
            model = sv.Model(on_surface(true, grip))
            log = sv.drive(model, manoeuvre, seed=rng, noise=fleet.sensors_of(car))
        except SysidError:  # the driver loses the car
            continue
        for told, vehicle in (("its own", true), ("generic", fleet.generic(true))):
            for kind in KINDS:
                run = estimate_sideslip(vehicle, log, kind=kind)
                shares = [held(run, run.exact_std_rad), held(run, run.beta_std_rad)]
                rows.append((told, kind, [*shares, float(np.mean(run.refuted))]))
    return rows


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--cars", type=int, default=5)
    parser.add_argument("--seed", type=int, default=307323)
    args = parser.parse_args()
    warnings.simplefilter("ignore", SysidWarning)  # that the tyres do not fit is the point
    print("surface  tyres told  observer    drives  as exact  judged (worst)  refuted")
    for grip in GRIPS:
        rows = []
        for i in range(args.cars):
            car = fleet.draw_car(np.random.default_rng([args.seed, i]))
            rows += rows_of(car, [args.seed, i], grip)
        for told, kind in dict.fromkeys(row[:2] for row in rows):
            cell = 100.0 * np.array([shares for *which, shares in rows if which == [told, kind]])
            exact, judged, refuted = cell.mean(axis=0)
            print(
                f"{grip:7g}  {told:10s}  {kind:10s} {len(cell):7d} {exact:7.0f} % {judged:7.0f} % "
                f"({cell[:, 1].min():.0f}) {refuted:8.0f} %",
                flush=True,
            )
    return 0


if __name__ == "__main__":
    sys.exit(main())
