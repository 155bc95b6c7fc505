"""May an effect be named, or is something else wrong? What is left beside the likeliest one tells.

Readings that are late, shuffled or in another unit are no effect of a car. Some effect of the
catalogue always fits them best, and its score may be large, as scores are taken at a fit that is
nowhere near the truth. But the refit does not confirm it, or what was left before stays.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import scipy

from ...compare import Comparison, compare
from ...effects import Effect
from ...estimate import Driving
from ...identify import Fit
from ...rules import USUAL, Rules, excess, share_explained
from ..evidence.evidence import Evidence
from ..unexplained.omnibus import Omnibus, omnibus_of
from .possible import lacking
from .score import ScoreBoard, score_board_of


@dataclass(frozen=True, eq=False)
class Beside:
    """What a model leaves that has the likeliest effect.

    Attributes
    ----------
    fit : Fit
    driving : Driving
    lacked : frozenset of str
        Effects that may be missing too.
    rules : Rules
    """

    fit: Fit
    driving: Driving
    lacked: frozenset[str]
    rules: Rules = USUAL

    @cached_property
    def evidence(self) -> Evidence:
        """The residuals."""
        return Evidence(self.fit, self.driving)

    @cached_property
    def omnibus(self) -> Omnibus:
        """Whether anything is left."""
        return omnibus_of(self.evidence, self.rules)

    @cached_property
    def board(self) -> ScoreBoard:
        """Scores of the other effects."""
        others = lacking(self.fit.model, self.lacked)
        return score_board_of(self.evidence, others, self.rules)

    @cached_property
    def _comparison(self) -> Comparison:
        return compare(self.fit, self.driving)

    @property
    def unrelated(self) -> dict[str, str]:
        """Channels that contradict the others, and how."""
        return self._comparison.unrelated

    @property
    def worst(self) -> str:
        """The channel with the largest innovations, in words."""
        channels = self._comparison.channels
        name = max(channels, key=lambda c: channels[c].nrmse)
        return f"the largest innovations are those of {name} ({channels[name].nrmse:.2f} expected)"


def beside(fit: Fit, driving: Driving, lacked: set[str], rules: Rules = USUAL) -> Beside:
    """Look at what a model leaves; nothing is computed before it is asked for."""
    return Beside(fit, driving, frozenset(lacked), rules)


def confirmed(statistic: float, effect: Effect, rules: Rules = USUAL) -> bool:
    """Whether a refit gained more than its parameters gain by chance."""
    return float(scipy.stats.chi2.sf(statistic, len(effect.parameters))) < rules.level


def reservation(
    left: Beside,
    before: Omnibus,
    error_before: float,
    error_after: float,
    rules: Rules = USUAL,
) -> str:
    """Why the likeliest effect may not be called missing; empty where it may.

    Parameters
    ----------
    left : Beside
        What the model with the effect leaves.
    before : Omnibus
        Without the effect.
    error_before, error_after : float
        One step ahead, without and with the effect, at one noise floor; NaN where not refitted.
    rules : Rules
    """
    if left.unrelated:
        return "; ".join(left.unrelated.values())
    if not left.omnibus.p_value < rules.strict or not left.fit.model.effects:
        return ""
    share = excess(left.omnibus) / max(excess(before), 1.0)
    if share > rules.most and share_explained(error_before, error_after) < rules.taken:
        return (
            f"with the best-fitting effect {100 * min(share, 1.0):.0f} % of the evidence that "
            f"something is missing remains, and the error does not fall; {left.worst}"
        )
    if not any(p < rules.alpha for p in left.board.family_p_values().values()):
        return (
            f"with the best-fitting effect {left.omnibus}, and no other effect of the catalogue "
            f"explains that; {left.worst}"
        )
    return ""
