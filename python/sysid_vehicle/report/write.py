"""From a study to a file."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from .._common.files import as_path, write_text
from .._common.progress import doing
from .._common.threads import in_parallel
from ..errors import InvalidInput
from ..model import Model
from ..study import Study
from .markdown import markdown
from .page import fold, page
from .samples import samples_of
from .screen import first_screen
from .sections import SECTIONS

_HTML, _MARKDOWN = (".html", ".htm", ""), ".md"  # endings of names


def write_report(study: Study, path: str | Path, *, truth: Model | None = None) -> None:
    """Write a study as one self-contained HTML file, whole or not at all; `.md` as Markdown.

    Parameters
    ----------
    study : Study
    path : str or Path
        An existing file is replaced.
    truth : Model, optional
        The car that was simulated, where it is known: its values stand beside the identified ones.

    Raises
    ------
    InvalidInput
        If the folder does not exist or is not writable, or the name promises another kind of file.
    """
    suffix = as_path(path).suffix.lower()
    if suffix not in (*_HTML, _MARKDOWN):
        raise InvalidInput(f"{path}: a report is HTML or Markdown; end the name in .html or .md")
    title = f"Study of {study.model.vehicle.name}"
    with doing("report"):
        _work_out(study)
        samples = samples_of(study)
        first = first_screen(study, samples)
        made = [(name, make(study, samples, truth)) for name, make in SECTIONS]
    folded = [fold(name, parts) for name, parts in made if parts]
    told = "" if samples is None else samples.json()
    whole = page(title, [*first, *folded], told)
    write_text(path, markdown(whole) if suffix == _MARKDOWN else whole)


def _work_out(study: Study) -> None:
    """Ask the study side by side for what the page tells; it keeps the answers."""
    # What takes longest first.
    asked: tuple[Callable[[], object], ...] = (
        lambda: study.hidden,
        lambda: study.where,
        lambda: study.late,
        lambda: study.causes,
        lambda: study.unknown,
        lambda: study.errors_with,
        lambda: study.shares,
        lambda: study.where_baseline,
        lambda: study.horizons,
    )
    in_parallel(lambda ask: ask(), asked)
