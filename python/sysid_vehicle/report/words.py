"""A study in sentences."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .._common.text import few, number, unit_after, with_error
from ..identify import Estimate
from ..study import AddedEffect, Study

RANKING_HEAD = ("effect", "statistic", "p", "validation error with it", "size", "confounded with")


@dataclass(frozen=True)
class Shown:
    """How people are shown a channel: its name, the unit they use, and the factor to it."""

    name: str
    unit: str
    factor: float


_SHOWN = {
    "vx_mps": Shown("speed", "m/s", 1.0),
    "vy_mps": Shown("lateral speed", "m/s", 1.0),
    "yaw_rate_radps": Shown("yaw rate", "deg/s", 180.0 / np.pi),
    "ax_mps2": Shown("longitudinal acceleration", "m/s\u00b2", 1.0),
    "ay_mps2": Shown("lateral acceleration", "m/s\u00b2", 1.0),
}


def shown_in(channel: str) -> Shown:
    """How people are shown a channel."""
    return _SHOWN[channel]


def interval(e: Estimate) -> str:
    """Print the 95 % interval; a dash where there is none."""
    return e.interval_text(quantity)


def quantity(x: float) -> str:
    """Print a number in four digits, and large ones without an exponent."""
    return f"{x:.0f}" if 1e4 <= abs(x) < 1e7 else number(x)


def effect_found(added: AddedEffect) -> str:
    """Print an added effect with its parameters and their 95 % intervals."""
    sizes = "; ".join(
        f"{e.name.split('.')[1]} = {quantity(e.value)}{unit_after(e.unit)} (95 %: {interval(e)})"
        for e in added.parameters
    )
    return f"{added.id}: {sizes}" + (f"; {added.reserve}" if added.reserve else "")


def stages(study: Study) -> list[tuple[str, int]]:
    """Name the models worth comparing, with their places: the baseline, and a final one."""
    return [("baseline", 0), *([("final model", -1)] if study.added else [])]


def summary(study: Study) -> tuple[str, str, str]:
    """Say what was found in three sentences: the verdict, the effects, the errors."""
    verdict = f"{study.verdict.replace('_', ' ').capitalize()}: {study.meaning}."
    if study.added:
        names = "; ".join(effect_found(a) for a in study.added)
        what = f"The model got {names}."
    elif study.diagnoses[0].significant:
        leading = [c.id for c in study.diagnoses[0].significant[:3]]
        but = "but none of them improves the prediction of validation data"
        if set(leading) & set(study.stopped):
            but = "but the time limit ended before all were tried on validation data"
        what = f"There is evidence for {', '.join(leading)}, {but}."
    else:
        what = "No effect was added: none of the catalogue is significant."
    error = f"On validation data, the one-step-ahead error {errors(study)}."
    return verdict, what, error


def errors(study: Study) -> str:
    """Say how the validation error changed, as a predicate."""
    before, after = (f"{study.test[i].error:.2f}" for i in (0, -1))
    if not study.added:
        return f"is {before} times the noise floor"
    if before == after:
        return f"stayed at {before} times the noise floor"
    fell = study.test[-1].error < study.test[0].error
    return f"{'fell' if fell else 'rose'} from {before} to {after} times the noise floor"


def ranking_title(study: Study) -> str:
    """Say what leads the ranking of the baseline, no surer of it than the verdict is."""
    dx = study.diagnoses[0]
    if not dx.significant:
        return f"No effect of the catalogue is significant; {dx.omnibus}."
    named = [
        a for a in study.added if not a.stands_in and study.verdicts[a.id].finding != "negligible"
    ]
    leading = next((a for c in dx.significant for a in named if a.id == c.id), None)
    if leading is None:
        best = dx.significant[0].effect
        return f"Best fit, but not named as missing: {best.title} ({best.id})."
    title = study.verdicts[leading.id].effect.title
    others = ", ".join(leading.confounded_with)
    beside = f", confounded with {others} in this driving" if others else ""
    return f"most likely missing: {title} ({leading.id}){beside}"


def ranking_rows(study: Study, which: int = 0, most: int = 10) -> list[list[str]]:
    """Print the first rows of the ranking of one diagnosis, under `RANKING_HEAD`."""
    rows = []
    known = study.errors_with[which]
    for c in study.diagnoses[which].ranking[:most]:
        size = ", ".join(
            f"{p.name} {with_error(v, s, (p.lower, p.upper))}{unit_after(p.unit)}"
            for p, v, s in zip(c.effect.parameters, c.value, c.std, strict=True)
        ).replace("+-", "±")
        confounded = few(c.indistinguishable_from) or "-"
        rows.append(
            [
                c.id,
                f"{c.statistic:.1f}",
                f"{c.p_value:.2g}",
                f"{known[c.id][1]:.3f}" if c.id in known else "-",
                size,
                confounded,
            ]
        )
    return rows
