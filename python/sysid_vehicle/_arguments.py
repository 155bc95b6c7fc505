"""Checks of plain arguments that many functions take: numbers, counts, seeds."""

from __future__ import annotations

import math
from decimal import Decimal
from numbers import Integral, Real

import numpy as np

from .errors import InvalidInput

__all__ = ["generator", "real", "whole"]


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
        return math.copysign(math.inf, value)


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


def generator(seed: int | np.random.Generator) -> np.random.Generator:
    """The generator, or a new one of this seed.

    Raises
    ------
    InvalidInput
        The seed is neither a generator nor a whole number from zero up.
    """
    if isinstance(seed, np.random.Generator):
        return seed
    return np.random.default_rng(whole(seed, "seed"))
