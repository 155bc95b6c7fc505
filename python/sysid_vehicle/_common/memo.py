"""Answers about fits that are remembered while a study asks again."""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache
from typing import TYPE_CHECKING, Any, TypeVar

if TYPE_CHECKING:
    from functools import _lru_cache_wrapper

R = TypeVar("R")

_memories: list[_lru_cache_wrapper[Any]] = []


def remembered(most: int) -> Callable[[Callable[..., R]], _lru_cache_wrapper[R]]:
    """Remember the last `most` answers of a function, until `forget`."""

    def of(function: Callable[..., R]) -> _lru_cache_wrapper[R]:
        memory = lru_cache(maxsize=most)(function)
        _memories.append(memory)
        return memory

    return of


def forget() -> None:
    """Let go of all that is remembered, with the fits and the logs that it is about."""
    for memory in _memories:
        memory.cache_clear()
