"""Pieces of a self-contained HTML page: no other files, light and dark, print."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Sequence
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING

from .._common.style import inline_svg
from .._common.text import html_table

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_SCRIPT = Path(__file__).with_name("page.js").read_text("utf-8")
_CSS = Path(__file__).with_name("page.css").read_text("utf-8")


def page(title: str, parts: Iterable[str], samples: str = "") -> str:
    """Make a whole document.

    `samples` is the JSON of what its charts share, which a script lets the reader explore.
    """
    body = "\n".join(parts)
    if samples:
        told = samples.replace("<", "\\u003c")
        body += f'\n<script type="application/json" id="samples">{told}</script>'
        body += f"\n<script>{_SCRIPT}</script>"
    return (
        '<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f"<title>{escape(title)}</title>\n<style>{_CSS}</style>\n</head>\n<body>\n"
        f"<h1>{escape(title)}</h1>\n{body}\n</body>\n</html>\n"
    )


def heading(text: str, level: int = 2) -> str:
    """Make a heading."""
    return f"<h{level}>{escape(text)}</h{level}>"


def paragraph(text: str, kind: str = "") -> str:
    """Make a paragraph, of the style class `kind`."""
    return f'<p class="{kind}">{escape(text)}</p>' if kind else f"<p>{escape(text)}</p>"


def bullets(items: Iterable[str], kind: str = "") -> str:
    """Make a list of sentences."""
    mark = f' class="{kind}"' if kind else ""
    return "<ul>" + "".join(f"<li{mark}>{escape(i)}</li>" for i in items) + "</ul>"


def table(head: Sequence[str], rows: Sequence[Sequence[str]], kind: str = "") -> str:
    """Make a table, of the style class `kind`, that scrolls by itself on a narrow screen."""
    return f'<div class="wide {kind}">{html_table(head, rows)}</div>'


def picture(figure: Figure, caption: str) -> str:
    """Put a figure into the page, with a caption that stands for it where none is shown."""
    name = hashlib.sha256(caption.encode()).hexdigest()[:12]
    width, height = (round(96.0 * float(x)) for x in figure.get_size_inches())
    drawn = inline_svg(figure, name).replace(
        "<svg",
        f'<svg role="img" aria-label="{escape(caption, quote=True)}" '
        f'width="{width}" height="{height}"',
        1,
    )
    return f"<figure>{drawn}<figcaption>{escape(caption)}</figcaption></figure>"


def panel(title: str, parts: Iterable[str], width: int) -> str:
    """Make a part of the first screen, so many of its twelve columns wide."""
    body = "".join(parts)
    return f'<div class="panel w{width}"><h2>{escape(title)}</h2>{body}</div>'


def fold(title: str, parts: Iterable[str]) -> str:
    """Make a section that opens when it is asked for, and in print."""
    body = "\n".join(parts)
    return f"<details><summary>{escape(title)}</summary>\n{body}\n</details>"


def bars(rows: Iterable[tuple[str, float, str, str]]) -> str:
    """Make horizontal bars.

    Parameters
    ----------
    rows : iterable of (str, float, str, str)
        Label, length from 0 to 1, text, style: `before`, `mute` or nothing.
    """
    cells = []
    for label, length, text, kind in rows:
        share = 100.0 * min(max(length, 0.0), 1.0)
        mark = f' class="{escape(kind, quote=True)}"' if kind else ""
        cells.append(
            f'<span>{escape(label)}</span><span><i{mark} style="width: {share:.1f}%"></i></span>'
            f"<span>{escape(text)}</span>"
        )
    return f'<div class="bars">{"".join(cells)}</div>'
