"""Are moments, delays and shapes of missing forces found, and none where nothing is missing?

    python benchmarks/finding_effects/where_it_fails.py [--seeds N] [--first-seed N]

Laps of 30 s with a car that the model describes completely, with grip that changes half way, with
steering that acts 20 or 40 ms late, and with a side wind that grows with the square of the speed; a
handling course is the validation data.
"""

from __future__ import annotations

import argparse
import warnings
from collections import Counter

import numpy as np
from recovery import OTHER_TYRES

import sysid_vehicle as sv

HALF_WAY_S, WIND = 15.0, np.array([0.0, 0.6, 0.3])
DELAYS_S = {"complete": 0.0, "20 ms late": 0.02, "40 ms late": 0.04}


class Wind(sv.RoadDisturbance):
    def __init__(self, speed: np.ndarray) -> None:
        super().__init__()
        object.__setattr__(self, "speed", speed)

    def sample(self, n: int, rate_hz: float, rng: np.random.Generator) -> np.ndarray:
        return np.outer(self.speed**2, WIND)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seeds", type=int, default=20)
    parser.add_argument("--first-seed", type=int, default=0)
    args = parser.parse_args()
    warnings.simplefilter("ignore", sv.SysidWarning)
    car = sv.Model(sv.example_vehicle())
    grip = {"friction_change.drop": 0.15, "friction_change.at_s": HALF_WAY_S}
    truths = {
        "complete": car,
        "grip": car.add("friction_change").with_values(grip),
        **{
            name: car.add("steer_delay").with_values({"steer_delay.delay_s": delay})
            for name, delay in DELAYS_S.items()
            if delay > 0.0
        },
        "wind": car,
    }
    found: dict[str, Counter[str]] = {name: Counter() for name in truths}
    for seed in range(args.first_seed, args.first_seed + args.seeds):
        for name, truth in truths.items():
            study(name, truth, seed, found[name])
    for name, counts in found.items():
        print(f"{name} ({args.seeds} laps)")
        for what, n in sorted(counts.items()):
            print(f"  {what:<44} {n:>4}")


def study(name: str, truth: sv.Model, seed: int, count: Counter[str]) -> None:
    lap = sv.manoeuvres.lap(30.0)
    course = sv.manoeuvres.handling_course(30.0, lateral_mps2=7.5)
    train, test = (
        sv.drive(truth, m, seed=s, disturbance=push)
        for m, s in ((lap, 3000 + seed), (course, 4000 + seed))
        for push in [Wind(sv.drive(truth, m, seed=s)["vx_mps"]) if name == "wind" else None]
    )
    fit = sv.identify(sv.Model(truth.vehicle.replace(**OTHER_TYRES)), train, starts=1, seed=seed)
    failing = sv.where(fit)
    delay = failing.coherence[0].delay
    if name == "grip":
        first = [c for c in failing.change_points if c.what == "grip"][:1]
        count["one change of grip"] += len(failing.change_points) == len(first) == 1
        count["its interval holds the moment"] += any(
            c.from_s <= HALF_WAY_S <= c.until_s for c in first
        )
    else:
        count["a change point is claimed"] += bool(failing.change_points)
    if name in DELAYS_S:
        assert delay is not None
        low, high = delay.interval
        count["its interval holds the delay"] += low <= DELAYS_S[name] <= high
    if DELAYS_S.get(name, 0.0) > 0.0:
        assert delay is not None
        count["a delay is claimed"] += delay.significant
        return
    count["a delay is claimed"] += any(
        c.delay is not None and c.delay.significant for c in failing.coherence
    )
    if name == "complete":
        count["a residual follows an input"] += any(
            c.peak[2] > c.threshold for c in failing.coherence
        )
        count["a map predicts more than 2 %"] += failing.best_map.share > 0.02
    if name == "grip":
        return
    shape = sv.unknown(fit, test)
    true = WIND if name == "wind" else np.zeros(3)
    for curve in shape.curves:
        gain = true[("F_x", "F_y", "M_z").index(curve.target)]
        if gain == 0.0 or curve.coordinate.name == "vx_mps":
            inside = np.abs(curve.force - gain * curve.at**2) <= curve.half_width
            count[f"the band of {curve.target} holds the truth"] += bool(inside.all())
    if name == "wind":
        best = shape.proposals[0] if shape.proposals else None
        count["first proposal is v_x^2"] += best is not None and str(best.form) == "v_x^2"
    else:
        count["a formula is proposed"] += bool(shape.proposals)


if __name__ == "__main__":
    main()
