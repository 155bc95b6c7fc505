"""The first screen of a report: compare, where, which, added, error falls."""

from __future__ import annotations

import numpy as np

from .._common.text import number, unit_after
from ..study import AddedEffect, Study, events, left_out
from . import figures
from .page import bars, bullets, panel, paragraph, table
from .samples import Samples
from .words import interval, quantity, shown_in, stages, summary

_AHEAD_S = 1.0
_CANDIDATES = 5


def first_screen(study: Study, samples: Samples | None) -> list[str]:
    """Tell the whole story in five panels."""
    verdict = summary(study)[0]
    panels = [
        *([] if samples is None else [_compare(study, samples), _where(study, samples)]),
        _which(study),
        _added(study),
        _falls(study),
        _remains(study),
    ]
    return [
        paragraph(verdict, "lead"),
        *(paragraph(f"{text[0].upper()}{text[1:]}.") for text in left_out(study)),
        '<section class="screen">',
        *panels,
        "</section>",
    ]


def _compare(study: Study, samples: Samples) -> str:
    excerpt = samples.excerpt
    caption = (
        f"{excerpt.log}, validation data: the baseline's worst seconds, predicted "
        f"{excerpt.horizon_s:g} s ahead. Below: one-step error."
    )
    return panel("1 Compare", [figures.overlay(study, samples, caption)], 7)


def _where(study: Study, samples: Samples) -> str:
    worst = study.test[0].regions[:1]
    kind = (
        "Track from speed and yaw rate, and accelerations" if samples.has_track else "Accelerations"
    )
    caption = (
        f"{kind}, coloured by the error of the baseline over half a second; rings: the seconds "
        "shown beside."
    )
    said = [paragraph(f"The largest share: {worst[0]}.")] if worst else []
    return panel("2 Where", [figures.place(samples, caption), *said], 5)


def _which(study: Study) -> str:
    """Of what the baseline leaves on validation data, what each effect takes away alone."""
    before = study.test[0].error
    beyond = before - 1.0
    tried = {e: both[1] for e, both in study.errors_with[0].items()}
    if "errors_with" in study.left_out:
        return panel("3 Which", [paragraph("Left out: there was no time.")], 4)
    if not tried:
        none = "No effect of the catalogue was significant enough for a refit."
        return panel("3 Which", [paragraph(none)], 4)
    if beyond <= 0.0:
        none = "On validation data the error of the baseline is at the noise floor."
        return panel("3 Which", [paragraph(none)], 4)
    gone = {e: (before - after) / beyond for e, after in tried.items() if np.isfinite(after)}
    order = sorted(gone, key=lambda e: -gone[e])[:_CANDIDATES]
    own = {a.id for a in study.added}
    probable = study.causes[0].inclusion
    rows = []
    for e in order:
        text = f"{100.0 * max(gone[e], 0.0):.0f} %"
        if e in probable:
            text += f" ({probable[e]:.2f})"
        rows.append((e, gone[e], text, "" if e in own else "mute"))
    text = (
        "Share of the baseline's one-step error beyond the noise floor on validation data that "
        "each effect removes if it alone is added. "
        f"{len(study.diagnoses[0].ranking)} were scored, {len(tried)} refitted."
        + (
            " In brackets: probability that it is missing, by the training data."
            if probable
            else ""
        )
    )
    if own:
        text += " Grey: not added."
    return panel("3 Which", [bars(rows), paragraph(text)], 4)


def _added(study: Study) -> str:
    told = [_effect(study, a) for a in study.added]
    parts = [bullets(told)] if told else [paragraph(summary(study)[1])]
    sets = study.causes[0].sets
    if sets:
        parts.append(paragraph(f"Credible sets: {'; '.join(map(str, sets))}."))
    return panel("4 Added", parts, 4)


def _effect(study: Study, added: AddedEffect) -> str:
    sizes = ", ".join(
        f"{e.name.split('.')[1]} {quantity(e.value)}{unit_after(e.unit)} (95 %: {interval(e)})"
        for e in added.parameters
    )
    at = study.horizons.horizons_s.index(_AHEAD_S)
    gains, step = [], study.step_of(added.id)
    others = [a.id for a in study.added if a.id != added.id and study.step_of(a.id) == step]
    for channel, by_horizon in study.horizons.gains(step).items():
        gain, shown = by_horizon[at], shown_in(channel)
        if gain is not None and channel in _SHOWN:
            gains.append(f"{shown.name} {-shown.factor * gain:+.2g} {shown.unit}")
    takes = f"changes the error {_AHEAD_S:g} s ahead: {', '.join(gains)}" if gains else ""
    beside = f"together with {' and '.join(others)} " if others else ""
    takes = takes and f"; {beside}{takes}"
    reserve = f"; {added.reserve}" if added.reserve else ""
    return f"{added.id} ({added.grade}): {sizes}{takes}{reserve}"


def _remains(study: Study) -> str:
    """What is explained and what is not, and what to do about it."""
    steps = [f"Next: {text}." for text in study.next_steps]
    told = (*events(study), study.in_the_end)
    said = [*map(paragraph, told), *([bullets(steps)] if steps else [])]
    return panel("6 What remains", said, 12)


_SHOWN = ("vy_mps", "yaw_rate_radps", "ay_mps2")


def _falls(study: Study) -> str:
    """One step ahead in noise floors, and a second ahead in physical units."""
    one_step = [c.error for c in study.test]
    top = max(*one_step, 1.0) if np.isfinite(one_step).all() else 1.0
    rows = [
        (step, e / top, f"{e:.2f}", "before" if i == 0 else "")
        for i, (step, e) in enumerate(zip(study.steps, one_step, strict=True))
    ]
    ahead = study.horizons
    at = ahead.horizons_s.index(_AHEAD_S)
    lines = []
    for j, channel in enumerate(ahead.channels):
        shown = shown_in(channel)
        found = [shown.factor * float(ahead.error[i, at, j]) for _, i in stages(study)]
        noise = shown.factor * float(ahead.noise[j])
        if channel in _SHOWN and np.isfinite(found).any():
            figures_ = [number(x, 2) for x in (*found, noise)]
            lines.append([f"{shown.name} [{shown.unit}]", *figures_])
    parts = [
        bars([*rows, ("noise floor", 1.0 / top, "1.00", "mute")]),
        paragraph("One-step error on validation data, of the noise floor."),
    ]
    if lines:
        models = [title.removesuffix(" model") for title, _ in stages(study)]
        parts.append(table([f"error {_AHEAD_S:g} s ahead", *models, "sensor noise"], lines))
    return panel("5 Error falls" if study.added else "5 Error", parts, 4)
