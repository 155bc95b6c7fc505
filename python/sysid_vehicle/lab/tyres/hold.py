"""Would the data accept a given value? The likelihood-ratio test of one coefficient."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ..._common.text import number
from ..._common.typed import typed
from ...errors import InvalidInput, near_names
from ...identify.intervals.profile import lost_at
from ...identify.intervals.side import LEVEL, Optimum
from .fit import TyreFit
from .problem import box_of, objective_of


@dataclass(frozen=True)
class HeldValue:
    """What holding one coefficient or combination at a value costs.

    Attributes
    ----------
    name : str
    value : float
    lost : float
        Log-likelihood lost with all others fitted anew, in nats.
    """

    name: str
    value: float
    lost: float

    @property
    def accepted(self) -> bool:
        """Whether the value lies in the 95 % interval of the profile likelihood."""
        return self.lost <= 0.5 * LEVEL**2

    def __str__(self) -> str:
        verdict = "accepted" if self.accepted else "refused"
        return (
            f"{self.name} = {number(self.value, 5)}: {verdict} at 95 %, "
            f"{number(self.lost, 3)} nats lost"
        )


@typed
def hold_value(fit: TyreFit, name: str, value: float) -> HeldValue:
    """Ask whether the data accept a value, such as that of a supplier's data sheet.

    Equivalent to asking whether it lies in the interval of the profile likelihood, for one search
    instead of some twenty (Wilks, Annals of Mathematical Statistics 9, 1938). The search starts
    from the best tyres and from every rival.

    Parameters
    ----------
    fit : TyreFit
    name : str
        A free parameter, or a combination such as `BCD_front`.
    value : float

    Raises
    ------
    InvalidInput
        No estimate is called `name`, or the value is not finite or outside the search box.
    """
    names = [e.name for e in fit.estimates]
    known = fit.quantities
    if name not in known:
        raise InvalidInput(f"there is no estimate '{name}'{near_names(name, tuple(known))}")
    what = known[name]
    box = box_of(names, {})
    if what.column is not None:
        i = box.columns.index(what.column)
        if not box.lower[i] <= value <= box.upper[i]:
            raise InvalidInput(
                f"{name} = {value:g} is outside {box.lower[i]:g} .. {box.upper[i]:g}, where tyres "
                "are looked for"
            )
    elif not np.isfinite(value):
        raise InvalidInput(f"{name} = {value} is not a number")
    objective = objective_of(fit.vehicle, fit.logs, residual_terms="P1" in names)
    at = Optimum.of(objective, fit.parameters, fit.noise, box, fit.covariance)
    rivals = [replace(at, p=r.parameters, covariance=r.covariance) for r in fit.rivals]
    with np.errstate(over="ignore", invalid="ignore"):
        lost = min(lost_at(valley, what, value) for valley in (at, *rivals))
    return HeldValue(name, value, max(lost, 0.0))
