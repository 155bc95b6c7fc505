"""The drive that answers what a study left open: which of several effects it is."""

from __future__ import annotations

from .._common.arguments import expect
from .._common.typed import typed
from ..diagnose import DriveLimits, NextDrive, suggest_manoeuvre
from ..errors import InvalidInput
from ..identify import explaining, refine
from .results.next_steps import open_groups
from .study import Study


@typed
@explaining
def next_drive(
    study: Study,
    effect: str | None = None,
    *,
    limits: DriveLimits | None = None,
    progress: bool | None = None,
) -> NextDrive:
    """Suggest the drive that tells an effect from those it is confounded with in a study.

    The effects have the sizes that the training data show beside all else that the study added.
    Record the drive, add it to the training data, and study again.

    Parameters
    ----------
    study : Study
    effect : str, optional
        Which of those that the study added; by default the first that its next steps ask about.
    limits : DriveLimits, optional
        What can be driven; by default `DriveLimits.usual`.
    progress : bool, optional
        Show a progress bar; by default in a terminal or a notebook, after two seconds.

    Returns
    -------
    NextDrive

    Raises
    ------
    InvalidInput
        The study confounds no effect with others, or not this one.
    """
    expect(study, Study, "next_drive")
    groups = open_groups(study)
    if not groups:
        raise InvalidInput(
            "the study has no effect that it confounds with others; its next steps say what helps"
        )
    chosen = groups[0] if effect is None else next((g for g in groups if g[0] == effect), None)
    if chosen is None:
        known = ", ".join(g[0] for g in groups)
        raise InvalidInput(f"the study does not confound '{effect}' with others, but {known}")
    without = study.model.drop(*(e for e in chosen if e in study.model.effects))
    fit = refine(without, study.fit.driving, study.fit.noise)
    return suggest_manoeuvre(fit, *chosen, limits=limits, progress=progress)
