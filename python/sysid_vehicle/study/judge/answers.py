"""What a study has found out about its validation data, for those who ask again.

Reports and files ask for offsets of logs and for parameters that predict best, as the study did. It
stands in the file of a study. Its validation data hold it, so that it goes where they go.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from ..._common.arrays import FloatArray
from ...estimate import Driving
from ...identify import Fit
from ...identify.offsets import OFFSETS, Settled, settled_offsets
from ..validation import BEST, FITTED_AHEAD, at_its_best, fitted_ahead


@dataclass(frozen=True, eq=False)
class Answers:
    """Answers about fits on validation data, which hold them once there is one of these.

    Attributes
    ----------
    validation : Driving
    best : tuple of (Fit, Fit)
        A fit, and its model with the parameters that predict validation data best.
    ahead : tuple of (Fit, Fit or None)
        A fit, and its model fitted to predictions; its own driving holds that.
    offsets : tuple of (Fit, Driving, tuple of array)
        A fit, the validation data with the offsets of their logs under it, and the noise of each.
    """

    validation: Driving
    best: tuple[tuple[Fit, Fit], ...]
    ahead: tuple[tuple[Fit, Fit | None], ...]
    offsets: tuple[tuple[Fit, Driving, tuple[FloatArray, ...]], ...]

    def __post_init__(self) -> None:
        for fit, best in self.best:
            self.validation.told[BEST, fit] = best
        for fit, predicting in self.ahead:
            fit.driving.told[FITTED_AHEAD, fit] = predicting
        for fit, driving, noise in self.offsets:
            self.validation.told[OFFSETS, fit] = Settled(driving, noise)


def answers_of(fits: Sequence[Fit], validation: Driving) -> Answers:
    """What is remembered of fits on validation data."""
    best = [
        (fit, other)
        for (fit, driving), other in at_its_best.known().items()
        if driving is validation and fit in fits
    ]
    ahead = [(fit, found) for (fit,), found in fitted_ahead.known().items() if fit in fits]
    asked = {*fits, *(found for _, found in (*best, *ahead))}
    offsets = [
        (fit, found.driving, found.noise)
        for (fit, driving), found in settled_offsets.known().items()
        if driving is validation and fit in asked
    ]
    return Answers(validation, tuple(best), tuple(ahead), tuple(offsets))  # type: ignore[arg-type]
