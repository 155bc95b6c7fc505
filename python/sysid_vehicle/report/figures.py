"""The figures of a report; each draws onto given axes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from .._style import AFTER, BEFORE, FLOOR, MEASURED, TRUTH, axes_or_new, tidy
from ..diagnose import Causes
from ..model import Model
from ..study import Study
from .excerpt import Excerpt
from .tyres import TyreCurve
from .words import stages

if TYPE_CHECKING:
    from matplotlib.axes import Axes

__all__ = [
    "causes",
    "errors_by_step",
    "failure_maps",
    "overlay",
    "residuals",
    "sizes",
    "tyre_curve",
]

_WIDE_RANGE = 8.0  # largest over smallest error that still reads well on a linear axis


def errors_by_step(study: Study, ax: Axes | None = None) -> Axes:
    """Draw validation errors by step as bars, training errors as marks, and the noise floor."""
    ax = axes_or_new(ax, 7.0, 3.0)
    labels = list(study.steps)
    validation = [c.error for c in study.test]
    train = [c.error for c in study.train]
    at = np.arange(len(validation))
    colours = [BEFORE, *([AFTER] * (len(validation) - 1))]
    ax.bar(at, validation, width=0.55, color=colours, alpha=0.85, label="validation data")
    ax.plot(at, train, "D", color=MEASURED, markersize=6, label="training driving")
    ax.axhline(1.0, color=FLOOR, linestyle="--", linewidth=1.2, label="noise floor")
    for i, e in enumerate(validation):
        ax.annotate(
            f"{e:.2f}",
            (i - 0.25, e),
            (0, -12),
            textcoords="offset points",
            color="white",
            fontweight="bold",
        )
    top = max(*validation, *train)
    if top > _WIDE_RANGE:
        ax.set_yscale("log")
        ax.set_ylim(0.8, 2.0 * top)
    else:
        ax.set_ylim(0.0, 1.18 * top)
    ax.set_xticks(at, labels)
    ax.set_xlim(-0.6, max(len(at) - 0.4, 1.6))
    ax.legend(frameon=False, loc="upper right", fontsize="small")
    return tidy(ax, ylabel="error / noise floor")


def failure_maps(study: Study, axes: Sequence[Axes]) -> None:
    """Draw where the model of each stage fails on validation data, on one colour scale."""
    maps = [study.test[i].failure_map for _, i in stages(study)]
    # Single extreme cells would leave all others in one colour.
    cells = np.concatenate([m.error[np.isfinite(m.error)] for m in maps])
    highest = max(float(np.percentile(cells, 98.0)), 1.5) if cells.size else 1.5
    for ax, shown, (title, _) in zip(axes, maps, stages(study), strict=True):
        shown.plot(ax, highest=highest)
        _as_pixels(ax)
        ax.set_title(title, fontsize="medium")
    for ax in axes[1:]:
        ax.set_ylabel("")


def causes(
    found: Causes, grades: Mapping[str, str], ax: Axes | None = None, most: int = 10
) -> Axes:
    """Draw inclusion probabilities by credible set, with the grades of what was added."""
    return tidy(found.plot(axes_or_new(ax, 7.0, 3.4), most, grades))


def sizes(study: Study, ax: Axes | None = None, truth: Model | None = None) -> Axes:
    """Draw parameters of the added effects with 95 % intervals, in units of their typical size."""
    known = study.model.parameters
    estimates = [e for a in study.added for e in a.parameters]
    ax = axes_or_new(ax, 7.0, 0.9 + 0.4 * len(estimates))
    for row, e in enumerate(reversed(estimates)):
        p = known[e.name]
        matters = p.matters / p.typical
        ax.fill_betweenx([row - 0.35, row + 0.35], -matters, matters, color="0.88", linewidth=0.0)
        size = (e.value - p.null_value) / p.typical
        half = 1.96 * e.std / p.typical
        spread = half if np.isfinite(half) else 0.0
        ax.errorbar(size, row, xerr=spread, fmt="o", color=AFTER, capsize=4, markersize=5)
        if truth is not None and e.name in truth.names:
            real = (truth.value(e.name) - p.null_value) / p.typical
            ax.plot(real, row, "|", color=TRUTH, markersize=18, markeredgewidth=2.0)
    ax.axvline(0.0, color=FLOOR, linewidth=1.0)
    ax.set_yticks(range(len(estimates)), [e.name for e in reversed(estimates)])
    ax.set_ylim(-0.6, len(estimates) - 0.4)
    return tidy(ax, xlabel="size / typical size (grey: too small to matter)")


def tyre_curve(
    curve: TyreCurve,
    ax: Axes | None = None,
    *,
    start: TyreCurve | None = None,
    truth: TyreCurve | None = None,
) -> Axes:
    """Draw lateral force over slip angle with its 95 % band; hatched where nobody drove."""
    ax = axes_or_new(ax, 3.8, 3.2)
    slip = np.degrees(curve.slip_rad)
    force = curve.force_n / 1e3
    half = 1.96 * curve.std_n / 1e3
    ax.fill_between(slip, force - half, force + half, color=AFTER, alpha=0.25, linewidth=0.0)
    ax.plot(slip, force, color=AFTER, label="identified, 95 % band")
    if start is not None:
        ax.plot(slip, start.force_n / 1e3, color=BEFORE, linestyle=":", label="vehicle file")
    if truth is not None:
        ax.plot(slip, truth.force_n / 1e3, color=TRUTH, linestyle="--", label="truth")
    ends = float(np.degrees(curve.driven_rad))
    if ends < slip[-1]:
        ax.axvspan(ends, slip[-1], facecolor="none", edgecolor="0.8", hatch="///", linewidth=0.0)
    ax.set_xlim(0.0, float(slip[-1]))
    ax.set_ylim(0.0, 1.2 * float(force.max()))
    ax.set_title(f"{curve.axle} axle", fontsize="medium")
    ax.legend(frameon=False, loc="lower right", fontsize="small")
    return tidy(ax, xlabel="slip angle [deg]", ylabel="lateral force at static load [kN]")


def overlay(excerpt: Excerpt, axes: Sequence[Axes]) -> None:
    """Draw measured and predicted channels over a few seconds, and below each what is left.

    `axes` holds two per channel of the excerpt: signal, then error.
    """
    t = excerpt.time_s
    for i, channel in enumerate(excerpt.channels):
        signal, error = axes[2 * i], axes[2 * i + 1]
        measured = excerpt.measured[:, i]
        signal.plot(t, measured, color=MEASURED, linewidth=1.4, label="measured")
        for (label, errors), colour in zip(excerpt.errors.items(), (BEFORE, AFTER), strict=False):
            left = errors[:, i]
            signal.plot(t, measured - left, color=colour, linewidth=1.0, label=label)
            error.plot(t, left, color=colour, linewidth=0.9)
        error.axhline(0.0, color=FLOOR, linewidth=0.8)
        tidy(signal, ylabel=channel)
        tidy(error, ylabel="error")
    axes[0].legend(
        frameon=False, ncols=3, fontsize="small", loc="lower right", bbox_to_anchor=(1.0, 1.0)
    )
    axes[-1].set_xlabel("time_s")


def residuals(study: Study, axes: Sequence[Axes]) -> None:
    """Draw the running size of the validation residuals at each stage of the study, by channel."""
    for ax, (title, i) in zip(axes, stages(study), strict=True):
        study.test[i].plot_residuals(ax)
        _as_pixels(ax)
        ax.set_title(title, fontsize="medium", loc="left")
        tidy(ax, ylabel="residual / floor")
        legend = ax.get_legend()
        if legend is not None:
            legend.remove()
    for ax in axes[:-1]:
        ax.set_xlabel("")
    axes[0].legend(
        frameon=False, ncols=5, fontsize="small", loc="lower right", bbox_to_anchor=(1.0, 1.0)
    )


def _as_pixels(ax: Axes) -> None:
    """Keep what has thousands of points, or seams between cells, out of the vectors."""
    for artist in (*ax.lines, *ax.collections):
        artist.set_rasterized(True)
