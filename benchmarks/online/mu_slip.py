"""Accuracy of every estimator of the friction curve, against published values and the bound.

Run: python benchmarks/online/mu_slip.py [--quick] [--sets N]. Ends with status 1 if a row fails.
"""

import argparse
import sys
import time
from collections.abc import Callable

import numpy as np

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
WANTED = 5000  # sets; with fewer the scatter of the means exceeds the targets
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


def row(name: str, shown: str, good: bool | None = None) -> bool:
    """Print one line; `good` is None for a row without a target."""
    verdict = "" if good is None else "ok" if good else "FAILS"
    print(f"{name:42s} {shown:58s} {verdict}")
    return good is not False


def pair(values: np.ndarray, digits: int = 4) -> str:
    return "(" + ", ".join(f"{x:.{digits}f}" for x in values) + ")"


def noise_free() -> bool:
    found = mu_slip_ekf(simulate_mu_slip()).estimate
    target = np.array([0.34314887, 0.15529258]), np.array([0.040034, 0.030074])
    good = np.abs(found.values - target[0]).max() < 1e-6
    good &= np.abs(found.std - target[1]).max() < 1e-6
    shown = f"{pair(found.values, 8)}, sigma {pair(found.std, 6)}"
    return row("noise-free EKF", shown, bool(good))


def monte_carlo(sets: int) -> bool:
    data = [simulate_mu_slip(TRUTH, noise_std=NOISE, seed=k) for k in range(sets)]
    bound = np.sqrt(np.diag(mu_slip_cramer_rao(data[0].slip, TRUTH, NOISE)))
    row("Cramer-Rao bound", f"std {pair(bound)}")
    good, best = True, np.inf
    for name, estimator in ESTIMATORS.items():
        begun = time.perf_counter()
        values = np.array([estimator(d) for d in data])
        cost = (time.perf_counter() - begun) / sets
        mean, std = values.mean(axis=0), values.std(axis=0, ddof=1)
        bias, excess = np.abs(mean / TRUTH - 1).max(), np.abs(std / bound - 1).max()
        shown = f"mean {pair(mean)}, std {pair(std)}, {1e6 * cost:.0f} us"
        target = None
        if name == "EKF, published":
            # The means as printed; the deviations within three times their own scatter.
            target = np.abs(mean - (0.341, 0.157)).max() <= 0.5e-3
            target &= np.abs(std / (0.0109, 0.0081) - 1).max() <= 3.0 / np.sqrt(2 * sets)
        if name == "least squares, corrected":
            target = bias < 0.003 and excess < 0.05
            best = (bias, excess)
        good &= row(name, shown, None if target is None or sets < WANTED else bool(target))
    row("  best: bias, distance from the bound", f"{best[0]:.2%}, {best[1]:.2%}")
    return good


def calibration(sets: int) -> None:
    """Share of sets with the truth inside the one-sigma contour; 39 % is honest."""
    for name, run in (("EKF, published", mu_slip_ekf), ("iterated smoother", mu_slip_smooth)):
        inside = []
        for k in range(sets):
            found = run(simulate_mu_slip(TRUTH, noise_std=NOISE, seed=k))
            error = found.mean[-1] - TRUTH
            inside.append(error @ np.linalg.solve(found.covariance[-1], error) < 1.0)
        row(f"truth in the contour, {name}", f"{np.mean(inside):.1%}")


def magic_formula(sets: int, curve: MuSlipCurve = MAGIC_FORMULA) -> None:
    data = [simulate_mu_slip(PACEJKA, curve=curve, noise_std=NOISE, seed=k) for k in range(sets)]
    bound = np.sqrt(np.diag(mu_slip_cramer_rao(data[0].slip, PACEJKA, NOISE, curve=curve)))
    row("Magic Formula: bound", f"std {pair(bound)}")
    estimators: dict[str, Estimator] = {
        "EKF": lambda d: mu_slip_ekf(d, curve=curve).mean[-1],
        "least squares": lambda d: mu_slip_fit(d, curve=curve).values,
        "iterated smoother": lambda d: mu_slip_smooth(d, curve=curve).mean[-1],
    }
    for name, estimator in estimators.items():
        values = np.array([estimator(d) for d in data])
        mean, std = values.mean(axis=0), values.std(axis=0, ddof=1)
        row(f"Magic Formula: {name}", f"mean {pair(mean, 3)}, std {pair(std)}")


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--sets", type=int, default=WANTED)
    parser.add_argument("--quick", action="store_true", help="500 sets, too few for a verdict")
    args = parser.parse_args()
    sets = 500 if args.quick else args.sets
    good = noise_free()
    good &= monte_carlo(sets)
    calibration(min(sets, 2000))
    magic_formula(min(sets, 1000))
    return 0 if good else 1


if __name__ == "__main__":
    sys.exit(main())
