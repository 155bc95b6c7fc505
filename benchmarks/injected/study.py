"""Is a fault of the steering or of the vehicle file named by a comparison with the drive before?

    python benchmarks/injected/study.py DATA [SET ...] [--fetched FOLDER] [--validation]
        [--other] [--only WORD] [--fits FOLDER] [--json JSON]

The half minutes of `check.py`, sensors put right. The effects for which a diagnosis has most
evidence become part of the model, at most three, until nothing more is missing: that is the
reference. Then each injection (`falsify.py`) is compared with it by `sv.changed`, as if it were
other driving. Named: the effect that undoes it changed, perhaps as one of a group. Size: the change
of it lies within the 95 % interval. Wrong name: something else is named, and is of no group with
it. Not testable: it is not named, and its interval is wider than the injection. To be named asks
for more than an interval off nothing, as any of fifty effects may have changed: of injections that
are as large as `EffectChange.least`, by which `sv.changed` says what it would name, counts are
given by themselves.

`--other`: the faults are put into another half minute than the reference's, with its sensors put
right as those of the reference; that of the validation log with `--validation`.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
import warnings
from collections.abc import Sequence
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "real_driving"))

from cars import NAMES, vehicle
from check import arguments, line, other_piece, piece, summary
from falsify import DYNAMIC, Falsified, falsified

import sysid_vehicle as sv

Row = dict[str, Any]

_SIDES = 1.959964
_ROUNDS = 3
_STARTS = 4


def put_right(fit: sv.Fit, settled: Sequence[str]) -> sv.Diagnosis:
    """The diagnosis of the model with the effects for which there is most evidence."""
    dx = diagnosed(fit, settled)
    for _ in range(_ROUNDS):
        best = next((c for c in dx.significant if c.fit is not None), None)
        if best is None or best.fit is None or best.statistic <= 0.0:
            break
        dx = diagnosed(sv.identify(best.fit.model, fit.driving, starts=1), settled)
    return dx


def diagnosed(fit: sv.Fit, settled: Sequence[str]) -> sv.Diagnosis:
    lacked = [e.id for e in fit.model.candidates if e.id not in settled]
    return sv.diagnose(fit, candidates=lacked)


def judged(injection: Falsified, log: sv.Log, before: sv.Fit, settled: Sequence[str]) -> Row:
    """What the comparison with the reference says of a known fault."""
    effect, parameter = injection.effect.split(".")
    act, car = injection.act, injection.car
    change = sv.changed(
        before,
        log if act is None else falsified(log, act),
        vehicle=None if car is None else car(before.model.vehicle),
        candidates=[e.id for e in before.model.candidates if e.id not in settled],
    )
    found = change[effect]
    at = found.names.index(parameter)
    difference, std = found.value[at], found.std[at]
    return {
        "difference": difference,
        "wanted": injection.size,
        "std": std,
        "testable": bool(found.named or _SIDES * std < abs(injection.size)),
        "least": float(found.least[at]),
        "named": found.named,
        "inside": bool(abs(difference - injection.size) < _SIDES * std),
        "wrong": wrong(change, effect),
        "said": found.said,
        "sets": [str(s) for s in change.causes.sets],
    }


def wrong(change: sv.Change, effect: str = "") -> list[str]:
    """What is named and is not the effect, nor one of a group with it."""
    return sorted(e.id for e in change.named if effect not in (e.id, *e.group))


def reference(name: str, args: argparse.Namespace) -> tuple[sv.Fit, tuple[str, ...]]:
    """The model of a half minute that is right as far as it can be, and what the check settles."""
    kept = None
    validation = args.validation and not args.other
    if args.fits is not None:
        kept = args.fits / f"{name}_{int(validation)}.fit"
        if kept.exists():
            settled = kept.with_suffix(".settled").read_text(encoding="utf-8")
            return sv.load(kept), tuple(settled.split())
    log = piece(name, args.data, args.fetched, validation)
    check = sv.check(log, vehicle(name, args.data))
    first = sv.Model(vehicle(name, args.data)).with_nuisances()
    begun = sv.identify(first, check.apply(log), starts=_STARTS)
    fit, settled = put_right(begun, check.settles).fit, tuple(check.settles)
    if kept is not None:
        kept.parent.mkdir(parents=True, exist_ok=True)
        fit.save(kept)
        kept.with_suffix(".settled").write_text(" ".join(settled), encoding="utf-8")
    return fit, settled


def judging(name: str, args: argparse.Namespace, fit: sv.Fit) -> sv.Log | None:
    """The log that the faults are put into; None where there is no other driving."""
    if not args.other:
        (log,) = fit.driving.logs
        return log
    log = other_piece(name, args.data, args.fetched, args.validation)
    if log is None:
        return None
    return sv.check(piece(name, args.data, args.fetched), vehicle(name, args.data)).apply(log)


def main() -> None:
    parser = arguments(__doc__)
    parser.add_argument("--other", action="store_true", help="faults in other driving")
    parser.add_argument("--only", default="", metavar="WORD", help="injections with this word")
    parser.add_argument("--fits", type=Path, metavar="FOLDER", help="keeps the references")
    args = parser.parse_args()
    warnings.simplefilter("ignore", sv.SysidWarning)
    rows: dict[str, dict[str, Row]] = {}
    unchanged: dict[str, list[str]] = {}
    for name in args.sets or NAMES:
        began = time.perf_counter()
        fit, settled = reference(name, args)
        log = judging(name, args, fit)
        if log is None:
            continue
        print(f"== {log.name}: {', '.join(fit.model.effects)}", flush=True)
        lacked = [e.id for e in fit.model.candidates if e.id not in settled]
        same = sv.changed(fit, log, candidates=lacked)
        unchanged[name] = wrong(same)
        told = f"{', '.join(unchanged[name]) or 'nothing'} named; {same.alike}"
        print(f"  {'nothing':28s} {told}", flush=True)
        rows[name] = {}
        for injection in (f for f in DYNAMIC if args.only in f.what):
            row = judged(injection, log, fit, settled)
            rows[name][injection.what] = row
            print(line(injection, row), "; ".join(row["sets"]), flush=True)
        print(f"  {time.perf_counter() - began:.0f} s", flush=True)
        if args.json is not None:
            args.json.write_text(json.dumps(rows, indent=1) + "\n", encoding="utf-8")
    print(summary(rows))
    large = [r for of in rows.values() for r in of.values() if abs(r["wanted"]) >= r["least"]]
    print(
        f"as large as would be named: {len(large)}, named {sum(r['named'] for r in large)}, "
        f"inside {sum(r['inside'] for r in large)}"
    )
    print(f"without a fault something is named in {sum(map(bool, unchanged.values()))} drives")


if __name__ == "__main__":
    main()
