"""Studies: the whole loop from a log to a better model."""

from .added import AddedEffect
from .horizons import Horizons
from .improve import improve
from .study import Study, Verdict
from .waterfall import Waterfall, look_ahead

__all__ = ["AddedEffect", "Horizons", "Study", "Verdict", "Waterfall", "improve", "look_ahead"]
