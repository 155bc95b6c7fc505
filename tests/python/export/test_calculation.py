"""Steps of a calculation become text that calculates the same."""

import math
from typing import Any

import numpy as np
import pytest

from sysid_vehicle.export.calculation import Calculation, Step, Writer, free_name


class Tape:
    """Notes steps as the compiled model does: each once, operands first."""

    def __init__(self) -> None:
        self.steps: list[Step] = []

    def note(self, operation: str, *of: int, constant: float = 0.0) -> int:
        a, b, c = (*of, -1, -1, -1)[:3]
        step = (operation, a, b, c, constant)
        if operation == "input" or step not in self.steps:
            self.steps.append(step)
            return len(self.steps) - 1
        return self.steps.index(step)

    def constant(self, value: float) -> int:
        return self.note("constant", constant=value)

    def below(self, x: int, limit: float, yes: int, no: int) -> int:
        return self.note("where_below", x, yes, no, constant=limit)


def lines_of(
    tape: Tape, results: dict[str, int], told: list[tuple[int, str]] | None = None
) -> list[str]:
    calculation = Calculation(tape.steps, results)
    names = {i: f"in_{i}" for i, s in enumerate(tape.steps) if s[0] == "input"}
    sections = Writer(calculation, names, told or []).sections([(0, "all")])
    return [line for _, lines in sections for line in lines]


def test_what_no_result_needs_is_left_out() -> None:
    tape = Tape()
    x, unused = tape.note("input"), tape.note("input")
    tape.note("sin", unused)
    y = tape.note("cos", x)
    assert Calculation(tape.steps, {"y": y}).inputs() == [x]
    assert lines_of(tape, {"y": y}) == ["y = cos(in_0)"]


def test_operands_keep_together() -> None:
    tape = Tape()
    a, b, c = (tape.note("input") for _ in range(3))
    add = tape.note("add", a, b)
    told = {
        "left": tape.note("subtract", add, c),
        "right": tape.note("subtract", c, add),
        "times": tape.note("multiply", c, tape.note("divide", a, b)),
        "below": tape.note("divide", c, tape.note("multiply", a, b)),
        "sign": tape.note("negative", tape.note("multiply", a, c)),
        "debt": tape.note("multiply", a, tape.constant(-2.0)),
    }
    assert lines_of(tape, told) == [
        "in_0_plus_in_1 = in_0 + in_1",
        "left = in_0_plus_in_1 - in_2",
        "right = in_2 - in_0_plus_in_1",
        "times = in_2 * (in_0 / in_1)",
        "below = in_2 / (in_0 * in_1)",
        "sign = -(in_0 * in_2)",
        "debt = in_0 * (-2.0)",
    ]


def test_choices() -> None:
    tape = Tape()
    a, b = tape.note("input"), tape.note("input")
    limit, none, one, zero = (tape.constant(v) for v in (3.0, 0.0, 1.0, 0.0))
    less = tape.note("subtract", a, b)
    greater = tape.below(less, 0.0, one, zero)
    chosen = tape.note("negative", tape.note("absolute", greater))
    both = tape.below(tape.below(a, 9.0, a, tape.constant(9.0)), 3.0, tape.note("sin", a), limit)
    least = tape.below(a, 9.0, a, tape.constant(9.0))
    assert none == zero
    told = {
        "least": tape.below(a, 3.0, a, limit),
        "most": tape.below(a, 3.0, limit, a),
        "smaller": tape.below(less, 0.0, a, b),
        "larger": tape.below(less, 0.0, b, a),
        "other": tape.below(a, 3.0, b, limit),
        "selected": tape.below(chosen, 0.0, b, limit),
        "by_number": tape.below(
            tape.note("negative", tape.note("absolute", b)), 0.0, a, tape.constant(4.0)
        ),
        "nested": tape.below(least, 3.0, least, limit),
        "both": both,
    }
    deep = tape.note("sin", tape.below(a, 2.0, one, zero))
    told["no_choice"] = tape.below(tape.note("negative", deep), 5.0, a, b)
    assert lines_of(tape, told)[-10:] == [
        "both = where(fmin(in_0, 9.0) < 3.0, sin(in_0), 3.0)",
        "least = fmin(in_0, 3.0)",
        "most = fmax(in_0, 3.0)",
        "smaller = fmin(in_0, in_1)",
        "larger = fmax(in_0, in_1)",
        "other = where(in_0 < 3.0, in_1, 3.0)",
        "selected = where(in_0 < in_1, in_1, 3.0)",
        "by_number = where(in_1 != 0.0, in_0, 4.0)",
        "nested = fmin(in_0, 3.0)",
        "no_choice = where(-sin(where(in_0 < 2.0, 1.0, 0.0)) < 5.0, in_0, in_1)",
    ]


def test_a_name_is_given_again_unless_it_is_still_needed() -> None:
    tape = Tape()
    x = tape.note("input")
    first = tape.note("sin", x)
    second = tape.note("multiply", first, x)
    late = tape.note("add", second, first)
    told = [(first, "fx"), (second, "fx")]
    assert lines_of(tape, {"y": tape.note("cos", second)}, told)[:2] == [
        "fx = sin(in_0)",
        "fx = fx * in_0",
    ]
    assert lines_of(tape, {"y": late}, told) == [
        "fx_before = sin(in_0)",
        "fx = fx_before * in_0",
        "y = fx + fx_before",
    ]


def test_long_sums_are_broken(rng: np.random.Generator) -> None:
    tape = Tape()
    inputs = [tape.note("input") for _ in range(40)]
    total = inputs[0]
    for k, i in enumerate(inputs[1:]):
        total = tape.note("multiply" if k % 3 else "subtract", total, i)
    lines = lines_of(tape, {"y": total, "same": total, "in": inputs[3]})
    assert max(map(len, lines)) <= 92
    assert lines[-2:] == ["same = y", "in = in_3"]
    values = dict(zip((f"in_{i}" for i in inputs), rng.uniform(0.5, 1.5, 40), strict=True))
    known: dict[str, Any] = dict(values)
    for line in lines:
        name, _, expression = line.partition(" = ")
        known[name] = eval(expression, {}, known)
    wanted = values["in_0"]
    for k in range(39):
        wanted = wanted * values[f"in_{k + 1}"] if k % 3 else wanted - values[f"in_{k + 1}"]
    assert math.isclose(known["y"], wanted, rel_tol=1e-12)


@pytest.mark.parametrize(("name", "free"), [("sin", "sin_"), ("µ_x", "__x"), ("new", "new")])
def test_names_are_free_in_every_language(name: str, free: str) -> None:
    assert free_name(name, {"sin"}) == free


def test_names_of_results_and_inputs_are_not_given_to_others() -> None:
    tape = Tape()
    x = tape.note("input")
    y = tape.note("sin", x)
    z = tape.note("cos", y)
    lines = lines_of(tape, {"fx": z}, [(y, "fx"), (y, "in_0")])
    assert lines == ["fx_ = sin(in_0)", "fx = cos(fx_)"]
