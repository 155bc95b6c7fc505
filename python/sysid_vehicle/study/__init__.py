"""Studies: the whole loop from a log to a better model."""

from ..rules import Verdict
from .added import AddedEffect
from .hidden import open_effects
from .horizons import LATERAL, PREDICTED, Horizons, horizons
from .improve import improve
from .said import left_out
from .study import Study
from .waterfall import Waterfall, look_ahead

__all__ = [
    "LATERAL",
    "PREDICTED",
    "AddedEffect",
    "Horizons",
    "Study",
    "Verdict",
    "Waterfall",
    "horizons",
    "improve",
    "left_out",
    "look_ahead",
    "open_effects",
]
