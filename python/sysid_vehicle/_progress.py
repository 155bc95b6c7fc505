"""Progress bars, loaded where one is shown."""

from collections.abc import Iterable
from typing import TypeVar

T = TypeVar("T")


def with_progress(
    items: Iterable[T], description: str, *, total: int | None = None, shown: bool
) -> Iterable[T]:
    """Pass items on, with a bar that counts them if it is to be shown."""
    if not shown:
        return items
    from tqdm.auto import tqdm

    bar: Iterable[T] = tqdm(items, desc=description, total=total)
    return bar
