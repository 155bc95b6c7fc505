"""Shares of what is missing, and of what could be explained."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from .limits import USUAL, Rules

NONE_GONE = (
    "refitted to predict the validation data, the baseline has no larger error 1 to 5 s ahead"
)
"""Why what was added explains nothing, though the fits of one step err less with it."""


def share_explained(before: float, after: float) -> float:
    """Of the square of an error beyond the noise floor, what a richer model took away.

    All of it, where nothing was beyond the noise floor.
    """
    most, left = (max(error**2 - 1.0, 0.0) for error in (before, after))
    return share_of(most, left) if most > 0.0 else 1.0


def share_of(before: float, after: float) -> float:
    """Of what is missing, what a richer model took away; where nothing was missing, all or none."""
    if before > 0.0:
        return 1.0 - after / before
    return 0.0 if after > 0.0 else 1.0


@dataclass(frozen=True)
class Share:
    """Of what could be explained, what is; NaN where nothing could.

    Attributes
    ----------
    value, low, high : float
        With a 95 % interval.
    """

    value: float
    low: float
    high: float

    @property
    def known(self) -> bool:
        """Whether there is anything that could be explained."""
        return not np.isnan(self.value)

    def __str__(self) -> str:
        if not self.known:
            return ""
        return f"{_percent(self.value)} % ({_percent(self.low)} to {_percent(self.high)})"

    def to_dict(self) -> dict[str, float | None]:
        """Share and interval, ready for JSON."""
        names = ("value", "low", "high")
        return {n: getattr(self, n) if self.known else None for n in names}


def _percent(share: float) -> str:
    text = f"{100 * share:.0f}"
    return "0" if text == "-0" else text


def low_of_mean(shares: Sequence[Share]) -> float:
    """Lower end of the interval of the mean of shares, each of other data.

    Half intervals of independent figures add up as their squares do; NaN where one is unknown.
    """
    values, lows = (np.array([getattr(s, end) for s in shares]) for end in ("value", "low"))
    return float(values.mean() - np.linalg.norm(values - lows) / len(shares))


UNKNOWN = Share(np.nan, np.nan, np.nan)
"""A share of nothing, or of what was not asked."""


def share_between(
    squares: npt.NDArray[np.float64], least: float = 0.0, rules: Rules = USUAL
) -> Share:
    """Share of the way from the baseline to the ceiling.

    Parameters
    ----------
    squares : array, shape (1 + draws, 3)
        Mean squared errors of baseline, final model and ceiling: as found, then with blocks drawn
        anew (Efron 1979).
    least : float
        Share of the baseline's square that must be explainable.
    rules : Rules
        How sure that has to be.

    Returns
    -------
    Share
        Unknown where the ceiling is not below the baseline by so much in all draws but a share
        `alpha` of the rules.
    """
    before, after, least_left = squares.T
    explainable = before - np.minimum(least_left, after)
    seen = explainable - least * before
    if not seen[0] > 0.0 or not np.quantile(seen[1:], rules.alpha) > 0.0:
        return UNKNOWN
    found = explainable[1:] > 0.0
    drawn = (before[1:] - after[1:])[found] / explainable[1:][found]
    low, high = np.quantile(drawn, (0.025, 0.975))
    return Share(float((before[0] - after[0]) / explainable[0]), float(low), float(high))
