"""Does a fleet that is killed end as one that is not, and is nothing done twice?

    python benchmarks/speed/kill.py [--logs 200] [--executor processes|dask|ray] [--kills 2]
        [--workers 2] [--seed 0] [--keep FOLDER]

Short logs of one car are studied once undisturbed and once by a run whose whole process group gets
SIGKILL: each time when a random number of further studies has ended, and a random part of a second
later. The last run is let alone. Every study notes that it begins. Held against each other: the
rows and studies of both folders; the files that were there at a kill and in the end; how often a
study began.
"""

from __future__ import annotations

import argparse
import json
import os
import re
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Iterator
from concurrent.futures import Executor
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

import sysid_vehicle as sv

ROOT = Path(__file__).resolve().parents[2]
OPTIONS: dict[str, Any] = {"candidates": ["mass"], "starts": 1, "most_effects": 1}
# Runs in every process before its first study, as the definition of an effect that is no candidate.
NOTES = """
import os
import sysid_vehicle as sv
from sysid_vehicle.fleet import work
read = work._logs
def noting(job, drives):
    if drives is job.train:
        with open({notes!r} % os.getpid(), "a") as file:
            file.write(job.name + "\\n")
    return read(job, drives)
work._logs = noting
gain = sv.parameter("gain", "N s2/m2", typical=0.5, lower=-5.0, upper=5.0)
force = lambda d, p: p.gain * d.v_x * d.v_y
sv.define_effect("side_drag", title="side drag", parameters=[gain], force_y=force)
"""


def make(folder: Path, logs: int) -> None:
    """Writes the car and so many logs of 10 s, one in ten of a car heavier than told."""
    car = sv.Model(sv.example_vehicle())
    car.vehicle.to_toml(folder / "car.toml")
    loaded = car.add("mass").with_values({"mass.relative_error": 0.1})
    (folder / "logs").mkdir()
    for i in range(logs):
        log = sv.drive(car if i % 10 else loaded, sv.manoeuvres.lap(10.0), seed=i, rate_hz=25.0)
        log.to_csv(folder / "logs" / f"{i:03d}.csv")


@contextmanager
def executor_of(kind: str, workers: int) -> Iterator[Executor | None]:
    """An executor of that kind; None for the processes of `improve_many`."""
    if kind == "processes":
        yield None
    elif kind == "dask":
        from dask.distributed import Client, LocalCluster

        with (
            LocalCluster(n_workers=workers, threads_per_worker=1, dashboard_address=None) as all_,
            Client(all_) as client,
            client.get_executor() as executor,
        ):
            yield executor
    else:
        import ray

        page = (ROOT / "docs/howto/fleets.md").read_text("utf-8")
        (code,) = re.findall(r"^class RayExecutor.*?(?=^\S*sv\.)", page, re.MULTILINE | re.DOTALL)
        names: dict[str, Any] = {"ray": ray, "Executor": Executor}
        exec(code, names)
        ray.init(num_cpus=workers, include_dashboard=False, log_to_driver=False)
        try:
            yield names["RayExecutor"]()
        finally:
            ray.shutdown()


def study(folder: Path, out: Path, kind: str, workers: int) -> None:
    """One run over all logs."""
    out.mkdir(exist_ok=True)
    (out / "begun").mkdir(exist_ok=True)
    notes = out / "notes.py"
    if not notes.exists():
        notes.write_text(NOTES.format(notes=str(out / "begun" / "%d")))
    with executor_of(kind, workers) as executor:
        sv.improve_many(
            folder / "car.toml",
            sorted(folder.glob("logs/*.csv")),
            out=out,
            executor=executor,
            workers=workers if executor is None else None,
            define=[notes],
            progress=False,
            **OPTIONS,
        )


def begin(folder: Path, out: Path, args: argparse.Namespace) -> subprocess.Popen[bytes]:
    """The same in a process group of its own."""
    command = [sys.executable, __file__, "--executor", args.executor]
    command += ["--workers", str(args.workers), "--study", str(folder), str(out)]
    # What is wrong with logs as short as these stands in their rows.
    told_once = {**os.environ, "PYTHONWARNINGS": "ignore"}
    return subprocess.Popen(command, start_new_session=True, env=told_once)


