"""Progress of long calls, told where somebody watches."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterable
from typing import TypeVar

T = TypeVar("T")

_SILENT_S = 2.0  # before a bar that nobody asked for


def watched() -> bool:
    """Whether this process writes to a terminal or to a notebook."""
    kernel = sys.modules.get("ipykernel.kernelapp")
    if kernel is not None and kernel.IPKernelApp.initialized():
        return True
    return sys.stderr is not None and sys.stderr.isatty()


def with_progress(
    items: Iterable[T], description: str, *, total: int | None = None, shown: bool | None
) -> Iterable[T]:
    """Pass items on, with a bar that counts them.

    Parameters
    ----------
    items : iterable
    description : str
        What is counted.
    total : int, optional
        How many, where `items` have no length.
    shown : bool, optional
        None: where somebody watches, once it has taken two seconds.
    """
    if not (watched() if shown is None else shown):
        return items
    from tqdm.auto import tqdm

    delay = _SILENT_S if shown is None else 0.0
    bar: Iterable[T] = tqdm(items, desc=description, total=total, delay=delay, leave=bool(shown))
    return bar


def teller(shown: bool | None) -> Callable[[str], None]:
    """Return what tells a sentence about each step: to the error stream, or to nobody."""
    return _tell if (watched() if shown is None else shown) else _silent


def _tell(text: str) -> None:
    print(text, file=sys.stderr, flush=True)


def _silent(_: str) -> None:
    pass
