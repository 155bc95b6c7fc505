"""Is a jump of one sensor told by the check, and none where nothing jumped?

    python benchmarks/sensors/moments.py [--first 1] [--drives 24]

Each drive has a manoeuvre, a rate and a road of its own; then one of its channels jumps for 0.1 to
0.5 s. Told: a moment of that channel at that time. Other: any other moment of the same log.
"""

from __future__ import annotations

import argparse
import warnings

import numpy as np

import sysid_vehicle as sv

_JUMPS = {"yaw_rate_radps": 0.1, "vy_mps": 0.5, "ay_mps2": 3.0, "vx_mps": 1.5}
_EDGE_S = 3.0


def _driven(rng: np.random.Generator, seed: int) -> sv.Log:
    m = sv.manoeuvres
    manoeuvres = (
        m.lap(40.0, 7.5),
        m.handling_course(40.0, 7.0),
        m.sine_sweep(30.0, 25.0, 3.5),
        m.step_steer((17.0, 27.0), (3.0, 6.0)),
        m.slalom(),
        m.sine_with_dwell(),
        m.double_lane_change(),
        m.brake_in_turn(),
    )
    road = None
    if rng.integers(2):
        road = sv.RoadDisturbance(150.0, 200.0, 100.0, float(rng.choice([0.03, 0.3])))
    return sv.drive(
        sv.Model(sv.example_vehicle()),
        manoeuvres[int(rng.integers(len(manoeuvres)))],
        seed=seed,
        rate_hz=float(rng.choice([50.0, 100.0])),
        disturbance=road,
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--first", type=int, default=1)
    parser.add_argument("--drives", type=int, default=24)
    args = parser.parse_args()
    warnings.simplefilter("ignore", sv.SysidWarning)
    false = told = other = 0
    for seed in range(args.first, args.first + args.drives):
        rng = np.random.default_rng(seed)
        log = _driven(rng, seed)
        false += bool(sv.check(log).moments)
        channel = str(rng.choice(list(_JUMPS)))
        size = _JUMPS[channel] * float(rng.choice([-1.0, 1.0]))
        begin = float(rng.uniform(_EDGE_S, log["time_s"][-1] - _EDGE_S))
        end = begin + float(rng.uniform(0.1, 0.5))
        channels = {c: np.array(log[c]) for c in log.channels}
        channels[channel][(channels["time_s"] >= begin) & (channels["time_s"] < end)] += size
        moments = sv.check(sv.Log.from_arrays(channels, name=log.name, check=False)).moments
        right = [m.channel == channel and m.from_s < end and m.until_s > begin for m in moments]
        told += any(right)
        other += len(right) - sum(right)
        if not any(right):
            print(f"{seed}: {channel} {size:+g} from {begin:.1f} to {end:.1f} s of {log.name}")
    print(f"a moment where nothing jumped: {false} of {args.drives}")
    print(f"jumps told: {told} of {args.drives}; other moments: {other}")


if __name__ == "__main__":
    main()
