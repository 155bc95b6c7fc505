"""What else explains what a change does: how alike two changes are, and by which it is hidden."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import numpy as np

from ..._common.arrays import FloatArray
from ..candidates.single_effects import Hypothesis
from ..evidence.projection import pseudo_inverse


def likeness(
    information: FloatArray, whole: Mapping[str, Hypothesis]
) -> dict[tuple[str, str], float]:
    """Largest squared correlation between what two hypotheses can do."""
    inverses = {
        n: pseudo_inverse(information[np.ix_(h.columns, h.columns)])[0] for n, h in whole.items()
    }
    found: dict[tuple[str, str], float] = {}
    for a, one in whole.items():
        for b, other in whole.items():
            if (b, a) in found:
                found[a, b] = found[b, a]
                continue
            cross = information[np.ix_(one.columns, other.columns)]
            both = inverses[a] @ cross @ inverses[b] @ cross.T
            found[a, b] = float(np.clip(np.linalg.eigvals(both).real.max(), 0.0, 1.0))
    return found


def left_by(
    information: FloatArray, one: Hypothesis, size: FloatArray, others: Iterable[Hypothesis]
) -> dict[str, float]:
    """Nats of a change of some size that another one, of any size, does not explain.

    Of white residuals. With no other one, under its own name, it is what the change gains by
    itself.
    """
    own = list(one.columns)
    found = {one.name: 0.5 * float(size @ information[np.ix_(own, own)] @ size)}
    for other in others:
        rest = list(other.columns)
        cross = size @ information[np.ix_(own, rest)]
        known = pseudo_inverse(information[np.ix_(rest, rest)])[0]
        found[other.name] = max(found[one.name] - 0.5 * float(cross @ known @ cross), 0.0)
    return found
