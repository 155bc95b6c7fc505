"""The look of figures, and drawing them without a window."""

from __future__ import annotations

import io
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = [
    "AFTER",
    "BEFORE",
    "FLOOR",
    "MEASURED",
    "TRUTH",
    "axes_or_new",
    "new_figure",
    "svg",
    "tidy",
]

# Told apart in grey print and by colour-blind readers (Okabe & Ito, 2008).
MEASURED = "#000000"
BEFORE = "#d55e00"
AFTER = "#0072b2"
TRUTH = "#009e73"
FLOOR = "#666666"


def new_figure(width_in: float, height_in: float) -> Figure:
    """Make a figure that belongs to no window and that nothing keeps alive."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width_in, height_in), layout="constrained")
    FigureCanvasAgg(figure)
    return figure


def axes_or_new(ax: Axes | None, width_in: float, height_in: float) -> Axes:
    """Return `ax`, or where it is None the axes of a new figure that pyplot shows."""
    if ax is not None:
        return ax
    from matplotlib import pyplot

    return pyplot.figure(figsize=(width_in, height_in), layout="constrained").add_subplot()


def tidy(ax: Axes, **labels: Any) -> Axes:
    """Give axes the common look: a faint grid, no frame on the right and on top."""
    ax.set(**labels)
    ax.grid(visible=True, alpha=0.25, linewidth=0.6)
    ax.set_axisbelow(True)
    ax.spines[["top", "right"]].set_visible(False)
    return ax


def svg(figure: Figure) -> bytes:
    """Render a figure as SVG; the same figure gives the same bytes."""
    import matplotlib

    stream = io.BytesIO()
    with matplotlib.rc_context({"svg.hashsalt": "sysid-vehicle", "svg.fonttype": "path"}):
        figure.savefig(stream, format="svg", dpi=200, metadata={"Date": None})
    return stream.getvalue()
