"""What the search for missing effects makes of driving that others measured.

    python benchmarks/real_driving/improve.py DATA [SET ...] [--fetched FOLDER] [--report FOLDER]
        [--beside EFFECT ...]

DATA is the folder that holds the data sets, FOLDER the logs of two cars that carry no licence; none
is part of this project. Checks the sensors, puts the logs right, and prints what was found, the
errors of 2 s of prediction on validation data before and after (`ahead.py`), the effects added,
and the verdicts that name something. What the data's authors know of their cars, and whether it
agrees, is in README.md beside this file. "As logged" is the baseline fitted to logs whose sensors
were not put right, "before" the one fitted to logs that were, with the offsets that every measured
log has (`Model.with_nuisances`); "fitted ahead" says that parameters were fitted to predictions of
2 s.
"""

from __future__ import annotations

import argparse
import json
import time
import warnings
from pathlib import Path

from ahead import ahead, motion_logs
from cars import LEVEL, NAMES, logs, vehicle

import sysid_vehicle as sv


def one(name: str, args: argparse.Namespace) -> dict[str, object]:
    began = time.perf_counter()
    train, validation = logs(name, args.data, args.fetched)
    car = vehicle(name, args.data)
    check = sv.check([*train, *validation], car, level=name in LEVEL)
    faults = ", ".join(f"{f.name} {f.value:.3g} +- {f.std:.2g}" for f in check.found)
    print(f"  sensors: {faults or 'no fault'} ({time.perf_counter() - began:.0f} s)", flush=True)
    motion = motion_logs(check, validation)
    model = sv.Model(car) if args.no_nuisances else sv.Model(car).with_nuisances()
    model = model.add(*args.beside)
    study = sv.improve(
        model,
        train,
        validation,
        sensors=None if args.raw else check,
        time_limit_s=args.time_limit,
        tell=lambda text: print(f"  {text} ({time.perf_counter() - began:.0f} s)", flush=True),
    )
    print(study)
    for v in study.verdicts.all:
        if v.finding in ("missing", "one of a group", "proxy"):
            print(f"  {v}")
    if args.save is not None:
        study.save(args.save / f"{name}.npz")
    told: dict[str, object] = {"verdict": study.verdict, "added": [a.name for a in study.added]}
    fits = {"before": study.fits[0], "after": study.fit}
    try:
        fits = {"as logged": sv.identify(sv.Model(car), train), **fits}
    except sv.InvalidInput as error:
        print(f"  as logged: {error}")
    if study.predicting is not None:
        fits["before, fitted ahead"] = study.predicting.baseline
        fits["after, fitted ahead"] = study.predicting.final
    for word, fit in fits.items():
        for seconds in (2.0, 4.0):
            error = ahead(fit, motion, seconds, study.validation)
            told[f"{word} {seconds:g} s"] = vars(error)
            print(f"  {word}, {seconds:g} s ahead: {error}", flush=True)
    if args.report is not None:
        study.report(args.report / f"{name}.html")
    print(f"  {time.perf_counter() - began:.0f} s\n", flush=True)
    return told


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("data", type=Path)
    parser.add_argument("sets", nargs="*", metavar="SET", help=", ".join(NAMES))
    parser.add_argument("--fetched", type=Path, metavar="FOLDER", help="logs without a licence")
    parser.add_argument("--raw", action="store_true", help="do not put the sensors right")
    parser.add_argument("--no-nuisances", action="store_true", help="without offsets of the logs")
    parser.add_argument("--beside", nargs="+", default=(), metavar="EFFECT", help="in the baseline")
    parser.add_argument("--time-limit", type=float, metavar="SECONDS", help="of each search")
    parser.add_argument("--save", type=Path, metavar="FOLDER", help="where studies go")
    parser.add_argument("--report", type=Path, metavar="FOLDER", help="where reports go")
    parser.add_argument("--json", type=Path, metavar="JSON", help="file for the figures")
    args = parser.parse_args()
    warnings.simplefilter("ignore", sv.SysidWarning)
    figures = {}
    for name in args.sets or NAMES:
        print(f"== {name}", flush=True)
        figures[name] = one(name, args)
    if args.json is not None:
        args.json.write_text(json.dumps(figures, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
