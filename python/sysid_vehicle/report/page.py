"""Pieces of a self-contained HTML page: no scripts, no other files."""

from __future__ import annotations

import base64
from collections.abc import Iterable, Sequence
from html import escape
from typing import TYPE_CHECKING

from .._style import svg
from .._text import html_table

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["bullets", "heading", "page", "paragraph", "picture", "table"]

_CSS = """
body { font: 16px/1.5 Georgia, "DejaVu Serif", serif; color: #111; background: #fff;
       max-width: 56rem; margin: 2rem auto; padding: 0 1rem; }
h1, h2, h3, th, figcaption { font-family: Helvetica, Arial, "DejaVu Sans", sans-serif; }
h1 { font-size: 1.7rem; margin-bottom: 0.2rem; }
h2 { font-size: 1.25rem; margin-top: 2.2rem; border-bottom: 1px solid #bbb; }
h3 { font-size: 1.05rem; margin-bottom: 0.3rem; }
p.lead { font-size: 1.1rem; }
table { border-collapse: collapse; margin: 0.8rem 0; font-size: 0.85rem; }
th, td { padding: 0.15rem 0.6rem; text-align: right; border-bottom: 1px solid #ddd; }
th { border-bottom: 1px solid #444; }
th:first-child, td:first-child { text-align: left; white-space: nowrap; }
div.wide { overflow-x: auto; }
div.ranking th:nth-child(n+5), div.ranking td:nth-child(n+5) { text-align: left; }
figure { margin: 1rem 0; }
figure img { max-width: 100%; height: auto; }
figcaption { font-size: 0.85rem; color: #444; }
li.warning { color: #8a2b00; }
@media print {
  body { font-size: 10pt; max-width: none; margin: 0; }
  figure, table, tr { break-inside: avoid; }
  h2, h3 { break-after: avoid; }
  div.wide { overflow: visible; }
}
"""


def page(title: str, parts: Iterable[str]) -> str:
    """Make a whole document."""
    body = "\n".join(parts)
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
    """Put a figure into the page as an image, which its caption stands for where none is shown."""
    data = base64.b64encode(svg(figure)).decode("ascii")
    text = escape(caption)
    return (
        f'<figure><img src="data:image/svg+xml;base64,{data}" alt="{escape(caption, quote=True)}">'
        f"<figcaption>{text}</figcaption></figure>"
    )
