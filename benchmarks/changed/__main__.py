"""Does a comparison of two drives name what changed in the car between them, and nothing else?

    python benchmarks/changed [--seed 1] [--pairs 40] [--unchanged 20] [--kind KIND] [--json FILE]
                              [--driving COURSE] [--apart] [--without-vy]
    python benchmarks/changed --read FILE [FILE ...]

Each pair is a car of its own: mass, wheelbase, place of the centre of gravity, tyres, what its
model lacks, white noise, pushes of the road, a lap or a handling course, near the limit or gently.
A model with other tyres is fitted to the first drive, and the second one compared by `sv.changed`.
After the pairs of drawn kinds come as many as are asked for in which nothing changed.

Named: of each change that was made, an effect that it is, alone or in a group (`in group`), or as
what is named first (`first`). Least: of changes at least as large as the comparison says that it
would name, and how many of these were named (`of these`). Inside: the 95 % interval of its size
holds the truth, named or not. Wrong: something else is named that is of no group with a change that
was made; `unknown` ones are counted apart. Claims: anything named where nothing changed. `--read`
prints the tables of runs.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
import warnings
from collections.abc import Iterable
from math import isfinite
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent))

from counts import Row, table
from pairs import ASKED, DRIVING, Pair, Truth, drawn

import sysid_vehicle as sv

_SIDES = 1.959964


def judged(pair: Pair) -> Row | None:
    """What is said of one pair; None where one of its changes is not named alone."""
    began = time.process_time()
    fit = sv.identify(pair.baseline, pair.before, starts=2)
    if not all(sv.changed(fit, log).named for log in pair.alone):
        return None
    asked = time.process_time() if pair.alone else began
    change = sv.changed(fit, pair.after)
    named = [e.id for e in change.named]
    groups = {e.id: list(e.group) for e in change.named}
    right = {e for t in pair.truths for e in t.effects}
    return {
        "kind": pair.kind,
        "driving": pair.driving,
        "lacks": pair.lacks,
        "road": pair.road,
        "named": named,
        "groups": groups,
        "unknown": [s.effects[0] for s in change.unknown],
        "headline": change.to_dict()["headline"],
        "truths": [_of(t, change) for t in pair.truths],
        "wrong": [e for e in named if not right & {e, *groups[e]}],
        "seconds": time.process_time() - asked,
    }


def _of(truth: Truth, change: sv.Change) -> Row:
    known = {e.id: e for e in change.effects}
    right = [known[e] for e in truth.effects if e in known]
    named = [e for e in change.named if set(truth.effects) & {e.id, *e.group}]
    leads = [e for e in change.named if e.id in truth.effects]
    # The first of a group, or alone.
    order = [e.id for e in change.named]
    first = any(all(order.index(e.id) < order.index(g) for g in e.group if g in order)
                for e in leads)  # fmt: skip
    told: Row = {"effects": truth.effects, "size": truth.size, "group": bool(named), "first": first}
    told |= {"inside": None, "least": None}
    told["weak"] = any(e.weak for e in right)
    told["imitated"] = any(e.imitated_by for e in right)
    if right and truth.name:
        e = leads[0] if leads else right[0]
        value, std = _size(e, truth.name)
        told["value"], told["std"] = value, std
        # Of what the driving does not show the interval is anything.
        told["inside"] = bool(abs(value - truth.size) < _SIDES * std) if isfinite(std) else None
        least = _least(e, truth.name)
        told["least"] = None if least is None else bool(abs(truth.size) >= least)
    return told


def _size(e: sv.EffectChange, name: str) -> tuple[float, float]:
    if name == "stiffness":
        assert e.stiffness is not None
        return e.stiffness
    at = e.names.index(name)
    return e.value[at], e.std[at]


def _least(e: sv.EffectChange, name: str) -> float | None:
    """The smallest change that would have been named, where it is told."""
    if name == "stiffness":
        return e.least_stiffness
    return e.least[e.names.index(name)]


def line(number: int, row: Row) -> str:
    """A pair in a line."""
    wanted = ", ".join(f"{'/'.join(t['effects'])} {t['size']:+.3g}" for t in row["truths"])
    what = f"{number:3d} {row['kind']:15s} {row['driving']:20s} lacks {row['lacks'] or '-':22s}"
    return f"{what} [{wanted}] {row['headline']} ({row['seconds']:.0f} s)"


def _kinds(args: argparse.Namespace) -> Iterable[str]:
    yield from [args.kind] * args.pairs
    yield from ["nothing"] * args.unchanged


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--pairs", type=int, default=40)
    parser.add_argument("--unchanged", type=int, default=20)
    parser.add_argument("--first", type=int, default=0, help="number of the first pair")
    parser.add_argument("--kind", choices=ASKED, default="", help="of all pairs")
    parser.add_argument("--driving", choices=DRIVING, default="", help="of all pairs")
    parser.add_argument(
        "--apart", action="store_true", help="of two changes only pairs where each alone is named"
    )
    parser.add_argument("--without-vy", action="store_true", help="nobody measures v_y")
    parser.add_argument("--json", type=Path, metavar="FILE", help="a line for each pair")
    parser.add_argument("--read", nargs="+", type=Path, metavar="FILE")
    args = parser.parse_args()
    if args.read:
        texts = (path.read_text(encoding="utf-8").splitlines() for path in args.read)
        print(table([json.loads(text) for several in texts for text in several]))
        return
    warnings.simplefilter("ignore", sv.SysidWarning)
    rows: list[Row] = []
    for number, kind in enumerate(_kinds(args)):
        if number < args.first:
            continue
        try:
            pair = drawn(
                args.seed,
                number,
                kind,
                args.driving,
                apart=args.apart,
                with_vy=not args.without_vy,
            )
            row = judged(pair)
        except sv.SysidError as e:
            print(f"{number:3d} {kind}: {e}", flush=True)
            continue
        if row is None:
            continue
        rows.append(row)
        print(line(number, row), flush=True)
        if args.json is not None:
            with args.json.open("a", encoding="utf-8") as file:
                file.write(json.dumps(row) + "\n")
    print(table(rows))


if __name__ == "__main__":
    main()
