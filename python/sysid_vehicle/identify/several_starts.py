"""The maximum of the likelihood from several values that may lead to different ones."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress

import numpy as np

from ..errors import InvalidInput, NumericalError
from ..estimate import Driving, NoiseModel
from ..model import Model
from .fit import Fit
from .maximum import objectives, top
from .search.box import free_box
from .search.settle import rivalled, settle
from .search.starts import Starts


def refine_from(begins: Sequence[Model], driving: Driving, noise: NoiseModel) -> Fit | None:
    """As `refine`, from several values of one model: the likeliest end; None where all fail.

    Noise is learned from the first that leads anywhere. From the others parameters move first, and
    are followed where noise of their own may make them likelier (`rivalled`).
    """
    objective, thinned = objectives(begins[0], driving)
    box, starts = free_box(begins[0]), Starts.none(begins[0].free_names)
    best = None
    for begin in begins:
        p = box.inside(begin.vector())
        with suppress(NumericalError, InvalidInput, np.linalg.LinAlgError):
            if best is None:
                best = settle(objective, p, noise.vector(), box, thin=thinned)
            else:
                best = rivalled(objective, best, p, box, thinned)
    if best is None:
        return None
    with suppress(NumericalError, InvalidInput, np.linalg.LinAlgError):
        return top(begins[0], driving, objective, best, starts, thinned)
    return None
