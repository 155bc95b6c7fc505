"""Comparison of a fitted model with driving."""

from .compare import ChannelScore, Comparison, compare, one_step_error
from .event import Event
from .failure_map import FailureMap, Region
from .unrelated import incoherent, unrelated

__all__ = [
    "ChannelScore",
    "Comparison",
    "Event",
    "FailureMap",
    "Region",
    "compare",
    "incoherent",
    "one_step_error",
    "unrelated",
]
