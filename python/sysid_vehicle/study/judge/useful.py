"""Whether predictions are better with what a step added.

Evidence grows with the data: an effect may be significant and matter to no prediction. A model may
keep it, as dropping it would bend what stands beside it; its user is to know.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from ...estimate import Driving
from ...identify import Fit
from ...rules import USUAL, Rules
from ..ahead.beyond import Beyond
from ..ahead.unmoved import changes_of
from ..validation import AHEAD, fall_in_error

NONE: frozenset[str] = frozenset()


def useless(
    fits: Sequence[Fit], test: Driving, explained: Beyond | None = None, rules: Rules = USUAL
) -> frozenset[str]:
    """Find added effects with which no error on validation data is shown to fall, in their step.

    None is where all together surely take something off the errors ahead, and no step shows which.

    Parameters
    ----------
    fits : sequence of Fit
        From the baseline to the final model.
    test : Driving
        Validation data.
    explained : Beyond, optional
        What all together take off the errors 1 to 5 s ahead on validation data.
    rules : Rules
    """
    steps = [pair for pair in pairwise(fits) if not serves(*pair, test, rules)]
    found = frozenset(
        e for poorer, richer in steps for e in richer.model.effects if e not in poorer.model.effects
    )
    every = set(fits[-1].model.effects).difference(fits[0].model.effects)
    sure = explained is not None and explained.low > 0.0
    return frozenset() if sure and found >= every else found


def serves(poorer: Fit, richer: Fit, test: Driving, rules: Rules = USUAL) -> bool:
    """Whether a richer model predicts validation data better, by more than chance.

    One step ahead, or 1 to 5 s: any channel in the mean over these, both models as they are fitted.
    """
    if fall_in_error(poorer, richer, test).beyond(rules.interval):
        return True
    ahead = changes_of(poorer, richer, test, AHEAD)
    own = [[c for c in ahead if c.channel == name] for name in {c.channel for c in ahead}]
    return any(
        np.mean([c.log_ratio for c in some]) < -rules.interval * np.mean([c.error for c in some])
        for some in own
    )
