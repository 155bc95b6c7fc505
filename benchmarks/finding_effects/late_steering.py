"""Does a smooth lap tell a delay of the steering from a lag, where the logged angle has noise?

    python benchmarks/finding_effects/late_steering.py [--seeds 6] [--first 0] [--steer-noise RAD]

A lap is fitted, a course judges. Printed for each drive: `right`, where the truth alone is named,
`group`, where it is said that this driving cannot tell it from what is named, or `wrong`.
"""

from __future__ import annotations

import argparse
import warnings
from collections import Counter

import sysid_vehicle as sv

TRUTHS = {"steer_delay": ("delay_s", 0.03), "steer_lag": ("time_constant_s", 0.04)}


def outcome(effect: str, seed: int, noise: sv.SensorNoise) -> tuple[str, str]:
    """What a study says of the truth, and what it names."""
    parameter, late_s = TRUTHS[effect]
    start = sv.Model(sv.example_vehicle())
    truth = start.add(effect).with_values({f"{effect}.{parameter}": late_s})
    drives = (sv.manoeuvres.lap(60.0, 8.5), sv.manoeuvres.handling_course(60.0, 8.2))
    logs = [sv.drive(truth, m, seed=seed + i, noise=noise) for i, m in enumerate(drives)]
    study = sv.improve(start, *logs, starts=3)
    named = [a for a in study.added if not a.stands_in]
    told = ", ".join(f"{a.id} ({a.grade})" for a in named)
    if len(named) != 1 or effect not in {named[0].id, *named[0].confounded_with}:
        return "wrong", told
    return "group" if named[0].confounded_with else "right", told


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--seeds", type=int, default=6)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--steer-noise", type=float, default=2e-4, metavar="RAD")
    args = parser.parse_args()
    warnings.simplefilter("ignore", sv.SysidWarning)
    counts: Counter[tuple[str, str]] = Counter()
    for seed in range(args.first, args.first + 10 * args.seeds, 10):
        for effect in TRUTHS:
            found, told = outcome(effect, seed, sv.SensorNoise(steer_rad=args.steer_noise))
            counts[effect, found] += 1
            print(f"{seed} {effect:11s} {found}: {told}", flush=True)
    for (effect, found), number in sorted(counts.items()):
        print(f"{effect}: {found} in {number} of {args.seeds}")


if __name__ == "__main__":
    main()
