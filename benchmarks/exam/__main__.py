"""The exam: how often does the diagnosis find what is hidden, and own up when it cannot?

    python benchmarks/exam [--small | --full | --draw KIND=N ...] [--driving SET ...]
                           [--severity S ...] [--workers N] [--only TABLE] [--json FILE]
                           [--plot PNG] [--course-mps2 A]

`--small` (the default) takes less than a minute. `--full` does every point of the grid; `--draw`
some of them, its truths and severities in turn. Outcomes go to the file as they come: the same
command goes on where it was broken off, and an exam with all its outcomes on file only prints.
`--course-mps2` makes validation courses of at least so much lateral acceleration, where by itself
no validation course goes beyond the driving that is fitted.
"""

from __future__ import annotations

import argparse
import os
import sys
import time
from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from confusion import draw
from design import KINDS, MANOEUVRES, SEVERITIES, Trial, full, small, stratified
from store import read, run
from tables import KINDS_OF, NAMES, tables
from trial import Outcome

# Of one core: about 2 s where nothing is hidden, 7 s elsewhere, three times that with all drives.
_USUAL_SECONDS = 6.0


def main(argv: Sequence[str] | None = None) -> None:
    args = _parse(argv)
    trials = _trials(args)
    known = read(args.json) if args.json is not None else {}
    left = [t for t in trials if t.key not in known]
    print(_estimate(len(trials), len(left), list(known.values()), args.workers), flush=True)
    outcomes = []
    began = time.perf_counter()
    for outcome in run(trials, workers=args.workers, path=args.json):
        outcomes.append(outcome)
        if sys.stderr.isatty():
            print(f"\r{len(outcomes)}/{len(trials)}", end="", file=sys.stderr)
    print(f"{len(left)} trials in {time.perf_counter() - began:.0f} s; {_states(outcomes)}\n")
    print("\n\n".join(map(str, tables(outcomes, args.only))))
    if args.plot is not None:
        _plot(outcomes, args.plot)


def _parse(argv: Sequence[str] | None) -> argparse.Namespace:
    assert __doc__ is not None
    parser = argparse.ArgumentParser(prog="exam", description=__doc__.splitlines()[0])
    size = parser.add_mutually_exclusive_group()
    size.add_argument("--small", action="store_true", help="a sample of seconds (default)")
    size.add_argument("--full", action="store_true", help="every point of the grid")
    size.add_argument(
        "--draw", nargs="+", metavar="KIND=N", help=f"so many of each kind: {', '.join(KINDS)}"
    )
    parser.add_argument("--driving", nargs="+", choices=MANOEUVRES, default=MANOEUVRES)
    parser.add_argument("--severity", nargs="+", type=float, choices=SEVERITIES, default=SEVERITIES)
    parser.add_argument(
        "--repeats",
        type=int,
        default=1,
        help="of each point of the full grid, 25 times as many where nothing is hidden",
    )
    parser.add_argument("--seed", type=int, default=0, help="of the sample")
    parser.add_argument("--workers", type=int, default=os.cpu_count() or 1)
    parser.add_argument(
        "--course-mps2",
        type=float,
        default=0.0,
        metavar="A",
        help="least lateral acceleration of validation courses",
    )
    parser.add_argument("--only", choices=NAMES, help="this table, and the trials it needs")
    parser.add_argument("--json", type=Path, metavar="FILE", help="outcomes, one a line")
    parser.add_argument("--plot", type=Path, metavar="PNG", help="confusion matrix")
    return parser.parse_args(argv)


def _trials(args: argparse.Namespace) -> tuple[Trial, ...]:
    if args.full or args.draw:
        trials = tuple(
            t
            for t in full(args.repeats, 25 * args.repeats)
            if t.driving in args.driving and (t.severity in args.severity or t.kind == "null")
        )
        if args.draw:
            each = {kind: int(n) for kind, n in (text.rsplit("=", 1) for text in args.draw)}
            trials = stratified(trials, each, args.seed)
    else:
        trials = small(args.seed)
    if args.only is not None:
        trials = tuple(t for t in trials if t.kind in KINDS_OF[args.only])
    return tuple(replace(t, course_mps2=args.course_mps2) for t in trials)


def _estimate(total: int, left: int, known: Sequence[Outcome], workers: int) -> str:
    seconds = [o["seconds"] for o in known if "seconds" in o]
    each = sum(seconds) / len(seconds) if seconds else _USUAL_SECONDS
    whole = each * left / workers
    amount = f"{whole / 3600:.1f} h" if whole > 5400 else f"{whole / 60:.1f} min"
    return (
        f"{total} trials, {left} to do: about {amount} at {each:.1f} s each with {workers} "
        "process(es)"
    )


def _states(outcomes: Sequence[Outcome]) -> str:
    counts = Counter(o["state"] for o in outcomes)
    return ", ".join(f"{n} {state}" for state, n in counts.items())


def _plot(outcomes: Sequence[Outcome], path: Path) -> None:
    import matplotlib as mpl

    mpl.use("Agg")
    from matplotlib import pyplot as plt

    figure, ax = plt.subplots(figsize=(9.0, 9.0), layout="constrained")
    draw(outcomes, ax)
    figure.savefig(path, dpi=150)


if __name__ == "__main__":
    main()
