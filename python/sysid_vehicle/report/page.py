"""Pieces of a self-contained HTML page: no scripts, no other files, light and dark, print."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Sequence
from html import escape
from typing import TYPE_CHECKING

from .._style import inline_svg
from .._text import html_table

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["bars", "bullets", "fold", "heading", "page", "panel", "paragraph", "picture", "table"]

# Dark blue and vermilion differ in lightness too (Okabe & Ito, 2008): no name needs colour vision.
_CSS = """
:root { color-scheme: light dark; --ink: #111; --paper: #fff; --mute: #5c5c5c; --grid: #b0b0b0;
  --unseen: #dcdcdc; --line: #c8c8c8; --panel: #f6f6f6; --before: #c05000; --after: #0072b2;
  --truth: #00805c; --warn: #8a2b00; }
@media (prefers-color-scheme: dark) { :root { --ink: #e8e8e8; --paper: #16181b; --mute: #a0a0a0;
  --grid: #5a5a5a; --unseen: #3a3d42; --line: #454950; --panel: #1e2125; --before: #ff9a4d;
  --after: #5cb8f0; --truth: #3ccfa0; --warn: #ffb38a; } }
* { stroke-linejoin: round; stroke-linecap: butt; box-sizing: border-box; }
body { font: 15px/1.45 system-ui, "Segoe UI", Helvetica, Arial, sans-serif; color: var(--ink);
  background: var(--paper); max-width: 86rem; margin: 0 auto; padding: 0.6rem 1rem; }
h1 { font-size: 1.35rem; margin: 0 0 0.1rem; }
h2 { font-size: 1.05rem; margin: 1.2rem 0 0.4rem; }
h3 { font-size: 0.95rem; margin: 0.8rem 0 0.2rem; }
p { margin: 0.3rem 0; } ul { margin: 0.3rem 0; padding-left: 1.3rem; }
p.lead { font-size: 1rem; }
p.small, .panel p { font-size: 0.85rem; }
section.screen { display: grid; grid-template-columns: repeat(12, minmax(0, 1fr)); gap: 0.6rem; }
.panel { background: var(--panel); border: 1px solid var(--line); border-radius: 6px;
  padding: 0.4rem 0.7rem; overflow: hidden; }
.panel h2 { margin: 0 0 0.2rem; font-size: 0.95rem; }
.w4 { grid-column: span 4; } .w5 { grid-column: span 5; } .w7 { grid-column: span 7; }
@media (max-width: 900px) { .w4, .w5, .w7 { grid-column: span 12; } }
.bars { display: grid; grid-template-columns: minmax(6rem, max-content) 1fr max-content;
  gap: 0.15rem 0.5rem; font-size: 0.85rem; align-items: center; }
.bars i { display: block; height: 0.85rem; background: var(--after); min-width: 1px; }
.bars i.before { background: repeating-linear-gradient(45deg, var(--before) 0 5px,
  color-mix(in srgb, var(--before) 70%, var(--paper)) 5px 8px); }
.bars i.mute { background: var(--grid); }
table { border-collapse: collapse; margin: 0.4rem 0; font-size: 0.85rem; }
th, td { padding: 0.1rem 0.55rem; text-align: right; border-bottom: 1px solid var(--line); }
th:first-child, td:first-child { text-align: left; white-space: nowrap; }
div.wide { overflow-x: auto; }
div.ranking th:nth-child(n+5), div.ranking td:nth-child(n+5), div.text th, div.text td
  { text-align: left; }
figure { margin: 0.3rem 0; }
figure svg { display: block; max-width: 100%; height: auto; }
figure svg text { fill: var(--ink); font-family: inherit !important; }
figcaption { font-size: 0.85rem; color: var(--mute); max-width: 60rem; }
details { border-top: 1px solid var(--line); padding: 0.3rem 0; }
summary { cursor: pointer; font-weight: 600; }
details > :not(summary) { max-width: 62rem; }
li.warning { color: var(--warn); }
@media print {
  :root { color-scheme: light; --ink: #111; --paper: #fff; --mute: #5c5c5c; --grid: #b0b0b0;
    --unseen: #dcdcdc; --line: #c8c8c8; --panel: #fff; --before: #c05000; --after: #0072b2;
    --truth: #00805c; --warn: #8a2b00; }
  @page { size: A4 landscape; margin: 12mm; }
  body { font-size: 9.5pt; max-width: none; padding: 0; print-color-adjust: exact;
    -webkit-print-color-adjust: exact; }
  details::details-content { content-visibility: visible; display: block; height: auto; }
  .panel, figure, tr { break-inside: avoid; }
  summary, h2, h3 { break-after: avoid; }
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
