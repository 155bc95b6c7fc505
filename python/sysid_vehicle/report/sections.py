"""The sections of a report, each from a study to HTML."""

from __future__ import annotations

from collections.abc import Callable

from .._common.text import html_table, number, unit_after
from ..estimate import UNITS
from ..estimate.noise import COLOURED
from ..model import Model
from ..study import LATERAL, Study, events, open_effects
from . import figures
from .failure import unknown, where_and_when
from .page import bullets, fold, heading, paragraph, table
from .samples import Samples
from .tyres import identified_curves, model_curves
from .words import RANKING_HEAD, interval, quantity, ranking_rows, stages, summary


def _where(study: Study, samples: Samples | None, truth: Model | None) -> list[str]:
    shown = [(title, study.test[i]) for title, i in stages(study)]
    first = study.test[0]
    head = ["channel", "unit", "noise floor"]
    for what in ("rmse", "normalised", "R²"):
        head += [f"{what}, {title}" for title, _ in shown]
    rows = []
    for name, floor in study.test[-1].channels.items():
        scores = [c.channels[name] for _, c in shown]
        rows.append(
            [
                name,
                UNITS[name],
                number(floor.noise_floor, 3),
                *(number(s.rmse, 3) for s in scores),
                *(f"{s.nrmse:.2f}" for s in scores),
                *(f"{s.r2:.4f}" for s in scores),
            ]
        )
    parts = [
        table(head, rows),
        paragraph(
            "One step ahead. Normalised errors are in units of the spread that the noise model "
            "expects of each prediction, so that 1 is the noise floor."
        ),
        figures.failure_maps(
            study,
            "Error over speed and lateral acceleration, on one colour scale. Grey: hardly any "
            "driving there.",
        ),
    ]
    if first.regions:
        parts.append(paragraph("The error of the baseline is largest at"))
        parts.append(bullets(str(r) for r in first.regions))
    return parts


def _which(study: Study, samples: Samples | None, truth: Model | None) -> list[str]:
    whose = "final" if study.added else "fitted"
    parts = []
    for i, dx in enumerate(study.diagnoses):
        if len(study.diagnoses) > 1:
            have = ", ".join(dx.fit.model.effects)
            parts.append(heading(f"With {have}" if i else "To the baseline", 3))
        if not dx.ranking:
            parts.append(paragraph("There was no candidate to test."))
            continue
        grades = {a.id: a.grade for a in study.added}
        n = len(dx.significant)
        parts += [
            figures.causes(study.causes[i], grades),
            paragraph(
                "Probability that each effect is missing, by credible set: effects of one set are "
                "confounded, and one of them acts. Beside a bar stands the grade of what the study "
                f"added. {n} of {len(dx.ranking)} effects are significant at {dx.alpha:g} over all "
                "of them together."
            ),
            table(RANKING_HEAD, _with_minus_signs(ranking_rows(study, i)), "ranking"),
        ]
    parts.append(
        paragraph(
            "Each candidate was refitted or scored as if it alone were missing, so sizes of "
            "confounded effects are not to be added up. 'validation error with it' is the "
            "one-step-ahead error on the validation data of the model with that effect, refitted "
            f"to the training data, in units of the noise floor of the {whose} model; where there "
            "is none nothing was refitted. 'confounded with' names effects that would explain the "
            "training data as well."
        )
    )
    return parts


_UNTOUCHED = ("absent", "negligible")


def _verdicts(study: Study, samples: Samples | None, truth: Model | None) -> list[str]:
    told = {v.effect.id: [v.effect.id, v.finding, v.sentence] for v in study.verdicts.all}
    rows = [row for row in told.values() if row[1] not in _UNTOUCHED]
    rest = [row for row in told.values() if row[1] in _UNTOUCHED]
    head = ("effect", "verdict", "in words")
    parts = [table(head, rows, "text")] if rows else []
    if rest:
        parts.append(
            fold(f"{len(rest)} effects are absent or negligible", [table(head, rest, "text")])
        )
    parts.append(
        paragraph(
            "Each is judged beside the effects that were added. 'one of a group': it or a "
            "confounded effect of the group is missing. 'proxy': it is significant, but not itself "
            "what is missing, for the reason stated. 'absent': it can be no larger than stated. "
            "'not testable': this driving could hide one large enough to matter."
        )
    )
    return parts + _hidden(study)


def _hidden(study: Study) -> list[str]:
    """What the effects that this driving tells least of would do to the parameters."""
    found, open_ = study.hidden, open_effects(study)
    title = heading("What the identified parameters would hide", 3)
    if not open_:
        text = (
            "Each effect that was tested would have been seen. bias_report computes what one does"
        )
        return [title, paragraph(f"{text} unseen.")]
    if found is None:
        return [title, paragraph("Left out: there was no time. bias_report computes it.")]
    return [
        title,
        paragraph(
            f"Of the {len(open_)} effects that are not testable, those that this driving shows "
            "least. Each was simulated at a typical size on the same driving, and the model fitted "
            "without it. bias_report computes the same for all effects."
        ),
        bullets(f"{b}." for b in found.biases),
    ]


def _ahead(study: Study, samples: Samples | None, truth: Model | None) -> list[str]:
    channels = [c for c in study.horizons.channels if c in LATERAL] or study.horizons.channels[:1]
    shares = study.shares
    return [
        *(
            []
            if "shares" in study.left_out
            else [
                paragraph(f"{shares.sentence} {shares.CAPTION}"),
                html_table(shares.HEAD, shares.rows()),
            ]
        ),
        figures.ahead(
            study,
            channels,
            "Error on validation data over how far ahead was predicted, from what was known then "
            "and the steering and force since: median over pieces of 5 s. "
            "Dotted: noise of the sensor.",
        ),
    ]


