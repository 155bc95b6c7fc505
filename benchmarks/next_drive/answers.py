"""What following the suggestions brought, as a table."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

Row = dict[str, Any]
OUTCOMES = ("right, alone", "right, in a group", "nothing named", "wrong")
_ENOUGH = 5.0


def outcome(row: Row, when: str = "after") -> str:
    """What a study named: one of `OUTCOMES`.

    Effects that only stand in for something are no names, nor are those of the verdict unknown.
    """
    told, truth = row[when], set(row["truth"])
    if told["verdict"] == "unknown":
        return "nothing named"
    named = [{a, *told["groups"][a]} for a in told["added"] if told["grades"][a] != "alias"]
    if any(not truth & group for group in named):
        return "wrong"
    if not named:
        return "nothing named"
    # Of a pair the other effect may stand in no group that was asked about.
    asked = [group for group in named if truth & group & set(row["between"])] or named
    return "right, alone" if all(len(group) == 1 for group in asked) else "right, in a group"


def is_asked(row: Row) -> bool:
    """Whether what was hidden is among the effects that were to be told apart."""
    return bool(set(row["truth"]) & set(row["between"]))


def promised(row: Row) -> float:
    """Standard errors that were promised for the effect that is there."""
    (right, *_) = (e for e in row["between"] if e in row["truth"])
    return float(row["drive"]["standard_errors_if"][right])


def reached(row: Row, of: str = "apart") -> float:
    """The same as it came out: of the first from the nearest other, of another from the first."""
    (right, *_) = (e for e in row["between"] if e in row["truth"])
    first, apart = row["between"][0], row[of]
    return float(min(apart.values()) if right == first else apart[first])


def table(rows: Sequence[Row]) -> str:
    """Counts of all questions, and of those that a suggestion was to answer."""
    done = [r for r in rows if r["state"] == "done" and r["drivable"]]
    lost = [r for r in rows if r["state"] == "done" and not r["drivable"]]
    failed = [r for r in rows if r["state"] == "failed"]
    asks = len(done) + len(lost) + len(failed)
    none = f"{len(failed)} with no suggestion, {len(lost)} with one that the car did not survive"
    lines = [f"{len(rows)} trials, of {asks} the study asks which effect it is; {none}"]
    kinds = {
        "promised to be enough": [r for r in done if r["promised"] >= _ENOUGH > r["now"]],
        "enough at hand already": [r for r in done if r["now"] >= _ENOUGH],
        "said not to be enough": [r for r in done if max(r["promised"], r["now"]) < _ENOUGH],
    }
    lines.append("  ".join([f"{'':32s}", "drives", *(f"{o:>17s}" for o in OUTCOMES)]))
    for kind, some in (*kinds.items(), ("all", done)):
        counts = [sum(outcome(r) == o for r in some) for o in OUTCOMES]
        lines.append("  ".join([f"{kind:32s}", f"{len(some):6d}", *(f"{n:17d}" for n in counts)]))
    lines += _distances([r for r in done if is_asked(r)])
    lines += _driving(done)
    return "\n".join(lines)


def _distances(rows: Sequence[Row]) -> list[str]:
    if not rows:
        return []
    pairs = [(promised(r), reached(r)) for r in rows]
    off = [b - a for a, b in pairs if a < 2.0 * _ENOUGH]
    far = [b / a for a, b in pairs if a >= 2.0 * _ENOUGH]
    told = [f"the effect is among those asked about: {len(rows)}"]
    if off:
        low, middle, high = np.quantile(off, (0.25, 0.5, 0.75))
        told.append(
            f"reached less promised, where less than {2.0 * _ENOUGH:g} were promised: median "
            f"{middle:+.1f}, quartiles {low:+.1f} and {high:+.1f}, rms "
            f"{np.sqrt(np.mean(np.square(off))):.1f} of {len(off)}"
        )
    if far:
        told.append(f"reached over promised, elsewhere: median {np.median(far):.2f} of {len(far)}")
    sure = [b for a, b in pairs if a >= _ENOUGH]
    told.append(
        f"promised {_ENOUGH:g} and more: reached {_ENOUGH:g} in {sum(b >= _ENOUGH for b in sure)} "
        f"of {len(sure)}, at least {min(sure, default=np.nan):.1f}"
    )
    return told


def _driving(rows: Sequence[Row]) -> list[str]:
    if not rows:
        return []
    beyond = [r["lateral"] / r["lateral_limit"] for r in rows]
    lines = [f"lateral acceleration of the true car over the limit: at most {max(beyond):.2f}"]
    less = [r for r in rows if r["promised"] >= _ENOUGH and r["less"] and is_asked(r)]
    enough = [
        r for r in less if reached(r["less"] | {k: r[k] for k in ("between", "truth")}) >= 5.0
    ]
    lines.append(
        f"a shorter drive of the list, said not to be enough, would have been: {len(enough)} of "
        f"{len(less)}"
    )
    return lines
