"""Does the drive that is suggested after a study tell apart what the study could not?

    python benchmarks/next_drive [--seed 1] [--trials 60] [--pairs 10] [--severity S ...]
                                 [--json FILE]
    python benchmarks/next_drive --read FILE [FILE ...]

The trials are those of the exam with single manoeuvres: cars, hidden effects, noise. Where the
study names effects that it cannot tell apart, `sv.next_drive` is asked what to drive; the true car
drives the first suggestion as often as it says, with the noise of the trial, and the study is
repeated with the new logs among the training data. Standard errors that were reached are those of
the likelihood of all these logs, between the true effect and the others. Of the rest of the list
the most telling one that is shorter is driven too.
"""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent))

from answers import Row, is_asked, outcome, promised, reached, table
from followed import followed

from design import SEVERITIES, full, stratified  # isort: skip


def main() -> None:
    assert __doc__ is not None
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--trials", type=int, default=60, help="with one hidden effect")
    parser.add_argument("--pairs", type=int, default=10, help="with two")
    parser.add_argument("--severity", nargs="+", type=float, default=(0.5, 1.0), choices=SEVERITIES)
    parser.add_argument("--first", type=int, default=0, help="number of the first trial")
    parser.add_argument("--json", type=Path, metavar="FILE", help="a line for each trial")
    parser.add_argument("--read", nargs="+", type=Path, metavar="FILE")
    args = parser.parse_args()
    if args.read:
        texts = (path.read_text(encoding="utf-8").splitlines() for path in args.read)
        rows = [json.loads(text) for several in texts for text in several]
        print("\n".join(line(r) for r in rows if r["state"] not in ("no question", "lost")))
        print(table(rows))
        return
    drawn = [t for t in full(null_repeats=1) if t.driving != "all" and t.severity in args.severity]
    trials = stratified(drawn, {"effect": args.trials, "pair": args.pairs}, args.seed)
    rows = []
    for trial in trials[args.first :]:
        rows.append(followed(trial))
        print(line(rows[-1]), flush=True)
        if args.json is not None:
            with args.json.open("a", encoding="utf-8") as file:
                file.write(json.dumps(rows[-1]) + "\n")
    print(table(rows))


def line(row: Row) -> str:
    """A trial in a line."""
    if row["state"] != "done":
        return f"{row['key']}: {row['state']} {row.get('why', '')}"
    drive = row["drive"]
    what = f"{drive['times']} x {drive['manoeuvre']} of {drive['duration_s']:.0f} s"
    asked = f"{' or '.join(row['between'])}, {row['now']:.1f} at hand"
    text = f"{row['key']}: {asked}; {what} promises {row['promised']:.1f}"
    if not row["drivable"]:
        return f"{text}; {row['why']}"
    came = f"{reached(row):.1f} for {promised(row):.1f}" if is_asked(row) else "not asked about"
    return f"{text}; {came}; {outcome(row)} ({row['seconds']:.0f} s)"


if __name__ == "__main__":
    main()
