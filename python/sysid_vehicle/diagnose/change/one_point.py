"""Both drivings linearised at one point: where what did not change was fitted to both.

Coefficients of tyres lie in a bent valley. A line along it where the reference was fitted alone
does not meet the one where both were: what lies between them would be called a change, or would
take the place of one.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ..._common.arrays import FloatArray
from .beside_reference import Shared, Side
from .both_axles import without
from .reference import Exact, Reference


@dataclass(frozen=True, eq=False)
class Lines:
    """The reference as `Differences` takes it.

    Attributes
    ----------
    side : Side
    shift : array, shape (n,)
        By which parameters of the later driving differ from those of `side`.
    known : Shared
        About them.
    """

    side: Side
    shift: FloatArray
    known: Shared

    @classmethod
    def at_one_point(cls, reference: Reference, state: Exact) -> Lines:
        """The reference where a state has what did not change, and what did as it was before."""
        known, model = reference.shared, without(state.searched)
        own = {n: reference.own(state, n) for n in state.changes if n in model.parameters}
        model = model.with_values(own)
        off = np.zeros(len(state.shift))
        for n in model.free_names:
            off[reference.place[n]] = model.value(n) - reference.value(n)
        there = replace(reference.before, model=model)
        side = Side(there, reference.names, reference.effects, like=reference.side)
        return cls(side, state.shift - off, replace(known, centre=known.centre - off))
