"""Accuracy of every estimator of the friction curve, against published values and the bound.

Run: python benchmarks/online/mu_slip.py [--quick] [--sets N]. Ends with status 1 if a row fails.
"""

import argparse
import sys
import time
from collections.abc import Callable

import numpy as np
from table import Table

from sysid_vehicle.online import (
    MAGIC_FORMULA,
    TWO_PARAMETER,
    MuSlipCurve,
    MuSlipData,
    mu_slip_cramer_rao,
    mu_slip_ekf,
    mu_slip_fit,
    mu_slip_smooth,
    simulate_mu_slip,
)

TRUTH = np.array([0.35, 0.15])
PACEJKA = np.array([0.9, 0.12, 1.65, 2.4])
NOISE = 0.04
WANTED, QUICK = 5000, 500  # sets; with fewer the scatter of the means exceeds the targets
Estimator = Callable[[MuSlipData], np.ndarray]


def least_squares(count: int) -> Estimator:
    """From the filter's start, inside the published box."""
    return lambda d: (
        mu_slip_fit(
            d,
            start=TWO_PARAMETER.prior.mean,
            bounds=TWO_PARAMETER.fit_bounds,
            max_iterations=count,
        ).values
    )


ESTIMATORS: dict[str, Estimator] = {
    "EKF, published": lambda d: mu_slip_ekf(d).mean[-1],
    "EKF, no pseudo-noise": lambda d: mu_slip_ekf(d, pseudo_noise=False).mean[-1],
    "EKF, second pass": lambda d: mu_slip_ekf(d, passes=2).mean[-1],
    "iterated EKF": lambda d: mu_slip_ekf(d, iterations=10).mean[-1],
    "iterated smoother": lambda d: mu_slip_smooth(d).mean[-1],
    "least squares, 1 iteration": least_squares(1),
    "least squares, 2 iterations": least_squares(2),
    "least squares, 5 iterations": least_squares(5),
    "least squares, batch": lambda d: mu_slip_fit(d).values,
    "least squares, corrected": lambda d: mu_slip_fit(d, corrected=True).values,
}


def pair(values: np.ndarray, digits: int = 4) -> str:
    return "(" + ", ".join(f"{x:.{digits}f}" for x in values) + ")"


def noise_free(table: Table) -> None:
    found = mu_slip_ekf(simulate_mu_slip()).estimate
    target = np.array([0.34314887, 0.15529258]), np.array([0.040034, 0.030074])
    good = np.abs(found.values - target[0]).max() < 1e-6
    good &= np.abs(found.std - target[1]).max() < 1e-6
    shown = f"{pair(found.values, 8)}, sigma {pair(found.std, 6)}"
    table.row("mu-slip, noise-free EKF", shown, "as published, to 1e-6", bool(good))


def monte_carlo(table: Table, sets: int) -> None:
    data = [simulate_mu_slip(TRUTH, noise_std=NOISE, seed=k) for k in range(sets)]
    bound = np.sqrt(np.diag(mu_slip_cramer_rao(data[0].slip, TRUTH, NOISE)))
    table.row(f"mu-slip, {sets} noisy sets: Cramer-Rao bound", f"std {pair(bound)}")
    for name, estimator in ESTIMATORS.items():
        begun = time.perf_counter()
        values = np.array([estimator(d) for d in data])
        cost = (time.perf_counter() - begun) / sets
        mean, std = values.mean(axis=0), values.std(axis=0, ddof=1)
        bias, excess = np.abs(mean / TRUTH - 1).max(), np.abs(std / bound - 1).max()
        shown = f"mean {pair(mean)}, std {pair(std)}, {1e6 * cost:.0f} us"
        target, good = "", None
        if name == "EKF, published":
            # The means as printed; the deviations within three times their own scatter.
            target = "(.341, .157), (.0109, .0081)"
            good = np.abs(mean - (0.341, 0.157)).max() <= 0.5e-3
            good &= np.abs(std / (0.0109, 0.0081) - 1).max() <= 3.0 / np.sqrt(2 * sets)
        if name == "least squares, corrected":
            target = "bias 0.3 %, bound + 5 %"
            good = bias < 0.003 and excess < 0.05
            shown += f"; bias {bias:.2%}, {excess:.2%} off the bound"
        table.row(f"  {name}", shown, target, None if good is None or sets < WANTED else bool(good))


def calibration(table: Table, sets: int) -> None:
    """Share of sets with the truth inside the one-sigma contour; 39 % is honest."""
    for name, run in (("EKF, published", mu_slip_ekf), ("iterated smoother", mu_slip_smooth)):
        inside = []
        for k in range(sets):
            found = run(simulate_mu_slip(TRUTH, noise_std=NOISE, seed=k))
            error = found.mean[-1] - TRUTH
            inside.append(error @ np.linalg.solve(found.covariance[-1], error) < 1.0)
        table.row(f"  truth in the contour, {name}", f"{np.mean(inside):.1%}")


def magic_formula(table: Table, sets: int, curve: MuSlipCurve = MAGIC_FORMULA) -> None:
    data = [simulate_mu_slip(PACEJKA, curve=curve, noise_std=NOISE, seed=k) for k in range(sets)]
    bound = np.sqrt(np.diag(mu_slip_cramer_rao(data[0].slip, PACEJKA, NOISE, curve=curve)))
    table.row("Magic Formula: bound", f"std {pair(bound)}")
    estimators: dict[str, Estimator] = {
        "EKF": lambda d: mu_slip_ekf(d, curve=curve).mean[-1],
        "least squares": lambda d: mu_slip_fit(d, curve=curve).values,
        "iterated smoother": lambda d: mu_slip_smooth(d, curve=curve).mean[-1],
    }
    for name, estimator in estimators.items():
        values = np.array([estimator(d) for d in data])
        mean, std = values.mean(axis=0), values.std(axis=0, ddof=1)
        table.row(f"  {name}", f"mean {pair(mean, 3)}, std {pair(std)}")


def rows(table: Table, sets: int) -> None:
    """Print everything that this file measures."""
    noise_free(table)
    monte_carlo(table, sets)
    calibration(table, min(sets, 2000))
    magic_formula(table, min(sets, 1000))


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--sets", type=int, default=WANTED)
    parser.add_argument("--quick", action="store_true", help="500 sets, too few for a verdict")
    args = parser.parse_args()
    table = Table()
    rows(table, QUICK if args.quick else args.sets)
    return 1 if table.failed else 0


if __name__ == "__main__":
    sys.exit(main())
