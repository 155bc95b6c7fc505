"""What each command does; errors are left to `main`."""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from dataclasses import asdict, replace
from typing import Any

from .._common.progress import note
from .._common.text import text_table
from ..compare import Comparison, compare
from ..demo import run_demo
from ..diagnose import where
from ..effects import catalogue, effect, installed_effects, load_effects
from ..errors import warn
from ..identify import Fit, identify
from ..model import Model
from ..report import RANKING_HEAD, ranking_rows, ranking_title, summary, write_report
from ..study import Study, events, improve, left_out
from ..vehicle import Vehicle
from . import changed, fleet, forces, lab, mu_slip, next_drive, sensors, sideslip, twin
from .log_arguments import read_logs, say_it_runs, written_map
from .outputs import write_figures

Warnings = list[str]

# Of a time limit, when the study ends, and when what takes long to tell of it does.
_STUDIED, _TOLD = 0.75, 0.95


def _demo(args: argparse.Namespace, heard: Warnings) -> None:
    shown = run_demo(
        args.hidden,
        seed=args.seed,
        report=args.report,
        tell=lambda text: print(text, end="\n\n", flush=True),
    )
    if args.json is not None:
        truth = shown.truth
        hidden = {
            "id": truth.effects[0],
            "parameters": {n.split(".")[1]: truth.value(n) for n in truth.names if "." in n},
            "found": shown.found,
        }
        told = _with_warnings(shown.study, heard).to_dict()
        write_figures(args.json, {**told, "hidden": hidden}, told["warnings"])


def _compare(args: argparse.Namespace, heard: Warnings) -> None:
    model = Model(Vehicle.from_toml(args.vehicle), args.effects)
    logs = read_logs(args.logs, args, model.vehicle)
    fit = identify(model, logs)
    comparison = compare(fit, logs)
    failing = where(fit)
    print(comparison)
    print(failing)
    print(fit)
    told = {**_comparison(comparison, fit), "where": failing.to_dict()}
    write_figures(args.json, told, heard)


def _diagnose(args: argparse.Namespace, heard: Warnings) -> None:
    study = _study(args, heard)
    print(replace(study.test[0], event=None))  # those of the final model follow
    print()
    print(ranking_title(study))
    rows = [[cell.replace("±", "+-") for cell in row] for row in ranking_rows(study, most=12)]
    print(text_table(RANKING_HEAD, rows))
    print()
    print(" ".join(summary(study)))
    print(*events(study), study.in_the_end, sep="\n")
    print()
    _print_where(study)
    if study.unknown is not None:
        print(study.unknown)
    print()
    print(study.verdicts)
    if args.json is not None:
        study.to_json(args.json)


def _improve(args: argparse.Namespace, heard: Warnings) -> None:
    study = _study(args, heard)
    # The warnings have gone to the error stream.
    print(study.with_warnings(()))
    if "shares" not in study.left_out:
        print(study.shares)
    print(f"Of what the final model lacks, {study.ceiling}.")
    _print_where(study)
    if study.unknown is not None:
        print(study.unknown)
    # With the intervals of the study, which include what is missing.
    print(study.fit.text(study.estimates))
    if args.json is not None:
        study.to_json(args.json)
    if args.report is not None:
        write_report(study, args.report)
        print(f"Report: {args.report}")


def _print_where(study: Study) -> None:
    for title, lines in study.where_lines:
        print("\n".join([title, *(f"  {line}" for line in lines)]))


def _effects(args: argparse.Namespace, heard: Warnings) -> None:
    sized = effect if args.vehicle is None else Model(Vehicle.from_toml(args.vehicle)).effect
    print("\n\n".join(str(sized(e)) for e in args.names or catalogue()))
    if args.names:
        return
    known = {e.id for e in catalogue()}
    others = [str(p) for p in installed_effects() if p.id not in known]
    if others:
        print("\nInstalled, not loaded; --define ID loads one:", *others, sep="\n  ")


def _map(args: argparse.Namespace, heard: Warnings) -> None:
    vehicle = None if args.vehicle is None else Vehicle.from_toml(args.vehicle)
    print(written_map(args.log, args.output, args.dbc, vehicle), end="")


_COMMANDS: dict[str, Callable[[argparse.Namespace, Warnings], None]] = {
    "demo": _demo,
    "compare": _compare,
    "diagnose": _diagnose,
    "improve": _improve,
    "improve-many": fleet.run,
    "effects": _effects,
    "changed": changed.run,
    "next-drive": next_drive.run,
    "check": sensors.run,
    "forces": forces.run,
    "map": _map,
    "lab": lab.run,
    "mu-slip": mu_slip.run,
    "twin": twin.run,
    "sideslip": sideslip.run,
}


def run(args: argparse.Namespace, heard: Warnings) -> None:
    """Run a command, after the user's files that define effects."""
    for path in getattr(args, "define", ()):
        if path.exists():  # for what a package brings, `load_effects` says it
            say_it_runs(path)
        load_effects(path)
    _COMMANDS[args.command](args, heard)


def _study(args: argparse.Namespace, heard: Warnings) -> Study:
    began, limit = time.perf_counter(), args.time_limit
    model = Model(Vehicle.from_toml(args.vehicle))
    if args.nuisances:
        model = model.with_nuisances()
    model = model.add(*args.effects)
    train = read_logs(args.logs, args, model.vehicle)
    test = read_logs(args.test, args, model.vehicle) if args.test else None
    study = improve(
        model,
        train,
        test,
        most_effects=args.max_effects,
        exclude=args.exclude,
        level=args.level_ground,
        time_limit_s=None if limit is None else _STUDIED * limit,
        matters=args.matters,
        tell=note,
    )
    if limit is not None:
        left = began + _TOLD * limit - time.perf_counter()
        study = study.in_time(max(left, 1e-9), reported=_reported(args))
        for text in left_out(study):
            warn(text)
    return _with_warnings(study, heard)


def _reported(args: argparse.Namespace) -> bool:
    """Whether something is asked for that needs all that a study tells."""
    printed = args.command == "diagnose"
    return printed or args.json is not None or getattr(args, "report", None) is not None


def _with_warnings(study: Study, heard: Warnings) -> Study:
    """Give the study all warnings of the run, and issue those it kept to itself."""
    for text in study.warnings:
        if text not in heard:
            warn(text)
    return study.with_warnings(heard)


def _comparison(c: Comparison, fit: Fit) -> dict[str, Any]:
    return {
        "effects": list(fit.model.effects),
        "error": c.error,
        "channels": {name: asdict(score) for name, score in c.channels.items()},
        "regions": [
            {
                "speed_mps": list(r.speed_mps),
                "lateral_acceleration_mps2": list(r.lateral_mps2),
                "share": r.share,
                "error": r.error,
            }
            for r in c.regions
        ],
        "parameters": {e.name: e.to_dict() for e in (*fit.estimates, *fit.derived)},
        "unrelated": c.unrelated,
        "event": None if c.event is None else c.event.to_dict(),
    }
