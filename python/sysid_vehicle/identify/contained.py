"""A fit of a model with added effects is never worse than that of the model that it contains.

A search with more parameters may end elsewhere: at other tyres, or at noise of another time. Where
effects begin at nothing, the maximum without them is another place to begin at.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace

import numpy as np

from ..effects import Effect
from ..errors import InvalidInput, NumericalError
from ..model import Model
from .beside_noise import beside_noise
from .fit import Fit
from .maximum import refine


def above_contained(fit: Fit, model: Model, maximum: Callable[[Model], Fit]) -> Fit:
    """The fit, or the likelier one to which the maximum without its added effects leads.

    Parameters
    ----------
    fit : Fit
    model : Model
        With the values at which the search began: effects that stand at nothing were added.
    maximum : callable
        From a model to its fit to the same driving.
    """
    added = [e for e in model.parts if _is_nothing(model, e)]
    few = model.drop(*(e.id for e in added))
    if not added or not few.free_names:
        return fit
    with suppress(InvalidInput, NumericalError, np.linalg.LinAlgError):
        contained = maximum(few)
        if contained.log_likelihood > fit.log_likelihood:
            nothing = {n: model.value(n) for e in added for n in e.named}
            begin = model.with_values({n: contained.model.value(n) for n in few.names} | nothing)
            found = refine(begin, contained.driving, contained.noise)
            if found.log_likelihood > fit.log_likelihood:
                return beside_noise(replace(found, starts=fit.starts))
    return fit


def _is_nothing(model: Model, effect: Effect) -> bool:
    """Whether an effect stands where it does nothing, and may stay there for all that is known."""
    free = [n for n in effect.named if n in model.free_names]
    sizes = {n: p.null_value for n, p in effect.named.items() if not p.scan}
    bounds = {n: model.bounds(n) for n in free if n in sizes}
    within = all(low <= sizes[n] <= high for n, (low, high) in bounds.items())
    at_null = all(model.value(n) == null for n, null in sizes.items())
    return bool(free) and at_null and within and not model.priors.keys() & effect.named.keys()
