"""Who gives an argument of another kind than is written is told which, and what to give.

One rule for all public functions. Nothing is looked at beforehand, so that whatever works goes on
working, and what a function says of its arguments itself comes first. Where one fails with words of
Python or NumPy, its arguments are compared with its annotations: if one is of another kind, that is
the cause; if none is, the error is not the caller's and stays as it is.
"""

from __future__ import annotations

import dataclasses
import functools
import inspect
import os
import types
import typing
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Literal, ParamSpec, TypeVar, Union

import numpy as np
import numpy.typing as npt

from ..errors import InvalidInput, SysidError
from .arguments import expect, real

P = ParamSpec("P")
R = TypeVar("R")
_SEVERAL = (Sequence, Collection, Iterable, tuple, list, set, frozenset)
_SHOWN = 60  # characters of what was given
_ANSWERED = ("Log", "Fit", "Model", "Vehicle")  # what to do in place of these is known
_RAW = (TypeError, AttributeError, ValueError, LookupError, ArithmeticError)


def typed(function: Callable[P, R]) -> Callable[P, R]:
    """Name the argument where the function fails as it is of another kind than annotated.

    Raises
    ------
    InvalidInput
        In place of what Python or NumPy raise; the message names function, argument, and what to
        give.
    """

    @functools.wraps(function)
    def checked(*args: P.args, **kwargs: P.kwargs) -> R:
        try:
            return function(*args, **kwargs)
        except SysidError:
            raise
        except _RAW as error:
            signature = inspect.signature(function)
            try:
                given = signature.bind(*args, **kwargs).arguments
            except TypeError:
                raise error from None  # Python's own words for what is missing are clear
            _blame(function, given, signature, error)
            raise

    return checked


@contextmanager
def blaming(function: Callable[..., Any], given: Mapping[str, Any]) -> Iterator[None]:
    """Do the same for arguments of a function that are looked at before it is called."""
    try:
        yield
    except SysidError:
        raise
    except _RAW as error:
        _blame(function, given, inspect.signature(function), error)
        raise


def _blame(
    function: Callable[..., Any],
    given: Mapping[str, Any],
    signature: inspect.Signature,
    error: Exception,
) -> None:
    hints = _hints(function)
    for name, value in given.items():
        kind = signature.parameters[name].kind
        if name not in hints or kind is inspect.Parameter.VAR_KEYWORD:
            continue
        where = f"{function.__qualname__.removesuffix('.__init__')}: {name}"
        for one in value if kind is inspect.Parameter.VAR_POSITIONAL else (value,):
            _refuse_other(one, hints[name], where, error)


def typed_fields(check: Callable[[Any], None]) -> Callable[[Any], None]:
    """Do for the fields of a dataclass in its ``__post_init__`` what `typed` does for arguments."""

    @functools.wraps(check)
    def checked(self: Any) -> None:
        try:
            check(self)
        except SysidError:
            raise
        except _RAW as error:
            check_types(self, error)
            raise

    return checked


def check_types(thing: Any, error: Exception | None = None) -> None:
    """Refuse a dataclass with a field of another kind than its annotation says."""
    owner: Any = type(thing)
    hints = _hints(owner)
    for field in dataclasses.fields(thing):
        where = f"{owner.__name__}: {field.name}"
        _refuse_other(getattr(thing, field.name), hints.get(field.name, Any), where, error)


@functools.cache
def _hints(owner: Any) -> dict[str, Any]:
    try:
        return typing.get_type_hints(owner)
    except NameError:  # names that only type checkers import
        return {
            name: found
            for name, text in owner.__annotations__.items()
            if (found := _read(text, owner)) is not None
        }


def _read(text: Any, owner: Any) -> Any:
    try:
        return typing.get_type_hints(
            types.SimpleNamespace(__annotations__={"it": text}),
            globalns=vars(inspect.getmodule(owner)),
        )["it"]
    except NameError:
        return None


