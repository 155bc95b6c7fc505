"""Where the free parameters of a model may lie."""

from __future__ import annotations

import numpy as np

from ..model import Model
from .search import Box

__all__ = ["free_box"]


def free_box(model: Model) -> Box:
    """The model's free parameters, in the order of their names."""
    names = list(model.free_names)
    known = model.parameters
    bounds = np.array([model.bounds(n) for n in names])
    lower = bounds[:, 0].copy()
    for i, n in enumerate(names):
        # A lag of exactly zero has no derivative; a tenth of its typical size is next to none.
        part = next((e for e in model.parts if n.startswith(f"{e.id}.")), None)
        if part is not None and part.scored_at_typical:
            lower[i] = max(lower[i], 0.1 * known[n].typical)
    return Box([known[n].column for n in names], lower, bounds[:, 1])
