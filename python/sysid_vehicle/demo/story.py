"""The demonstration in plain sentences."""

from __future__ import annotations

from .._common.text import text_table, unit_after
from ..compare import Comparison
from ..effects import effect
from ..log import Log
from ..model import Model
from ..report.words import effect_found, interval, quantity, summary
from ..study import Study

_RIVALS = 6


def opening(model: Model, train: Log, test: Log) -> str:
    """Tell what is given before anything is computed."""
    return (
        f"A simulated {model.vehicle.name} drove a lap of {train.duration_s:.0f} s at up to "
        f"{train['vx_mps'].max():.0f} m/s, and another course of {test.duration_s:.0f} s that is "
        "validation data: no fit uses it.\n"
        "Something acts on this car that the model does not have. The vehicle file gives slightly "
        "wrong tyres.\n"
        "Fitting the model, looking for what is missing: about half a minute."
    )


def findings(study: Study) -> list[str]:
    """Tell what the study found, paragraph by paragraph, without a look at the truth."""
    told = [_errors("1. The fitted baseline on the other course", study.test[0])]
    told.append(_where(study))
    told.append(_ranking(study))
    told.append(_added(study))
    if study.added:
        told.append(_errors("5. The improved model on the other course", study.test[-1]))
    rows = [
        [label, f"{a.error:.3f}", f"{b.error:.3f}"]
        for label, a, b in zip(study.steps, study.train, study.test, strict=True)
    ]
    told.append(
        "Error of all channels together, one step ahead; the noise floor is 1\n"
        + text_table(("model", "lap", "other course"), rows)
    )
    told.append(f"Verdict - {summary(study)[0]}\n{study.in_the_end}")
    return told


def _errors(title: str, c: Comparison) -> str:
    head = ("channel", "error (rms)", "error / noise floor")
    rows = [[name, quantity(s.rmse), f"{s.nrmse:.2f}"] for name, s in c.channels.items()]
    return f"{title}: {c.error:.2f} times the noise floor\n{text_table(head, rows)}"


def _where(study: Study) -> str:
    regions = study.test[0].regions
    if not regions:
        return "2. Where it fails: no part of the driving stands out from the noise floor"
    return "\n".join(["2. Where it fails most", *(f"  {r}" for r in regions)])


def _ranking(study: Study) -> str:
    first = study.diagnoses[0]
    rows = [[c.id, f"{c.statistic:.1f}", f"{c.p_value:.1g}"] for c in first.ranking[:_RIVALS]]
    text = (
        f"3. Which of {len(first.ranking)} effects is missing: evidence, and the probability (p) "
        "of as much by chance\n" + text_table(("effect", "evidence", "p"), rows)
    )
    best = first.ranking[0]
    if first.significant and best.indistinguishable_from:
        others = ", ".join(best.indistinguishable_from)
        text += f"\n  {best.id} is confounded with {others} in this driving."
    return text


def _added(study: Study) -> str:
    if not study.added:
        return f"4. {summary(study)[1]}"
    lines = ["4. Added to the model"]
    for a in study.added:
        lines += [f"  {effect_found(a)}", f"    {effect(a.id).title}: {effect(a.id).equation}"]
    return "\n".join(lines)


def revelation(study: Study, truth: Model) -> str:
    """Name the hidden effect, and set the identified values beside the true ones."""
    hidden = truth.parts[0]
    lines = [f"The hidden effect was {hidden.id}: {hidden.title}."]
    found = hidden.id in study.model.effects
    if found:
        true = {n: truth.value(n) for n in truth.names} | study.fit.values_of(truth)
        shown = [e for e in study.estimates if e.name.startswith(f"{hidden.id}.")]
        rows = [
            [
                e.name,
                quantity(true[e.name]),
                quantity(e.value),
                interval(e),
                unit_after(e.unit).strip(),
                e.note,
            ]
            for e in (*shown, *study.fit.derived)
        ]
        own = next(a for a in study.added if a.id == hidden.id)
        lines.append(f"Found; {own.reserve}." if own.reserve else "Found.")
        head = ("parameter", "truth", "found", "95 % interval", "unit", "note")
        lines.append(text_table(head, rows))
        beside = [e for e in study.model.effects if e != hidden.id]
        if beside:
            lines.append(
                f"Besides it the model got {', '.join(beside)}, which the car does not have."
            )
        return "\n".join(lines)
    for p in hidden.parameters:
        value = truth.value(f"{hidden.id}.{p.name}")
        lines.append(f"  {p.name} = {quantity(value)}{unit_after(p.unit)}")
    lines.append(f"Not found: {_why_not(study, hidden.id)}")
    return "\n".join(lines)


def _why_not(study: Study, hidden: str) -> str:
    first = study.diagnoses[0]
    own = next((c for c in first.ranking if c.id == hidden), None)
    confounded = set(study.model.effects) & set(own.indistinguishable_from if own else ())
    if confounded:
        others = ", ".join(sorted(confounded))
        return f"it is confounded with {others}, which was added to the model."
    if study.added:
        return f"the model got {', '.join(study.model.effects)} instead."
    if study.verdict in ("adequate", "not_testable"):
        return "this driving does not show it; the fitted tyres make up for it."
    return "the study saw that something is missing, but could not say what."
