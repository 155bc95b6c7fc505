"""How often the intervals of `sv.check` hold the truth, and how often it claims what is not there.

    python benchmarks/sensors/coverage.py [--seeds 20] [--first 1000] [--seconds 120] [CASE ...]

Simulated laps and handling courses with white noise of usual size and wandering
forces; each case falsifies the sensors in one way. Two minutes are the shortest
drive whose parts are asked for the same faults. Printed per case: how often the faults that are
there are named, how often their 95 % interval holds the truth, the same of all the faults that are
not there, and the share of runs with a false claim.
"""

from __future__ import annotations

import argparse

import numpy as np
from falsified import CASES, falsified

import sysid_vehicle as sv


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("cases", nargs="*", default=list(CASES))
    parser.add_argument("--seeds", type=int, default=20)
    parser.add_argument("--first", type=int, default=1000)
    parser.add_argument("--seconds", type=float, default=120.0, help="of each drive")
    args = parser.parse_args()
    print("case              named  covered  rest covered  runs with false claims   estimates")
    total = np.zeros(6)
    for case in args.cases:
        count = np.zeros(6)
        values: dict[str, list[float]] = {}
        wrong: dict[str, int] = {}
        for seed in range(args.first, args.first + args.seeds):
            log, truth = falsified(case, seed, args.seconds)
            checked = sv.check(log)
            false = 0
            for fault in checked.faults:
                low, high = fault.interval
                true = truth.get(fault.name, 0.0)
                inside = low <= true <= high
                if fault.name in truth:
                    count[:3] += (fault.found, inside, 1)
                    values.setdefault(fault.name, []).append(fault.value)
                else:
                    count[3:5] += (inside, 1)
                    false += fault.found
                    if fault.found:
                        wrong[fault.name] = wrong.get(fault.name, 0) + 1
            count[5] += false > 0
        total += count
        shown = "; ".join(
            f"{name} {np.mean(v):.4g} +- {np.std(v):.2g}" for name, v in values.items()
        )
        print(_line(case, count, args.seeds), shown, wrong or "", flush=True)
    print(_line("all", total, args.seeds * len(args.cases)))


def _line(case: str, count: np.ndarray, runs: int) -> str:
    own = (f"{100 * count[i] / count[2]:5.1f} %" if count[2] else "     " for i in (0, 1))
    rest = 100 * count[3] / count[4]
    return f"{case:16s} {'  '.join(own):>16s}  {rest:9.1f} %  {count[5]:5.0f} of {runs:<4d}        "


if __name__ == "__main__":
    main()