def _refuse_other(value: object, hint: Any, where: str, error: Exception | None) -> None:
    if not _fits(value, hint):
        wanted = typing.get_args(hint)[0] if isinstance(hint, types.UnionType) else hint
        if getattr(wanted, "__name__", "") in _ANSWERED and (
            isinstance(value, str) or not isinstance(value, Sequence)
        ):
            expect(value, wanted, where)
        shown = repr(value)
        shown = shown if len(shown) <= _SHOWN else f"{shown[: _SHOWN - 3]}..."
        shown = " ".join(shown.split())
        raise InvalidInput(
            f"{where} = {shown} ({type(value).__name__}); give {_said(hint)}"
        ) from error


def _fits(value: object, hint: Any) -> bool:
    origin, inner = typing.get_origin(hint), typing.get_args(hint)
    if _takes_arrays(hint):
        return (value is None and type(None) in inner) or _makes_an_array(value)
    if origin in (Union, types.UnionType):
        return any(_fits(value, one) for one in inner)
    if origin is Literal:
        return any(value is one or (type(value) is type(one) and value == one) for one in inner)
    if hint is None or hint is type(None):
        return value is None
    if hint is float:
        return real(value) is not None
    if hint is int:
        return isinstance(value, int | np.integer) and not isinstance(value, bool)
    if hint is bool:
        return isinstance(value, bool | np.bool_)
    if origin is Mapping or origin is dict:
        return isinstance(value, Mapping) and all(
            _fits(k, inner[0]) and _fits(v, inner[1]) for k, v in value.items()
        )
    if origin in _SEVERAL:
        return _fits_several(value, origin, inner)
    if origin is not None and origin is not np.ndarray:
        return callable(value) if origin is Callable else True  # what has other arguments
    if hint is np.ndarray or origin is np.ndarray:
        return _makes_an_array(value)  # who takes it checks its shape
    if hint is Path:
        return isinstance(value, os.PathLike)
    if isinstance(hint, type) and not getattr(hint, "_is_protocol", False):
        return isinstance(value, hint)
    return True


def _takes_arrays(hint: Any) -> bool:
    """Whether a union holds all kinds of `numpy.typing.ArrayLike`, by itself or beside others."""
    is_union = typing.get_origin(hint) in (Union, types.UnionType)
    return is_union and {*typing.get_args(npt.ArrayLike)} <= {*typing.get_args(hint)}


def _makes_an_array(value: object) -> bool:
    try:
        np.asarray(value, dtype=np.float64)
    except (TypeError, ValueError):
        return False
    return value is not None


def _fits_several(value: object, origin: Any, inner: tuple[Any, ...]) -> bool:
    if isinstance(value, str | bytes | Mapping) or not isinstance(value, Iterable):
        return False
    if not isinstance(value, Collection):
        return origin is Iterable  # an iterator is used up by looking at it
    if origin is tuple and inner and inner[-1] is not Ellipsis:
        return len(value) == len(inner) and all(map(_fits, value, inner))
    return not inner or all(_fits(one, inner[0]) for one in value)


def _said(hint: Any) -> str:
    """The annotation in words."""
    origin, inner = typing.get_origin(hint), typing.get_args(hint)
    if _takes_arrays(hint):
        return "a number or an array of numbers"
    if origin in (Union, types.UnionType):
        return " or ".join(dict.fromkeys(_said(one) for one in inner))
    if origin is Literal:
        return " or ".join(repr(one) for one in inner)
    if hint is None or hint is type(None):
        return "None"
    if origin is Mapping or origin is dict:
        return f"a mapping from {_said(inner[0])} to {_said(inner[1])}"
    if origin in _SEVERAL:
        several = list(dict.fromkeys(_said(one) for one in inner if one is not Ellipsis))
        return f"a list of {' and '.join(map(_plural, several))}" if several else "a list"
    if origin is Callable or hint is Callable:
        return "a function"
    names = {float: "a number", int: "a whole number", bool: "True or False", str: "a string"}
    if hint in names:
        return names[hint]
    if hint is Path:
        return "a path"
    if hint is np.ndarray or origin is np.ndarray:
        return "an array of numbers"
    name = getattr(hint, "__name__", str(hint))
    return f"an {name}" if name[0] in "AEIOU" else f"a {name}"


def _plural(one: str) -> str:
    return " or ".join(f"{word.partition(' ')[2]}s" for word in one.split(" or "))
