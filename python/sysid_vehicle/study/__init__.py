"""Studies: the whole loop from a log to a better model."""

from ..rules import Verdict
from .added import AddedEffect
from .horizons import LATERAL, PREDICTED, Horizons, horizons
from .improve import improve
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
    "look_ahead",
]
