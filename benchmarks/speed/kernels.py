"""What the kernels of the main likelihood cost for each sample.

    python benchmarks/speed/kernels.py [--seconds S] [--effects ID ...]

One simulated lap at 100 Hz, one core, least processor time of several calls. The baseline has nine
free parameters, of which eight are the tyres'; each effect that is named is added to it with its
typical values. The last row is the tyre regression of the laboratory on a known motion.
"""

from __future__ import annotations

import argparse
import time
import warnings
from collections.abc import Callable

import numpy as np

import sysid_vehicle as sv
from sysid_vehicle import _core
from sysid_vehicle.estimate import Driving, first_guess


def microseconds(work: Callable[[], object], samples: int, times: int = 7) -> float:
    """Least processor time of a few calls, for one sample: what others do is not ours."""
    best = float("inf")
    for _ in range(times):
        began = time.process_time()
        work()
        best = min(best, time.process_time() - began)
    return best / samples * 1e6


def likelihood(model: sv.Model, driving: Driving) -> None:
    """Prints a row for each kernel of the grey-box model."""
    # As a problem of so many samples at most it shares no filters with others.
    problem = driving.problem(model, most_samples=driving.samples)
    p = model.vector()
    noise = first_guess(driving, model.vehicle).vector()
    filtered = problem.freeze(p, noise)
    tyres = list(range(8))
    signals = np.ones((problem.samples, 8))
    targets = [0, 1, 2, 5, 6, 7, 8, 9]
    ahead = [(100, 10), (200, 20), (500, 50)]  # of 100 Hz
    for name, work in (
        ("value with frozen gains", lambda: problem.half_sum_of_squares(p, filtered)),
        ("normal equations, 8 parameters", lambda: problem.normal_equations(p, filtered, tyres)),
        (
            "normal equations, 12 parameters",
            lambda: problem.normal_equations(p, filtered, [*tyres, 8, 9, 10, 11]),
        ),
        (
            "sensitivities, 40 parameters",
            lambda: problem.sensitivities(p, filtered, list(range(40))),
        ),
        (
            "signal sensitivities, 8 signals",
            lambda: problem.signal_sensitivities(p, filtered, signals, targets),
        ),
        ("freeze", lambda: problem.freeze(p, noise)),
        ("noise score", lambda: problem.noise_score(p, noise)),
        ("the same, the filter known", lambda: problem.filtered_noise_score(p, filtered)),
        ("1, 2 and 5 s ahead", lambda: problem.look_ahead(p, noise, ahead)),
        ("trace, smoothed", lambda: problem.trace(p, noise, True)),
    ):
        print(f"  {name:<34} {microseconds(work, problem.samples):7.3f} us", flush=True)


def regression(samples: int = 20000) -> None:
    """Prints the row of the tyre regression: residuals, derivatives and normal equations."""
    car = _core.VehicleData()
    car.mass_kg, car.lf_m, car.lr_m = 1500.0, 1.2, 1.5
    some = np.random.default_rng(0)
    motion = np.column_stack(
        [some.normal(c, w, samples) for c, w in ((25, 5), (0, 0.5), (0, 0.3), (0, 0.05))]
        + [some.uniform(5000.0, 9000.0, samples) for _ in range(2)]
    )
    readings = some.normal(size=(samples, 2))
    loss = _core.TyreLoss(car, 2500.0, True, motion, readings, np.ones((samples, 2)))
    p = np.array([10.0, 1.4, 1.0, 0.1, 11.0, 1.4, 1.0, 0.1, 0, 0, 0, 1, 1, 0])
    print(f"{samples} samples, tyre regression")
    for name, work in (
        ("value", lambda: loss.half_sum_of_squares(p, None)),
        ("normal equations, 8 parameters", lambda: loss.normal_equations(p, None, list(range(8)))),
        (
            "normal equations, 11 parameters",
            lambda: loss.normal_equations(p, None, list(range(11))),
        ),
    ):
        print(f"  {name:<34} {microseconds(work, samples, 15):7.3f} us", flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seconds", type=float, default=60.0)
    parser.add_argument("--effects", nargs="*", default=["tyre_relaxation"], metavar="ID")
    args = parser.parse_args()
    warnings.simplefilter("ignore", sv.SysidWarning)
    vehicle = sv.example_vehicle()
    log = sv.drive(sv.Model(vehicle), sv.manoeuvres.lap(args.seconds), seed=1)
    driving = Driving.of(log)
    baseline = sv.Model(vehicle)
    print(f"{driving.samples} samples, baseline")
    likelihood(baseline, driving)
    for effect in args.effects:
        richer = baseline.add(effect)
        parameters = sv.effects.effect(effect).parameters
        typical = {f"{effect}.{q.name}": q.typical for q in parameters}
        print(f"{driving.samples} samples, {effect}")
        likelihood(richer.with_values(typical), driving)
    regression()


if __name__ == "__main__":
    main()
