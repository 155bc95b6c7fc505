"""Memory and time of `compare`, `diagnose` and `identify` on very long logs.

    python benchmarks/speed/long_log.py [--samples 1e5 1e6] [--limit-gib 4] [--refits 1]
        [--only compare|diagnose|identify]

Laps of a car with a hidden effect at 100 Hz, simulated in pieces of 10^6 samples by processes of
their own and joined by a second without speed. The model is fitted to 60 s; then the long log is
compared and diagnosed in a process that may address no more than the limit. For each length: time,
largest resident memory, and what that is for each sample beyond the process without the log.
"""

from __future__ import annotations

import argparse
import resource
import subprocess
import sys
import tempfile
import time
import warnings
from pathlib import Path

import numpy as np

import sysid_vehicle as sv

RATE_HZ, PIECE = 100.0, 10**6
HIDDEN = {"tyre_load_sensitivity.sensitivity": 0.1}


def lap(samples: int, seed: int) -> sv.Log:
    """A lap of so many samples."""
    truth = sv.Model(sv.example_vehicle()).add("tyre_load_sensitivity").with_values(HIDDEN)
    return sv.drive(truth, sv.manoeuvres.lap(samples / RATE_HZ), seed=seed, rate_hz=RATE_HZ)


def simulate(samples: int, seed: int, path: Path) -> None:
    """Writes the channels of a lap."""
    log = lap(samples, seed)
    np.savez(path, **{c: log[c][:samples] for c in log.channels if c != "time_s"})


def long_log(samples: int) -> sv.Log:
    """Laps of so many samples in all, as one log."""
    columns: dict[str, np.ndarray] = {}
    for begin in range(0, samples, PIECE):
        some = min(PIECE, samples - begin)
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "lap.npz"
            order = ["--simulate", str(some), str(2 + begin // PIECE), str(path)]
            subprocess.run([sys.executable, __file__, *order], check=True)
            with np.load(path) as found:
                for name in found.files:
                    column = columns.setdefault(name, np.empty(samples))
                    column[begin : begin + some] = found[name]
        if begin:
            columns["vx_mps"][begin : begin + round(RATE_HZ)] = np.nan
    columns["time_s"] = np.arange(samples) / RATE_HZ
    return sv.Log.from_arrays(columns, name="long", check=False)


def peak() -> int:
    """Largest resident memory so far [B]."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024


def measure(samples: int, limit_gib: float, refits: int, only: str) -> None:
    """Prints a line for each question about a log of so many samples."""
    warnings.simplefilter("ignore")
    limit = int(limit_gib * 2**30)
    resource.setrlimit(resource.RLIMIT_AS, (limit, limit))
    fit = sv.identify(sv.Model(sv.example_vehicle()), lap(6000, 1), starts=1, progress=False)
    before = peak()
    log = long_log(samples)
    for name in (only,) if only else ("compare", "diagnose"):
        began, used = time.perf_counter(), time.process_time()
        if name == "compare":
            told = f"error {sv.compare(fit, log).error:.6f}"
        elif name == "identify":
            found = sv.identify(sv.Model(sv.example_vehicle()), log, progress=False)
            told = f"log-likelihood {found.log_likelihood:.3f}"
        else:
            dx = sv.diagnose(fit, log, refits=refits, progress=False)
            first = dx.ranking[0]
            told = f"{first.id}, statistic {first.statistic:.6g}"
        took, cpu = time.perf_counter() - began, time.process_time() - used
        print(
            f"{samples:9d} samples, {name:<8}: {took:6.1f} s ({1e6 * took / samples:5.1f} us per "
            f"sample, {1e6 * cpu / samples:5.1f} of processors), {peak() / 2**30:.2f} GiB, "
            f"{(peak() - before) / samples:5.0f} B per sample; {told}",
            flush=True,
        )


def main() -> None:
    """Command line."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--samples", type=float, nargs="+", default=[1e5, 1e6])
    parser.add_argument("--limit-gib", type=float, default=4.0)
    parser.add_argument("--refits", type=int, default=1)
    parser.add_argument("--only", choices=("compare", "diagnose", "identify"), default="")
    parser.add_argument("--simulate", nargs=3, help=argparse.SUPPRESS)
    parser.add_argument("--measure", type=int, help=argparse.SUPPRESS)
    args = parser.parse_args()
    if args.simulate:
        simulate(int(args.simulate[0]), int(args.simulate[1]), Path(args.simulate[2]))
    elif args.measure:
        measure(args.measure, args.limit_gib, args.refits, args.only)
    else:
        for samples in args.samples:
            order = ["--measure", str(int(samples)), "--limit-gib", str(args.limit_gib)]
            order += ["--refits", str(args.refits), *(["--only", args.only] if args.only else [])]
            subprocess.run([sys.executable, __file__, *order], check=True)


if __name__ == "__main__":
    main()
