"""The derivative of a traced formula by one of the states that it reads, as steps again."""

from __future__ import annotations

from typing import Any

import numpy as np

from .formula import _OPERATIONS, Step, Traced, _needed, _Tape

_NAMES = {number: name for name, number in _OPERATIONS.items()}
_LEAVES = ("constant", "signal", "parameter", "channel", "state")


def decay_of(steps: tuple[Step, ...], state: int) -> tuple[Step, ...]:
    """Minus the derivative of a formula by its state number `state`.

    Where the formula has a kink, it is that of the side on which the formula stands.
    """
    tape = _Tape()
    values: list[Any] = []
    slopes: list[Any] = []
    for operation, (a, b, c), constant in steps:
        name = _NAMES[operation]
        if name in _LEAVES:
            values.append(Traced(tape, tape.add(name, a, constant=constant), name))
            slopes.append(1.0 if (name, a) == ("state", state) else 0.0)
            continue
        x, y, z = values[a], values[b], values[c]
        dx, dy, dz = slopes[a], slopes[b], slopes[c]
        values.append(x._apply(name, *(x, y, z)[: _arity(name)]))
        slopes.append(_slope(name, (x, y, values[-1]), (dx, dy, dz)))
    decay = -slopes[-1]
    if not isinstance(decay, Traced):
        decay = values[0]._of(decay)
    return _needed(list(tape.steps), decay._place)


def _arity(name: str) -> int:
    return {"where": 3}.get(name, 2 if name in _OF_TWO else 1)


_OF_TWO = ("add", "subtract", "multiply", "divide", "arctan2", "minimum", "maximum", "greater")


def _times(a: Any, b: Any) -> Any:
    """A product that is plainly zero where one factor is."""
    return 0.0 if _zero(a) or _zero(b) else a * b


def _zero(x: Any) -> bool:
    return not isinstance(x, Traced) and x == 0.0


def _slope(name: str, v: tuple[Any, Any, Any], d: tuple[Any, Any, Any]) -> Any:
    """Of the operation `name` on x and y with the value `out`; of `where` on (x, y, z)."""
    x, y, out = v
    dx, dy, dz = d
    if name == "where":
        return 0.0 if _zero(dy) and _zero(dz) else x._apply("where", x, dy, dz)
    if all(_zero(s) for s in d[: _arity(name)]) or name in ("sign", "greater"):
        return 0.0
    if name == "add":
        return dx + dy
    if name == "subtract":
        return dx - dy
    if name == "multiply":
        return _times(dx, y) + _times(x, dy)
    if name == "divide":
        return (dx - _times(out, dy)) / y
    if name == "arctan2":
        return (_times(y, dx) - _times(x, dy)) / (x * x + y * y)
    if name in ("minimum", "maximum"):
        first, second = (dx, dy) if name == "minimum" else (dy, dx)
        return x._apply("where", y > x, first, second)
    return _times(_unary(name, x, out), dx)


def _unary(name: str, x: Any, out: Any) -> Any:
    if name == "negative":
        return -1.0
    if name == "absolute":
        return np.sign(x)
    if name == "sin":
        return np.cos(x)
    if name == "cos":
        return -np.sin(x)
    if name == "arctan":
        return 1.0 / (1.0 + x * x)
    if name == "sqrt":
        return 0.5 / out
    if name == "exp":
        return out
    if name == "log":
        return 1.0 / x
    return 1.0 - out * out  # tanh
