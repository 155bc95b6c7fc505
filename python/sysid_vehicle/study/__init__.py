"""Studies: the whole loop from a log to a better model."""

from ..rules import Verdict
from .ahead.horizons import LATERAL, PREDICTED, Horizons, horizons
from .ahead.waterfall import Waterfall, look_ahead
from .asked import asked
from .improve import improve
from .next_drive import next_drive
from .results.added import AddedEffect
from .results.hidden import open_effects
from .results.sentences import events, left_out
from .study import Study

__all__ = [
    "LATERAL",
    "PREDICTED",
    "AddedEffect",
    "Horizons",
    "Study",
    "Verdict",
    "Waterfall",
    "asked",
    "events",
    "horizons",
    "improve",
    "left_out",
    "look_ahead",
    "next_drive",
    "open_effects",
]
