"""Does a designed excitation teach what its preview promises?

Designs an excitation from doubtful knowledge of the tyres, drives the true car with it many times,
fits the eight tyre coefficients to each log, and compares the errors with what was promised.
Neither the design nor the fits see the true tyres: both begin at the doubtful ones.
"""

import argparse
import time
from dataclasses import replace

import numpy as np

from sysid_vehicle import Model
from sysid_vehicle.identify.search.search import Box, minimise
from sysid_vehicle.lab import Setup, design_excitation, preview, run_closed_loop
from sysid_vehicle.lab.design.information import TYRES, information, problem_of, sensor_noise
from sysid_vehicle.lab.drive.loop import ClosedLoop

# What is believed of tyres that are 22, 1.8, 1.6, 0.8 on both axles.
BELIEVED = dict(zip(TYRES, (19.0, 1.7, 1.7, 0.6, 24.0, 1.7, 1.5, 0.6), strict=True))
# A simulated car obeys its model; a promise made for a real one allows for more.
MOTION = (1e-4, 1e-4, 1e-5)


def fit(drive: ClosedLoop, start: Model) -> tuple[np.ndarray, np.ndarray]:
    """Estimates of the tyres and their standard deviations, from readings alone."""
    problem = problem_of(drive, start)
    columns = [start.parameters[n].column for n in TYRES]
    low, high = np.array([start.bounds(n) for n in TYRES]).T
    box = Box(columns, low, high)
    p = start.vector()
    for motion in ((0.1, 0.1, 0.1), (5e-3, 5e-3, 1e-3), MOTION, MOTION):
        noise = sensor_noise(drive, motion).vector()
        p[columns] = minimise(problem, p, problem.freeze(p, noise), box, rounds=30).x
    found = start.with_values(dict(zip(TYRES, map(float, p[columns]), strict=True)))
    covariance = np.linalg.inv(information(drive, found, TYRES, motion=MOTION))
    return p[columns], np.sqrt(np.diag(covariance))


def main() -> None:
    """Run the study and print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="few repeats")
    parser.add_argument("--repeats", type=int, default=40)
    parser.add_argument("--duration", type=float, default=60.0, help="of the drive, in seconds")
    args = parser.parse_args()
    repeats = 4 if args.quick else args.repeats
    setup = Setup.default()
    truth = setup.plant
    begin = time.perf_counter()
    design = design_excitation(
        setup, believed=truth.with_values(BELIEVED), duration_s=args.duration
    )
    print(design)
    print(f"designed in {time.perf_counter() - begin:.1f} s\n")
    inside = replace(design.setup, simulator=replace(setup.simulator, inputs_linear=True))
    believed, told = design.preview, preview(design.excitation, inside, motion=MOTION)
    values = np.array([truth.value(n) for n in TYRES])
    errors, pulls = [], []
    for seed in range(1, repeats + 1):
        drive = run_closed_loop(design.excitation, inside, seed=seed)
        if drive.lost_s is not None:
            print(f"seed {seed}: the car was lost at {drive.lost_s} s")
        estimate, std = fit(drive, truth.with_values(BELIEVED))
        errors.append(estimate / values - 1.0)
        pulls.append((estimate - values) / std)
    error, pull = 100.0 * np.array(errors), np.array(pulls)
    print(f"{repeats} drives of the true car, relative to the true value in %:")
    print(
        f"{'':8s} {'promised':>9s} {'if it obeys':>11s} {'rms error':>10s} {'worst':>8s} "
        f"{'in 95 % interval':>17s}"
    )
    for i, name in enumerate(TYRES):
        print(
            f"{name:8s} {100 * believed[name].relative:9.3f} {100 * told[name].relative:11.3f} "
            f"{np.sqrt(np.mean(error[:, i] ** 2)):10.3f} {np.abs(error[:, i]).max():8.3f} "
            f"{100 * np.mean(np.abs(pull[:, i]) < 1.96):15.0f} %"
        )


if __name__ == "__main__":
    main()
