"""Whether one effect that was not sought explains all that was found: one error in several names.

A wrong mass scales every force. Where a user takes the mass for known, a study finds a gain of the
wheel force, a yaw inertia and a drag of the same size, each for itself and rightly by the data.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from contextlib import suppress
from typing import NamedTuple

import numpy as np

from ..._common.text import few, unit_after, with_error
from ...diagnose.diagnose import diagnose
from ...effects import Effect
from ...errors import NumericalError
from ...identify import Fit, refine
from ...rules import Rules
from ..search.steps import merit
from .between_logs import no_effect_but_the_log
from .slip_of_the_file import slip_of_the_file

_IN_THE_FILE = {
    "aero_drag": "drag_area_m2 of the vehicle file",
    "cg_position": "lf_m and lr_m of the vehicle file",
    "mass": "mass_kg of the vehicle file",
    "steer_ratio": "the factor of steer_rad in the channel map",
    "yaw_inertia": "yaw_inertia_kgm2 of the vehicle file",
}


class OneForAll(NamedTuple):
    """What explains all that was found.

    Attributes
    ----------
    said : str
        A sentence; empty where nothing does.
    effect : str
        The effect, where it is one that was not sought.
    """

    said: str
    effect: str = ""


def one_for_all(
    baseline: Fit, final: Fit, added: Sequence[str], sought: Collection[str], rules: Rules
) -> OneForAll:
    """Say which slip of the vehicle file, difference of logs, or other effect explains all of it.

    An effect that was left out, or is fixed, and is refitted in the place of all that were added
    has to be as likely on the training data by the BIC, which its fewer parameters may let it be,
    and of a size that a car can have.

    Parameters
    ----------
    baseline, final : Fit
    added : sequence of str
        Effects of the final model that the baseline lacks; one has no common cause with itself.
    sought : collection of str
        Effects that were considered.
    rules : Rules

    Returns
    -------
    OneForAll
        Empty where there is no such slip or effect, and the logs tell one car.
    """
    slip = slip_of_the_file(final, added, rules)
    if not slip:
        slip = no_effect_but_the_log(baseline, final, added, rules)
    if slip or len(added) < 2:
        return OneForAll(slip)
    enough = merit(final)
    found = [
        (e, fit)
        for e, fit in (*_fixed(baseline), *_left_out(baseline, sought, rules))
        if merit(fit) >= enough
    ]
    if not found:
        return OneForAll("")
    e, fit = max(found, key=lambda at: merit(at[1]))
    sizes = ", ".join(
        f"{p.name} {with_error(fit[n].value, fit[n].std, fit[n].bounds)}{unit_after(p.unit)}"
        for n, p in e.named.items()
    )
    where = _IN_THE_FILE.get(e.id, "what is known of it")
    said = (
        f"{few(added)} may be one error: {e.id}, which was not sought, explains the training data "
        f"as well in place of all of them ({sizes}); check {where}, or let the study seek {e.id}"
    )
    return OneForAll(said, e.id)


def _fixed(baseline: Fit) -> list[tuple[Effect, Fit]]:
    """Effects that the model has at fixed values, each with a fit in which it is free."""
    free, found = baseline.model.free_names, []
    for e in baseline.model.parts:
        if set(e.named).isdisjoint(free):
            with suppress(NumericalError, np.linalg.LinAlgError):
                model = baseline.model.with_free(e.named)
                found.append((e, refine(model, baseline.driving, baseline.noise)))
    return found


def _left_out(baseline: Fit, sought: Collection[str], rules: Rules) -> list[tuple[Effect, Fit]]:
    """The likeliest of the effects that the model lacks and nobody sought, with its fit."""
    others = [e for e in baseline.model.candidates if e.id not in sought]
    if not others:
        return []
    ranking = diagnose(baseline, candidates=others, rules=rules, refits=1).ranking
    return [(c.effect, c.fit) for c in ranking if c.fit is not None and c.can_be(rules)]
