"""The demonstration from the first metre to the report."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from .._common.arguments import generator
from .._common.text import brief
from ..model import Model
from ..report import write_report
from ..study import Study, improve
from . import story
from .hidden import drive_both, hide, vehicle_file

DEFAULT = "tyre_load_sensitivity"


@dataclass(frozen=True, eq=False)
class Demonstration:
    """What was hidden, and what the study made of it.

    Attributes
    ----------
    truth : Model
        The car that was driven.
    study : Study
        Made without knowing it.
    """

    truth: Model
    study: Study

    @property
    def found(self) -> bool:
        """Whether the final model has the hidden effect."""
        return set(self.truth.effects) <= set(self.study.model.effects)

    __repr__ = brief

    def __str__(self) -> str:
        return "\n\n".join([*story.findings(self.study), story.revelation(self.study, self.truth)])

    def _repr_html_(self) -> str:
        return self.study._repr_html_()


def run_demo(
    hidden: str = DEFAULT,
    *,
    seed: int = 0,
    report: str | Path | None = None,
    tell: Callable[[str], None] = print,
    progress: bool | None = None,
) -> Demonstration:
    """Drive a simulated car on which an unknown effect acts, find the effect, tell the story.

    Parameters
    ----------
    hidden : str
        Id of the effect, or `random`. Nothing that is told before the end gives it away.
    seed : int
        Of the draw, of the sensor noise and of the study.
    report : str or Path, optional
        HTML file to write.
    tell : callable
        Called with each paragraph of the story.
    progress : bool, optional
        Show progress bars; by default in a terminal or a notebook.

    Raises
    ------
    InvalidInput
        If no effect has this id, or the report cannot be written.
    """
    rng = generator(seed)
    truth = hide(hidden, rng)
    train, test = drive_both(truth, rng)
    model = Model(vehicle_file(truth.vehicle))
    tell(story.opening(model, train, test))
    study = improve(model, train, test, seed=seed, progress=progress, tell=lambda _: None)
    for paragraph in story.findings(study):
        tell(paragraph)
    if report is not None:
        write_report(study, report, truth=truth)
        tell(f"Everything in pictures: {report}")
    tell(story.revelation(study, truth))
    return Demonstration(truth, study)