def rows(out: Path) -> dict[str, tuple[int, int]]:
    """Studies that are there complete, and which file tells so: one written again is another."""
    found = {}
    for path in out.glob("studies/*.json"):
        found[path.stem] = (path.stat().st_ino, path.stat().st_mtime_ns)
    return found


def told(out: Path) -> dict[str, Any]:
    """Rows without the time they took, and the fits of the studies, by name."""
    found = {}
    for path in sorted(out.glob("studies/*.json")):
        row = {**json.loads(path.read_text("utf-8"))["row"], "seconds": None}
        fits = [] if row["failure"] else sv.load(path.with_suffix(".npz")).fits
        found[path.stem] = (
            row,
            [
                (f.log_likelihood, f.noise, *((e.name, e.value, e.std) for e in f.estimates))
                for f in fits
            ],
        )
    return found


def begun(out: Path) -> Counter[str]:
    """How often each study began."""
    return Counter(line for p in (out / "begun").iterdir() for line in p.read_text().split())


def check(folder: Path, args: argparse.Namespace) -> bool:
    """Kills and resumes; whether all is as it should be."""
    rng = np.random.default_rng(args.seed)
    make(folder, args.logs)
    clean, killed = folder / "undisturbed", folder / "killed"
    started = time.monotonic()
    if begin(folder, clean, args).wait():
        raise SystemExit("the undisturbed run failed")
    print(f"{args.logs} logs, {args.executor}: {time.monotonic() - started:.0f} s undisturbed")
    ok, there = True, 0
    for kill in range(args.kills):
        process = begin(folder, killed, args)
        share = rng.uniform(0.3, 0.7) * (args.logs - there) / (args.kills - kill)
        least = there + max(int(share), 1)
        while len(rows(killed)) < least and process.poll() is None:
            time.sleep(0.02)
        time.sleep(rng.uniform(0.0, 1.0))
        if process.poll() is not None:
            raise SystemExit("the run ended before it was killed; give more logs")
        os.killpg(process.pid, signal.SIGKILL)
        process.wait()
        time.sleep(3.0)  # what is outside the group, as Ray's daemons, ends by itself
        before = rows(killed)
        there = len(before)
        twice = begun(killed).total() - there
        print(f"kill {kill + 1}: {there} studies kept, {twice} begun beside them so far")
    started = time.monotonic()
    if begin(folder, killed, args).wait():
        raise SystemExit("the last run failed")
    same = told(killed) == told(clean)
    untouched = before.items() <= rows(killed).items()
    again = {name: n - 1 for name, n in begun(killed).items() if n > 1}
    ok = same and untouched and len(rows(killed)) == args.logs
    ok = ok and sum(again.values()) <= args.kills * args.workers * 2
    print(f"last run: {time.monotonic() - started:.0f} s")
    print(f"{len(rows(killed))} of {args.logs} studies; same as undisturbed: {same}")
    print(f"files that were there are untouched: {untouched}")
    print(f"begun more than once, being in flight at a kill: {sum(again.values())}")
    failed = sum(bool(row["failure"]) for row, _ in told(clean).values())
    print(f"failed studies: {failed}")
    return ok and not failed


def main() -> int:
    """Command line."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--logs", type=int, default=200)
    parser.add_argument("--executor", choices=("processes", "dask", "ray"), default="processes")
    parser.add_argument("--kills", type=int, default=2)
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--keep", type=Path, help="a new folder that stays")
    parser.add_argument("--study", type=Path, nargs=2, help=argparse.SUPPRESS)
    args = parser.parse_args()
    if args.study:
        study(*args.study, args.executor, args.workers)
        return 0
    if args.keep:
        args.keep.mkdir(parents=True)
        return 0 if check(args.keep.absolute(), args) else 1
    with tempfile.TemporaryDirectory() as folder:
        return 0 if check(Path(folder), args) else 1


if __name__ == "__main__":
    raise SystemExit(main())
