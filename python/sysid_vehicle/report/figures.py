"""The figures of a report: HTML of charts with captions."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from .._common.arrays import FloatArray
from .._common.text import HALF_95
from ..diagnose import Causes
from ..estimate import MEASURED
from ..model import Model
from ..study import Study
from .chart import CIVIDIS, VIRIDIS, Chart, figure, legend, scale
from .page import bars
from .samples import Samples
from .tyres import TyreCurve
from .words import shown_in, stages

LOOKS = ("before", "after")
"""Style classes of the baseline and the final model."""


def overlay(study: Study, samples: Samples, caption: str) -> str:
    """Measured and predicted channels over the worst seconds, what is left, and all the driving."""
    names = [title for title, _ in stages(study)]
    inside = samples.inside
    seconds = samples["t"][inside]
    view = float(seconds[0]), float(seconds[-1])
    charts: list[Chart] = []
    last = 2 * len(samples.excerpt.channels) - 1
    for c in samples.excerpt.channels:
        shown = shown_in(c)
        signals = [f"m.{c}", *(f"p{k}.{c}" for k in range(len(names)))]
        left = [f"d{k}.{c}" for k in range(len(names))]
        for columns, told, words, height, title in (
            (
                signals,
                ["measured", *names],
                ("measured", *LOOKS),
                108,
                f"{shown.name} [{shown.unit}]",
            ),
            (left, names, LOOKS, 52, ""),
        ):
            chart = Chart(
                768, height, view, samples.range(*columns, rows=inside), title=title,
                ylabel="" if title else "error", xticks=() if len(charts) < last else None,
                bottom=4.0 if len(charts) < last else 17.0, link="zoom",
            )  # fmt: skip
            if not title:
                chart.level(0.0)
            for column, name, kind in zip(columns, told, words, strict=False):
                chart.line(seconds, samples[column][inside], kind, column, name)
            charts.append(chart)
    charts.append(_whole(samples, names))
    key = legend([("measured", "measured"), *zip(LOOKS, names, strict=False)])
    return figure(charts, caption, key)


def _whole(samples: Samples, names: Sequence[str]) -> Chart:
    """The running error over all the driving, in which seconds are selected."""
    columns = [f"e{k}" for k in range(len(names))]
    t = samples["t"]
    top = samples.range(*columns)[1]
    chart = Chart(
        768, 72, (float(t[0]), float(t[-1])), (0.0, top), ylabel="/ floor", link="t",
        xlabel=samples.time_label,
    )  # fmt: skip
    within = t[samples.inside]
    chart.hatch(float(within[0]), float(within[-1]))
    for column, name, kind in zip(columns, names, LOOKS, strict=False):
        chart.line(_broken(samples), samples[column], kind, column, f"error, {name}")
    return chart


def _broken(samples: Samples) -> FloatArray:
    """Time, no number where another stretch begins."""
    t = samples["t"].copy()
    t[1:][np.diff(samples["run"]) != 0] = np.nan
    return t


def place(samples: Samples, caption: str) -> str:
    """Where the baseline fails: on the track, where there is one, and over both accelerations."""
    error = samples["e0"]
    known = error[np.isfinite(error)]
    limits = 1.0, max(float(np.percentile(known, 99.0)) if known.size else 1.5, 1.5)
    pairs = [("ay", "ax", "lateral [m/s\u00b2]", "longitudinal [m/s\u00b2]")]
    if samples.has_track:
        pairs.insert(0, ("x", "y", "track [m]", ""))
    charts: list[Chart] = []
    for x, y, across, up in pairs:
        if not np.isfinite(samples[y]).any():
            continue
        chart = Chart(
            (528, 260)[len(pairs) - 1], 300, samples.range(x), samples.range(y), xlabel=across,
            ylabel=up, equal=x == "x", link=f"{x},{y}",
        )  # fmt: skip
        chart.selected(samples[x][samples.inside], samples[y][samples.inside])
        chart.shaded(samples[x], samples[y], error, limits, CIVIDIS)
        charts.append(chart)
    return figure(charts, caption, scale(limits, CIVIDIS, "error / noise floor"), "row shade")


def failure_maps(study: Study, caption: str) -> str:
    """Where the model of each stage fails on validation data, on one colour scale."""
    maps = [study.test[i].failure_map for _, i in stages(study)]
    # Single extreme cells would leave all others in one colour.
    cells = np.concatenate([m.error[np.isfinite(m.error)] for m in maps])
    limits = 1.0, max(float(np.percentile(cells, 98.0)), 1.5) if cells.size else 1.5
    charts: list[Chart] = []
    for m, (title, _) in zip(maps, stages(study), strict=True):
        ends = [(float(e[0]), float(e[-1])) for e in (m.lateral_mps2, m.speed_mps)]
        chart = Chart(
            420, 300, *ends, title=title, xlabel="lateral acceleration [m/s\u00b2]",
            ylabel="speed [m/s]", link="ay,v",
        )  # fmt: skip
        chart.cells(m.lateral_mps2, m.speed_mps, m.error, limits, VIRIDIS)
        charts.append(chart)
    return figure(charts, caption, scale(limits, VIRIDIS, "error / noise floor"), "row")


def causes(found: Causes, grades: Mapping[str, str], most: int = 10) -> str:
    """Inclusion probabilities by credible set, with the grades of what was added."""
    grouped = list(dict.fromkeys(e for s in found.sets for e in s.effects))
    others = (e for e, p in found.inclusion.items() if e not in grouped and p >= 0.005)
    shown = [*grouped, *others][:most]
    rows = []
    for e in shown:
        own = found.of(e)
        number = next((i + 1 for i, s in enumerate(found.sets) if s is own), None)
        told = [f"{found.inclusion[e]:.2f}", f"set {number}" if number else "", grades.get(e, "")]
        rows.append((e, found.inclusion[e], ", ".join(filter(None, told)), "" if own else "mute"))
    return bars(rows)


def sizes(study: Study, truth: Model | None, caption: str) -> str:
    """Parameters of the added effects with 95 % intervals, in units of their typical size."""
    known = study.model.parameters
    estimates = [e for a in study.added for e in a.parameters][::-1]
    rows = []
    for e in estimates:
        p = known[e.name]
        ends = e.interval if e.has_interval else (e.value, e.value)
        low, high = sorted((end - p.null_value) / p.typical for end in ends)
        real = None if truth is None or e.name not in truth.names else truth.value(e.name)
        rows.append(
            (
                (e.value - p.null_value) / p.typical,
                (low, high),
                p.matters / p.typical,
                None if real is None else (real - p.null_value) / p.typical,
            )
        )
    shown = [v for _, reach, matters, _ in rows for v in (*reach, -matters, matters)]
    shown += [real for *_, real in rows if real is not None] + [0.0]
    room = 0.05 * (max(shown) - min(shown))
    chart = Chart(
        680, 52 + 32 * len(rows), (min(shown) - room, max(shown) + room), (-0.6, len(rows) - 0.4),
        yticks=[(float(k), e.name) for k, e in enumerate(estimates)], left=260,
        xlabel="size / typical size (grey: too small to matter)",
    )  # fmt: skip
    for k, (x, reach, matters, real) in enumerate(rows):
        chart.band([-matters, matters], [k - 0.35] * 2, [k + 0.35] * 2, "mute")
        chart.along(reach[0], reach[1], k, "after")
        chart.dots([x], [k], "after large")
        if real is not None:
            chart.dots([real], [k], "truth large")
    return figure([chart], caption)


def tyre_curves(
    curves: Sequence[TyreCurve],
    start: Sequence[TyreCurve],
    truth: Sequence[TyreCurve] | None,
    caption: str,
) -> str:
    """Lateral force over slip angle with its 95 % band; grey where nobody drove."""
    top = 1.15e-3 * max(float(c.force_n.max()) for c in (*curves, *start))
    charts: list[Chart] = []
    for i, curve in enumerate(curves):
        slip, force = np.degrees(curve.slip_rad), curve.force_n / 1e3
        half = HALF_95 * curve.std_n / 1e3
        chart = Chart(
            400, 300, (0.0, float(slip[-1])), (0.0, top), title=f"{curve.axle} axle",
            xlabel="slip angle [deg]", ylabel="force at static load [kN]",
        )  # fmt: skip
        ends = float(np.degrees(curve.driven_rad))
        if ends < slip[-1]:
            chart.hatch(ends, float(slip[-1]))
        chart.band(slip, force - half, force + half, "after")
        chart.line(slip, start[i].force_n / 1e3, "before")
        chart.line(slip, force, "after")
        if truth is not None:
            chart.line(slip, truth[i].force_n / 1e3, "truth")
        charts.append(chart)
    key = [("after", "identified, 95 % band"), ("before", "vehicle file")]
    return figure(charts, caption, legend([*key, *([("truth", "truth")] if truth else [])]), "row")


def ahead(study: Study, channels: Sequence[str], caption: str) -> str:
    """The validation error of each stage over the horizon, a chart for each channel."""
    found = study.horizons
    at = np.array(found.horizons_s)
    charts: list[Chart] = []
    for channel in channels:
        j, shown = found.channels.index(channel), shown_in(channel)
        errors = shown.factor * np.where(np.isfinite(found.error), found.error, np.nan)[:, :, j]
        noise = shown.factor * float(found.noise[j])
        drawn = [errors[i] for _, i in stages(study)]
        known = [float(v) for e in drawn for v in e[np.isfinite(e)]]
        top = 1.06 * max([*known, noise if np.isfinite(noise) else 0.0, 1e-9])
        chart = Chart(
            300, 240, (0.0, 1.04 * float(at[-1])), (0.0, top), title=f"{shown.name} [{shown.unit}]",
            xlabel="predicted ahead [s]",
        )  # fmt: skip
        for e, kind in zip(drawn, LOOKS, strict=False):
            chart.line(at, e, kind)
            chart.dots(at, e, kind)
        chart.level(noise, "chance")
        charts.append(chart)
    names = [*zip(LOOKS, (title for title, _ in stages(study)), strict=False)]
    return figure(charts, caption, legend([*names, ("chance", "noise of the sensor")]), "row")


def residuals(study: Study, samples: Samples, caption: str) -> str:
    """The running size of the validation residuals at each stage of the study, by channel."""
    t = _broken(samples)
    channels = [c for c in MEASURED if f"r0.{c}" in samples.columns]
    charts: list[Chart] = []
    for k, (title, _) in enumerate(stages(study)):
        columns = [f"r{k}.{c}" for c in channels]
        chart = Chart(
            860, 190, (float(samples["t"][0]), float(samples["t"][-1])),
            (0.0, samples.range(*(c.replace(f"r{k}.", "r0.") for c in columns), *columns)[1]),
            title=title, xlabel=samples.time_label, ylabel="residual / floor", link="t",
        )  # fmt: skip
        chart.level(1.0, "chance")
        for i, (column, channel) in enumerate(zip(columns, channels, strict=True)):
            chart.line(t, samples[column], f"c{i}", column, channel)
        charts.append(chart)
    return figure(charts, caption, legend((f"c{i}", c) for i, c in enumerate(channels)))
