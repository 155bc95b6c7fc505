"""Reports: a study as one HTML file."""

from .check import check_page
from .samples import Samples, samples_of
from .tyres import TyreCurve, identified_curves, model_curves
from .words import RANKING_HEAD, ranking_rows, ranking_title, summary
from .write import write_report

__all__ = [
    "RANKING_HEAD",
    "Samples",
    "TyreCurve",
    "check_page",
    "identified_curves",
    "model_curves",
    "ranking_rows",
    "ranking_title",
    "samples_of",
    "summary",
    "write_report",
]
