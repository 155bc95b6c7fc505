"""The work of the fuzzer's processes."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence

import cases
import files
from oracle import CALLS, Verdict, judge

Job = tuple[str, int, int, tuple[str, ...]]  # kind, first case, how many, calls


def run_case(kind: str, case: cases.Case, calls: Sequence[str]) -> Iterator[tuple[str, Verdict]]:
    """Judge every call with a case."""
    if kind == "files":
        yield case["reader"], judge(lambda: files.read(case))
        return
    columns, vehicle = cases.build(case)
    for name in calls:
        call = CALLS[name]
        yield name, judge(lambda call=call: call(columns, vehicle))


def some(job: Job) -> tuple[Counter[str], list[dict[str, object]]]:
    """How the calls of some cases ended, and what was wrong."""
    kind, first, count, calls = job
    states: Counter[str] = Counter()
    wrong: list[dict[str, object]] = []
    for number in range(first, first + count):
        case = (files if kind == "files" else cases).draw(number)
        for name, verdict in run_case(kind, case, calls):
            states[verdict.state] += 1
            if verdict.state == "wrong":
                wrong.append({"kind": kind, "call": name, "why": verdict.words, "case": case})
    return states, wrong
