"""Mass and inertia from the twin: medians over seeds, beside the paper's figures.

python benchmarks/twin/must_show.py [--seeds 20] [--sweep-seeds 20] [--jobs 2] [--quick]
    [--json FILE]

Rms over the last second in % of the true change. "twins" are twins side by side, "law" is the
published law with its sign corrected and taken from the twin.
"""

import argparse
import json
import statistics
import time
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np

from sysid_vehicle.published import estimate_mass, estimate_pitch, estimate_roll_yaw

INF = float("inf")
RUN = {"mass": estimate_mass, "roll_yaw": estimate_roll_yaw, "pitch": estimate_pitch}
WRONG = {"mass": "wrong", "wrong_cg": True}
# Name, experiment, its options, figures of the paper, figures to reach.
CASES: list[tuple[str, str, dict[str, Any], tuple[float, ...], tuple[float, ...]]] = [
    ("mass, noiseless", "mass", {"snr": INF}, (0.64,), (0.3,)),
    ("mass, snr 10", "mass", {}, (1.61,), (1.0,)),
    ("mass, snr 10, wrong centre", "mass", {"wrong_cg": True}, (0.68,), (1.0,)),
    ("Jxx/Jzz, noiseless", "roll_yaw", {"snr": INF}, (0.38, 0.96), (0.1, 0.1)),
    (
        "Jxx/Jzz, noiseless, mass of stage 1",
        "roll_yaw",
        {"snr": INF, "mass": "stage_1"},
        (4.22, 0.25),
        (2.0, 0.5),
    ),
    ("Jxx/Jzz, snr 10", "roll_yaw", {}, (23.91, 6.18), (5.0, 2.0)),
    (
        "Jxx/Jzz, snr 10, mass of stage 1",
        "roll_yaw",
        {"mass": "stage_1"},
        (26.50, 5.38),
        (6.0, 2.0),
    ),
    ("Jxx/Jzz, snr 10, wrong mass, centre", "roll_yaw", WRONG, (45.43, 26.50), (10.0, 10.0)),
    ("Jyy, noiseless", "pitch", {"snr": INF}, (0.11,), (0.05,)),
    ("Jyy, road noise", "pitch", {"snr": INF, "road_noise": 0.1}, (3.19,), (1.0,)),
    ("Jyy, snr 10", "pitch", {}, (0.33,), (0.33,)),
    ("Jyy, snr 10, road noise", "pitch", {"road_noise": 0.1}, (3.24,), (2.0,)),
    ("Jyy, both, wrong mass", "pitch", {"road_noise": 0.1, "mass": "wrong"}, (2.38,), (2.4,)),
    ("Jyy, both, wrong centre", "pitch", {"road_noise": 0.1, "wrong_cg": True}, (5.51,), (4.0,)),
    ("Jyy, both, both wrong", "pitch", {"road_noise": 0.1, **WRONG}, (10.20,), (6.0,)),
]
SWEPT = len(CASES)
for _snr in (5.0, 7.5, 15.0, 20.0):
    CASES += [
        (f"mass, snr {_snr:g}", "mass", {"snr": _snr}, (), (10.0,)),
        (f"Jxx/Jzz, snr {_snr:g}", "roll_yaw", {"snr": _snr}, (), (10.0, 10.0)),
        (f"Jyy, snr {_snr:g}", "pitch", {"snr": _snr}, (), (10.0,)),
    ]


Found = dict[str, dict[str, list[float]]]


def errors(job: tuple[int, int]) -> Found:
    """Errors of all cases, the last ones from `job[1]` on left out, by both laws with one seed."""
    seed, count = job
    out: Found = {}
    for name, experiment, options, _, _ in CASES[:count]:
        out[name] = {}
        for law in ("side_by_side", "published"):
            done = RUN[experiment](law=law, seed=seed, **options)  # type: ignore[arg-type]
            out[name][law] = [done.error_percent(parameter) for parameter in done.names]
    return out


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--seeds", type=int, default=20)
    parser.add_argument("--sweep-seeds", type=int, help="seeds of the sweep of the noise")
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--quick", action="store_true", help="two seeds, no sweep of the noise")
    parser.add_argument("--json", type=Path, help="errors by seed; written as they come")
    args = parser.parse_args()
    seeds = 2 if args.quick else args.seeds
    swept = seeds if args.sweep_seeds is None else args.sweep_seeds
    swept = 0 if args.quick else swept
    jobs = [(seed, len(CASES) if seed < swept else SWEPT) for seed in range(seeds)]
    began = time.perf_counter()
    found: list[Found] = []
    with ProcessPoolExecutor(args.jobs) as pool:
        for one in pool.map(errors, jobs):
            found.append(one)
            if args.json is not None:
                args.json.write_text(json.dumps(found), encoding="utf-8")
    table(found)
    print(f"{seeds} seeds, of the sweep {min(seeds, swept)}, {time.perf_counter() - began:.0f} s")


def table(found: list[Found]) -> None:
    """Print the medians of all cases that were run."""
    print(f"{'case':38s} {'paper':>14s} {'to reach':>12s} {'twins':>14s} {'law':>16s}")
    for name, _, _, paper, goal in CASES:
        ran = [f[name] for f in found if name in f]
        if not ran:
            continue
        mine, law = (
            [statistics.median(column) for column in zip(*(f[k] for f in ran), strict=True)]
            for k in ("side_by_side", "published")
        )
        met = all(m <= g for m, g in zip(mine, goal, strict=True))
        print(
            f"{name:38s} {_text(paper):>14s} {_text(goal):>12s} {_text(mine, 3):>14s} "
            f"{_text(law):>16s} {'' if met else '  MISSED'}"
        )


def _text(values: tuple[float, ...] | list[float], digits: int = 2) -> str:
    return " / ".join(f"{v:.{digits}f}" if np.isfinite(v) else "lost" for v in values) or "-"


if __name__ == "__main__":
    main()
