"""Checks of plain arguments that many functions take: numbers, counts, seeds."""

from __future__ import annotations

import math
import os
from collections.abc import Mapping, Sequence
from dataclasses import fields
from decimal import Decimal
from numbers import Integral, Real

import numpy as np

from ..errors import InvalidInput


def real(value: object) -> float | None:
    """The real scalar as a float, whatever its type; None for what is none.

    Of NumPy, scalars and arrays without dimensions count. Truth values do not.
    """
    if isinstance(value, np.ndarray) and value.ndim == 0:
        value = value[()]
    if isinstance(value, bool | np.bool_) or not isinstance(value, Real | Decimal):
        return None
    try:
        return float(value)
    except OverflowError:
        return math.inf if value > 0 else -math.inf  # type: ignore[operator]


def whole(value: object, name: str, least: int = 0) -> int:
    """The whole number as an int.

    Raises
    ------
    InvalidInput
        It is no whole number, or below `least`.
    """
    if isinstance(value, np.ndarray) and value.ndim == 0:
        value = value[()]
    if isinstance(value, bool) or not isinstance(value, Integral) or value < least:
        raise InvalidInput(f"{name} = {value!r}: give a whole number, {least} or more")
    return int(value)


def pair(value: object, name: str, meaning: str) -> tuple[float, float]:
    """The two real numbers as floats.

    Raises
    ------
    InvalidInput
        It is not two numbers; the message says what they mean.
    """
    several = [real(v) for v in value] if isinstance(value, Sequence | np.ndarray) else []
    numbers = [v for v in several if v is not None]
    if len(numbers) != 2 or len(several) != 2:
        raise InvalidInput(f"{name}: {value!r} was given; give {meaning}, two numbers")
    return numbers[0], numbers[1]


def duration(seconds: object, name: str) -> float:
    """The duration as a float [s]; endless where it is None.

    Raises
    ------
    InvalidInput
        It is no number above 0.
    """
    value = math.inf if seconds is None else real(seconds)
    if value is None or not value > 0.0:
        raise InvalidInput(f"{name} = {seconds!r}: give seconds, above 0")
    return value


def generator(seed: object) -> np.random.Generator:
    """The generator, or a new one of this seed.

    Raises
    ------
    InvalidInput
        The seed is neither a generator nor a whole number from zero up. Nothing, which numpy takes
        for "never the same twice", is none.
    """
    if isinstance(seed, np.random.Generator):
        return seed
    try:
        return np.random.default_rng(whole(seed, "seed"))
    except InvalidInput:
        raise InvalidInput(
            f"seed = {seed!r}; give a whole number from zero up, or a numpy generator"
        ) from None


def check_positive(where: str, **values: float | Sequence[float]) -> None:
    """Refuse arguments that are not positive numbers, or sequences that hold none.

    Raises
    ------
    InvalidInput
        The message names the first such argument.
    """
    for name, given in values.items():
        numbers = np.atleast_1d(np.asarray(given, dtype=float))
        if numbers.size == 0:
            raise InvalidInput(f"{where}: {name} is empty; give one value or more")
        if not ((numbers > 0.0) & (numbers < np.inf)).all():
            raise InvalidInput(f"{where}: {name} = {given!r}; give positive numbers")


def check_positive_fields(thing: object, *names: str) -> None:
    """Refuse a dataclass of which a named field is not positive, as `check_positive` does."""
    check_positive(type(thing).__name__, **{name: getattr(thing, name) for name in names})


def check_not_negative(thing: object, *, finite: bool = False) -> None:
    """Refuse a dataclass of which a number is below zero, or, if asked, infinite.

    Raises
    ------
    InvalidInput
        The message names the first such field.
    """
    for field in fields(thing):  # type: ignore[arg-type]
        value = getattr(thing, field.name)
        if isinstance(value, float) and not (value >= 0.0 and (value < math.inf or not finite)):
            raise InvalidInput(
                f"{type(thing).__name__}: {field.name} = {value!r}; give zero or a positive number"
            )


# What to do with something that is given where something else is wanted.
_REMEDIES = {
    ("Log", "path"): "read it with read_log first",
    ("Log", "table"): "make a log of it with Log.from_arrays",
    ("Log", "Drive"): "pass its .log",
    ("Log", "Fit"): "the fit comes first, then the logs",
    ("Log", "Model"): "the model comes first, then the logs",
    ("Fit", "Model"): "fit it first: identify(model, logs)",
    ("Fit", "Vehicle"): "fit its model first: identify(Model(vehicle), logs)",
    ("Fit", "Study"): "pass its .fit",
    ("Fit", "Log"): "the fit comes first, then the logs: identify(model, logs) makes one",
    ("Vehicle", "path"): "read the car first: Vehicle.from_toml(path)",
    ("Vehicle", "Model"): "pass its .vehicle",
    ("Vehicle", "Fit"): "pass its .model.vehicle",
    ("Model", "Vehicle"): "make a model of it: Model(vehicle)",
    ("Model", "path"): "read the car first: Model(Vehicle.from_toml(path))",
    ("Model", "Fit"): "pass its .model",
    ("Model", "Study"): "pass its .model",
    ("Model", "Log"): "the model comes first, then the logs",
}


def expect(value: object, wanted: type, function: str) -> None:
    """Refuse what is no `wanted`, with a word on what to do with it.

    Raises
    ------
    InvalidInput
        The value is of another type.
    """
    if isinstance(value, wanted):
        return
    given = type(value).__name__
    kind = given
    if isinstance(value, str | os.PathLike):
        kind = "path"
    elif (wanted.__name__, given) not in _REMEDIES and (
        isinstance(value, Mapping | np.ndarray) or hasattr(value, "columns")
    ):
        kind = "table"
    name = wanted.__name__
    remedy = _REMEDIES.get((name, kind), f"pass {_one(name)}")
    raise InvalidInput(f"{function}: {_one(given)} was given in place of {_one(name)}; {remedy}")


def _one(name: str) -> str:
    return f"an {name}" if name[0] in "AEIOUaeiou" else f"a {name}"
