"""A study in sentences."""

from __future__ import annotations

import numpy as np

from .._text import number
from ..diagnose import Diagnosis
from ..identify import Estimate
from ..study import AddedEffect, Study

__all__ = [
    "RANKING_HEAD",
    "effect_found",
    "interval",
    "quantity",
    "ranking_rows",
    "stages",
    "summary",
    "unit",
]

RANKING_HEAD = ("effect", "statistic", "p", "error with it", "size", "cannot tell from")


def unit(name: str) -> str:
    """Print a unit: nothing for a pure number."""
    return "" if name == "1" else f" {name}"


def interval(e: Estimate) -> str:
    """Print the 95 % interval; a dash where there is none."""
    if not np.isfinite(e.std):
        return "-"
    low, high = e.interval
    return f"{quantity(low)} .. {quantity(high)}"


def quantity(x: float) -> str:
    """Print a number in four digits, and large ones without an exponent."""
    return f"{x:.0f}" if 1e4 <= abs(x) < 1e7 else number(x)


def effect_found(added: AddedEffect) -> str:
    """Print an added effect with its parameters and their 95 % intervals."""
    sizes = "; ".join(
        f"{e.name.split('.')[1]} = {quantity(e.value)}{unit(e.unit)} (95 %: {interval(e)})"
        for e in added.parameters
    )
    return f"{added.id}: {sizes}"


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
        names = ", ".join(c.id for c in study.diagnoses[0].significant[:3])
        what = f"There is evidence for {names}, but none of them holds on held-out driving."
    else:
        what = "No effect was added: there is evidence for none of the catalogue."
    before, after = study.test[0].error, study.test[-1].error
    if study.added:
        error = (
            f"On driving the fit never saw, the one-step-ahead error fell from {before:.2f} to "
            f"{after:.2f} times the noise floor."
        )
    else:
        error = (
            f"On driving the fit never saw, the one-step-ahead error is {before:.2f} times the "
            "noise floor."
        )
    return verdict, what, error


def ranking_rows(diagnosis: Diagnosis, most: int = 10) -> list[list[str]]:
    """Print the first rows of a ranking, under `RANKING_HEAD`."""
    rows = []
    for c in diagnosis.ranking[:most]:
        size = ", ".join(
            f"{p.name} {number(v, 3)} ± {number(s, 2)}{unit(p.unit)}"
            for p, v, s in zip(c.effect.parameters, c.value, c.std, strict=True)
        )
        twins = ", ".join(c.indistinguishable_from) or "-"
        rows.append(
            [
                c.id,
                f"{c.statistic:.1f}",
                f"{c.p_value:.2g}",
                f"{c.predicted_error:.3f}",
                size,
                twins,
            ]
        )
    return rows
