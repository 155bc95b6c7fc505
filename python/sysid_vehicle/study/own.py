"""What each effect that was added does that nothing else of the model would do in its place."""

from __future__ import annotations

from collections.abc import Collection, Sequence

import numpy as np

from .._threads import in_parallel
from ..errors import NumericalError
from ..estimate import Driving
from ..identify import Fit, refit
from ..rules import UNKNOWN, Share
from .beyond import own_share
from .horizons import moving_with
from .validation import AHEAD, at_its_best


def own_shares(
    final: Fit, effects: Sequence[str], named: Collection[str], test: Driving
) -> dict[str, tuple[Share, Share]]:
    """Find the share of the error 1 to 5 s ahead that is an effect's own.

    The model without it is fitted anew under the same noise: tyres and the other effects take up
    what they can. On validation data both models have the parameters of `at_its_best`. Errors of
    the motion that it moves count, along the car or lateral: others it cannot take away, and what
    parameters fitted anew change there is none of its doing.

    Parameters
    ----------
    final : Fit
    effects : sequence of str
        Those that were added.
    named : collection of str
        Those of them that are asked for: where none has a share of the training data, validation
        data are not asked.
    test : Driving
        Validation data.

    Returns
    -------
    dict
        By effect, on validation and on training data; unknown where a model fails.
    """
    without = dict(zip(effects, in_parallel(lambda e: _without(final, e), effects), strict=True))
    left = {e: fit for e, fit in without.items() if fit is not None}
    moved = {part.id: moving_with(part.moved) for part in final.model.parts}

    def in_training(e: str) -> Share:
        return own_share(left[e], final, final.driving, AHEAD, channels=moved[e])

    fitted = dict(zip(left, in_parallel(in_training, left), strict=True))
    judged: dict[str, Share] = {}
    if any(fitted[e].low > 0.0 for e in fitted if e in named):
        best = at_its_best(final, test)

        def on_test(e: str) -> Share:
            return own_share(at_its_best(left[e], test), best, test, AHEAD, channels=moved[e])

        judged = dict(zip(left, in_parallel(on_test, left), strict=True))
    return {e: (judged.get(e, UNKNOWN), fitted.get(e, UNKNOWN)) for e in effects}


def _without(final: Fit, effect: str) -> Fit | None:
    try:
        return refit(final.model.drop(effect), final.driving, final.noise)
    except (NumericalError, np.linalg.LinAlgError):
        return None
