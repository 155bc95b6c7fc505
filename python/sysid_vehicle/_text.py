"""Plain-text and HTML tables, shared by everything that prints."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from html import escape
from math import isfinite

__all__ = [
    "brief",
    "html_list",
    "html_paragraph",
    "html_table",
    "html_text",
    "number",
    "text_table",
    "with_error",
]


def brief(self: object) -> str:
    """Return the `repr` of a result: its type, and the first line of what it prints."""
    return f"<{type(self).__name__}: {str(self).partition(chr(10))[0]}>"


def number(x: float, digits: int = 4) -> str:
    """A number in few characters."""
    return f"{x:.{digits}g}"


def with_error(value: float, std: float) -> str:
    """A value with its standard error, or why it has none."""
    if not isfinite(std):
        return f"{number(value, 3)} (at a bound, or never felt)"
    return f"{number(value, 3)} +- {number(std, 2)}"


def text_table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Aligned columns; the first is left-aligned, the others right-aligned."""
    table = [list(head), *[list(r) for r in rows]]
    widths = [max(len(r[i]) for r in table) for i in range(len(head))]
    lines = []
    for r in table:
        cells = [
            r[0].ljust(widths[0]),
            *(c.rjust(w) for c, w in zip(r[1:], widths[1:], strict=True)),
        ]
        lines.append("  " + "  ".join(cells).rstrip())
    lines.insert(1, "  " + "  ".join("-" * w for w in widths))
    return "\n".join(lines)


def html_paragraph(text: object) -> str:
    """What it prints as a paragraph."""
    return f"<p>{escape(str(text))}</p>"


def html_list(items: Iterable[object]) -> str:
    """What they print as the items of a list."""
    return "<ul>" + "".join(f"<li>{escape(str(item))}</li>" for item in items) + "</ul>"


def html_text(text: object) -> str:
    """What it prints, line by line as it stands."""
    return f"<pre>{escape(str(text))}</pre>"


def html_table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """The same as an HTML table."""
    top = "".join(f"<th>{escape(h)}</th>" for h in head)
    body = "".join("<tr>" + "".join(f"<td>{escape(c)}</td>" for c in r) + "</tr>" for r in rows)
    return f"<table><thead><tr>{top}</tr></thead><tbody>{body}</tbody></table>"
