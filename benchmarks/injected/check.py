"""Is a fault that was put into a measured log named by the check of the sensors, with its size?

    python benchmarks/injected/check.py DATA [SET ...] [--fetched FOLDER] [--validation]
        [--as-logged] [--json JSON]

For each measured drive (`benchmarks/real_driving/cars.py`) half a minute is checked and put right
until the check finds nothing more, at most three times; then checked once for each injection. A
fault of one sensor is made of the readings of the others, so these have to be right (`--as-logged`:
as they are). Named: the fault is found (an offset: it moved by more than it can be wrong). Size:
the difference to the log without the injection lies in the 95 % interval. Wrong name: a fault is
found that was not before. Where the check says that the fault cannot be told the case is not
testable.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
import warnings
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "real_driving"))

from cars import NAMES, logs
from falsify import KINEMATIC, Injection, falsified

import sysid_vehicle as sv

PIECE_S = 30.0
_SIDES = 1.959964
_ROUNDS = 3


def piece(name: str, data: Path, fetched: Path | None, validation: bool = False) -> sv.Log:
    """The liveliest half minute of the first training log, or of the first validation log."""
    return liveliest(logs(name, data, fetched)[int(validation)][0])


def other_piece(name: str, data: Path, fetched: Path | None, validation: bool) -> sv.Log | None:
    """Half a minute of other driving than the first training log's liveliest one, if there is any.

    Of the second training log, else of what is left of the first; or of the validation log.
    """
    training, later = logs(name, data, fetched)
    if validation:
        return liveliest(later[0])
    if len(training) > 1:
        return liveliest(training[1])
    taken = liveliest(training[0])["time_s"]
    times = training[0]["time_s"]
    if max(taken[0] - times[0], times[-1] - taken[-1]) < PIECE_S:
        return None
    return liveliest(training[0], without=(float(taken[0]), float(taken[-1])))


def liveliest(log: sv.Log, without: tuple[float, float] = (np.inf, np.inf)) -> sv.Log:
    """The half minute with the liveliest lateral acceleration, outside of some time."""
    time_s = log["time_s"]
    if log.duration_s <= PIECE_S:
        return log
    begins = np.arange(time_s[0], time_s[-1] - PIECE_S, 2.0)
    begins = begins[(begins + PIECE_S <= without[0]) | (begins >= without[1])]
    lively = [
        float(np.nanstd(log["ay_mps2"][(time_s >= b) & (time_s < b + PIECE_S)])) for b in begins
    ]
    begin = float(begins[int(np.argmax(lively))])
    return log.between(begin, begin + PIECE_S)


def told(check: sv.SensorCheck, fault: str) -> tuple[float, float, bool]:
    """Value, standard deviation, and whether the log can tell it."""
    if fault in check.offsets:
        return (*check.offsets[fault], True)
    found = check[fault]
    return found.value, found.std, found.told or found.found


def judged(
    injection: Injection, before: sv.SensorCheck, after: sv.SensorCheck
) -> dict[str, object]:
    was, _, could = told(before, injection.fault)
    now, std, can = told(after, injection.fault)
    offset = injection.fault in before.offsets
    named = abs(now - was) > _SIDES * std if offset else after[injection.fault].found
    mine = {injection.fault}
    new = {f.name for f in after.found} - {f.name for f in before.found} - mine
    wanted = injection.size * (
        1.0 if offset or not injection.fault.startswith("gain") else 1.0 + was
    )
    return {
        "difference": now - was,
        "wanted": wanted,
        "std": std,
        "testable": bool(np.isfinite(std)) and (could or can or named),
        "named": bool(named),
        "inside": bool(abs(now - was - wanted) < _SIDES * std),
        "wrong": sorted(new),
    }


def summary(rows: dict[str, dict[str, dict[str, object]]]) -> str:
    """Counts over all data sets and injections."""
    cases = [row for of in rows.values() for row in of.values()]
    testable = [row for row in cases if row["testable"]]
    named, inside = (sum(bool(row[k]) for row in testable) for k in ("named", "inside"))
    wrong = sum(bool(row["wrong"]) for row in cases)
    return (
        f"{len(testable)} of {len(cases)} testable: {named} named, {inside} with the size inside "
        f"the interval; a wrong name in {wrong} of {len(cases)}"
    )


def line(injection: Injection, row: dict[str, object]) -> str:
    """A row in a line."""
    return (
        f"  {injection.what:28s} {row['difference']:+8.4f} of {row['wanted']:+8.4f} "
        f"+- {row['std']:.2g}"
        f"{'' if row['testable'] else '  not testable'}"
        f"{'  named' if row['named'] else ''}{'  inside' if row['inside'] else ''}"
        f"{'  WRONG: ' + ', '.join(row['wrong']) if row['wrong'] else ''}"
    )


def arguments(doc: str) -> argparse.ArgumentParser:
    """What every benchmark of injections is given."""
    parser = argparse.ArgumentParser(description=doc.splitlines()[0])
    parser.add_argument("data", type=Path)
    parser.add_argument("sets", nargs="*", metavar="SET", help=", ".join(NAMES))
    parser.add_argument("--fetched", type=Path, metavar="FOLDER", help="logs without a licence")
    parser.add_argument("--validation", action="store_true", help="the logs for validation")
    parser.add_argument("--json", type=Path, metavar="JSON", help="file for the figures")
    return parser


def main() -> None:
    parser = arguments(__doc__)
    parser.add_argument("--as-logged", action="store_true", help="not put right before")
    args = parser.parse_args()
    warnings.simplefilter("ignore", sv.SysidWarning)
    rows: dict[str, dict[str, dict[str, object]]] = {}
    for name in args.sets or NAMES:
        began = time.perf_counter()
        log = piece(name, args.data, args.fetched, args.validation)
        before = sv.check(log)
        for _ in range(0 if args.as_logged else _ROUNDS):
            if not before.found:
                break
            log = before.apply(log)
            before = sv.check(log)
        print(f"== {log.name}: {', '.join(f.name for f in before.found) or 'no fault'}", flush=True)
        rows[name] = {}
        for injection in KINEMATIC:
            row = judged(injection, before, sv.check(falsified(log, injection.act)))
            rows[name][injection.what] = row
            print(line(injection, row), flush=True)
        print(f"  {time.perf_counter() - began:.0f} s", flush=True)
        if args.json is not None:
            args.json.write_text(json.dumps(rows, indent=1) + "\n", encoding="utf-8")
    print(summary(rows))


if __name__ == "__main__":
    main()
