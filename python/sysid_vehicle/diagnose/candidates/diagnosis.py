"""What a diagnosis found: a ranking, and what may be named as the cause."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from ..._common.printed import Part, Printed, Table
from ..._common.style import axes_or_new
from ..._common.tables import frame
from ..._common.text import brief, few
from ..._common.threads import in_parallel
from ...compare import one_step_error
from ...effects import Effect
from ...errors import InvalidInput, NumericalError
from ...estimate import Driving, NoiseModel
from ...identify import Fit, driving_of
from ...rules import Rules
from ..unexplained.omnibus import Omnibus
from .candidate import Candidate
from .causes import Causes
from .possible import Size
from .reservation import Beside, beside, confirmed, reservation
from .score import Score

if TYPE_CHECKING:
    from matplotlib.axes import Axes


@dataclass(frozen=True, eq=False)
class Diagnosis(Printed):
    """Effects ranked by the evidence that they are missing.

    Attributes
    ----------
    fit : Fit
        The diagnosed model.
    driving : Driving
        What it was diagnosed on.
    ranking : tuple of Candidate
        All candidates, the most likely first.
    omnibus : Omnibus
        Whether anything at all is left.
    rules : Rules
        By which it claims.
    scores : tuple of Score
        The tests that the ranking began with, beside the fit as it is.
    family : dict of str to float
        Their p-values by effect, corrected for testing all of them.
    error : float
        One-step-ahead error on the driving without any of the effects, in units of `floor`.
    proposed : Causes
        Posterior of a sum of single effects over the scores, linearised at the fit; see `causes`.
    unfollowed : tuple of str
        What comes nowhere near the best effect, by its score or, where noise may hide it, by few
        samples: their scores stand (`with_unfollowed`).
    """

    fit: Fit
    driving: Driving
    ranking: tuple[Candidate, ...]
    omnibus: Omnibus
    rules: Rules
    scores: tuple[Score, ...]
    family: dict[str, float]
    error: float = float("nan")
    proposed: Causes = field(default_factory=lambda: Causes({}, (), {}))
    unfollowed: tuple[str, ...] = ()

    @cached_property
    def causes(self) -> Causes:
        """What is missing: inclusion probabilities and credible sets that exact refits confirm.

        A second or two at first, where several sets are proposed.
        """
        from .confirm import confirmed_causes  # it needs refits, which make candidates

        return confirmed_causes(self)

    @property
    def alpha(self) -> float:
        """Rate of false claims accepted, over all effects together."""
        return self.rules.alpha

    @property
    def floor(self) -> NoiseModel:
        """Noise that errors are measured by: that of the best refit, or of the fit as it is."""
        best = self.ranking[0].fit if self.significant else None
        return (self.fit if best is None else best).noise

    def errors_on(self, driving: Driving, floor: NoiseModel) -> dict[str, float]:
        """Errors with each effect that was refitted, one step ahead.

        Offsets of the driving's logs are those of each refit, from those of the fit as it is on.

        Parameters
        ----------
        driving : Driving
        floor : NoiseModel
            Its sensors and white motion noise are the unit.

        Returns
        -------
        dict of str to float
            By effect. Infinite where the model fails.
        """
        refitted = {c.id: c.fit for c in self.ranking if c.fit is not None}
        if refitted:
            driving_of(self.fit, driving)  # once, and not in each thread

        def error(fit: Fit) -> float:
            try:
                return one_step_error(fit, driving, floor, near=self.fit)
            except NumericalError:
                return float("inf")

        return dict(zip(refitted, in_parallel(error, refitted.values()), strict=True))

    def to_pandas(self) -> Any:
        """A DataFrame of the ranking, by effect."""
        found = self.ranking
        columns: dict[str, list[Any]] = {
            "effect": [c.id for c in found],
            "statistic": [c.statistic for c in found],
            "p_value": [c.p_value for c in found],
            "probability": [self.causes.inclusion.get(c.id, float("nan")) for c in found],
            "error": [c.error for c in found],
            "size": [c.size for c in found],
        }
        return frame(columns, "effect")

    @property
    def sizes(self) -> dict[str, Size]:
        """Parameters of each effect that was refitted, and their standard errors."""
        return {c.id: (c.value, c.std) for c in self.ranking if c.fit is not None}

    @property
    def significant(self) -> tuple[Candidate, ...]:
        """Candidates for which there is evidence."""
        return tuple(c for c in self.ranking if c.p_value < self.alpha)

    @property
    def named(self) -> Candidate | None:
        """The candidate that may be called missing, if there is one.

        The likeliest that a refit confirms, with a value that a car can have, or one that is nearly
        as likely. A score alone names nothing.
        """
        return None if self.reservation else self._likeliest

    @property
    def best(self) -> Effect:
        """The effect most likely missing.

        Raises
        ------
        InvalidInput
            There is evidence for none, or none may be named (`reservation`).
        """
        if not self.significant:
            raise InvalidInput(self._without_evidence())
        if self.named is None:
            raise InvalidInput(
                f"no effect can be named: {self.reservation}; check the channels and the vehicle "
                "file, or add one of `ranking` to look further"
            )
        return self.named.effect

    @cached_property
    def reservation(self) -> str:
        """Why no effect may be called missing, though there is evidence for some; else empty."""
        if not self.significant:
            return ""
        first = self._likeliest
        if first is None:
            return self._refused(self.significant[0])
        return reservation(self.beside, self.omnibus, self.error, first.error, self.rules)

    @cached_property
    def beside(self) -> Beside:
        """What is left with the likeliest effect in the model, or without any."""
        first = self._likeliest
        fit = self.fit if first is None else first.fit
        assert fit is not None  # the likeliest is refitted
        return beside(fit, self.driving, self.lacked, self.rules)

    @property
    def lacked(self) -> set[str]:
        """What the model lacks of the catalogue, and what was asked for beside that."""
        return {e.id for e in self.fit.model.candidates} | {c.id for c in self.ranking}

    @cached_property
    def _likeliest(self) -> Candidate | None:
        few = self.significant
        return next(
            (
                c
                for c in few
                if c.statistic >= self.rules.near * few[0].statistic
                and c.can_be(self.rules)
                and c.fit is not None
                and confirmed(c.statistic, c.effect, self.rules)
            ),
            None,
        )

    def _refused(self, c: Candidate) -> str:
        if c.fit is None:
            told = f"{c.id} is likeliest by its score alone: no refit confirms it"
        elif not confirmed(c.statistic, c.effect, self.rules):
            told = f"{c.id} is likeliest by its score, but a refit with it predicts no better"
        else:
            told = f"{c.id} fits best, but its value is physically implausible ({c.size})"
        worst = "; ".join(self.beside.unrelated.values())
        return f"{told}; {worst or self.beside.worst}"

    def _without_evidence(self) -> str:
        """What may be said where no effect is significant."""
        wrong = "; ".join(self.beside.unrelated.values())
        if wrong:
            return f"no effect of the catalogue is significant, but channels are wrong: {wrong}"
        if self.omnibus.rejects:
            return f"no effect of the catalogue explains what is missing: {self.omnibus}"
        return f"no effect of the catalogue is missing; {self.omnibus}"

    _HEAD = ("effect", "statistic", "p", "training error with it", "size", "confounded with")

    def _rows(self, most: int = 12) -> list[list[str]]:
        return [
            [
                c.id,
                f"{c.statistic:.1f}",
                f"{c.p_value:.2g}",
                "-" if np.isnan(c.error) else f"{c.error:.3f}",
                c.size,
                few(c.indistinguishable_from),
            ]
            for c in self.ranking[:most]
        ]

    def _headline(self) -> str:
        if not self.significant:
            return self._without_evidence()
        if self.named is None:
            return f"something is missing, but no effect can be named: {self.reservation}"
        what = f"most likely missing: {self.named.effect.title}"
        if self.named.indistinguishable_from:
            others = few(self.named.indistinguishable_from)
            what += f" (confounded with {others} in this driving)"
        # The test against unknown forces is blunter than that of one effect: its silence is none.
        return f"{what}; with it {self.beside.omnibus}" if self.omnibus.rejects else what

    __repr__ = brief

    def _parts(self) -> list[Part]:
        return [self._headline(), Table(self._HEAD, self._rows())]

    def plot(self, ax: Axes | None = None, most: int = 10) -> Axes:
        """Bars of the evidence for each effect."""
        ax = axes_or_new(ax, 6.0, 3.5)
        shown = self.ranking[:most][::-1]
        colours = ["tab:red" if c.p_value < self.alpha else "0.7" for c in shown]
        ax.barh([c.id for c in shown], [max(c.statistic, 0.1) for c in shown], color=colours)
        ax.set(
            xscale="log", xlabel="evidence (score statistic; refitted: 2 x gain in log-likelihood)"
        )
        return ax
