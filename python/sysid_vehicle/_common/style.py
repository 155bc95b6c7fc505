"""The look of figures, and drawing them without a window."""

from __future__ import annotations

import io
import re
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

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


def framed(width_in: float, height_in: float, left: float = 0.7, wspace: float = 0.3) -> Figure:
    """Make a figure with given margins [in] and gaps between axes (shares of their size).

    It is drawn in a third of the time that one takes whose margins are worked out.
    """
    from matplotlib.backends.backend_svg import FigureCanvasSVG
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width_in, height_in))
    FigureCanvasSVG(figure)
    figure.subplots_adjust(
        left / width_in,
        0.5 / height_in,
        1.0 - 0.15 / width_in,
        1.0 - 0.3 / height_in,
        wspace,
        0.12,
    )
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


def legend_above(ax: Axes) -> None:
    """Put the legend beside the title, where it covers no curve."""
    ax.legend(
        frameon=False,
        ncols=5,
        fontsize="small",
        loc="lower right",
        bbox_to_anchor=(1.0, 1.0),
        borderaxespad=0.1,
    )


def svg(figure: Figure) -> bytes:
    """Render a figure as SVG; the same figure gives the same bytes."""
    import matplotlib

    stream = io.BytesIO()
    with matplotlib.rc_context({"svg.hashsalt": "sysid-vehicle", "svg.fonttype": "path"}):
        figure.savefig(stream, format="svg", dpi=200, metadata={"Date": None})
    return stream.getvalue()


# Colours of figures, and names under which a page's style sheet has them for light and dark.
_THEMED = {
    MEASURED: "ink",
    "#ffffff": "paper",
    FLOOR: "mute",
    BEFORE: "before",
    AFTER: "after",
    TRUTH: "truth",
    "#b0b0b0": "grid",
    **dict.fromkeys(("#d9d9d9", "#e0e0e0", "#cccccc"), "unseen"),
    **dict.fromkeys(("#333333", "#4d4d4d", "#808080", "#7f7f7f"), "mute"),
}


def inline_svg(figure: Figure, name: str) -> str:
    """Render a figure as an element of a page, whose style sheet chooses the colours.

    Parameters
    ----------
    figure : matplotlib Figure
    name : str
        No other figure of the page has it: names inside the element are made of it.
    """
    import matplotlib

    stream = io.StringIO()
    with matplotlib.rc_context({"svg.hashsalt": name, "svg.fonttype": "none"}):
        figure.savefig(stream, format="svg", dpi=110, metadata={"Date": None}, facecolor="none")
    text = stream.getvalue()
    text = text[text.index("<svg") :]
    text = re.sub(r"<metadata>.*?</metadata>", "", text, count=1, flags=re.DOTALL)
    text = re.sub(r'(<svg[^>]*?) width="[^"]*"', r"\1", text, count=1)
    text = re.sub(r'(<svg[^>]*?) height="[^"]*"', r"\1", text, count=1)
    text = re.sub(r'<style type="text/css">.*?</style>', "", text, count=1)
    return re.sub(
        r"(?<=: )#[0-9a-f]{6}(?=[;\"])",
        lambda m: f"var(--{_THEMED[m[0]]})" if m[0] in _THEMED else m[0],
        text,
    )