def _with_minus_signs(rows: list[list[str]]) -> list[list[str]]:
    # A line may break after a hyphen, in the middle of a number; not after a minus sign.
    return [[row[0], *(cell.replace("-", "\u2212") for cell in row[1:-1]), row[-1]] for row in rows]


def _parameters(study: Study, samples: Samples | None, truth: Model | None) -> list[str]:
    fit = study.fit
    real = {} if truth is None else {n: quantity(truth.value(n)) for n in truth.names}
    if truth is not None:
        real |= {name: quantity(value) for name, value in fit.values_of(truth).items()}
    rows = []
    for e in study.estimates:
        row = [e.name, quantity(e.value), interval(e), unit_after(e.unit).strip(), e.note or "-"]
        rows.append(row if truth is None else [*row, real.get(e.name, "-")])
    head = ["parameter", "value", "95 % interval", "unit", "note"]
    parts = [table(head if truth is None else [*head, "truth"], rows)]
    if study.added:
        text = "Size of the added effects with 95 % intervals"
        told = f"{text}; green: the truth." if truth else f"{text}."
        parts.append(figures.sizes(study, truth, told))
    return [*parts, _tyres(study, truth)]


def _tyres(study: Study, truth: Model | None) -> str:
    curves = identified_curves(study.fit)
    slip = curves[0].slip_rad
    start = model_curves(Model(study.model.vehicle), slip)
    real = None if truth is None else model_curves(truth, slip)
    caption = (
        "Tyre curves at static load, without effects. Grey: slip angles that this driving did "
        "not reach; the curve there is extrapolated."
    )
    return figures.tyre_curves(curves, start, real, caption)


_RUNNING = "Residuals on validation data, root mean square over half a second by channel."


def _remains(study: Study, samples: Samples | None, truth: Model | None) -> list[str]:
    noise = study.fit.noise
    sensors = [
        [c, number(s, 3), UNITS[c]]
        for c, s in zip(UNITS, noise.sensor, strict=True)
        if c in study.fit.driving.present
    ]
    coloured = zip(COLOURED, noise.colour, noise.colour_time_s, strict=True)
    sensors += [
        [f"{c}, over {number(t, 2)} s", number(s, 3), UNITS[c]] for c, s, t in coloured if s
    ]
    x, y, moment = noise.disturbance
    parts = [
        *map(paragraph, (*events(study), study.in_the_end)),
        *([] if samples is None else [figures.residuals(study, samples, _RUNNING)]),
        heading("Noise model", 3),
        table(("sensor", "noise", "unit"), sensors),
        paragraph(
            "Beyond its equations the final model still needs a disturbance force of "
            f"{number(x, 2)} N forward and {number(y, 2)} N sideways and a yaw moment of "
            f"{number(moment, 2)} N m (standard deviations; correlation times "
            f"{noise.times})."
        ),
    ]
    if study.warnings:
        parts += [heading("Warnings", 3), bullets(study.warnings, "warning")]
    return parts


_METHOD = (
    "The model is a single track with three degrees of freedom and load transfer (Rajamani, "
    "Vehicle Dynamics and Control, 2nd ed., ch. 2 and 4) on Magic Formula tyres (Pacejka, Tire "
    "and Vehicle Dynamics, 3rd ed., eq. 4.6), in ISO 8855 axes. An extended Kalman filter "
    "predicts each measurement one step ahead; parameters and noise are those of maximum "
    "likelihood of the prediction errors (Ljung, System Identification, 2nd ed., sec. 7.2 and "
    "7.4). Effects are ranked by score tests of the whitened residuals after projection on the "
    "fitted parameters (Basseville, Automatica 1998; Bera & Bilias, J. Statistical Planning and "
    "Inference 2001), the best ones refitted with their exact dynamics. An effect is added only "
    "if it also predicts the validation data better. Whether anything is left is decided by a "
    "score test against unknown forces that depend on the driving (Lin, Biometrika 1997). All "
    "models are judged with the noise of the final one."
)


def _method(study: Study, samples: Samples | None, truth: Model | None) -> list[str]:
    starts = study.fits[0].starts
    validation = study.test[0].title.split(" on ", 1)[1]
    parts = [
        paragraph(" ".join(summary(study))),
        paragraph(f"Fitted to {study.fit.driving}. Validation data: {validation}."),
        paragraph(_METHOD),
        paragraph(
            f"{sum(s.agrees for s in starts)} of {len(starts)} starts of the search for the "
            f"baseline ended at the same optimum. The study took {study.seconds:.0f} s."
        ),
    ]
    if study.model.parts:
        parts.append(heading("Equations of the added effects", 3))
        parts.append(bullets(f"{e.id}: {e.equation} ({e.source})" for e in study.model.parts))
    return parts


SECTIONS: tuple[tuple[str, Callable[[Study, Samples | None, Model | None], list[str]]], ...] = (
    ("Errors on validation data", _where),
    ("Further ahead", _ahead),
    ("Which effect is missing", _which),
    ("A verdict for every effect", _verdicts),
    ("Where, when and how fast the model fails", where_and_when),
    ("The shape of what is missing", unknown),
    ("Parameters of the final model", _parameters),
    ("What remains", _remains),
    ("How it was computed", _method),
)
"""What is folded below the first screen, in order; a section without parts is left out."""
