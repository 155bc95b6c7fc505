"""Studies: the whole loop from a log to a better model."""

from .improve import improve
from .study import AddedEffect, Study, Verdict
from .waterfall import Waterfall

__all__ = ["AddedEffect", "Study", "Verdict", "Waterfall", "improve"]
