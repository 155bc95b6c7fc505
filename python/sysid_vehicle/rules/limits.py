"""All limits that decide what is claimed, each with its unit, meaning and benchmark."""

from __future__ import annotations

from dataclasses import dataclass, field, fields, replace
from statistics import NormalDist
from typing import Any

import numpy as np

from .._common.arguments import real
from .._common.text import text_table
from .._common.typed import typed_fields
from ..errors import InvalidInput

_NULLS = "benchmarks/exam --draw null=2000"
_EFFECTS = "benchmarks/exam --draw effect=120 pair=50 --severity 1 2"
_OUTSIDE = 'benchmarks/exam --draw "group removed=70" outside=40 --severity 0.5 2'
_CONVENTION = "convention"
_LEVEL = "convention; rates of false claims: benchmarks/exam --draw null=2000"
_BREIMAN = "convention: Breiman et al., Classification and Regression Trees (1984), sec. 3.4.3"
_NUMERICAL = "numerical: what rounding and the end of a search leave"


def _limit(value: float, unit: str, meaning: str, chosen_by: str) -> float:
    told = {"unit": unit, "meaning": meaning, "chosen_by": chosen_by}
    found: float = field(default=value, metadata=told)
    return found


@dataclass(frozen=True)
class Rules:
    """Every limit that decides what is claimed; printed, a table with units and meanings.

    Seven are tuned, by the benchmarks they name. The others are levels of significance and other
    conventions, or tolerances of the arithmetic; what follows from those is a property.

    Raises
    ------
    InvalidInput
        A limit is no positive finite number, or a probability or share above 1.
    """

    alpha: float = _limit(
        0.05, "probability", "of a false claim, over all effects together, per step", _LEVEL
    )
    level: float = _limit(
        0.01, "probability", "below which a single test of a complete model rejects it", _LEVEL
    )
    strict: float = _limit(
        1e-3,
        "probability",
        "below which what is left makes names uncertain, and is no disturbance",
        _LEVEL,
    )
    retained: float = _limit(
        1e-3,
        "share",
        "of an effect that fitted parameters cannot copy; less is not testable",
        _NUMERICAL,
    )
    lasts: float = _limit(
        5.0, "s", "of usable training data that each effect of a model takes", _EFFECTS
    )
    implausible: float = _limit(
        5.0, "typical sizes", "beyond which a value is physically implausible", _OUTSIDE
    )
    price: float = _limit(
        2.0, "BIC penalties", "of one parameter that the likelihood ratio of a refit covers", _NULLS
    )
    lean: float = _limit(
        1.0,
        "standard errors",
        "by which measures speak for an effect whose error falls, and, in the mean over horizons, "
        "errors ahead of a channel against it",
        _BREIMAN,
    )
    sure: float = _limit(
        4.5,
        "standard errors",
        "of likelihood on validation data that decide alone, and between what two data sets tell",
        _EFFECTS,
    )
    worse: float = _limit(0.05, "share", "by which no error 1 to 5 s ahead may grow", _EFFECTS)
    nothing: float = _limit(
        0.5, "probability", "before any data, that one of a sum of effects is none", _CONVENTION
    )
    credible: float = _limit(
        0.95,
        "probability",
        "that a credible set holds a missing effect, an interval or a bound a parameter",
        _CONVENTION,
    )
    same: float = _limit(
        0.05, "twice nats", "between fits that are the same by other names", _NUMERICAL
    )
    near: float = _limit(
        0.6, "share", "of the evidence for the best, with which another may replace it", _EFFECTS
    )
    most: float = _limit(
        0.9,
        "share",
        "of the error that names take up beside which something is left; less than the rest of it "
        "is no part worth a name, and no structure",
        _OUTSIDE,
    )

    @typed_fields
    def __post_init__(self) -> None:
        for f in fields(self):
            value = real(getattr(self, f.name))
            most = 1.0 if f.metadata["unit"] in ("probability", "share") else np.inf
            certain = f.name == "credible" and value == 1.0  # no interval is certain
            if value is None or not 0.0 < value <= most or np.isinf(value) or certain:
                wanted = "between 0 and 1" if most == 1.0 else "above 0, finite"
                raise InvalidInput(f"{f.name} = {getattr(self, f.name)!r}: give a number {wanted}")
            object.__setattr__(self, f.name, value)

    @property
    def interval(self) -> float:
        """Half the interval of a normal variable that is `credible` [standard errors].

        Beyond it measures speak for an effect whose error does not fall, and errors at one horizon
        against any.
        """
        return self.interval_of(1)

    def interval_of(self, tests: int) -> float:
        """The same where all of so many intervals are `credible` together (Bonferroni)."""
        return NormalDist().inv_cdf(1.0 - 0.5 * (1.0 - self.credible) / max(tests, 1))

    @property
    def bound(self) -> float:
        """The same of a bound on one side [standard errors]."""
        return NormalDist().inv_cdf(self.credible)

    @property
    def told(self) -> float:
        """Evidence beyond which a claim is `credible`, were it as likely as not before [nats]."""
        return float(np.log(self.credible / (1.0 - self.credible)))

    @property
    def insignificant(self) -> float:
        """Distance from nothing within which an effect may be needless [standard errors].

        That of a single test at `level`.
        """
        return NormalDist().inv_cdf(1.0 - 0.5 * self.level)

    @property
    def apart(self) -> float:
        """Log-likelihood that tells two models apart, beyond the BIC penalty [nats].

        That by which a parameter of normal error is shown at `strict` to have one sign.
        """
        return 0.5 * NormalDist().inv_cdf(1.0 - self.strict) ** 2

    @property
    def explainable(self) -> float:
        """Share of a missing force, or of an error ahead, that the driving predicts: structure."""
        return 1.0 - self.most

    @property
    def taken(self) -> float:
        """Share of the error that is worth a name: less than what may be left beside names."""
        return 1.0 - self.most

    def at(self, alpha: float | None) -> Rules:
        """The same with another rate of false claims; None leaves it as it is."""
        return self if alpha is None else replace(self, alpha=alpha)

    def to_dict(self) -> dict[str, dict[str, Any]]:
        """Value, unit, meaning and benchmark of each limit, ready for JSON."""
        return {f.name: {"value": getattr(self, f.name), **f.metadata} for f in fields(self)}

    def __str__(self) -> str:
        told = self.to_dict().items()
        rows = [[n, f"{t['value']:g}", t["unit"], t["meaning"], t["chosen_by"]] for n, t in told]
        return text_table(("limit", "value", "unit", "meaning", "chosen or judged by"), rows)


USUAL = Rules()
"""The rules that hold where none are given."""
