"""The likelihood of later driving and of the reference together, and where its searches begin."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import Any

import numpy as np

from ... import _core
from ..._common.arrays import FloatArray, as_float64
from ...errors import NumericalError
from ...estimate import noise_range
from ...identify import Fit
from ...identify.search.box import free_box
from ...identify.search.objective import LinearRows, Objective, Predicting
from ...model import Model
from .beside_reference import Shared
from .both_axles import Scaled
from .both_drivings import BothDrivings

_FAR = 3.0  # usual sizes, within which a search begins
_SHARES = (0.5, 1.0, 2.0)  # of the usual size, where it may begin too


@dataclass(frozen=True, eq=False)
class Together:
    """What both drivings are fitted to.

    Attributes
    ----------
    before : Fit
        The reference.
    place : dict of str to int
        Columns of parameters in `shared`.
    shared : Shared
    """

    before: Fit
    place: dict[str, int]
    shared: Shared

    def objective(
        self,
        start: Fit,
        model: Model,
        own: Model | None,
        loose: Sequence[str],
        changed: Sequence[str],
    ) -> Objective:
        """The likelihood of a driving, and that of the reference, with priors of what stays.

        The reference is not approximated by its information: of tyres in their linear range a
        line says that they may go where they cannot.

        Parameters
        ----------
        start : Fit
            Of whose driving it is.
        model : Model
        own : Model, optional
            Of the reference; without, it is the likelihood of the one driving.
        loose : sequence of str
            Parameters without a prior.
        changed : sequence of str
            Those that may differ between both.
        """
        model_before = self.before.model
        names = [n for n in model_before.free_names if n not in loose]
        at = [self.place[n] for n in names]
        rows = np.zeros((len(names), _core.PARAMETERS))
        root = np.sqrt(self.shared.precision[at])
        rows[np.arange(len(names)), [model_before.parameters[n].column for n in names]] = root
        centre = [model_before.value(n) + self.shared.centre[self.place[n]] for n in names]
        stays = LinearRows(rows, as_float64(root * centre))
        later = Scaled.of(start.driving, model)
        problem: Predicting = later
        if own is not None:
            shared = [own.parameters[n].column for n in own.free_names if n not in changed]
            before = Scaled.of(self.before.driving, own)
            problem = BothDrivings(later, before, own.vector(), shared)
        return Objective(problem, (stays,), *noise_range(model.vehicle, start.driving))


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
