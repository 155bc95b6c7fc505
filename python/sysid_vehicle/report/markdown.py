"""A page of the report as Markdown: its text and tables, without its charts."""

from __future__ import annotations

from html.parser import HTMLParser
from itertools import pairwise

_SKIPPED = {"figure", "style", "script", "title"}
_TEXT = {"p", "li", "h1", "h2", "h3", "summary", "th", "td", "span"}
_MARKS = {"h1": "# ", "h2": "## ", "summary": "## ", "h3": "### ", "li": "- ", "p": ""}


class _Writer(HTMLParser):
    """Turns the elements that a report is made of into lines."""

    def __init__(self) -> None:
        super().__init__()
        self.blocks: list[str] = []
        self._words: list[str] = []
        self._cells: list[str] = []
        self._rows: list[list[str]] = []
        self._inside: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        classes = dict(attrs).get("class") or ""
        self._inside.append(f"{tag}.bars" if classes == "bars" else tag)
        if tag in _TEXT:
            self._words = []

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        pass  # parts of charts

    def handle_data(self, data: str) -> None:
        if not _SKIPPED & set(self._inside):
            self._words.append(data)

    def handle_endtag(self, tag: str) -> None:
        if _SKIPPED & set(self._inside):
            self._close(tag)
            return
        text = _plain("".join(self._words))
        if tag in ("th", "td"):
            self._cells.append(text.replace("|", "\\|"))
        elif tag == "tr":
            self._rows.append(self._cells)
            self._cells = []
        elif tag == "table":
            self._table()
        elif tag == "span" and "div.bars" in self._inside:
            self._cells += [text] if text else []
        elif tag == "div" and self._inside[-1] == "div.bars":
            pairs = zip(self._cells[::2], self._cells[1::2], strict=True)
            self.blocks.append("\n".join(f"- {label}: {told}" for label, told in pairs))
            self._cells = []
        elif tag == "li" and self.blocks and self.blocks[-1].startswith("- "):
            self.blocks[-1] += f"\n- {text}"
        elif tag in _MARKS and text:
            self.blocks.append(_MARKS[tag] + text)
        elif tag == "ul":
            self.blocks.append("")  # a list after this is another one
        self._close(tag)
        if tag in _TEXT:
            self._words = []

    def _close(self, tag: str) -> None:
        while self._inside and self._inside.pop().removesuffix(".bars") != tag:
            pass  # elements without an end, such as meta

    def _table(self) -> None:
        head, *rows = self._rows
        lines = [head, ["---"] * len(head), *rows]
        self.blocks.append("\n".join(f"| {' | '.join(line)} |" for line in lines))
        self._rows = []


def _plain(text: str) -> str:
    """One line, in which nothing is markup."""
    line = " ".join(text.split())
    for mark in ("\\", "`", "*", "_", "<"):
        line = line.replace(mark, f"\\{mark}")
    return line


def markdown(page: str) -> str:
    """The text of a page, its tables and bars.

    Parameters
    ----------
    page : str
        HTML of the pieces of `sysid_vehicle.report.page`.
    """
    writer = _Writer()
    writer.feed(page)
    writer.close()
    blocks = [block for block in writer.blocks if block]
    empty = {i for i, (a, b) in enumerate(pairwise(blocks)) if a[:3] == b[:3] == "## "}
    return "\n\n".join(b for i, b in enumerate(blocks) if i not in empty) + "\n"
