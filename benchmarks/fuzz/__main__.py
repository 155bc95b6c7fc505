"""Attack the public calls with data that no one should give them.

    python benchmarks/fuzz logs    [--count N] [--first N] [--calls NAME ...] [--seconds S]
    python benchmarks/fuzz files   [--count N] [--first N] [--seconds S]
    python benchmarks/fuzz again   the stored corpus

`logs` draws driving logs, right and spoilt, and cars from plausible to extreme, and hands them to
reading, fitting, comparing, scoring, filtering and observing; `files` hands files with random bytes
to the readers. What ends neither in an error of the package nor in finite numbers is printed and
written to the corpus, which the tests run. Cases are numbered: with `--state FILE` the same command
goes on where it was broken off. Exit status 1 says that something was found.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
import time
from collections import Counter
from collections.abc import Sequence
from multiprocessing import get_context
from pathlib import Path

import cases
from judging import run_case, some
from oracle import CALLS

CORPUS = cases.TESTS / "corpus"
_CHUNK = 5


def _where(why: str) -> str:
    """What tells one defect from another: type and place."""
    return why.split(":")[0] + why[why.rfind("(") :] if "(" in why else why


def fuzz(args: argparse.Namespace) -> int:
    known = {_where(json.loads(p.read_text())["why"]) for p in CORPUS.glob("*.json")}
    first = args.first
    if args.state is not None and args.state.exists():
        first = json.loads(args.state.read_text())["next"]
    last, began = args.first + args.count, time.monotonic()
    jobs = [
        (args.kind, n, min(_CHUNK, last - n), tuple(args.calls)) for n in range(first, last, _CHUNK)
    ]
    states: Counter[str] = Counter()
    found: Counter[str] = Counter()
    done = first
    with get_context("spawn").Pool(args.workers) as pool:
        for (_, begin, count, _), (counted, wrong) in zip(jobs, pool.imap(some, jobs), strict=True):
            states += counted
            done = begin + count
            for failure in wrong:
                found[f"{failure['call']}: {_where(failure['why'])}"] += 1
                if _where(failure["why"]) not in known:
                    known.add(_where(failure["why"]))
                    print(f"{failure['call']}: {failure['why']}", flush=True)
                    args.corpus.mkdir(parents=True, exist_ok=True)
                    path = args.corpus / f"{args.kind}_{len(list(args.corpus.iterdir())):03d}.json"
                    path.write_text(json.dumps(failure, indent=1) + "\n")
            if args.state is not None:
                args.state.write_text(json.dumps({"next": done}))
            if args.seconds is not None and time.monotonic() - began > args.seconds:
                pool.terminate()
                break
    print(f"{done - first} cases in {time.monotonic() - began:.0f} s: {dict(states)}")
    for what, count in found.most_common():
        print(f"{count:6d}  {what}")
    return 1 if found else 0


def again() -> int:
    """Run the corpus."""
    wrong = 0
    for path in sorted(CORPUS.glob("*.json")):
        stored = json.loads(path.read_text())
        for name, verdict in run_case(stored["kind"], stored["case"], (stored["call"],)):
            print(f"{path.name}: {name}: {verdict.state} {verdict.words}")
            wrong += verdict.state == "wrong"
    return 1 if wrong else 0


def main(argv: Sequence[str] | None = None) -> int:
    assert __doc__ is not None
    parser = argparse.ArgumentParser(prog="fuzz", description=__doc__.splitlines()[0])
    parser.add_argument("kind", choices=("logs", "files", "again"))
    parser.add_argument("--count", type=int, default=1000)
    parser.add_argument("--first", type=int, default=0, help="number of the first case")
    parser.add_argument("--calls", nargs="+", choices=tuple(CALLS), default=tuple(CALLS))
    parser.add_argument("--seconds", type=float, help="stop after so long")
    parser.add_argument("--workers", type=int, default=os.cpu_count() or 1)
    parser.add_argument("--state", type=Path, metavar="FILE", help="go on where it says")
    parser.add_argument("--corpus", type=Path, default=CORPUS, help="where failures are written")
    args = parser.parse_args(argv)
    return again() if args.kind == "again" else fuzz(args)


if __name__ == "__main__":
    sys.exit(main())
