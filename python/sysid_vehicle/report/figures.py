"""The figures of a report; each draws onto given axes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from .._style import AFTER, BEFORE, FLOOR, MEASURED, TRUTH, axes_or_new, legend_above, tidy
from ..diagnose import Causes
from ..model import Model
from ..study import Study
from .excerpt import Excerpt
from .tyres import TyreCurve
from .words import shown_in, stages

if TYPE_CHECKING:
    from matplotlib.axes import Axes

__all__ = [
    "ahead",
    "causes",
    "failure_maps",
    "overlay",
    "place",
    "residuals",
    "sizes",
    "tyre_curve",
]

_OVAL = 0.15  # a track's smaller extent over its larger one, above which its map is worth a look
_POINTS = 1200


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
        signal, error, shown = axes[2 * i], axes[2 * i + 1], shown_in(channel)
        measured = shown.factor * excerpt.measured[:, i]
        signal.plot(t, measured, color=MEASURED, linewidth=1.4, label="measured")
        styles = ((BEFORE, "--"), (AFTER, "-"))
        for (label, errors), (colour, line) in zip(excerpt.errors.items(), styles, strict=False):
            left = shown.factor * errors[:, i]
            look: dict[str, Any] = {"color": colour, "linestyle": line}
            signal.plot(t, measured - left, linewidth=1.1, label=label, **look)
            error.plot(t, left, linewidth=1.0, **look)
        error.axhline(0.0, color=FLOOR, linewidth=0.8)
        signal.set_title(f"{shown.name} [{shown.unit}]", loc="left", fontsize="medium")
        tidy(signal)
        tidy(error, ylabel="error")
    legend_above(axes[0])
    axes[-1].set_xlabel("time [s]")


def place(study: Study, excerpt: Excerpt, ax: Axes) -> str:
    """Draw where the baseline fails: on a map of the track, or over both accelerations.

    Returns what was drawn, in words. The map is that of the stretch of the excerpt, from speed and
    yaw rate; a track that is hardly wider than its road is not worth a map.
    """
    driving = study.validation
    begin = 0
    for s in driving.stretches:
        end = begin + s.where.stop - s.where.start
        if begin <= excerpt.where.start < end:
            break
        begin = end
    stretch = slice(begin, end)
    rate = driving.logs[s.log].rate_hz
    residual = study.test[0].residual[stretch]
    box = np.ones(max(round(0.5 * rate), 1))
    squares, count = (
        np.convolve(x, box, "same")
        for x in (np.nansum(residual**2, axis=1), np.isfinite(residual).sum(axis=1))
    )
    error = np.sqrt(squares / np.maximum(count, 1.0))
    v, r, ax_, ay = (
        np.nan_to_num(driving.channel(c)[stretch])
        for c in ("vx_mps", "yaw_rate_radps", "ax_mps2", "ay_mps2")
    )
    heading = np.cumsum(r) / rate
    track = np.cumsum(v[:, None] * np.column_stack([np.cos(heading), np.sin(heading)]), axis=0)
    extent = np.sort(np.ptp(track, axis=0))
    on_track = bool(extent[0] > _OVAL * extent[1])
    points = track / rate if on_track else np.column_stack([ay, ax_])
    if on_track and np.ptp(points[:, 1]) > np.ptp(points[:, 0]):
        points = np.column_stack([-points[:, 1], points[:, 0]])  # the longer side lies
    ax.set_facecolor("#f2f2f2")  # in the dark, too: the colours of the error begin dark
    every = max(len(points) // _POINTS, 1)
    inside = slice(excerpt.where.start - begin, excerpt.where.stop - begin, max(every, 1))
    around: dict[str, Any] = {"markersize": 9, "markerfacecolor": "none", "markeredgewidth": 0.8}
    (ring,) = ax.plot(points[inside, 0], points[inside, 1], "o", color=MEASURED, **around)
    ring.set_rasterized(True)
    shown = points[::every]
    drawn = ax.scatter(shown[:, 0], shown[:, 1], s=14, c=error[::every], cmap="cividis", zorder=3)
    drawn.set_clim(1.0, max(float(np.percentile(error, 99.0)), 1.5))
    drawn.set_rasterized(True)
    ax.figure.colorbar(drawn, ax=ax, label="error / noise floor", pad=0.02, fraction=0.06)
    if on_track:
        ax.set_aspect("equal", adjustable="datalim")
        tidy(ax, xlabel="[m]", ylabel="[m]")
        return "Track from speed and yaw rate"
    tidy(ax, xlabel="lateral acceleration [m/s\u00b2]", ylabel="longitudinal [m/s\u00b2]")
    return "Both accelerations"


def ahead(study: Study, channels: Sequence[str], axes: Sequence[Axes]) -> None:
    """Draw the validation error of each stage over the horizon, a channel on each axes."""
    found = study.horizons
    looks = ((BEFORE, "--o"), (AFTER, "-o"))
    for ax, channel in zip(axes, channels, strict=True):
        j, shown = found.channels.index(channel), shown_in(channel)
        for (title, i), (colour, line) in zip(stages(study), looks, strict=False):
            error = shown.factor * np.where(np.isfinite(found.error), found.error, np.nan)[i, :, j]
            ax.plot(found.horizons_s, error, line, color=colour, markersize=4, label=title)
        noise = shown.factor * float(found.noise[j])
        ax.axhline(noise, color=FLOOR, linestyle=":", linewidth=1.2)
        ax.set_ylim(bottom=0.0)
        tidy(ax, xlabel="predicted ahead [s]", ylabel=f"{shown.name} [{shown.unit}]")
    legend_above(axes[0])


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
    legend_above(axes[0])


def _as_pixels(ax: Axes) -> None:
    """Keep what has thousands of points, or seams between cells, out of the vectors."""
    for artist in (*ax.lines, *ax.collections):
        artist.set_rasterized(True)
