"""Answers about fits that are remembered while a study asks again."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable, Hashable
from functools import update_wrapper
from threading import Lock
from typing import Generic, TypeVar

R = TypeVar("R")


class Memory(Generic[R]):
    """A function that remembers its last answers.

    Parameters
    ----------
    function : callable
        Of hashable arguments; fits and driving are so by identity.
    most : int
        Answers that are kept.
    """

    def __init__(self, function: Callable[..., R], most: int) -> None:
        update_wrapper(self, function)
        self._function, self._most = function, most
        self._lock = Lock()
        self._answers: OrderedDict[tuple[Hashable, ...], R] = OrderedDict()

    def __call__(self, *asked: Hashable) -> R:
        """The answer; threads that ask at the same time may both work it out."""
        with self._lock:
            if asked in self._answers:
                self._answers.move_to_end(asked)
                return self._answers[asked]
        answer = self._function(*asked)
        with self._lock:
            answer = self._answers.setdefault(asked, answer)
            while len(self._answers) > self._most:
                self._answers.popitem(last=False)
        return answer

    def known(self) -> dict[tuple[Hashable, ...], R]:
        """What is remembered, by what was asked."""
        with self._lock:
            return dict(self._answers)

    def __len__(self) -> int:
        """How many answers are remembered."""
        return len(self._answers)

    def cache_clear(self) -> None:
        """Let go of all answers."""
        with self._lock:
            self._answers.clear()


_memories: list[Memory[object]] = []


def remembered(most: int) -> Callable[[Callable[..., R]], Memory[R]]:
    """Remember the last `most` answers of a function, until `forget`."""

    def of(function: Callable[..., R]) -> Memory[R]:
        memory = Memory(function, most)
        _memories.append(memory)  # type: ignore[arg-type]
        return memory

    return of


def forget() -> None:
    """Let go of all that is remembered, with the fits and the logs that it is about."""
    for memory in _memories:
        memory.cache_clear()
