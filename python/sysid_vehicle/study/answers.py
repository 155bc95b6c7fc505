"""What a study has found out about its validation data, for those who ask again.

Reports and files ask for offsets of logs and for parameters that predict best, as the study did. It
is remembered while the process lasts, and stands in the file of a study, whose reader remembers it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from .._common.arrays import FloatArray
from ..estimate import Driving
from ..identify import Fit
from ..identify.offsets import Settled, settled_offsets
from .validation import at_its_best


@dataclass(frozen=True, eq=False)
class Answers:
    """Answers about fits on validation data; once there is one of these, they are remembered.

    Attributes
    ----------
    validation : Driving
    best : tuple of (Fit, Fit)
        A fit, and its model with the parameters that predict validation data best.
    offsets : tuple of (Fit, Driving, tuple of array)
        A fit, the validation data with the offsets of their logs under it, and the noise of each.
    """

    validation: Driving
    best: tuple[tuple[Fit, Fit], ...]
    offsets: tuple[tuple[Fit, Driving, tuple[FloatArray, ...]], ...]

    def __post_init__(self) -> None:
        for fit, best in self.best:
            at_its_best.tell(best, fit, self.validation)
        for fit, driving, noise in self.offsets:
            settled_offsets.tell(Settled(driving, noise), fit, self.validation)


def answers_of(fits: Sequence[Fit], validation: Driving) -> Answers:
    """What is remembered of fits on validation data."""
    best = [
        (fit, other)
        for (fit, driving), other in at_its_best.known().items()
        if driving is validation and fit in fits
    ]
    asked = {*fits, *(other for _, other in best)}
    offsets = [
        (fit, found.driving, found.noise)
        for (fit, driving), found in settled_offsets.known().items()
        if driving is validation and fit in asked
    ]
    return Answers(validation, tuple(best), tuple(offsets))  # type: ignore[arg-type]
