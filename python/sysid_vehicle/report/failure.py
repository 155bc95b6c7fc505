"""Sections on the force that is missing: where, when, how fast, and of which shape."""

from __future__ import annotations

import numpy as np

from .._common.arrays import FloatArray
from .._common.text import HALF_95
from ..diagnose import INPUTS, Coherence, Curve, ForceMap, Surface, Where
from ..diagnose.evidence.coordinates import COORDINATES
from ..diagnose.unexplained.force_map import UNITS
from ..model import Model
from ..study import Study
from .chart import DIVERGING, Chart, figure, legend, scale
from .page import bullets, heading, paragraph
from .samples import Samples

_SIZE = 430, 260


def where_and_when(study: Study, samples: Samples | None, truth: Model | None) -> list[str]:
    """Where the baseline fails, and where, when and at which frequencies the final model does."""
    final, baseline = study.where, study.where_baseline
    parts = []
    for title, lines in study.where_lines:
        parts += [heading(title, 3), bullets(f"{line[0].upper()}{line[1:]}." for line in lines)]
    whose = "the final model" if study.added else "the baseline"
    best = baseline.best_map or baseline.over_time
    if len(best.coordinates) == 2:
        grid, told = _map(best)
        read = "grey: hardly any driving; dots: beyond two standard errors"
    else:
        grid, told, read = over_one(best), "", "with 95 % intervals"
    follows = baseline.coherence[0]
    channels = list(follows.coherence)
    key = legend([*((f"c{i}", c) for i, c in enumerate(channels)), ("chance", "by chance, 95 %")])
    return [
        *parts,
        figure(
            [grid, _coherence(follows)],
            f"Of the baseline: the force that it lacks, over {best.title}, of all that moved what "
            f"predicts most of it on other pieces of the driving ({read}), and how far its "
            f"residuals follow the {INPUTS[follows.input]}, by frequency.",
            told + key,
            "row",
        ),
        figure(
            [_over_time(final), _phase(final.coherence[0])],
            f"Of {whose}: the force that it lacks over the time driven with 95 % intervals "
            "(upright lines are moments at which the car changed), and by what phase the car "
            "lags it, with the delay that fits; a delay is a straight line.",
            kind="row",
        ),
    ]


def _map(found: ForceMap) -> tuple[Chart, str]:
    """The map of the strongest force over two coordinates, and what its colours mean."""
    target = found.strongest
    i = found.targets.index(target)
    force, std = found.force[i], found.std[i]
    up, along = (COORDINATES[c] for c in found.coordinates)
    y, x = (c.scale * e for c, e in zip((up, along), found.edges, strict=True))
    beyond = np.argwhere(np.abs(force) > 2.0 * std)
    middles = [0.5 * (e[1:] + e[:-1]) for e in (y, x)]
    return _grid(
        (x, y), force, (middles[1][beyond[:, 1]], middles[0][beyond[:, 0]]),
        (along.axis, up.axis), f"missing {target} [{UNITS[target]}]",
    )  # fmt: skip


def _grid(
    edges: tuple[FloatArray, FloatArray],
    force: FloatArray,
    sure: tuple[FloatArray, FloatArray],
    labels: tuple[str, str],
    name: str,
) -> tuple[Chart, str]:
    x, y = edges
    top = max(float(np.nanmax(np.abs(force), initial=0.0)), 1e-9)
    chart = Chart(
        *_SIZE, (float(x[0]), float(x[-1])), (float(y[0]), float(y[-1])),
        xlabel=labels[0], ylabel=labels[1],
    )  # fmt: skip
    chart.cells(x, y, force, (-top, top), DIVERGING)
    chart.dots(*sure, "small")
    return chart, scale((-top, top), DIVERGING, name)


def _over_time(found: Where) -> Chart:
    chart = over_one(found.over_time)
    for c in found.change_points or ():
        chart.moment(c.driven_s, c.what)
    return chart


def over_one(found: ForceMap) -> Chart:
    """The map of the strongest force over one coordinate, with 95 % intervals."""
    target = found.strongest
    i = found.targets.index(target)
    coordinate = COORDINATES[found.coordinates[0]]
    edges = coordinate.scale * found.edges[0]
    force, half = found.force[i], HALF_95 * found.std[i]
    known = [float(v) for v in (*(force - half), *(force + half)) if np.isfinite(v)]
    first = 0.0 if found.coordinates == ("time_s",) else float(edges[0])
    chart = Chart(
        *_SIZE, (first, float(edges[-1])),
        (min([*known, 0.0]), max([*known, 0.0])), xlabel=coordinate.axis,
        ylabel=f"missing {target} [{UNITS[target]}]", left=60,
    )  # fmt: skip
    chart.level(0.0)
    chart.bars(0.5 * (edges[1:] + edges[:-1]), force, half)
    return chart


