"""Counts of what was said of pairs, by what changed."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from pairs import KINDS

Row = dict[str, Any]
_COLUMNS = ("kind", "changes", "first", "in group", "least", "of these", "inside", "wrong")


def table(rows: Sequence[Row]) -> str:
    """Counts by kind."""
    lines = ["  ".join(f"{c:>16s}" if i == 0 else f"{c:>8s}" for i, c in enumerate(_COLUMNS))]
    for kind in (*KINDS[1:], "all"):
        some = [r for r in rows if r["kind"] == kind or (kind == "all" and r["truths"])]
        truths = [t for r in some for t in r["truths"]]
        if not some:
            continue
        large = [t for t in truths if t["least"]]
        inside = [t["inside"] for t in truths if t["inside"] is not None]
        cells = (
            str(len(truths)),
            str(sum(t["first"] for t in truths)),
            str(sum(t["group"] for t in truths)),
            str(len(large)),
            str(sum(t["group"] for t in large)),
            f"{sum(inside)}/{len(inside)}",
            str(sum(len(r["wrong"]) for r in some)),
        )
        lines.append("  ".join([f"{kind:>16s}", *(f"{c:>8s}" for c in cells)]))
    lines += _of_two([r for r in rows if r["kind"] == "two"])
    none = [r for r in rows if not r["truths"]]
    claimed = [r for r in none if r["named"]]
    something = [r for r in none if r["unknown"] and not r["named"]]
    likeliest = [r for r in none if "something changed, likeliest" in r["headline"]]
    lines.append(
        f"nothing changed: {len(none)}, claims {len(claimed)}, something unknown {len(something)}, "
        f"something likely {len(likeliest)}"
    )
    lines.append(
        f"pairs with a change {len(rows) - len(none)}, with a wrong name "
        f"{sum(bool(r['wrong']) for r in rows if r['truths'])}, with something unknown "
        f"{sum(bool(r['unknown']) for r in rows if r['truths'])}"
    )
    missed = [t for r in rows for t in r["truths"] if not t["group"]]
    lines.append(
        f"not named {len(missed)}, told that one of usual size is too weak to see "
        f"{sum(t.get('weak', False) for t in missed)}, that it is imitated "
        f"{sum(t.get('imitated', False) for t in missed)}"
    )
    return "\n".join(lines)


def _of_two(rows: Sequence[Row]) -> list[str]:
    """What was said of pairs with two changes, by what drove them apart."""
    if not rows:
        return []
    told = [_both(r) for r in rows]
    kinds = ("both", "one of two", "wrong name", "something", "nothing")
    return ["two changes: " + ", ".join(f"{k} {told.count(k)}" for k in kinds)]


def _both(row: Row) -> str:
    """Whether both changes are named and nothing else, one, something else, or none."""
    if row["wrong"]:
        return "wrong name"
    named = [t["group"] for t in row["truths"]]
    if any(named):
        return "both" if all(named) else "one of two"
    return "nothing" if row["headline"] == "no change is shown" else "something"
