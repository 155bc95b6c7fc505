"""What was hidden against what was named."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt
from design import catalogue
from matplotlib.axes import Axes
from trial import Outcome

NOTHING = "nothing"


def confusion(
    outcomes: Sequence[Outcome],
) -> tuple[tuple[str, ...], npt.NDArray[np.int64]]:
    """Count by hidden effect (rows) and the one named first (columns).

    Returns
    -------
    names : tuple of str
        `nothing`, then the catalogue.
    counts : array, shape (names, names)
    """
    names = (NOTHING, *(e.id for e in catalogue()))
    at = {n: i for i, n in enumerate(names)}
    counts = np.zeros((len(names), len(names)), dtype=np.int64)
    for o in outcomes:
        if o["state"] == "done" and o["trial"]["kind"] in ("null", "effect"):
            truth = o["trial"]["truth"][0] if o["trial"]["truth"] else NOTHING
            counts[at[truth], at[o["leader"] or NOTHING]] += 1
    return names, counts


def draw(outcomes: Sequence[Outcome], ax: Axes) -> Axes:
    """Draw the confusion matrix, each row as shares of what was hidden."""
    names, counts = confusion(outcomes)
    shares = counts / np.maximum(counts.sum(axis=1, keepdims=True), 1)
    ax.imshow(np.where(counts > 0, shares, np.nan), vmin=0.0, vmax=1.0, cmap="Blues")
    for row, column in zip(*np.nonzero(counts), strict=True):
        colour = "white" if shares[row, column] > 0.6 else "black"
        ax.text(column, row, counts[row, column], ha="center", va="center", color=colour, size=6)
    ax.set_xticks(range(len(names)), names, rotation=90, size=6)
    ax.set_yticks(range(len(names)), names, size=6)
    ax.set(xlabel="named first", ylabel="hidden")
    return ax
