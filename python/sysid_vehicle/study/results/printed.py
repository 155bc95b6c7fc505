"""A study as text, and in notebooks."""

from __future__ import annotations

from html import escape
from typing import TYPE_CHECKING

from ..._common.text import html_list, html_paragraph, html_table, text_table
from .sentences import ahead, events, left_out, nuisances

if TYPE_CHECKING:
    from ..study import Study

_HEAD = ("step", "train error", "validation error")


def as_text(study: Study) -> str:
    """What a study prints."""
    lines = [f"Verdict: {study.verdict} - {study.meaning}."]
    lines += [f"  {a}" for a in study.added]
    lines += [f"  {text}" for text in (*nuisances(study), *study.sensors)]
    lines += [text_table(_HEAD, _rows(study)), *events(study)]
    lines += [text for text in (ahead(study), study.in_the_end) if text]
    lines += [f"Next: {text}." for text in study.next_steps]
    lines += [f"Warning: {w}" for w in dict.fromkeys((*study.warnings, *left_out(study)))]
    return "\n".join(lines)


def as_html(study: Study) -> str:
    """What a notebook shows of a study."""
    return (
        f"<p><b>{escape(study.verdict)}</b>: {escape(study.meaning)}.</p>"
        + html_list([*study.added, *nuisances(study), *study.sensors])
        + html_table(_HEAD, _rows(study))
        + "".join(map(html_paragraph, events(study)))
        + html_paragraph(f"{ahead(study)} {study.in_the_end}".lstrip())
        + html_list([f"Next: {text}." for text in study.next_steps])
    )


def _rows(study: Study) -> list[list[str]]:
    return [
        [label, f"{a.error:.3f}", f"{b.error:.3f}"]
        for label, a, b in zip(study.steps, study.train, study.test, strict=True)
    ] + [["noise floor", "1.000", "1.000"]]
