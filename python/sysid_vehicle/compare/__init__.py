"""Comparison of a fitted model with driving."""

from .compare import ChannelScore, Comparison, compare
from .unrelated import out_of_time, unrelated
from .where import FailureMap, Region

__all__ = [
    "ChannelScore",
    "Comparison",
    "FailureMap",
    "Region",
    "compare",
    "out_of_time",
    "unrelated",
]
