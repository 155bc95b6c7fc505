"""Do intervals of fits to predictions hold the true car, and what does such a fit cost?

    python benchmarks/finding_effects/ahead_intervals.py [--drives N] [--seed SEED]

A simulated car drives laps of 40 s with noise of its own each; the model that is the car is fitted
by the likelihood and to predictions of 2 s. Printed for each quantity: how many 95 % intervals hold
the true value, and the standard error stated over the one that estimates show, where 1 is right.
"""

from __future__ import annotations

import argparse

import numpy as np

import sysid_vehicle as sv
from sysid_vehicle.identify import predicting_ahead

QUANTITIES = ("cornering stiffness front", "cornering stiffness rear", "D_front", "D_rear")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--drives", type=int, default=200)
    parser.add_argument("--seed", type=int, default=0, help="of the first drive")
    args = parser.parse_args()
    truth = sv.Model(sv.example_vehicle())
    found: dict[str, list[list[tuple[float, float]]]] = {"one step": [], "2 s ahead": []}
    for seed in range(args.seed, args.seed + args.drives):
        fit = sv.identify(truth, sv.drive(truth, sv.manoeuvres.lap(40.0), seed=seed), starts=1)
        true = {**fit.values_of(truth), **{n: truth.value(n) for n in truth.free_names}}
        for word, one in (("one step", fit), ("2 s ahead", predicting_ahead(fit))):
            found[word].append([(one[q].value, one[q].std) for q in QUANTITIES])
    print(f"{'fitted to':<10} {'quantity':<26} {'inside':>12} {'stated/seen':>12}")
    for word, drives in found.items():
        values, errors = np.moveaxis(np.array(drives), 2, 0)
        inside = np.abs(values - [true[q] for q in QUANTITIES]) < 1.96 * errors
        stated = np.sqrt(np.mean(errors**2, axis=0)) / np.std(values, axis=0, ddof=1)
        for i, quantity in enumerate(QUANTITIES):
            count = f"{np.count_nonzero(inside[:, i])} of {len(values)}"
            print(f"{word:<10} {quantity:<26} {count:>12} {stated[i]:>12.2f}")


if __name__ == "__main__":
    main()
