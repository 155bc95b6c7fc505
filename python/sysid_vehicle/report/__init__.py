"""Reports: a study as one HTML file."""

from .check import check_page
from .figures import causes, failure_maps, overlay, residuals, sizes, tyre_curve
from .tyres import TyreCurve, identified_curves, model_curves
from .words import RANKING_HEAD, ranking_rows, ranking_title, summary
from .write import write_report

__all__ = [
    "RANKING_HEAD",
    "TyreCurve",
    "causes",
    "check_page",
    "failure_maps",
    "identified_curves",
    "model_curves",
    "overlay",
    "ranking_rows",
    "ranking_title",
    "residuals",
    "sizes",
    "summary",
    "tyre_curve",
    "write_report",
]
