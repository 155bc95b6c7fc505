"""All estimators of the friction curve on the same readings."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

from ..._common.printed import Told
from ..._common.progress import doing
from ..._common.text import text_table
from ...errors import InvalidInput
from .curve import MAGIC_FORMULA, TWO_PARAMETER, MuSlipCurve
from .data import MuSlipData
from .doubts import doubts
from .filter import mu_slip_ekf, mu_slip_smooth
from .least_squares import counted, mu_slip_fit, noise_of
from .results import MuSlipEstimate

_ITERATIONS = 10


@dataclass(frozen=True, repr=False)
class MuSlipComparison(Told):
    """All estimators on the same readings.

    Attributes
    ----------
    data : MuSlipData
        The readings, with the noise that was learnt where none was told.
    estimates : tuple of MuSlipEstimate
        One per estimator, the recommended one last.
    notes : tuple of str
        Which estimators failed, and what the readings say against curve, offsets and noise told.
    """

    data: MuSlipData
    estimates: tuple[MuSlipEstimate, ...]
    notes: tuple[str, ...] = ()

    @property
    def best(self) -> MuSlipEstimate:
        """The recommended one, which is the last."""
        return self.estimates[-1]

    def __str__(self) -> str:
        names = self.best.curve.parameters
        rows = [[e.method, *map(e.cell, range(len(names)))] for e in self.estimates]
        table = text_table([f"{self.best.curve.name} curve", *names], rows)
        notes = (f"  note: {note}" for note in (*self.notes, *self.best.notes))
        return "\n".join([str(self.data), table, *notes])


@doing("estimators of the curve")
def compare_mu_slip(data: MuSlipData, *, curve: MuSlipCurve = TWO_PARAMETER) -> MuSlipComparison:
    """Run every estimator: filters, smoother, and least squares of 1, 2, 5 and all iterations.

    The recommended one is last: least squares with its bias removed for the two-parameter curve;
    for the Magic Formula the iterated smoother, whose prior holds shape and slope where the
    readings say little of them.
    """
    told = replace(data, noise_std=noise_of(data, curve))
    found, notes = every_estimate(told, curve)
    return MuSlipComparison(told, found, (*notes, *doubts(data, found[-1])))


def every_estimate(
    data: MuSlipData, curve: MuSlipCurve
) -> tuple[tuple[MuSlipEstimate, ...], list[str]]:
    """Estimates of readings whose noise is known, and which estimators failed."""
    found = [
        mu_slip_ekf(data, curve=curve).estimate,
        mu_slip_ekf(data, curve=curve, passes=2).estimate,
        mu_slip_ekf(data, curve=curve, iterations=_ITERATIONS).estimate,
    ]
    notes: list[str] = []

    def fit(method: str, **options: Any) -> None:
        try:
            found.append(replace(mu_slip_fit(data, curve=curve, **options), method=method))
        except InvalidInput:
            notes.append(f"{method}: left out, the readings do not determine the curve")

    for most in (1, 2, 5):
        fit(
            f"least squares, {counted(most)}",
            start=curve.prior.mean,
            bounds=curve.fit_bounds,
            max_iterations=most,
        )
    smoothed = mu_slip_smooth(data, curve=curve).estimate
    if curve is MAGIC_FORMULA:
        fit("least squares")
        found.append(smoothed)
    else:
        found.append(smoothed)
        fit("least squares")
        fit("least squares, corrected", corrected=True)
    return tuple(found), notes
