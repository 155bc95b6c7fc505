"""What becomes of a study where parameters are fitted to predictions of seconds.

The likelihood is that of one step. Where a model lacks something, its maximum may predict poorly
some seconds ahead, and a part of what an effect takes away then is what other parameters would have
taken away as well.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from ..._common.text import number
from ...estimate import UNITS
from ...identify import Fit
from ...rules import ErrorChange, Rules
from ..ahead.horizons import Horizons, changes, horizons
from ..validation import AHEAD_S, fitted_ahead, longest_s

if TYPE_CHECKING:
    from ..study import Study

_WORTH = 0.1  # logarithm of the ratio of two errors that differ


@dataclass(frozen=True, eq=False)
class Predicting:
    """The first and the last model of a study, fitted to predictions some seconds ahead.

    Attributes
    ----------
    baseline, final : Fit
        One and the same where nothing was added.
    horizon_s : float
    better : tuple of ErrorChange
        Errors of the final model so far ahead on validation data, against the likelihood's.
    needed : tuple of ErrorChange
        The same against those of the baseline, both fitted to predictions; empty where nothing was
        added.
    errors : Horizons
        The final model as the likelihood fits it, then as fitted to predictions.
    """

    baseline: Fit
    final: Fit
    horizon_s: float
    better: tuple[ErrorChange, ...]
    needed: tuple[ErrorChange, ...]
    errors: Horizons
    rules: Rules

    @property
    def helps(self) -> bool:
        """Whether some error falls, and none grows."""
        return self._falls(self.better)

    @property
    def explains(self) -> bool:
        """Whether what was added is needed so far ahead."""
        return not self.needed or self._falls(self.needed)

    def _falls(self, found: Sequence[ErrorChange]) -> bool:
        sure = [c for c in found if abs(c.log_ratio) > self.rules.interval * c.error]
        falls = any(c.log_ratio < -_WORTH for c in sure)
        return falls and not any(c.log_ratio > _WORTH for c in sure)

    def to_dict(self) -> dict[str, Any]:
        """Parameters of the final model, and what they change, ready for JSON."""
        return {
            "horizon_s": self.horizon_s,
            "parameters": {e.name: e.to_dict() for e in self.final.estimates},
            "helps": self.helps,
            "added_is_needed": self.explains,
            "errors": self.errors.to_dict(),
        }

    def __str__(self) -> str:
        """Sentences, or nothing where the likelihood predicts as well."""
        said = []
        if self.helps:
            before, after = self.errors.error[0, 0], self.errors.error[-1, 0]
            told = ", ".join(
                f"{c} {number(float(a), 2)} {UNITS[c]} for {number(float(b), 2)}"
                for c, b, a in zip(self.errors.channels, before, after, strict=True)
            )
            said.append(
                f"Fitted to predictions {self.horizon_s:g} s ahead (`study.predicting.final`), the "
                f"final model has smaller errors there on validation data than as fitted one step "
                f"ahead: {told}."
            )
        if not self.explains and self._falls(self.better):
            said.append(
                f"The baseline so fitted has no larger error: {self.horizon_s:g} s ahead the "
                "effects added are not needed."
            )
        return " ".join(said)


def predicting(study: Study) -> Predicting | None:
    """Fit the first and the last model of a study to predictions; None where that cannot be done.

    Parameters
    ----------
    study : Study
    """
    if longest_s(study.validation) < 2.0 * AHEAD_S:
        return None
    final, baseline = fitted_ahead(study.fit), fitted_ahead(study.fits[0])
    if final is None or baseline is None:
        return None
    ahead, elsewhere = (AHEAD_S,), study.validation
    return Predicting(
        baseline,
        final,
        AHEAD_S,
        changes(study.fit, final, elsewhere, ahead),
        changes(baseline, final, elsewhere, ahead) if len(study.fits) > 1 else (),
        horizons([study.fit, final], ["one step", f"{AHEAD_S:g} s ahead"], elsewhere, ahead),
        study.rules,
    )
