"""What `sv.check` and the laws of motion say of sound logs of usual roads: nothing is wrong there.

    python benchmarks/sensors/roads.py [--seeds 24] [--first 1000] [--against TREE/python]

Motorways, country roads and towns of one to two and a half minutes, on level ground or on hills and
crossfalls of 0.015 rad, with and without pushes of the road; a driver who holds path and speed.
With `--against` the same with the package of another tree that has `usual_road`, in a process of
its own.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import time
import warnings
from typing import get_args

import numpy as np

import sysid_vehicle as sv
from sysid_vehicle.manoeuvres import RoadKind, usual_road

KINDS: tuple[RoadKind, ...] = get_args(RoadKind)


def drive(seed: int) -> tuple[str, sv.Log]:
    """One drive, all of it drawn by the seed, and what it was."""
    rng = np.random.default_rng(seed)
    kind = KINDS[int(rng.integers(len(KINDS)))]
    duration_s, slope = rng.choice([60.0, 100.0, 150.0]), rng.choice([0.0, 0.015])
    push, rate_hz = rng.choice([0.0, 1.0]), float(rng.choice([50.0, 100.0]))
    ground = sv.RoadDisturbance(
        fx_n=120.0 * push,
        fy_n=150.0 * push,
        mz_nm=100.0 * push,
        correlation_time_s=0.3,
        slope_rad=float(slope),
    )
    course = usual_road(kind, float(duration_s), rng)
    model = sv.Model(sv.example_vehicle())
    log = sv.drive(model, course, seed=seed, disturbance=ground, rate_hz=rate_hz)
    hills = "hills" if slope else "level"
    return f"{kind}, {duration_s:.0f} s, {hills}, {'pushes' if push else 'calm'}", log


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--seeds", type=int, default=24)
    parser.add_argument("--first", type=int, default=1000)
    parser.add_argument("--against", help="the folder python of another tree")
    args = parser.parse_args()
    warnings.simplefilter("ignore", sv.SysidWarning)
    claims = contradictions = drives = 0
    began = time.process_time()
    for seed in range(args.first, args.first + args.seeds):
        what, log = drive(seed)
        drives += 1
        found = sv.check(log, sv.example_vehicle())
        wrong = [f"{f.name} {f.value:.3g}" for f in found.found]
        wrong += [f"{name} {value:.2g}" for name, value in found.estimate.slips.items()]
        against = [c.text[:70] for c in log.contradictions if not c.on_the_level]
        claims += bool(wrong)
        contradictions += bool(against)
        if wrong or against:
            print(f"{seed} {what}: {'; '.join([*wrong, *against])}", flush=True)
    print(
        f"{drives} sound drives: faults claimed in {claims}, laws broken in {contradictions}; "
        f"{(time.process_time() - began) / drives:.1f} s each"
    )
    if args.against:
        print(f"with {args.against}:", flush=True)
        own = [sys.executable, __file__, f"--seeds={args.seeds}", f"--first={args.first}"]
        subprocess.run(own, check=True, env={**os.environ, "PYTHONPATH": args.against})


if __name__ == "__main__":
    main()
