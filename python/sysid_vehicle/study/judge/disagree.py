"""Whether training and validation data tell the same car.

A model that is the car has the same parameters on any driving. Where it is not, and validation data
fitted by themselves ask for another cornering stiffness, what differs between the drives (speed,
load, tyres, road, how a sensor was set up) is a part of what is missing.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from ..._common.memo import remembered
from ..._common.text import unit_after
from ...errors import NumericalError
from ...estimate import Driving
from ...identify import Estimate, Fit, beside_noise, driving_of, refine
from ...rules import USUAL, Rules

STIFFNESS = ("cornering stiffness front", "cornering stiffness rear")


@dataclass(frozen=True)
class Disagreement:
    """A quantity that training and validation data tell differently.

    Attributes
    ----------
    train, validation : Estimate
        Of the same model, fitted to either by itself.
    """

    train: Estimate
    validation: Estimate

    @property
    def apart(self) -> float:
        """Difference in its standard errors; 0 where one of the drives does not tell."""
        error = float(np.hypot(self.train.std, self.validation.std))
        return abs(self.train.value - self.validation.value) / error if error > 0.0 else 0.0

    def __str__(self) -> str:
        here, there = (e.size for e in (self.train, self.validation))
        return (
            f"{self.train.name} {here}{unit_after(self.train.unit)} from training data, {there} "
            "from validation data"
        )

    def to_dict(self) -> dict[str, Any]:
        """All figures, ready for JSON."""
        return {
            "name": self.train.name,
            "train": self.train.to_dict(),
            "validation": self.validation.to_dict(),
            "standard_errors_apart": self.apart,
        }


@remembered(8)
def disagreements(fit: Fit, test: Driving, rules: Rules = USUAL) -> tuple[Disagreement, ...]:
    """Find what validation data by themselves tell differently, the surest first.

    Cornering stiffness of both axles, and parameters of the model's effects.

    Parameters
    ----------
    fit : Fit
    test : Driving
        Validation data.
    rules : Rules
        `sure` standard errors are a disagreement.
    """
    try:
        other = beside_noise(refine(fit.model, driving_of(fit, test), fit.noise))
    except (NumericalError, np.linalg.LinAlgError):
        return ()
    told = {e.name for e in (*fit.estimates, *fit.derived)}
    # Offsets differ from log to log, and tell nothing of the car.
    own = {e.id for e in fit.model.parts} - set(fit.model.nuisances)
    names = [n for n in STIFFNESS if n in told]
    names += [e.name for e in fit.estimates if e.name.split(".")[0] in own]
    found = (Disagreement(fit[n], other[n]) for n in names)
    return tuple(
        sorted((d for d in found if d.apart > rules.sure), key=lambda d: d.apart, reverse=True)
    )
