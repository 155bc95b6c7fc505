"""Is the cornering stiffness of recursive least squares too small or too large?

Run: python benchmarks/online/cornering.py [--cars 8] [--seed 0]

Cars of `fleet.draw_car`, told with generic tyres, drive a course and a lap at up to 3 m/s2 and
28 m/s: in the single track with a relaxation length of 0.35 to 0.7 m, and in fourteen degrees of
freedom with such tyres, bodies that roll, and loads that move to the outer wheels.
"""

import argparse
import dataclasses
import warnings
from collections import defaultdict
from collections.abc import Iterator

import fleet
import numpy as np

import sysid_vehicle as sv
from sysid_vehicle import manoeuvres
from sysid_vehicle.online import cornering_stiffness
from sysid_vehicle.twin import TwinCar, on_manoeuvre, single_track, to_log

LATERAL_MPS2, DURATION_S = 3.0, 40.0


def at_rest(twin: TwinCar, car: fleet.Car, vehicle: sv.Vehicle) -> np.ndarray:
    """Stiffness of both axles [N/rad] at the load at rest."""
    known, found = twin.numbers(), []
    for axle, load, ratio in zip(
        ("front", "rear"), vehicle.static_loads_n, (1.0, car.stiffness_ratio), strict=True
    ):
        q = 1.0 / known[f"{axle}.tyre.load_at_peak_stiffness"]
        found.append(load * car.stiffness_front * ratio * 2.0 * q / (1.0 + q * q))
    return np.array(found)


def drives(seed: int, number: int) -> Iterator[tuple[str, sv.Vehicle, sv.Log, np.ndarray]]:
    """Simulator, what is told of the car, the log, and the true stiffness [N/rad]."""
    car = fleet.draw_car(np.random.default_rng([seed, number]))
    rng = np.random.default_rng([seed, number, 1])
    top = rng.uniform(16.0, 28.0)
    vehicle, noise = car.vehicle(), fleet.sensors_of(car)
    loads = np.array(vehicle.static_loads_n)
    tyres = (vehicle.tyre_front, vehicle.tyre_rear)
    slopes = np.array([tyre.cornering_stiffness_per_load for tyre in tyres])
    for course in (manoeuvres.handling_course, manoeuvres.lap):
        driven = course(DURATION_S, LATERAL_MPS2, top)
        model = sv.Model(vehicle).add("tyre_relaxation")
        length = {"tyre_relaxation.relaxation_length_m": rng.uniform(0.35, 0.7)}
        log = sv.drive(model.with_values(length), driven, seed=rng, noise=noise)
        yield "single track", fleet.generic(vehicle), log, loads * slopes
        late = dataclasses.replace(car, relaxation_m=rng.uniform(0.35, 0.7))
        twin = fleet.twin_of(late)
        log = to_log(twin, on_manoeuvre(twin, None, driven, dt_s=2e-3), seed=rng, noise=noise)
        known = single_track(twin, drive_front_share=0.0, brake_front_share=0.65)
        yield "14 degrees", fleet.generic(known), log, at_rest(twin, late, known)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--cars", type=int, default=8)
    parser.add_argument("--seed", type=int, default=0)
    args = parser.parse_args()
    warnings.simplefilter("ignore")
    off, sigmas = defaultdict(list), defaultdict(list)
    for number in range(args.cars):
        for simulator, vehicle, log, true in drives(args.seed, number):
            run = cornering_stiffness(vehicle, log, forgetting=1.0)
            value = np.array([run.cf_npr[-1], run.cr_npr[-1]])
            std = np.array([run.cf_std_npr[-1], run.cr_std_npr[-1]])
            off[simulator].append(100.0 * (value / true - 1.0))
            sigmas[simulator].append(np.abs(value - true) / std)
    for simulator, errors in off.items():
        told = ", ".join(
            f"{axle} {e.mean():+.1f} % ({e.min():+.1f} to {e.max():+.1f})"
            for axle, e in zip(("front", "rear"), np.array(errors).T, strict=True)
        )
        beyond = np.array(sigmas[simulator]) > 2.0
        print(f"{simulator}: {told}; beyond 2 sigma {beyond.sum()} of {beyond.size}")


if __name__ == "__main__":
    main()
