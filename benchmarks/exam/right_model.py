"""How often 95 % intervals hold what is hidden where the right model is fitted, detected or not.

    python benchmarks/exam/right_model.py --noise "coloured force" --trials 80 --seed 559761

Single effects of the exam's grid, of severity 1 and 2. `identify` begins at the exam's baseline;
beside it stands the maximum that is reached from the truth. Where the two differ the search has
ended elsewhere, and where they agree it is the interval that holds or does not.
"""

from __future__ import annotations

import argparse
import warnings
from dataclasses import replace

import numpy as np
import truths
from design import NOISES, Trial, full

import sysid_vehicle as sv
from sysid_vehicle.identify import beside_noise, refine

_REPEATS = (1000, 10**6)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--noise", choices=NOISES, default="coloured force")
    parser.add_argument("--trials", type=int, default=80)
    parser.add_argument("--seed", type=int, required=True)
    args = parser.parse_args()
    grid = [
        t for t in full(1, 25) if t.kind == "effect" and t.severity >= 1 and t.noise == args.noise
    ]
    rng = np.random.default_rng(args.seed)
    off = np.empty((0, 2))
    for k in rng.choice(len(grid), args.trials, replace=False):
        trial = replace(grid[k], repeat=int(rng.integers(*_REPEATS)))
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", sv.SysidWarning)
                found = _errors(trial)
        except sv.SysidError as error:
            print(f"{trial.key}: {error}", flush=True)
            continue
        for name, errors in found.items():
            off = np.vstack([off, errors])
            if np.abs(errors).max() > 1.96:
                print(f"{trial.key} {name}: {errors[0]:.2f}, {errors[1]:.2f}", flush=True)
    for where, z in zip(("from the baseline", "from the truth"), off.T, strict=True):
        held = np.count_nonzero(np.abs(z) < 1.96)
        print(f"{where}: {held} of {z.size} hold, rms {np.sqrt(np.mean(z**2)):.2f}")


def _errors(trial: Trial) -> dict[str, tuple[float, float]]:
    """Errors in standard errors, of both maxima, by hidden parameter that the data determine."""
    logs, _, _ = truths.sample(trial)
    model = truths.baseline(trial.vehicle).add(*trial.truth)
    fit = sv.identify(model, logs, starts=3, progress=False)
    near = beside_noise(refine(truths.hidden(trial), fit.driving, fit.noise))
    found = {}
    for name, true in truths.true_values(trial).items():
        if np.isfinite(fit[name].std) and not fit[name].note:
            both = [(e.value - true) / e.std for e in (fit[name], near[name])]
            found[name] = (float(both[0]), float(both[1]))
    return found


if __name__ == "__main__":
    main()
