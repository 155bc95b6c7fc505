"""Sections on the force that is missing: where, when, how fast, and of which shape."""

from __future__ import annotations

from .._style import framed
from ..model import Model
from ..study import Study
from .page import bullets, heading, paragraph, picture

__all__ = ["unknown", "where_and_when"]


def where_and_when(study: Study, truth: Model | None) -> list[str]:
    """Where the baseline fails, and where, when and at which frequencies the final model does."""
    final, baseline = study.where, study.where_baseline
    figure = framed(9.0, 6.4, hspace=0.3)
    axes = figure.subplots(2, 2)
    baseline.plot(axes[0, 0])
    final.plot_time(axes[0, 1])
    baseline.coherence[0].plot(axes[1, 0])
    final.coherence[0].plot_phase(axes[1, 1])
    parts = []
    for title, lines in study.where_lines:
        parts += [heading(title, 3), bullets(f"{line[0].upper()}{line[1:]}." for line in lines)]
    whose = "the final model" if study.added else "the baseline"
    return [
        *parts,
        picture(
            figure,
            "Left, of the baseline: the force that it lacks, over the pair of coordinates that "
            "predicts most of it on driving it was not made from (grey: hardly any driving; dots: "
            "beyond two standard errors), and how far its residuals follow the steering, by "
            f"frequency. Right, of {whose}: the force that it lacks over the time driven with 95 % "
            "intervals (red lines are moments at which the car changed), and by what phase the car "
            "lags it; a delay is a straight line.",
        ),
    ]


def unknown(study: Study, truth: Model | None) -> list[str]:
    """The shape of what is still missing, and formulas for it; nothing where nothing is."""
    found = study.unknown
    if found is None:
        return []
    drawn = found.curves[:2]
    figure = framed(4.0 * (len(drawn) + 1), 3.3)
    axes = figure.subplots(1, len(drawn) + 1)
    for ax, curve in zip(axes, drawn, strict=False):
        curve.plot(ax)
    found.surface.plot(axes[-1])
    parts = [
        picture(
            figure,
            "The missing force beyond all that the fitted parameters can do, over the coordinates "
            "that tell most of it. A band holds its whole curve with 95 %. On the map dots mark "
            "where the band excludes zero; grey: hardly any driving.",
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
        parts.append(paragraph("No formula that was tried holds on validation data."))
    return parts
