"""Text of a calculation that the compiled model wrote down, for Python and C++ alike.

What no result needs is left out; what is needed once stands where it is needed; what is needed
again, or has a name in the source of the model, is assigned to a name.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Mapping, Sequence
from itertools import count, pairwise
from typing import NamedTuple

Step = tuple[str, int, int, int, float]

_INFIX = {"add": ("+", 1), "subtract": ("-", 1), "multiply": ("*", 2), "divide": ("/", 2)}
_CALLS = {
    "sin": "sin",
    "cos": "cos",
    "arctan": "atan",
    "arctan2": "atan2",
    "sqrt": "sqrt",
    "exp": "exp",
    "log": "log",
    "tanh": "tanh",
    "absolute": "fabs",
    "fmin": "fmin",
    "fmax": "fmax",
}
FUNCTIONS = tuple(dict.fromkeys(_CALLS.values()))
# Words of the languages that a name with an underscore could be, and names that the texts use.
TAKEN = {
    *FUNCTIONS,
    *("where", "array", "broadcast_arrays", "derivatives", "step", "state", "rate", "felt", "car"),
    *("and_eq", "or_eq", "xor_eq", "not_eq", "static_cast", "static_assert", "dynamic_cast"),
    *("const_cast", "reinterpret_cast", "thread_local", "co_await", "co_return", "co_yield"),
}
_JOINED = {"add": "plus", "subtract": "minus", "multiply": "times", "divide": "per"}
_ATOM, _SIGNED = 4, 3
_TERM = "term_10"  # until all names are known
_LONGEST = 92  # characters of an assignment
_LONGEST_NAME = 30


class Form(NamedTuple):
    """What a step does, and what it does that to; the limit of a `where_below`."""

    what: str
    of: tuple[int, ...]
    limit: float = 0.0


class Calculation:
    """The steps that lead to some results.

    Parameters
    ----------
    steps : sequence of Step
        Operation, operands, constant; see `WrittenModel.steps`.
    results : mapping of str to int
        Names of results and their steps.
    """

    def __init__(self, steps: Sequence[Step], results: Mapping[str, int]) -> None:
        self.steps = steps
        self.results = dict(results)
        needed = set(self.results.values())
        for i in range(len(steps) - 1, -1, -1):
            if i in needed:
                needed.update(self.operands(i))
        self.needed = sorted(needed)

    def operands(self, i: int) -> tuple[int, ...]:
        """Steps that a step is made of, as its text names them."""
        return self.form(i).of

    def inputs(self) -> list[int]:
        """Those inputs that the results depend on."""
        return [i for i in self.needed if self.steps[i][0] == "input"]

    def depends(self, i: int, on: set[int]) -> bool:
        """Whether a step depends on one of some others."""
        seen: set[int] = set()
        left = [i]
        while left:
            at = left.pop()
            if at in on:
                return True
            if at not in seen:
                seen.add(at)
                left += self.operands(at)
        return False

    def _constant(self, i: int) -> float | None:
        operation, _, _, _, constant = self.steps[i]
        return constant if operation == "constant" else None

    def form(self, i: int) -> Form:
        """What a step does as one would write it."""
        operation, a, b, c, limit = self.steps[i]
        if operation != "where_below":
            return Form(operation, tuple(k for k in (a, b, c) if k >= 0))
        if b == a and self._constant(c) == limit:
            inner = self.form(a)
            above = self._constant(inner.of[1]) if inner.what == "fmin" else None
            return Form("fmin", (a if above is None or above < limit else inner.of[0], c))
        if c == a and self._constant(b) == limit:
            return Form("fmax", (a, b))
        asked, left, right, _, _ = self.steps[a]
        if limit == 0.0 and asked == "subtract":
            if (b, c) == (left, right):
                return Form("fmin", (b, c))
            if (c, b) == (left, right):
                return Form("fmax", (c, b))
            return Form("where_less", (left, right, b, c))
        if limit == 0.0 and asked == "negative" and self.steps[left][0] == "absolute":
            chosen = self.steps[left][1]  # not zero: what a formula selects by
            inner = self.form(chosen)
            if inner.what in ("where_less", "where_below") and self._truth(*inner.of[-2:]):
                return Form(inner.what, (*inner.of[:-2], b, c), inner.limit)
            return Form("where_not", (chosen, b, c))
        return Form(operation, (a, b, c), limit)

    def _truth(self, yes: int, no: int) -> bool:
        return self._constant(yes) == 1.0 and self._constant(no) == 0.0


class Writer:
    """Writes a calculation as assignments; a name may be assigned again.

    Parameters
    ----------
    calculation : Calculation
    inputs : mapping of int to str
        Names of inputs by their steps.
    told : sequence of tuple of int and str
        Steps that have names in the source of the model.
    """

    def __init__(
        self, calculation: Calculation, inputs: Mapping[int, str], told: Sequence[tuple[int, str]]
    ) -> None:
        self._of = calculation
        self._inputs = inputs
        self._taken = {*TAKEN, *inputs.values(), *calculation.results}
        self._names: dict[int, str] = {}
        needed = set(calculation.needed)
        for name, i in calculation.results.items():
            if not self._leaf(i):
                self._names.setdefault(i, name)
        own = {name: free_name(name, self._taken) for _, name in told}
        self._taken.update(own.values())
        for i, name in told:
            if i in needed and not self._leaf(i):
                self._names.setdefault(i, own[name])
        self._name_what_is_needed_again()
        self._break_long_ones()
        number = count(1)
        for i in sorted(self._names):
            if self._names[i] == _TERM:
                self._names[i] = self._new(f"term_{next(number)}")
        self._part_versions()

    def sections(self, parts: Sequence[tuple[int, str]]) -> tuple[tuple[str, tuple[str, ...]], ...]:
        """Give the assignments of each part that has some; `parts`: first step and title."""
        found: list[tuple[str, tuple[str, ...]]] = []
        begins = [0, *(first for first, _ in parts[1:]), len(self._of.steps)]
        for (_, title), (first, behind) in zip(parts, pairwise(begins), strict=True):
            lines = [self._line(i) for i in sorted(self._names) if first <= i < behind]
            if lines:
                found.append((title, tuple(lines)))
        last = [
            f"{name} = {self._operand(i, 0)}"
            for name, i in self._of.results.items()
            if self._names.get(i) != name
        ]
        return (*found, ("results", tuple(last))) if last else tuple(found)

    def _line(self, i: int) -> str:
        return f"{self._names[i]} = {self._text(i)[0]}"

    def _leaf(self, i: int) -> bool:
        return self._of.steps[i][0] in ("input", "constant")

    def _text(self, i: int) -> tuple[str, int]:
        """The text of what a step does, and how tightly it holds together."""
        form, of, limit = self._of.form(i)
        if form == "input":
            return self._inputs[i], _ATOM
        if form == "constant":
            value = self._of.steps[i][4]
            return repr(value), _ATOM if value >= 0.0 else 0
        if form == "negative":
            return f"-{self._operand(of[0], _SIGNED)}", _SIGNED
        if form in _INFIX:
            sign, level = _INFIX[form]
            left, right = self._operand(of[0], level), self._operand(of[1], level + 1)
            return f"{left} {sign} {right}", level
        told = [self._operand(k, 0) for k in of]
        if form == "where_less":
            return f"where({told[0]} < {told[1]}, {told[2]}, {told[3]})", _ATOM
        if form == "where_below":
            return f"where({told[0]} < {limit!r}, {told[1]}, {told[2]})", _ATOM
        if form == "where_not":
            return f"where({told[0]} != 0.0, {told[1]}, {told[2]})", _ATOM
        return f"{_CALLS[form]}({', '.join(told)})", _ATOM

    def _operand(self, i: int, level: int) -> str:
        if i in self._names:
            return self._names[i]
        text, own = self._text(i)
        return text if own >= level else f"({text})"

    def _name_what_is_needed_again(self) -> None:
        uses = Counter(k for i in self._of.needed for k in self._of.operands(i))
        uses.update(self._of.results.values())
        for i in self._of.needed:
            sign = self._of.steps[i][0] == "negative" and self._leaf(self._of.steps[i][1])
            if uses[i] > 1 and i not in self._names and not self._leaf(i) and not sign:
                self._names[i] = self._telling(i)

    def _break_long_ones(self) -> None:
        """Take the half out of what is too long for a line."""
        waiting = list(self._names)
        while waiting:
            i = waiting.pop()
            length = len(self._line(i))
            inner = [k for k in self._inside(i) if k != i]
            if length <= _LONGEST or not inner:
                continue
            half = min(inner, key=lambda k: abs(len(self._text(k)[0]) - length / 2))
            self._names[half] = _TERM
            waiting += [i, half]

    def _inside(self, i: int) -> list[int]:
        """Steps written out in the text of this one, itself among them."""
        found = [i]
        for k in self._of.operands(i):
            if k not in self._names and not self._leaf(k):
                found += self._inside(k)
        return found

    def _telling(self, i: int) -> str:
        """A name that says what is calculated, where that is short."""
        form, of, _ = self._of.form(i)
        told = [self._operand(k, 0) for k in of]
        name = ""
        if all(t.isidentifier() and t != _TERM for t in told):
            if form == "multiply" and of[0] == of[1]:
                name = f"{told[0]}_squared"
            elif form in _JOINED:
                name = f"{told[0]}_{_JOINED[form]}_{told[1]}"
            elif form in _CALLS and len(told) == 1:
                name = f"{_CALLS[form]}_{told[0]}"
        return self._new(name) if name and len(name) <= _LONGEST_NAME else _TERM

    def _new(self, name: str) -> str:
        name = free_name(name, self._taken)
        self._taken.add(name)
        return name

    def _part_versions(self) -> None:
        """Give a step another name where its name is assigned again before its last use."""
        last = {i: i for i in self._names}
        for i in self._names:
            for k in self._inside(i):
                for used in self._of.operands(k):
                    if used in self._names:
                        last[used] = max(last[used], i)
        for name, i in self._of.results.items():
            if self._names.get(i) != name:  # written at the end
                for used in (i, *self._of.operands(i)):
                    if used in self._names:
                        last[used] = len(self._of.steps)
            elif i in self._names:
                last[i] = len(self._of.steps)
        versions: dict[str, list[int]] = {}
        for i in sorted(self._names):
            versions.setdefault(self._names[i], []).append(i)
        for name, own in versions.items():
            for i, later in pairwise(own):
                if last[i] > later:
                    self._names[i] = self._new(f"{name}_before")


def free_name(name: str, taken: set[str]) -> str:
    """Return a name that is none of those taken, made of letters that every language allows."""
    name = re.sub(r"\W", "_", name, flags=re.ASCII)
    while name in taken:
        name += "_"
    return name
