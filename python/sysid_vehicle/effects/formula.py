"""A user's function of arrays, followed once and kept as the steps it took.

The compiled core evaluates the steps on any scalar, so that what a user writes in Python has exact
derivatives and costs no call back: `cpp/include/sysid/model/formula.hpp`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any, NoReturn

import numpy as np

from .. import _core
from .._common.arrays import FloatArray
from ..errors import InvalidInput, near_names

_PARTS = _core.formula_parts()
_OPERATIONS = {name: number for number, name in enumerate(_PARTS["operations"])}
SIGNALS: tuple[str, ...] = _PARTS["signals"]
TARGETS: tuple[str, ...] = _PARTS["targets"]
# Places of a formula beside those targets: the rate of a state, which knows all, and its beginning.
EVERYTHING, OUTSET = "rate", "initial"
_KNOWN = {
    target: tuple(SIGNALS[i] for i in there)
    for target, there in zip(TARGETS, _PARTS["signals_known"], strict=True)
} | {EVERYTHING: SIGNALS}
_KNOWN[OUTSET] = _KNOWN["force_x"]
_HIGHEST_POWER = 8
_LEAST_KNOTS = 2

_UNARY = ("negative", "absolute", "sign", "sin", "cos", "arctan", "sqrt", "exp", "log", "tanh")
_BINARY = ("add", "subtract", "multiply", "divide", "arctan2", "minimum", "maximum", "greater")
_SYMBOLS = {"add": "+", "subtract": "-", "multiply": "*", "divide": "/", "greater": ">"}
# Comparisons the other way round, and what is made of comparisons, which are one or nothing.
_NOT_BELOW = {"greater_equal": ">=", "less_equal": "<="}
_OF_CONDITIONS = {"and": ("multiply", "&"), "or": ("maximum", "|")}
_LOGICAL = {f"{kind}_{name}": name for kind in ("logical", "bitwise") for name in ("and", "or")}

Step = tuple[int, tuple[int, int, int], float]


@dataclass(frozen=True)
class Formula:
    """What a function does to its arguments.

    Attributes
    ----------
    steps : tuple
        Operation, operands, constant; the last is the result.
    text : str
        The same, to read.
    """

    steps: tuple[Step, ...]
    text: str


class _Tape:
    """The steps taken so far; a step that was taken before is not taken again."""

    def __init__(self) -> None:
        self.steps: dict[Step, int] = {}

    def add(self, operation: str, *operands: int, constant: float = 0.0) -> int:
        a, b, c = (*operands, 0, 0, 0)[:3]
        step = (_OPERATIONS[operation], (a, b, c), constant)
        return self.steps.setdefault(step, len(self.steps))


class Traced:
    """Stands for an array while a function is followed."""

    __array_priority__ = 1000.0

    def __init__(
        self, tape: _Tape, place: int, text: str, *, plain: bool = True, condition: bool = False
    ) -> None:
        self._tape, self._place, self._text, self._plain = tape, place, text, plain
        self._condition = condition

    def __array_ufunc__(self, ufunc: np.ufunc, method: str, *inputs: Any, **how: Any) -> Traced:
        name = {"true_divide": "divide", "fabs": "absolute"}.get(ufunc.__name__, ufunc.__name__)
        if method != "__call__" or any(v is not None for v in how.values()):
            raise InvalidInput(f"numpy.{ufunc.__name__}.{method} cannot be followed")
        return self._apply(name, *inputs)

    def __array_function__(
        self, function: Callable[..., Any], types: Any, args: Sequence[Any], how: Mapping[str, Any]
    ) -> Traced:
        if function is np.where and len(args) == 3:
            return self._apply("where", *args)
        if function is np.clip and len(args) == 3:
            return self._apply("minimum", self._apply("maximum", args[0], args[1]), args[2])
        if function is np.interp and len(args) == 3 and not how:
            return self._interpolated(*args)
        raise InvalidInput(f"numpy.{function.__name__} cannot be followed; {_ALLOWED}")

    def _of(self, x: Any) -> Traced:
        if isinstance(x, Traced):
            return x
        try:
            value = float(x)
        except (TypeError, ValueError):
            raise InvalidInput(f"a formula takes numbers, not {type(x).__name__}") from None
        place = self._tape.add("constant", constant=value)
        return Traced(self._tape, place, f"{value:g}", plain=value >= 0.0)

    def _apply(self, name: str, *inputs: Any) -> Traced:
        if name == "square":
            return self._power(self._of(inputs[0]), 2.0)
        if name in ("power", "float_power"):
            return self._power(self._of(inputs[0]), inputs[1])
        if name == "tan":
            return self._apply("sin", *inputs) / self._apply("cos", *inputs)
        if name == "less":
            return self._apply("greater", inputs[1], inputs[0])
        if name == "positive":
            return self._of(inputs[0])
        if name in _NOT_BELOW:
            return self._not_below(name, *inputs)
        if name in _LOGICAL:
            return self._both(_LOGICAL[name], *inputs)
        if name in ("logical_not", "invert"):
            return self._not(self._of(inputs[0]))
        if name not in (*_UNARY, *_BINARY, "where"):
            raise InvalidInput(f"numpy.{name} cannot be followed; {_ALLOWED}")
        given = [self._of(x) for x in inputs]
        place = self._tape.add(name, *(g._place for g in given))
        if name in _SYMBOLS:
            text = f"{given[0]._bound()} {_SYMBOLS[name]} {given[1]._bound()}"
            return Traced(self._tape, place, text, plain=False, condition=name == "greater")
        if name == "negative":
            return Traced(self._tape, place, f"-{given[0]._bound()}", plain=False)
        return Traced(self._tape, place, f"{name}({', '.join(g._text for g in given)})")

    def _not_below(self, name: str, a: Any, b: Any) -> Traced:
        """Whether one is not below the other, which is that the other is not greater."""
        a, b = self._of(a), self._of(b)
        text = f"{a._bound()} {_NOT_BELOW[name]} {b._bound()}"
        greater = (b, a) if name == "greater_equal" else (a, b)
        found = self._not(self._apply("greater", *greater))
        return Traced(self._tape, found._place, text, plain=False, condition=True)

    def _both(self, name: str, a: Any, b: Any) -> Traced:
        """Whether both conditions hold, or one of them."""
        a, b = self._of(a), self._of(b)
        for x in (a, b):
            x._must_be_condition()
        operation, symbol = _OF_CONDITIONS[name]
        place = self._apply(operation, a, b)._place
        text = f"{a._bound()} {symbol} {b._bound()}"
        return Traced(self._tape, place, text, plain=False, condition=True)

    def _not(self, x: Traced) -> Traced:
        x._must_be_condition()
        place = self._apply("subtract", 1.0, x)._place
        return Traced(self._tape, place, f"~{x._bound()}", plain=False, condition=True)

    def _must_be_condition(self) -> None:
        if not self._condition:
            raise InvalidInput(
                f"'&', '|' and '~' join comparisons such as (d.v_x > 3.0), not '{self._text}'"
            )

    def _interpolated(self, x: Any, knots: Any, values: Any) -> Traced:
        """A table, linear between its knots and held beyond them, as numpy.interp has it."""
        try:
            at = [float(k) for k in knots]
        except TypeError:
            raise InvalidInput("numpy.interp: the knots must be a list of numbers") from None
        given = list(values)
        if len(at) != len(given) or len(at) < _LEAST_KNOTS or not (np.diff(at) > 0.0).all():
            raise InvalidInput(
                "numpy.interp: give two or more knots that increase, and a value for each"
            )
        x = self._of(x)
        within = self._apply("minimum", self._apply("maximum", x, at[0]), at[-1])
        slopes = [
            (b - a) / (q - p) for a, b, p, q in zip(given, given[1:], at, at[1:], strict=False)
        ]
        result = given[0] + slopes[0] * (within - at[0])
        for knot, before, after in zip(at[1:], slopes, slopes[1:], strict=False):
            result = result + (after - before) * self._apply("maximum", within - knot, 0.0)
        shown = ", ".join(v._text if isinstance(v, Traced) else f"{float(v):g}" for v in given)
        knots_shown = ", ".join(f"{k:g}" for k in at)
        return Traced(self._tape, result._place, f"interp({x._text}, [{knots_shown}], [{shown}])")

    def _power(self, base: Traced, exponent: Any) -> Traced:
        if isinstance(exponent, Traced):
            return self._apply("exp", self._apply("log", base) * exponent)
        n = float(exponent)
        if n == 0.5:
            return self._apply("sqrt", base)
        if n != int(n):
            return self._apply("exp", self._apply("log", base) * n)
        if abs(n) > _HIGHEST_POWER:
            raise InvalidInput(f"the power {n:g} is higher than {_HIGHEST_POWER}")
        if n <= 0:
            return 1.0 / self._power(base, -n) if n < 0 else self._of(1.0)
        result = base
        for _ in range(int(n) - 1):
            result = Traced(self._tape, (result * base)._place, "")
        return Traced(self._tape, result._place, f"{base._bound()}**{n:g}" if n > 1 else base._text)

    def _bound(self) -> str:
        return self._text if self._plain else f"({self._text})"

    def __add__(self, o: Any) -> Traced:
        return self._apply("add", self, o)

    def __radd__(self, o: Any) -> Traced:
        return self._apply("add", o, self)

    def __sub__(self, o: Any) -> Traced:
        return self._apply("subtract", self, o)

    def __rsub__(self, o: Any) -> Traced:
        return self._apply("subtract", o, self)

    def __mul__(self, o: Any) -> Traced:
        return self._apply("multiply", self, o)

    def __rmul__(self, o: Any) -> Traced:
        return self._apply("multiply", o, self)

    def __truediv__(self, o: Any) -> Traced:
        return self._apply("divide", self, o)

    def __rtruediv__(self, o: Any) -> Traced:
        return self._apply("divide", o, self)

    def __pow__(self, o: Any) -> Traced:
        return self._power(self, o)

    def __rpow__(self, o: Any) -> Traced:
        return self._power(self._of(o), self)

    def __neg__(self) -> Traced:
        return self._apply("negative", self)

    def __pos__(self) -> Traced:
        return self

    def __abs__(self) -> Traced:
        return self._apply("absolute", self)

    def __gt__(self, o: Any) -> Traced:
        return self._apply("greater", self, o)

    def __lt__(self, o: Any) -> Traced:
        return self._apply("greater", o, self)

    def __ge__(self, o: Any) -> Traced:
        return self._apply("greater_equal", self, o)

    def __le__(self, o: Any) -> Traced:
        return self._apply("less_equal", self, o)

    def __and__(self, o: Any) -> Traced:
        return self._apply("logical_and", self, o)

    def __or__(self, o: Any) -> Traced:
        return self._apply("logical_or", self, o)

    def __invert__(self) -> Traced:
        return self._apply("logical_not", self)

    def __bool__(self) -> NoReturn:
        raise InvalidInput(
            "the function decides by a value (`if`, `and`, `max`): it must do the same to every "
            "sample; use numpy.where, numpy.minimum or numpy.maximum, and & | ~ between comparisons"
        )

    def __float__(self) -> NoReturn:
        raise InvalidInput(
            "the function asks for a plain number (`math` does): use the functions of numpy"
        )


_ALLOWED = (
    "allowed are + - * / ** and abs, comparisons with & | ~ between them, numpy's where, clip, "
    "interp, square, power, tan, less, " + ", ".join((*_UNARY, *_BINARY))
)


def trace(
    function: Callable[[Any, Any], Any],
    parameters: Sequence[str],
    target: str,
    what: str,
    *,
    channels: Sequence[str] = (),
    states: Sequence[str] = (),
) -> Formula:
    """Follow a function of signals and parameters.

    Parameters
    ----------
    function : callable
        Takes two namespaces, of signals (`SIGNALS`) and of parameters.
    parameters : sequence of str
    target : str
        What the result is added to, of `TARGETS`, or `EVERYTHING` or `OUTSET`.
    what : str
        What to call it in messages.
    channels, states : sequence of str
        Channels of the log, and states of the effect, that the function may read too.

    Raises
    ------
    InvalidInput
        The function reads a signal the model does not know yet at this place, decides by values,
        calls what cannot be followed, or fails otherwise.
    """
    tape = _Tape()
    known = _KNOWN[target]

    def read(kind: str, names: Sequence[str]) -> dict[str, Traced]:
        of = SIGNALS.index if kind == "signal" else list(names).index
        return {n: Traced(tape, tape.add(kind, of(n)), n) for n in names}

    try:
        d = read("signal", known) | read("channel", channels) | read("state", states)
        result = function(SimpleNamespace(**d), SimpleNamespace(**read("parameter", parameters)))
    except AttributeError as e:
        signals, lapse = (*known, *channels, *states), str(e)
        if isinstance(e.obj, SimpleNamespace):
            name = str(e.name)
            lapse = f"there is no '{name}' here{near_names(name, (*signals, *parameters))}"
        raise InvalidInput(
            f"{what}: {lapse}; its signals are {', '.join(signals)}, "
            f"its parameters {', '.join(parameters)}"
        ) from e
    except InvalidInput as e:
        raise InvalidInput(f"{what}: {e}") from e
    except Exception as e:
        raise InvalidInput(
            f"{what}: the function fails ({type(e).__name__}: {e}); give one of two arguments, "
            f"signals and parameters"
        ) from e
    if not isinstance(result, Traced) and target in (EVERYTHING, OUTSET):
        result = Traced(tape, 0, "")._of(result)
    if not isinstance(result, Traced):
        raise InvalidInput(
            f"{what}: the result depends on no signal and no parameter, it is {result!r}"
        )
    return Formula(_needed(list(tape.steps), result._place), result._text)


def _needed(steps: list[Step], last: int) -> tuple[Step, ...]:
    """The steps that the last one needs, numbered anew."""
    leaves = {_OPERATIONS[k] for k in ("constant", "signal", "parameter", "channel", "state")}
    operands = {_OPERATIONS[k]: 1 for k in _UNARY} | {_OPERATIONS[k]: 2 for k in _BINARY}
    operands[_OPERATIONS["where"]] = 3
    wanted = {last}
    for i in range(last, -1, -1):
        if i in wanted and steps[i][0] not in leaves:
            wanted |= set(steps[i][1][: operands[steps[i][0]]])
    places = {old: new for new, old in enumerate(sorted(wanted))}
    kept = []
    for old in sorted(wanted):
        operation, (a, b, c), constant = steps[old]
        if operation not in leaves:
            a, b, c = (places.get(x, 0) for x in (a, b, c))
        kept.append((operation, (a, b, c), constant))
    return tuple(kept)


def evaluate(
    function: Callable[[Any, Any], Any],
    target: str,
    signals: Mapping[str, FloatArray],
    parameters: Mapping[str, float],
) -> FloatArray:
    """The function's values on arrays, as NumPy works them out."""
    hidden = set(SIGNALS) - set(_KNOWN[target])
    known = {n: x for n, x in signals.items() if n not in hidden}
    result = function(SimpleNamespace(**known), SimpleNamespace(**parameters))
    n = len(next(iter(signals.values())))
    return np.broadcast_to(np.asarray(result, dtype=float), (n,)).astype(float)
