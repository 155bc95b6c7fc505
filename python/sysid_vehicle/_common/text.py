"""Plain-text and HTML tables, shared by everything that prints."""

from __future__ import annotations

import shutil
import sys
import textwrap
from collections.abc import Callable, Iterable, Sequence
from html import escape
from math import inf, isfinite

HALF_95 = 1.96
"""Standard errors on either side of a value in the 95 % intervals that are told."""


def brief(self: object) -> str:
    """Return the `repr` of a result: its type, and the first line of what it prints."""
    return f"<{type(self).__name__}: {str(self).partition(chr(10))[0]}>"


def number(x: float, digits: int = 4) -> str:
    """A number in few characters."""
    return f"{x:.{digits}g}"


def few(names: Sequence[str], most: int = 4) -> str:
    """The first of some names, and how many there are more."""
    more = len(names) - most
    # One more is as short as its count.
    return ", ".join(names[:most]) + f" and {more} more" if more > 1 else ", ".join(names)


UNBOUNDED = (-inf, inf)
"""Bounds of what may have any value."""


def interval_95(
    value: float, std: float, bounds: tuple[float, float] = UNBOUNDED
) -> tuple[float, float]:
    """The 95 % interval of a value, as far as its bounds allow: no length is negative.

    A value beyond its bounds, as a linear prediction may be, has the nearer bound alone. Of one
    that is not known at all, as the slip at the peak of a tyre without one, it is the bounds.
    """
    if not isfinite(std):
        return bounds
    return within((value - HALF_95 * std, value + HALF_95 * std), bounds)


def within(interval: tuple[float, float], bounds: tuple[float, float]) -> tuple[float, float]:
    """An interval, as far as bounds allow."""
    low, high = (min(max(end, bounds[0]), bounds[1]) for end in interval)
    return low, high


def interval_text(
    interval: tuple[float, float],
    bounds: tuple[float, float] = UNBOUNDED,
    written: Callable[[float], str] = number,
) -> str:
    """An interval in words, which say where it ends at a bound of what a value may be."""
    (low, high), (lower, upper) = map(written, interval), bounds
    low += " (bound)" if isfinite(lower) and interval[0] <= lower else ""
    high += " (bound)" if isfinite(upper) and interval[1] >= upper else ""
    return f"{low} .. {high}"


def with_error(
    value: float, std: float, bounds: tuple[float, float] = UNBOUNDED, digits: int = 3
) -> str:
    """A value with its standard error, or why it has none.

    Where its 95 % interval would pass a bound the interval is told in place of the standard error.
    """
    if not isfinite(std):
        return f"{number(value, digits)} (at a bound, or never felt)"
    found = interval_95(value, std, bounds)
    if bounds[0] <= value <= bounds[1] and found != interval_95(value, std):
        told = interval_text(found, bounds, lambda x: number(x, digits))
        return f"{number(value, digits)} (95 %: {told})"
    return f"{number(value, digits)} +- {number(std, 2)}"


def unit_after(unit: str) -> str:
    """What stands behind a figure: a blank and its unit, nothing for a pure number."""
    return "" if unit == "1" else f" {unit}"


def columns() -> int | None:
    """How many characters a line of the terminal holds; None where nothing is shown in one."""
    shown = sys.stdout is not None and sys.stdout.isatty()
    return shutil.get_terminal_size().columns if shown else None


def wrapped(text: str, width: int) -> str:
    """The lines of a text, those that are too long broken between words, and indented further."""
    lines = []
    for line in text.split("\n"):
        indent = line[: len(line) - len(line.lstrip())]
        lines += _broken(line, width, indent, f"{indent}    "[: width // 2])
    return "\n".join(lines)


def text_table(head: Sequence[str], rows: Sequence[Sequence[str]], width: int | None = None) -> str:
    """Aligned columns; the first is left-aligned, the others right-aligned.

    Parameters
    ----------
    head : sequence of str
    rows : sequence of sequence of str
    width : int, optional
        Of a line, by default that of the terminal, without limit elsewhere. Cells of the widest
        columns are broken between words until the table fits; such columns are left-aligned.
    """
    table = [list(head), *[list(r) for r in rows]]
    widths = [max(len(r[i]) for r in table) for i in range(len(head))]
    limit = columns() if width is None else width
    narrow = widths if limit is None else _narrowed(table, widths, limit)
    left = [i == 0 or narrow[i] < widths[i] for i in range(len(head))]
    lines = []
    for r in table:
        cells = [_broken(c, w) for c, w in zip(r, narrow, strict=True)]
        for k in range(max(map(len, cells))):
            parts = [c[k] if k < len(c) else "" for c in cells]
            aligned = (
                p.ljust(w) if at_left else p.rjust(w)
                for p, w, at_left in zip(parts, narrow, left, strict=True)
            )
            lines.append("  " + "  ".join(aligned).rstrip())
        if r is table[0]:
            lines.append("  " + "  ".join("-" * w for w in narrow))
    return "\n".join(lines)


def _broken(text: str, width: int, first: str = "", rest: str = "") -> list[str]:
    """Lines of whole words; a text that fits stays as it is."""
    if len(text) <= width:
        return [text]
    return textwrap.wrap(
        text,
        width,
        initial_indent=first,
        subsequent_indent=rest,
        break_long_words=False,
        break_on_hyphens=False,
    )


def _narrowed(table: Sequence[Sequence[str]], widths: Sequence[int], limit: int) -> list[int]:
    """Widths of columns whose sum fits a line, none smaller than its longest word."""
    least = [
        max((len(word) for r in table for word in r[i].split()), default=0)
        for i in range(len(widths))
    ]
    narrow = list(widths)
    while sum(narrow) + 2 * len(narrow) > limit:
        wide = [i for i in range(len(narrow)) if narrow[i] > least[i]]
        if not wide:
            break
        narrow[max(wide, key=lambda i: narrow[i])] -= 1
    return narrow


def html_paragraph(text: object) -> str:
    """What it prints as a paragraph."""
    return f"<p>{escape(str(text))}</p>"


def html_list(items: Iterable[object]) -> str:
    """What they print as the items of a list."""
    return "<ul>" + "".join(f"<li>{escape(str(item))}</li>" for item in items) + "</ul>"


def html_text(text: object) -> str:
    """What it prints, line by line as it stands."""
    return f"<pre>{escape(str(text))}</pre>"


def html_table(head: Sequence[str], rows: Sequence[Sequence[str]], caption: str = "") -> str:
    """The same as an HTML table."""
    title = f"<caption>{escape(caption)}</caption>" if caption else ""
    top = "".join(f"<th>{escape(h)}</th>" for h in head)
    body = "".join("<tr>" + "".join(f"<td>{escape(c)}</td>" for c in r) + "</tr>" for r in rows)
    return f"<table>{title}<thead><tr>{top}</tr></thead><tbody>{body}</tbody></table>"
