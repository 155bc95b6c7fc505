"""Whether what was found is what differs between the training logs: tyres, a load, a sensor.

One model has one value for all logs. Where another set of tyres was driven in one of them, an
effect that acts by the log, such as the heat that tyres begin with, stands in for it.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations

import numpy as np

from ..._common.memo import remembered
from ..._common.text import few, unit_after
from ...errors import NumericalError
from ...identify import Fit, beside_noise, refine
from ...rules import USUAL, Rules
from ..results.next_steps import SHORT_S
from ..search.steps import merit
from .disagree import STIFFNESS, Disagreement


def no_effect_but_the_log(
    baseline: Fit, final: Fit, added: Sequence[str], rules: Rules = USUAL
) -> str:
    """Say that the baseline with parameters for each training log does as well as what was added.

    Parameters
    ----------
    baseline, final : Fit
    added : sequence of str
        Effects of the final model that the baseline lacks.
    rules : Rules

    Returns
    -------
    str
        A sentence; empty where that is not so.
    """
    if not added:
        return ""
    apart = by_log(baseline)
    if not apart or sum(map(merit, apart)) < merit(final):
        return ""
    told = differing(apart, rules)
    if not told:
        return ""
    return (
        f"{few(list(added))} may be what differs between the training logs (tyres, load, road, "
        f"sensors): without it, and with parameters for each log, the baseline explains them as "
        f"well ({told[0]}); study logs of one state of the car at a time, or compare them: "
        "`sv.changed`, `sv.identify_runs`"
    )


def told_differently(fit: Fit, rules: Rules = USUAL) -> list[str]:
    """Find what the training logs tell differently, where one value for each is likelier."""
    apart = by_log(fit)
    if not apart or sum(map(merit, apart)) < merit(fit):
        return []
    return differing(apart, rules)


@remembered(4)
def by_log(fit: Fit) -> tuple[Fit, ...]:
    """The same model fitted to each log; none where there is one, or one is a single manoeuvre."""
    logs = fit.driving.each_log()
    if len(logs) < 2 or min(d.usable_s for d in logs) < SHORT_S:
        return ()
    try:
        return tuple(beside_noise(refine(fit.model, d, fit.noise)) for d in logs)
    except (NumericalError, np.linalg.LinAlgError):
        return ()


def differing(apart: Sequence[Fit], rules: Rules = USUAL) -> list[str]:
    """What two of the fits tell most differently: by quantity, the surest first, in words."""
    first = apart[0]
    own = {e.id for e in first.model.parts} - set(first.model.nuisances)
    told = {e.name for e in first.derived}
    names = [n for n in STIFFNESS if n in told]
    names += [e.name for e in first.estimates if e.name.split(".")[0] in own]
    found = []
    for name in names:
        d, one, other = max(
            (
                (Disagreement(a[name], b[name]), a.driving.logs[0].name, b.driving.logs[0].name)
                for a, b in combinations(apart, 2)
            ),
            key=lambda at: at[0].apart,
        )
        if d.apart > rules.sure:
            here, there, unit = d.train.size, d.validation.size, unit_after(d.train.unit)
            found.append((d.apart, f"{name} {here}{unit} from {one}, {there} from {other}"))
    return [text for _, text in sorted(found, key=lambda at: -at[0])]
