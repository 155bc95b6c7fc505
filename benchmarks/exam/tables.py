"""What the outcomes of many trials say, as tables."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from design import KINEMATIC, MANOEUVRES
from rates import Rate
from trial import Outcome

Row = tuple[str, str, str]
TIMING = ("steer_lag", "tyre_relaxation")
QUIET = ("adequate", "not_testable")
_TOLD = ("missing", "one of a group")


@dataclass(frozen=True)
class Table:
    """Rows of question, figure and target."""

    name: str
    title: str
    rows: tuple[Row, ...]

    def __str__(self) -> str:
        widths = [max(len(r[i]) for r in (*self.rows, ("", "", ""))) for i in range(3)]
        lines = ["  ".join(c.ljust(w) for c, w in zip(r, widths, strict=True)) for r in self.rows]
        return "\n".join([self.title, *(f"  {line.rstrip()}" for line in lines)])


def _of(outcomes: Sequence[Outcome], *kinds: str) -> list[Outcome]:
    return [o for o in outcomes if o["state"] == "done" and o["trial"]["kind"] in kinds]


def _quantile(values: Sequence[float], q: float) -> str:
    return f"{np.quantile(values, q):.3f} of {len(values)}" if values else "none"


def detected(o: Outcome) -> bool:
    """Whether there was evidence of any effect."""
    return o["leader"] is not None


def named_first(o: Outcome) -> bool:
    """Whether the likeliest after the refits is what was hidden."""
    return o["leader"] in o["trial"]["truth"]


def in_group(o: Outcome) -> bool:
    """Whether it is that, or cannot be told from it."""
    return bool({o["leader"], *o["leader_group"]} & set(o["trial"]["truth"]))


def in_set(o: Outcome) -> bool:
    """Whether a credible set of the first posterior holds what was hidden."""
    return any(set(s) & set(o["trial"]["truth"]) for s in o["sets"])


def remainder(o: Outcome) -> bool:
    """Whether something else was added or is left."""
    return o["verdict"] != "explained" or any(a not in o["trial"]["truth"] for a in o["added"])


def claimed_alone(o: Outcome) -> bool:
    """Whether a single effect, which it cannot be, is said to be missing and to explain all."""
    told = [e for e, finding in o["findings"].items() if finding in _TOLD]
    return len(told) == 1 and told[0] not in o["trial"]["truth"] and o["verdict"] == "explained"


def claimed_at_all(o: Outcome) -> bool:
    """Whether any effect, none of which it can be, is said to be missing."""
    told = [e for e, finding in o["findings"].items() if finding in _TOLD]
    return bool(set(told) - set(o["trial"]["truth"]))


def _null(outcomes: Sequence[Outcome]) -> list[Row]:
    found = _of(outcomes, "null")
    rows = []
    for name in MANOEUVRES:
        these = [o for o in found if o["trial"]["driving"] == name]
        rows.append((f"any effect claimed, {name}", str(Rate.over(map(_claims, these))), "5 %"))
        rows.append(
            ("  evidence before validation data", str(Rate.over(map(detected, these))), "5 %")
        )
    rows.append(("any effect claimed, all sets", str(Rate.over(map(_claims, found))), "5 %"))
    rows.append(("  evidence before validation data", str(Rate.over(map(detected, found))), "5 %"))
    rows.append(
        ("verdict not adequate", str(Rate.over(o["verdict"] not in QUIET for o in found)), "6 %")
    )
    with_sets = [o for o in found if "sets" in o]  # older outcomes have none
    rows.append(("any credible set", str(Rate.over(bool(o["sets"]) for o in with_sets)), "1 %"))
    return rows


def _claims(o: Outcome) -> bool:
    return bool(o["added"])


def _naming(outcomes: Sequence[Outcome]) -> list[Row]:
    every = _of(outcomes, "effect")
    found = [o for o in every if detected(o)]
    rows: list[Row] = []
    for s in (0.5, 1.0, 2.0):
        these = [o for o in every if o["trial"]["severity"] == s]
        rows.append((f"detected at severity {s:g}", str(Rate.over(map(detected, these))), ""))
    rows += [
        ("of these named first", str(_rate(named_first, found)), ">= 97 %"),
        ("  where all manoeuvres were driven", str(_rate(named_first, _with_all(found))), ""),
        ("true one in the named group", str(_rate(in_group, found)), ">= 99 %"),
        ("mean size of the group", _mean(1 + len(o["leader_group"]) for o in found), "<= 1.3"),
        (
            "true one in a credible set of the baseline",
            str(_rate(in_set, [o for o in found if "sets" in o])),
            ">= 95 %",
        ),
    ]
    return rows


def _with_all(outcomes: Sequence[Outcome]) -> list[Outcome]:
    return [o for o in outcomes if o["trial"]["driving"] == "all"]


def _mean(values: object) -> str:
    found = list(values)  # type: ignore[call-overload]
    return f"{np.mean(found):.2f} of {len(found)}" if found else "none"


def _improving(outcomes: Sequence[Outcome]) -> list[Row]:
    found = [o for o in _of(outcomes, "effect", "pair") if o["added"]]
    better = Rate.over(o["test_errors"][-1] < o["test_errors"][0] for o in found)
    hard = [o for o in _of(outcomes, "effect") if o["trial"]["severity"] >= 1.0 and detected(o)]
    plain = [o["test_errors"][-1] for o in hard if "coloured" not in o["trial"]["noise"]]
    to_truth = [o["test_errors"][-1] / o["true_error"] for o in hard]
    covered = [
        abs(value - true) <= 1.96 * std
        for o in found
        for value, std, true in o["intervals"].values()
        if np.isfinite(std)
    ]
    return [
        ("validation error improved by what was added", str(better), ">= 98 %"),
        ("validation error after, of the true car's, median", _quantile(to_truth, 0.5), "<= 1.03"),
        ("  95th percentile", _quantile(to_truth, 0.95), "<= 1.10"),
        ("  of the noise floor, where noise is white, median", _quantile(plain, 0.5), "<= 1.03"),
        ("  95th percentile", _quantile(plain, 0.95), "<= 1.10"),
        ("95 % intervals that hold the true parameter", str(Rate.over(covered)), "93-97 %"),
    ]


def _unknown(outcomes: Sequence[Outcome]) -> list[Row]:
    rows: list[Row] = []
    for kind in ("outside", "itself removed", "group removed"):
        for s, target in ((2.0, "<= 2 %"), (1.0, ""), (0.5, "<= 10 %")):
            these = [o for o in _of(outcomes, kind) if o["trial"]["severity"] == s]
            seen = [o for o in these if detected(o) or o["omnibus_first"] < 0.01]
            told = Rate.over(o["verdict"] == "unknown" for o in seen)
            partly = Rate.over(o["verdict"] == "partly_explained" for o in seen)
            want = ">= 95 %" if s == 2.0 else ""
            rows += [
                (f"{kind}, severity {s:g}: seen at all", f"{len(seen)}/{len(these)}", ""),
                ("  verdict unknown, of those seen", str(told), want),
                ("  verdict partly explained", str(partly), ""),
                ("  single wrong effect explains it", str(_rate(claimed_alone, these)), target),
                ("  any wrong effect said to be missing", str(_rate(claimed_at_all, these)), ""),
            ]
    return rows


def _rate(question: Callable[[Outcome], bool], of: Sequence[Outcome]) -> Rate:
    return Rate.over(map(question, of))


def _timing(outcomes: Sequence[Outcome]) -> list[Row]:
    found = [o for o in _of(outcomes, "effect") if o["trial"]["truth"][0] in TIMING]
    found = [o for o in found if detected(o)]
    return [
        ("lag or relaxation named first", str(_rate(named_first, found)), ">= 97 %"),
        ("named, or in the group", str(_rate(in_group, found)), ""),
        ("something else left or added", str(_rate(remainder, found)), "<= 5 %"),
    ]


def _kinematic(outcomes: Sequence[Outcome]) -> list[Row]:
    rows: list[Row] = []
    for kind in ("itself removed", "group removed"):
        found = [o for o in _of(outcomes, kind) if o["trial"]["truth"][0] in KINEMATIC]
        for s in (2.0, 1.0, 0.5):
            these = [o for o in found if o["trial"]["severity"] == s]
            seen = Rate.over(o["omnibus_first"] < 0.01 for o in these)
            want = ">= 95 %" if s == 2.0 else ""
            rows.append((f"{kind}, severity {s:g}: seen by the omnibus test", str(seen), want))
    return rows


def _pairs(outcomes: Sequence[Outcome]) -> list[Row]:
    found = _of(outcomes, "pair")
    with_groups = Rate.over(_both_in_groups(o) for o in found)
    one = Rate.over(bool(set(o["added"]) & set(o["trial"]["truth"])) for o in found)
    # A weave in the linear range tells nothing of a load transfer, whoever looks at it.
    shown = [o for o in found if o.get("shown")]
    return [
        ("both found, nothing else", str(_rate(_just_these, found)), ">= 85 %"),
        ("  of those that the driving tells apart from one", str(_rate(_just_these, shown)), ""),
        ("  where all manoeuvres were driven", str(_rate(_just_these, _with_all(found))), ""),
        ("both found or in the groups, nothing else", str(with_groups), ""),
        ("one of them found at least", str(one), ""),
    ]


def _just_these(o: Outcome) -> bool:
    return set(o["added"]) == set(o["trial"]["truth"])


def _both_in_groups(o: Outcome) -> bool:
    named = [{a, *o["groups"].get(a, [])} for a in o["added"]]
    truth = set(o["trial"]["truth"])
    return len(named) == len(truth) and all(any(t in g for g in named) for t in truth)


def _partly(outcomes: Sequence[Outcome]) -> list[Row]:
    every = _of(outcomes, "one removed")
    found = [o for o in every if detected(o) or o["omnibus_first"] < 0.01]
    partly = Rate.over(o["verdict"] == "partly_explained" for o in found)
    unknown = Rate.over(o["verdict"] == "unknown" for o in found)
    return [
        ("seen at all", f"{len(found)}/{len(every)}", ""),
        ("the candidate named, or in the group", str(_rate(_candidate_named, found)), ""),
        ("any other effect named beside it or alone", str(_rate(_another_named, found)), "<= 2 %"),
        ("verdict partly explained", str(partly), ""),
        ("verdict unknown", str(unknown), ""),
    ]


def _named(o: Outcome) -> list[set[str]]:
    """What was added and is named, each with its rivals."""
    told = [e for e in o["added"] if o["findings"].get(e) in _TOLD]
    return [{e, *o["groups"].get(e, [])} for e in told]


def _candidate_named(o: Outcome) -> bool:
    return any(o["trial"]["truth"][0] in group for group in _named(o))


def _another_named(o: Outcome) -> bool:
    return any(o["trial"]["truth"][0] not in group for group in _named(o))


def _steps(outcomes: Sequence[Outcome]) -> list[Row]:
    found = _of(outcomes, "null")
    steps = [o for o in found if o["trial"]["driving"] in ("ramp", "step")]
    laps = [o for o in found if o["trial"]["driving"] == "lap"]
    return [
        ("false claims, ramps and steps", str(_rate(_claims, steps)), "equal"),
        ("false claims, laps", str(_rate(_claims, laps)), "equal"),
    ]


def _rivals(outcomes: Sequence[Outcome]) -> list[Row]:
    # Below two standard errors the noise of the measurement is all there is.
    found = [o for o in _of(outcomes, "rivals") if o["promised"] > 2.0]
    ratios = [o["achieved"] / o["promised"] for o in found]
    before = [o["before"] for o in found]
    after = [o["promised"] for o in found]
    return [
        ("achieved / promised separation, median", _quantile(ratios, 0.5), "0.8-1.25"),
        ("  first and third quartile", f"{_quantile(ratios, 0.25)}, {_quantile(ratios, 0.75)}", ""),
        ("standard errors before, median", _quantile(before, 0.5), ""),
        ("standard errors promised, median", _quantile(after, 0.5), ""),
    ]


_MAKERS: dict[str, tuple[str, Callable[[Sequence[Outcome]], list[Row]]]] = {
    "null": ("Nothing hidden", _null),
    "naming": ("One effect hidden: is it named?", _naming),
    "improving": ("What adding it does", _improving),
    "unknown": ("What is hidden is no candidate", _unknown),
    "timing": ("Lag and relaxation", _timing),
    "kinematic": ("Kinematic and sensor effects, not among the candidates", _kinematic),
    "pairs": ("Two effects hidden", _pairs),
    "partly": ("Two effects hidden, the second one and its like no candidates", _partly),
    "steps": ("Step-like driving beside laps", _steps),
    "rivals": ("After the drive that was suggested", _rivals),
}
NAMES = tuple(_MAKERS)

# Which kinds of trials each table needs.
KINDS_OF = {
    "null": ("null",),
    "naming": ("effect",),
    "improving": ("effect", "pair"),
    "unknown": ("outside", "itself removed", "group removed"),
    "timing": ("effect",),
    "kinematic": ("itself removed", "group removed"),
    "pairs": ("pair",),
    "partly": ("one removed",),
    "steps": ("null",),
    "rivals": ("rivals",),
}


def tables(outcomes: Sequence[Outcome], only: str | None = None) -> tuple[Table, ...]:
    """All tables, or one."""
    chosen = NAMES if only is None else (only,)
    return tuple(Table(n, _MAKERS[n][0], tuple(_MAKERS[n][1](outcomes))) for n in chosen)