def _coherence(found: Coherence) -> Chart:
    f = found.frequency_hz
    chart = Chart(
        *_SIZE, (0.0, float(f[-1])), (0.0, 1.0), xlabel="frequency [Hz]",
        ylabel=f"coherence with the {INPUTS[found.input]}",
    )  # fmt: skip
    for i, c in enumerate(found.coherence.values()):
        chart.line(f, c, f"c{i}")
    chart.level(found.threshold, "chance")
    return chart


def _phase(found: Coherence) -> Chart:
    x_name, y_name = "frequency [Hz]", f"lag behind the {INPUTS[found.input]} [deg]"
    d = found.delay
    if d is None:
        empty = Chart(*_SIZE, (0.0, 5.0), (-10.0, 10.0), xlabel=x_name, ylabel=y_name)
        empty.level(0.0)
        return empty
    f = np.linspace(0.0, 1.1 * float(d.frequency_hz.max()), 50)
    line = np.degrees(2.0 * np.pi * f)
    low, high = (end * line for end in d.interval)
    phase, half = np.degrees(d.phase_rad), HALF_95 * np.degrees(d.phase_std_rad)
    known = half < HALF_95 * 30.0
    x, phase, half = d.frequency_hz[known], phase[known], half[known]
    ends = [*low, *high, *(phase - half), *(phase + half)]
    said = f"{1e3 * d.delay_s:.1f} \u00b1 {1e3 * d.std_s:.1f} ms"
    chart = Chart(
        *_SIZE,
        (0.0, float(f[-1])),
        (min(ends), max(ends)),
        title=said,
        xlabel=x_name,
        ylabel=y_name,
    )
    chart.level(0.0)
    chart.band(f, low, high, "after")
    chart.line(f, d.delay_s * line, "after")
    chart.bars(x, phase, half)
    return chart


def _curve(found: Curve) -> Chart:
    x = found.coordinate.scale * found.at
    low, high = found.force - found.half_width, found.force + found.half_width
    chart = Chart(
        *_SIZE, (float(x[0]), float(x[-1])),
        (min(float(low.min()), 0.0), max(float(high.max()), 0.0)),
        xlabel=found.coordinate.axis, ylabel=f"missing {found.target} [{UNITS[found.target]}]",
        left=60,
    )  # fmt: skip
    chart.level(0.0)
    chart.band(x, low, high, "after")
    chart.line(x, found.force, "after")
    return chart


def _surface(found: Surface) -> tuple[Chart, str]:
    y, x = (c.scale * a for c, a in zip(found.coordinates, found.at, strict=True))
    sure = np.argwhere(np.abs(found.force) > found.half_width)
    up, along = found.coordinates
    return _grid(
        (_edges(x), _edges(y)), found.force, (x[sure[:, 1]], y[sure[:, 0]]),
        (along.axis, up.axis), f"missing {found.target} [{UNITS[found.target]}]",
    )  # fmt: skip


def _edges(middle: FloatArray) -> FloatArray:
    """Borders half way between points."""
    half = 0.5 * np.diff(middle)
    return np.concatenate([[middle[0] - half[0]], middle[:-1] + half, [middle[-1] + half[-1]]])


def unknown(study: Study, samples: Samples | None, truth: Model | None) -> list[str]:
    """The shape of what is still missing, and formulas for it; nothing where nothing is."""
    found = study.unknown
    if found is None:
        return []
    charts, told = [_curve(c) for c in found.curves[:2]], ""
    if found.surface is not None:
        grid, told = _surface(found.surface)
        charts.append(grid)
    parts = [
        figure(
            charts,
            "The missing force beyond all that the fitted parameters can do, over the coordinates "
            "that predict most of it. A band holds its whole curve with 95 %. On the map dots mark "
            "where the band excludes zero; grey: hardly any driving.",
            told,
            "row",
        ),
    ]
    if found.proposals:
        parts += [
            paragraph(
                "Formulas that also hold on validation data; each can be made an effect "
                "of the model:"
            ),
            bullets(f"{p}." for p in found.proposals),
        ]
    else:
        parts.append(paragraph("No formula that was tried also holds on validation data."))
    return parts
