"""One effect that may be missing: how it scores, and its refit where there is one."""

from __future__ import annotations

from dataclasses import dataclass

from ..._common.text import unit_after, with_error
from ...effects import Effect
from ...identify import Fit
from ...rules import USUAL, Rules
from .possible import possible, possible_in


@dataclass(frozen=True, eq=False)
class Candidate:
    """One effect that may be missing.

    Attributes
    ----------
    statistic : float
        Score statistic; after a refit, twice the gain in log-likelihood, with exact inputs.
    p_value : float
        Of the baseline being complete, corrected for testing all effects.
    value, std : tuple of float
        Parameters, predicted or refitted.
    error : float
        One-step-ahead error on the diagnosed driving with the effect, as `compare` gives it, in
        units of `Diagnosis.floor`; NaN where the effect was not refitted.
    retained : float
        Share of the effect that the fitted parameters cannot copy.
    indistinguishable_from : tuple of str
        Effects that this driving cannot tell from it.
    fit : Fit or None
        The model with the effect, where it was refitted.
    finished : bool
        Whether noise was learned with it; else it was refitted under the noise of the model without
        the effect.
    of_inputs : float
        After a refit, the part of the statistic that noise of the inputs had taken
        (`identify.lost_to_input_noise`).
    """

    effect: Effect
    statistic: float
    p_value: float
    value: tuple[float, ...]
    std: tuple[float, ...]
    retained: float
    variance_ratio: float
    error: float = float("nan")
    indistinguishable_from: tuple[str, ...] = ()
    fit: Fit | None = None
    finished: bool = False
    of_inputs: float = 0.0

    @property
    def id(self) -> str:
        """Id of the effect."""
        return self.effect.id

    def can_be(self, rules: Rules = USUAL) -> bool:
        """Whether its 95 % intervals hold values that a car can have."""
        if self.fit is not None:
            return possible_in(self.fit, self.effect, rules)
        return possible(self.effect, self.value, self.std, rules)

    @property
    def size(self) -> str:
        """Its parameters with standard errors, in words."""
        return ", ".join(
            f"{p.name} {with_error(v, s, (p.lower, p.upper))}{unit_after(p.unit)}"
            for p, v, s in zip(self.effect.parameters, self.value, self.std, strict=True)
        )
