"""One description of what a result says, for the text it prints and for notebooks."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterable, Sequence
from typing import NamedTuple

from .text import brief, html_list, html_paragraph, html_table, html_text, text_table


class Table(NamedTuple):
    """Columns under their heads."""

    head: Sequence[str]
    rows: Sequence[Sequence[str]]


Part = str | Table | list[str]
"""A paragraph, a table, or remarks, each on a line of its own."""


class Printed(ABC):
    """A result that prints, and shows itself in a notebook, by its `_parts`."""

    @abstractmethod
    def _parts(self) -> Iterable[Part]: ...

    def __str__(self) -> str:
        return "\n".join(_text(part) for part in self._parts() if part)

    def _repr_html_(self) -> str:
        return "".join(_html(part) for part in self._parts() if part)


class Told:
    """A result that shows itself in a notebook as it prints, and whose `repr` is the first line.

    A dataclass that derives from it has ``repr=False``.
    """

    __repr__ = brief
    _repr_html_ = html_text


def _text(part: Part) -> str:
    if isinstance(part, Table):
        return text_table(part.head, part.rows)
    return part if isinstance(part, str) else "\n".join(part)


def _html(part: Part) -> str:
    if isinstance(part, Table):
        return html_table(part.head, part.rows)
    return html_paragraph(part) if isinstance(part, str) else html_list(part)
