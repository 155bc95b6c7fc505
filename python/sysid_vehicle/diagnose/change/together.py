"""The likelihood of later driving and of the reference together, and where its searches begin."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from contextlib import suppress
from typing import Any

import numpy as np

from ... import _core
from ..._common.arrays import FloatArray
from ...errors import NumericalError
from ...estimate import noise_range
from ...identify import Fit
from ...identify.search.box import free_box
from ...identify.search.objective import Objective, Predicting, gaussian_prior
from ...model import Model
from .both_axles import Scaled
from .both_drivings import BothDrivings

_FAR = 3.0  # usual sizes, within which a search begins
_SHARES = (0.5, 1.0, 2.0)  # of the usual size, where it may begin too


def together(
    before: Fit, start: Fit, model: Model, own: Model | None, changed: Collection[str]
) -> Objective:
    """The likelihood of a driving and of the reference, with the priors of the fit of what stays.

    The reference is not approximated by its information: of tyres in their linear range a line
    says that they may go where they cannot. Nor do its estimates have a prior: coefficients of
    tyres that no driving tells one by one are far from them in the same car.

    Parameters
    ----------
    before : Fit
        The reference.
    start : Fit
        Of whose driving it is.
    model : Model
    own : Model, optional
        Of the reference; without, it is the likelihood of the one driving.
    changed : collection of str
        Parameters that may differ between both.
    """
    known = before.model.parameters
    priors = {known[n].column: p for n, p in before.model.priors.items() if n not in changed}
    later = Scaled.of(start.driving, model)
    problem: Predicting = later
    if own is not None:
        shared = [own.parameters[n].column for n in own.free_names if n not in changed]
        problem = BothDrivings(
            later, Scaled.of(before.driving, own), own.vector(), shared, start.noise.vector()
        )
    stays = gaussian_prior(_core.PARAMETERS, priors)
    return Objective(problem, stays, *noise_range(model.vehicle, start.driving))


def starts_of(
    model: Model,
    objective: Objective,
    noise: FloatArray,
    sizes: Mapping[str, float],
    usual: Mapping[str, float],
    also: Sequence[Mapping[str, float]],
    unchanged: Model | None,
) -> list[FloatArray]:
    """Starts, the likeliest first: what lines say leads astray where a change is large.

    Parameters
    ----------
    model : Model
        With all else as in the reference.
    objective : Objective
    noise : array
    sizes, usual : mapping of str to float
        Changes as lines tell them, and their usual sizes.
    also : sequence of mapping
        Other changes.
    unchanged : Model, optional
        With all else as it is where nothing changed.
    """
    box = free_box(model)
    far = {n: _FAR * usual.get(n, 0.0) for n in sizes}
    starts = [*also, {n: float(np.clip(v, -far[n], far[n])) for n, v in sizes.items()}]
    if len(usual) == 1:
        ((name, size),) = usual.items()
        starts += [{name: sign * share * size} for share in _SHARES for sign in (-1.0, 1.0)]
    near = [model]
    if unchanged is not None and sizes:
        stays = [n for n in unchanged.free_names if n not in sizes]
        near.append(model.with_values({n: unchanged.value(n) for n in stays}))
    sets = [
        box.inside(m.with_values({n: m.value(n) + x for n, x in start.items()}).vector())
        for m in near
        for start in starts
    ]
    # Where a search begins is told by the gains of one of them: filters cost far more.
    gains = objective.freeze(box.inside(model.vector()), noise)
    return sorted(sets, key=lambda p: cost(objective, p, gains))


def cost(objective: Objective, p: FloatArray, gains: Any) -> float:
    """Half the sum of squares; infinite where the model fails."""
    with suppress(NumericalError):
        cost = objective.half_sum_of_squares(p, gains)
        return cost if np.isfinite(cost) else np.inf
    return np.inf
