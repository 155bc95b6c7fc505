"""Does the likelihood fall as the information matrix says? Where it does not, its intervals fail.

Where a drive ends short of the peak, B, C, D and E copy each other along a bent valley. A straight
line leaves it at once, and the interval that the curvature at the optimum promises is too short.
"""

from __future__ import annotations

import numpy as np

from ..._common.arrays import as_float64
from ...identify.intervals.side import LEVEL, Optimum, moved
from ...identify.search.objective import Objective
from ...identify.search.search import Box
from .fit import TyreFit

_ACROSS = ("BCD", "drag", "mass", "yaw_inertia")
_OFF = 1.5  # times more, or less, than half the square of the level; 0.99 to 1.01 where it is none


def bent_of(fit: TyreFit, objective: Objective, box: Box) -> tuple[str, ...]:
    """What costs something else at the ends of its interval than the information matrix says.

    Without a search: at either end the others follow in a straight line on their scales. The
    stiffness and the drag are not asked: they are known across the valley, whatever its bend.
    """
    at = Optimum.of(objective, fit.parameters, fit.noise, box, fit.covariance)
    names, ends = [], []
    with np.errstate(over="ignore", invalid="ignore"):
        for name, what in fit.quantities.items():
            across, variance = at.across(what)
            skipped = name in fit.undetermined or name.startswith(_ACROSS)
            if skipped or not (np.isfinite(variance) and variance > 0.0):
                continue
            along = box.on_scales(at.p, across / variance)
            for sign in (-1.0, 1.0):
                end = what.of(at.p) + sign * LEVEL * float(np.sqrt(variance))
                there = moved(at.p, box, along, what, end)
                # A bound may be nearer than the end.
                share = (what.of(there) - what.of(at.p)) / (end - what.of(at.p))
                if np.isfinite(share) and share > 0.1:
                    names.append((name, share))
                    ends.append(there)
        values = objective.log_likelihoods(as_float64(ends), fit.noise)
    lost = -at.cost - values
    found = {
        name: None
        for (name, share), loss in zip(names, lost, strict=True)
        if not 1.0 / _OFF < loss / (0.5 * (share * LEVEL) ** 2) < _OFF
    }
    return tuple(found)
