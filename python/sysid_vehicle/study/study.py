"""What a study found."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from html import escape
from pathlib import Path
from typing import Any, Literal

from .._files import write_json
from .._text import html_list, html_table, text_table, with_error
from ..compare import Comparison
from ..diagnose import (
    Candidate,
    Diagnosis,
    EffectVerdict,
    Omnibus,
    Unknown,
    Verdicts,
    Where,
    unknown,
    where,
)
from ..estimate import Driving
from ..identify import Estimate, Fit
from ..model import Model
from .waterfall import Waterfall, waterfall

__all__ = ["AddedEffect", "Study", "Verdict"]

Verdict = Literal["adequate", "explained", "partly_explained", "unknown"]

_MEANING = {
    "adequate": "nothing is missing that this driving can show",
    "explained": "the effects found explain all that depends on the driving",
    "partly_explained": "the effects found explain part of it; something else is missing",
    "unknown": "something is missing and no effect of the catalogue explains it",
}


@dataclass(frozen=True)
class AddedEffect:
    """An effect that was added.

    Attributes
    ----------
    parameters : tuple of Estimate
        In the final model.
    error_before, error_after : float
        On the held-out driving, in units of the noise floor.
    p_value : float
        Of the model without it being complete.
    """

    id: str
    parameters: tuple[Estimate, ...]
    error_before: float
    error_after: float
    p_value: float

    def __str__(self) -> str:
        size = ", ".join(
            f"{e.name.split('.')[1]} {with_error(e.value, e.std)} {e.unit}" for e in self.parameters
        )
        return f"{self.id}: {size}"


@dataclass(frozen=True, eq=False)
class Study:
    """The way from a baseline to a better model.

    Attributes
    ----------
    verdict : str
        `adequate`, `explained`, `partly_explained` or `unknown`.
    fits : tuple of Fit
        The baseline, then one for each effect added.
    diagnoses : tuple of Diagnosis
        One before each step, and the last one, which found nothing more to add.
    train, test : tuple of Comparison
        For each fit, all against the noise floor of the final one.
    held_out : Driving
        The driving the fits never saw.
    added : tuple of AddedEffect
    omnibus, omnibus_held_out : Omnibus
        Whether the final model leaves anything that depends on the driving it was fitted to, or on
        the held-out driving; the latter is not asked where nothing was added.
    verdicts : Verdicts
        What is to be said of every effect that the baseline lacks.
    seconds : float
        Wall time.
    """

    verdict: Verdict
    fits: tuple[Fit, ...]
    diagnoses: tuple[Diagnosis, ...]
    train: tuple[Comparison, ...]
    test: tuple[Comparison, ...]
    held_out: Driving
    added: tuple[AddedEffect, ...]
    omnibus: Omnibus
    omnibus_held_out: Omnibus | None
    verdicts: Verdicts
    warnings: tuple[str, ...]
    seconds: float

    @property
    def fit(self) -> Fit:
        """The final fit."""
        return self.fits[-1]

    @property
    def model(self) -> Model:
        """The improved model."""
        return self.fit.model

    @property
    def meaning(self) -> str:
        """The verdict in words."""
        return _MEANING[self.verdict]

    @property
    def steps(self) -> tuple[str, ...]:
        """The baseline and what was added, in order."""
        return ("baseline", *(f"+ {a.id}" for a in self.added))

    @cached_property
    def where(self) -> Where:
        """Where, when and at which frequencies the baseline fails; some seconds at first."""
        return where(self.fits[0])

    @cached_property
    def unknown(self) -> Unknown | None:
        """The shape of what is still missing, and formulas for it; some seconds at first.

        None where the verdict does not ask for it.
        """
        if self.verdict not in ("unknown", "partly_explained"):
            return None
        return unknown(self.fit, self.held_out)

    def with_warnings(self, warnings: Sequence[str]) -> Study:
        """The same study with these warnings; what it has worked out so far it keeps."""
        other = replace(self, warnings=tuple(warnings))
        for slow in ("where", "unknown"):
            if slow in self.__dict__:
                other.__dict__[slow] = self.__dict__[slow]
        return other

    def waterfall(self, horizons_s: Sequence[float] = (0.5, 1.0, 2.0, 5.0)) -> Waterfall:
        """Errors of every step, one sample and further ahead, in training and held out.

        Parameters
        ----------
        horizons_s : sequence of float
            How far ahead, beside one sample. Long ones take some seconds each.
        """
        return waterfall(
            self.fits,
            self.steps,
            (self.fit.driving, self.train[-1]),
            (self.held_out, self.test[-1]),
            horizons_s,
        )

    _HEAD = ("step", "train error", "held-out error")

    def _rows(self) -> list[list[str]]:
        return [
            [label, f"{a.error:.3f}", f"{b.error:.3f}"]
            for label, a, b in zip(self.steps, self.train, self.test, strict=False)
        ] + [["noise floor", "1.000", "1.000"]]

    def __str__(self) -> str:
        lines = [f"Verdict: {self.verdict} - {self.meaning}."]
        lines += [f"  {a}" for a in self.added]
        lines.append(text_table(self._HEAD, self._rows()))
        lines.append(self.in_the_end)
        lines += [f"Warning: {w}" for w in self.warnings]
        return "\n".join(lines)

    @property
    def in_the_end(self) -> str:
        """What is left on the driving of the fit, and on the other, in words."""
        said = f"In the end: {self.omnibus}."
        if self.omnibus_held_out is not None:
            said += f" On the held-out driving: {self.omnibus_held_out}."
        return said

    def _repr_html_(self) -> str:
        return (
            f"<p><b>{escape(self.verdict)}</b>: {escape(self.meaning)}.</p>"
            + html_list(self.added)
            + html_table(self._HEAD, self._rows())
        )

    def to_dict(self) -> dict[str, Any]:
        """All figures, ready for JSON."""
        return {
            "verdict": self.verdict,
            "effects": [_effect(a) for a in self.added],
            "ranking": [_candidate(c, self.verdicts[c.id]) for c in self.diagnoses[0].ranking],
            "verdicts": self.verdicts.to_dict(),
            "channels": {
                "before": {"train": _channels(self.train[0]), "test": _channels(self.test[0])},
                "after": {"train": _channels(self.train[-1]), "test": _channels(self.test[-1])},
            },
            "regions": [
                {
                    "speed_mps": list(r.speed_mps),
                    "lateral_acceleration_mps2": list(r.lateral_mps2),
                    "share": r.share,
                }
                for r in self.test[0].regions
            ],
            "where": self.where.to_dict(),
            "unknown": {
                "p_value": self.omnibus.p_value,
                "strongest": self.omnibus.strongest,
                **_held_out(self.omnibus_held_out),
                **({} if self.unknown is None else self.unknown.to_dict()),
            },
            "errors": {
                "train": [c.error for c in self.train],
                "test": [c.error for c in self.test],
            },
            "parameters": {e.name: e.to_dict() for e in (*self.fit.estimates, *self.fit.derived)},
            "warnings": list(self.warnings),
        }

    def to_json(self, path: str | Path) -> None:
        """Write all figures to a JSON file, whole or not at all."""
        write_json(path, self.to_dict())

    def report(self, path: str | Path) -> None:
        """Write the study as one self-contained HTML file."""
        # Drawing is the last stage; it is imported only where somebody asks for it.
        from ..report import write_report

        write_report(self, Path(path))


def _held_out(o: Omnibus | None) -> dict[str, Any]:
    if o is None:
        return {}
    return {"held_out": {"p_value": o.p_value, "strongest": o.strongest}}


def _effect(a: AddedEffect) -> dict[str, Any]:
    return {
        "id": a.id,
        "parameters": {e.name.split(".")[1]: e.to_dict() for e in a.parameters},
        "error_before": a.error_before,
        "error_after": a.error_after,
        "p_value": a.p_value,
    }


def _candidate(c: Candidate, verdict: EffectVerdict) -> dict[str, Any]:
    return {
        "id": c.id,
        "status": verdict.finding,
        "bound": list(verdict.bound),
        "group": list(verdict.group),
        "retained": c.retained,
        "statistic": c.statistic,
        "p_value": c.p_value,
        "predicted_error": c.predicted_error,
        "indistinguishable_from": list(c.indistinguishable_from),
        "parameters": {
            p.name: {"value": v, "std": s, "unit": p.unit}
            for p, v, s in zip(c.effect.parameters, c.value, c.std, strict=True)
        },
    }


def _channels(c: Comparison) -> dict[str, Any]:
    return {
        name: {"rmse": s.rmse, "noise_floor": s.noise_floor, "nrmse": s.nrmse, "r2": s.r2}
        for name, s in c.channels.items()
    }
