"""Whether later driving is like that of the reference, as far as its model is known to hold.

What a model lacks acts otherwise at another speed or lateral acceleration. Where the reference
itself shows that something is lacking, later driving of another kind differs from it although the
car is the same, and no likelihood of both tells that from a change.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..._common.arrays import FloatArray
from ...estimate import Driving
from ...identify import Fit
from ...rules import USUAL, Rules
from ..unexplained.omnibus import Omnibus, omnibus


@dataclass(frozen=True)
class Alike:
    """How far a reference may be compared with later driving.

    Attributes
    ----------
    beyond : float
        Share of the later driving at speeds or lateral accelerations that the reference lacks.
    left : Omnibus or None
        What the reference leaves that depends on the driving; None where the later driving is
        alike, and nobody asks.
    rules : Rules
    """

    beyond: float
    left: Omnibus | None = None
    rules: Rules = USUAL

    @property
    def comparable(self) -> bool:
        """Whether a difference may be called a change."""
        return self.left is None or self.left.p_value > self.rules.strict

    def __str__(self) -> str:
        share = f"{100.0 * self.beyond:.0f} % of the later driving is at speeds or lateral"
        told = f"{share} accelerations that the reference does not have"
        if self.left is None or self.comparable:
            return told
        return f"{told}, and the model lacks something there already (p = {self.left.p_value:.2g})"


def alike(before: Fit, later: Driving, rules: Rules = USUAL) -> Alike:
    """Compare what was driven, and ask what the reference leaves where most of it is not alike.

    Parameters
    ----------
    before : Fit
        The reference.
    later : Driving
    rules : Rules
    """
    beyond = np.zeros(later.samples, dtype=bool)
    for known, new in zip(_motion(before.driving), _motion(later), strict=True):
        if np.isfinite(known).any():
            # What is not measured is not beyond anything: it compares as false.
            beyond |= (new < np.nanmin(known)) | (new > np.nanmax(known))
    share = float(beyond.mean())
    left = omnibus(before, before.driving, rules) if share > rules.alike else None
    return Alike(share, left, rules)


def _motion(driving: Driving) -> tuple[FloatArray, FloatArray]:
    """Speed, and lateral acceleration v_x r, sample by sample."""
    speed = driving.channel("vx_mps")
    return speed, speed * driving.channel("yaw_rate_radps")
