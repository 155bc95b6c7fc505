"""The dual sideslip observer on slippery roads, with the tyres of a dry road and with its own.

Run: python benchmarks/online/ice.py [--cars 4] [--seed 318859]

Cars of `fleet.draw_car` drive a lap of 60 s in the single track, at 10 to 13 m/s and up to 0.8 of
the friction, on surfaces with the cornering stiffness of the dry road and with 1.6 times the
friction's share of it. Printed is the share of samples whose sideslip the band of 2 standard
deviations holds, the worst drive of it, in how many drives a warning tells that the tyres are
others, and the friction that is told over the true one.
"""

import argparse
import dataclasses
import sys
import warnings

import fixed_tyres
import fleet
import numpy as np

import sysid_vehicle as sv
from sysid_vehicle.errors import SysidError, SysidWarning
from sysid_vehicle.online import estimate_sideslip

GRIPS = (0.5, 0.3, 0.15)
SOFTER = 1.6  # times the share of friction that is left, of the cornering stiffness


def softer(car: sv.Vehicle, grip: float) -> sv.Vehicle:
    """The car with so much of its friction, and `SOFTER` times that of its cornering stiffness."""
    tyres = {
        axle: getattr(car, axle).replace(
            D=grip * getattr(car, axle).D, B=SOFTER * getattr(car, axle).B
        )
        for axle in ("tyre_front", "tyre_rear")
    }
    return dataclasses.replace(car, **tyres)


def lap(car: sv.Vehicle) -> sv.manoeuvres.Manoeuvre:
    most = 0.8 * sv.manoeuvres.peak_lateral_mps2(car)
    speed = sv.manoeuvres.Knots((0.0, 30.0, 60.0), (10.0, 13.0, 11.0))
    return dataclasses.replace(sv.manoeuvres.lap(60.0, most, 14.0), speed_mps=speed)


def drives(cars: int, seed: int, grip: float, soft: bool) -> list[tuple[bool, list[float]]]:
    """Whether the observer was told the surface; held, warned, and friction over the true one."""
    rows = []
    for i in range(cars):
        car = fleet.draw_car(np.random.default_rng([seed, i]))
        dry = car.vehicle()
        true = (softer if soft else fixed_tyres.on_surface)(dry, grip)
        rng = np.random.default_rng([seed, i, 1])
        try:
            log = sv.drive(sv.Model(true), lap(true), seed=rng, noise=fleet.sensors_of(car))
        except SysidError:  # the driver loses the car
            continue
        for told in (dry, true):
            with warnings.catch_warnings(record=True) as heard:
                warnings.simplefilter("always", SysidWarning)
                run = estimate_sideslip(told, log)
            warned = any("cornering stiffness is" in str(w.message) for w in heard)
            friction = np.mean([run.mu_f[-1] / true.tyre_front.D, run.mu_r[-1] / true.tyre_rear.D])
            rows.append((told is true, [run.error().covered, float(warned), float(friction)]))
    return rows


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--cars", type=int, default=4)
    parser.add_argument("--seed", type=int, default=318859)
    args = parser.parse_args()
    print("friction  stiffness  tyres told  drives  held (worst)  warned  friction told / true")
    for soft in (False, True):
        for grip in GRIPS:
            rows = drives(args.cars, args.seed, grip, soft)
            for own in (False, True):
                held, warned, friction = np.array([r for told, r in rows if told is own]).T
                stiff, tyres = "softer" if soft else "same", "its own" if own else "dry"
                print(
                    f"{grip:8g}  {stiff:9s}  {tyres:10s}"
                    f"  {held.size:6d}  {100.0 * held.mean():4.0f} % ({100.0 * held.min():.0f})"
                    f"  {100.0 * warned.mean():5.0f} %  {friction.mean():.2f}",
                    flush=True,
                )
    return 0


if __name__ == "__main__":
    sys.exit(main())
