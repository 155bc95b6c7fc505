"""How long studies, diagnoses and fits of a minute's driving take, beside another version.

    python benchmarks/speed/studies.py [--draw KIND=N ...] [--seed N] [--what improve diagnose]
        [--time-limit S] [--against FOLDER] [--json FILE]

Trials of the exam's grid (typical size and twice that), driven for about 60 s at 100 Hz. Each runs
in a process of its own, as users call it: sensors checked, eight starts. With `--against`, the
folder that holds another version's package, both run in turn, the order changing from trial to
trial; verdicts, names and values are compared. Wall times are those of an idle machine only where
it is idle.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import time
import warnings
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

EXAM = Path(__file__).parents[1] / "exam"
sys.path.insert(0, str(EXAM))

import design  # noqa: E402
import truths  # noqa: E402

import sysid_vehicle as sv  # noqa: E402

RATE_HZ = 100.0
USUAL = ("effect=6", "pair=3", "group removed=2", "outside=2", "null=2")
Outcome = dict[str, Any]


# The drives of the exam of one manoeuvre, 52 to 65 s each; they are eased near the limit.
SINGLE: dict[str, Callable[[float], sv.manoeuvres.Manoeuvre]] = {
    "ramp": lambda ease: sv.manoeuvres.ramp_steer((18.0, 22.5, 27.0), 8.6 * ease, 4.0),
    "sweep": lambda ease: sv.manoeuvres.sine_sweep(60.0, 25.0, 3.5 * ease),
    "step": lambda ease: sv.manoeuvres.step_steer(
        (17.0, 20.0, 23.0, 27.0), (3.0 * ease, 6.0 * ease)
    ),
    "lap": lambda ease: sv.manoeuvres.lap(60.0, 8.6 * ease),
}


_of_the_exam = truths.manoeuvres


def _manoeuvres(trial: design.Trial, ease: float) -> tuple[sv.manoeuvres.Manoeuvre, ...]:
    *_, course = _of_the_exam(trial, ease)
    return SINGLE[trial.driving](ease), course


def drawn(draw: Sequence[str], seed: int) -> tuple[design.Trial, ...]:
    """Some trials of the grid."""
    each = {kind: int(n) for kind, n in (text.rsplit("=", 1) for text in draw)}
    grid = [
        t
        for t in design.full(1, 25)
        if t.driving in SINGLE and (t.severity >= 1.0 or t.kind == "null")
    ]
    return design.stratified(tuple(grid), each, seed)


def measured(trial: design.Trial, what: str, limit: float | None) -> Outcome:
    """Drive a trial, and do one thing with it."""
    warnings.simplefilter("ignore", sv.SysidWarning)
    setattr(truths, "RATE_HZ", RATE_HZ)  # noqa: B010 - a constant of the exam
    setattr(truths, "manoeuvres", _manoeuvres)  # noqa: B010
    try:
        (train,), test, _ = truths.sample(trial)
    except sv.NumericalError as error:
        return {"why": str(error)}
    model = truths.baseline(trial.vehicle)
    names = [e.id for e in design.catalogue() if e.id not in trial.removed]
    fit = sv.identify(model, train) if what == "diagnose" else None
    wall, cpu = time.perf_counter(), time.process_time()
    told: Outcome = {}
    try:
        if what == "improve":
            study = sv.improve(model, train, test, candidates=names, time_limit_s=limit)
            told = {"verdict": study.verdict, "names": [[a.id, a.grade] for a in study.added]}
            told["left out"] = [*study.stopped, *study.late_facts]
            fit = study.fit
        elif fit is not None:
            dx = sv.diagnose(fit, candidates=names)
            told = {"names": [c.id for c in dx.significant], "likeliest": str(dx).splitlines()[0]}
        else:
            fit = sv.identify(model, train)
    except sv.SysidError as error:
        return {"why": f"{type(error).__name__}: {error}"}
    told |= {"wall": time.perf_counter() - wall, "cpu": time.process_time() - cpu}
    told["log_likelihood"] = fit.log_likelihood
    return told | {"values": {e.name: [e.value, e.std] for e in fit.estimates}}


def _in_process(folder: Path, number: int, what: str, args: argparse.Namespace) -> Outcome:
    command = [sys.executable, __file__, "--one", str(number), "--what", what]
    command += ["--seed", str(args.seed), "--draw", *args.draw]
    if args.time_limit is not None:
        command += ["--time-limit", str(args.time_limit)]
    environment = {**os.environ, "PYTHONPATH": str(folder), "OPENBLAS_NUM_THREADS": "1"}
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=True)
    found: Outcome = json.loads(done.stdout.splitlines()[-1])
    return found


def _differences(old: Outcome, new: Outcome) -> str:
    apart = [k for k in ("verdict", "names", "likeliest") if old.get(k) != new.get(k)]
    told = [f"{k}: {old.get(k)} -> {new.get(k)}" for k in apart]
    if set(old["values"]) == set(new["values"]):
        off = max(
            (abs(new["values"][n][0] - v) / s for n, (v, s) in old["values"].items() if s > 0.0),
            default=0.0,
        )
        if off > 1e-9:
            told.append(f"values by {off:.2g} standard errors")
    gained = new["log_likelihood"] - old["log_likelihood"]
    if abs(gained) > 1e-6:
        told.append(f"log-likelihood {gained:+.3g}")
    return "; ".join(told) or "the same"


def _summary(what: str, old: Sequence[Outcome], new: Sequence[Outcome]) -> None:
    for measure in ("cpu", "wall"):
        several = np.array([o[measure] for o in new])
        told = f"median {np.median(several):.2f} s, worst {several.max():.2f} s"
        if len(old) == len(new):
            before = np.array([o[measure] for o in old])
            log = np.log(several / before)
            error = np.std(log, ddof=1) / np.sqrt(len(log)) if len(log) > 1 else np.nan
            low, high = np.exp(np.mean(log) - 2 * error), np.exp(np.mean(log) + 2 * error)
            told += (
                f"; before {np.median(before):.2f}, {before.max():.2f}; ratio "
                f"{np.exp(np.mean(log)):.2f} ({low:.2f} to {high:.2f})"
            )
        print(f"{what}, {measure} of {len(new)}: {told}")


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--draw", nargs="+", metavar="KIND=N", default=USUAL)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--what", nargs="+", choices=("improve", "diagnose", "identify"))
    parser.add_argument("--time-limit", type=float, metavar="S")
    parser.add_argument("--against", type=Path, metavar="FOLDER")
    parser.add_argument("--json", type=Path, metavar="FILE", help="outcomes, one a line")
    parser.add_argument("--one", type=int, help=argparse.SUPPRESS)
    args = parser.parse_args()
    trials, asked = drawn(args.draw, args.seed), args.what or ["improve"]
    if args.one is not None:
        print(json.dumps(measured(trials[args.one], asked[0], args.time_limit)))
        return
    here = Path(sv.__file__).parents[1]
    for what in asked:
        both: tuple[list[Outcome], list[Outcome]] = ([], [])
        for number, trial in enumerate(trials):
            folders = [here] if args.against is None else [args.against, here]
            order = folders[:: -1 if number % 2 else 1]
            found = {folder: _in_process(folder, number, what, args) for folder in order}
            if args.json is not None:
                with args.json.open("a", encoding="utf-8") as file:
                    for folder, one in found.items():
                        row = {"key": trial.key, "what": what, "folder": str(folder), **one}
                        file.write(json.dumps(row) + "\n")
            failed = [one["why"] for one in found.values() if "why" in one]
            if failed:
                print(f"{what} {trial.key}: {failed[0]}", flush=True)
                continue
            both[1].append(found[here])
            told = ""
            if args.against is not None:
                both[0].append(found[args.against])
                told = "; " + _differences(found[args.against], found[here])
            seconds = "{wall:.1f} s, {cpu:.1f} s of the processor".format(**found[here])
            print(f"{what} {trial.key}: {seconds}{told}", flush=True)
        if both[1]:
            _summary(what, *both)


if __name__ == "__main__":
    main()
