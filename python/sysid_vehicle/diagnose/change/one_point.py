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
    def of(cls, reference: Reference, state: Exact, *, another: bool, at_one_point: bool) -> Lines:
        """At one point where something was put in, or where it is asked for.

        Of another vehicle file what both share is told in the terms of the later one.
        """
        side = reference.side
        lines = cls(side, state.shift, reference.shared)
        if another:
            same = replace(reference.before, model=without(state.searched))
            names, effects = reference.names, reference.effects
            side = Side(same, names, effects, like=side, residuals_of=side)
            return replace(lines, side=side)
        return cls.at_one_point(reference, state) if state.put or at_one_point else lines

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
