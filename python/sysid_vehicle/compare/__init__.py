"""Comparison of a fitted model with driving."""

from .compare import ChannelScore, Comparison, compare, one_step_error
from .unrelated import incoherent, unrelated
from .where import FailureMap, Region

__all__ = [
    "ChannelScore",
    "Comparison",
    "FailureMap",
    "Region",
    "compare",
    "incoherent",
    "one_step_error",
    "unrelated",
]
