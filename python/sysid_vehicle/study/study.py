"""What a study found."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import pairwise
from pathlib import Path
from typing import Any

from .._common.arguments import duration
from .._common.arrays import FloatArray
from .._common.files import write_json
from .._common.tables import frame
from .._common.text import brief
from ..compare import Comparison
from ..diagnose import (
    BiasReport,
    Causes,
    Ceiling,
    Delay,
    Diagnosis,
    Omnibus,
    Unknown,
    Verdicts,
    Where,
    ceiling,
    unknown,
    where,
)
from ..estimate import Driving
from ..identify import Estimate, Fit
from ..model import Model
from ..rules import LACKING, USUAL, Rules, Verdict
from ..saved import save
from .ahead.beyond import Beyond
from .ahead.horizons import Horizons, horizons
from .ahead.shares import Shares, shares
from .ahead.waterfall import Waterfall, waterfall
from .judge.answers import Answers
from .judge.between_logs import told_differently
from .judge.disagree import Disagreement, disagreements
from .judge.foretold import Foretold
from .judge.structure import Structure
from .results.added import AddedEffect
from .results.failing import errors_with, late, where_lines
from .results.hidden import hidden
from .results.in_time import in_time, take_over, told, with_told
from .results.meaning import meaning
from .results.next_steps import next_steps
from .results.predicting import Predicting, predicting
from .results.printed import as_html, as_text
from .results.record import record
from .results.sentences import in_the_end, sufficient_baseline
from .results.widened import estimates_of
from .validation import at_its_best


@dataclass(frozen=True, eq=False)
class Study:
    """The way from a baseline to a better model.

    Attributes
    ----------
    verdict : str
        `adequate`, `explained`, `partly_explained`, `unknown` or `not_testable`.
    fits : tuple of Fit
        The baseline, then one for each effect added.
    diagnoses : tuple of Diagnosis
        One before each step, and the last one, which found nothing more to add.
    train, test : tuple of Comparison
        For each fit, all against the noise floor of the final one.
    validation : Driving
        The validation data.
    added : tuple of AddedEffect
    omnibus, omnibus_together : Omnibus
        Whether the final model leaves anything that depends on the driving it was fitted to, and
        whether anything unknown is left beside what was added on all data; None: time had run out.
    verdicts : Verdicts
        What is to be said of every effect that the baseline lacks.
    seconds : float
        Wall time.
    rules : Rules
        By which effects were claimed.
    explained : Beyond or None
        Of the errors 1 to 5 s ahead on validation data, beyond the noise of the sensors, what the
        added effects take away together; None where nothing was added, or time had run out.
    structure : Structure, optional
        What of that which the final model leaves depends on the driving.
    foretold : Foretold, optional
        Whether validation data err by more than the final model foretells with its disturbances.
    slow : tuple of str
        Disturbances of the final model that last as long as any may, in words: forces it lacks.
    stopped : tuple of str
        Effects with evidence that the time limit left untried.
    full : tuple of str
        Effects with evidence beyond as many as could be added.
    late_facts : tuple of str
        What the time limit left unknown, in words.
    checked : bool
        Whether the logs were put right by a check of the sensors.
    matters : mapping of str to float, optional
        Errors by channel that matter, where the user said which: else the noise of the sensors.
    buried : bool
        Whether something is left beside what was added, and errs by less, 0.5 to 5 s ahead, than
        the noise of the sensors.
    answers : Answers, optional
        About its validation data, for those who ask again.
    widened : array, shape (parameters, parameters), optional
        Covariance of the final fit's parameters by what is missing too; None where nothing is, or
        time had run out.
    worked_out : mapping of str to object
        Of a study that was read what takes long to tell and had been told before, by attribute.
    """

    verdict: Verdict
    fits: tuple[Fit, ...]
    diagnoses: tuple[Diagnosis, ...]
    train: tuple[Comparison, ...]
    test: tuple[Comparison, ...]
    validation: Driving
    added: tuple[AddedEffect, ...]
    omnibus: Omnibus
    omnibus_together: Omnibus | None
    verdicts: Verdicts
    warnings: tuple[str, ...]
    seconds: float
    rules: Rules = USUAL
    explained: Beyond | None = None
    structure: Structure | None = None
    foretold: Foretold | None = None
    slow: tuple[str, ...] = ()
    stopped: tuple[str, ...] = ()
    full: tuple[str, ...] = ()
    late_facts: tuple[str, ...] = ()
    checked: bool = False
    matters: Mapping[str, float] | None = None
    buried: bool = False
    answers: Answers | None = None
    widened: FloatArray | None = None
    worked_out: Mapping[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        take_over(self, self.worked_out)
        object.__setattr__(self, "worked_out", {})  # of this study alone: `replace` makes another

    @property
    def fit(self) -> Fit:
        """The final fit."""
        return self.fits[-1]

    @property
    def model(self) -> Model:
        """The improved model."""
        return self.fit.model

    @cached_property
    def estimates(self) -> tuple[Estimate, ...]:
        """Parameters of the final model and what follows from them.

        Where something is missing their intervals are wider than those of `fit`, which knows of
        noise alone: by what the unknown may do to them (`diagnose.widened`).
        """
        return estimates_of(self.fit, self.widened)

    def save(self, path: str | Path) -> None:
        """Write the study, its fits, its logs, what it told; :func:`sysid_vehicle.load` reads it.

        Raises
        ------
        InvalidInput
            If the file cannot be written.
        """
        save(with_told(self), path)

    @property
    def meaning(self) -> str:
        """The verdict in words."""
        return meaning(self)

    @property
    def steps(self) -> tuple[str, ...]:
        """The baseline and what each fit has more, in order."""
        names = {a.id: a.name for a in self.added}
        fits = [f.model.effects for f in self.fits]
        new = [[e for e in now if e not in last] for last, now in pairwise(fits)]
        return ("baseline", *(f"+ {' + '.join(names.get(e, e) for e in few)}" for few in new))

    def step_of(self, effect: str) -> int:
        """Which of `fits` is the first with an effect that was added."""
        return next(i for i, fit in enumerate(self.fits) if effect in fit.model.effects)

    @cached_property
    def where(self) -> Where:
        """Where, when and at which frequencies the final model fails; some seconds at first."""
        return where(self.fit, name=self.name_of(self.fit), omnibus=self.omnibus)

    @cached_property
    def where_baseline(self) -> Where:
        """The same of the baseline; some seconds at first.

        Where it was found to lack effects, these feign delays and changes of the car, which are
        then not sought: the final model tells.
        """
        if len(self.fits) == 1:
            return self.where
        first, left = self.fits[0], self.diagnoses[0].omnibus
        return where(first, causes=False, name=self.name_of(first), omnibus=left)

    @cached_property
    def errors_with(self) -> tuple[dict[str, tuple[float, float]], ...]:
        """Errors with each effect that a diagnosis refitted, on training and validation data.

        One step ahead, against the noise floor of the final model, as `train` and `test` are. A
        dictionary by effect for each diagnosis; some seconds at first.
        """
        return errors_with(self)

    @cached_property
    def late(self) -> dict[str, Delay]:
        """How late the car answers each input, where effects of the final model delay it.

        Compared with the final model without them, all else fitted anew. By input, `steer` and
        `force`; empty where no effect that was added delays anything.
        """
        return late(self)

    @property
    def where_lines(self) -> tuple[tuple[str, tuple[str, ...]], ...]:
        """Where the baseline and the final model fail: a title and sentences of each."""
        return where_lines(self)

    def name_of(self, fit: Fit) -> str:
        """The model of one of its fits, in words."""
        if len(self.fits) == 1:
            return "the baseline"
        added = [e for e in fit.model.effects if e not in self.fits[0].model.effects]
        return f"the final model (with {', '.join(added)})" if added else "the baseline"

    @cached_property
    def unknown(self) -> Unknown | None:
        """The shape of what is still missing, and formulas for it; some seconds at first.

        None where the verdict does not ask for it.
        """
        if self.verdict not in LACKING:
            return None
        return unknown(self.fit, self.validation)

    @cached_property
    def causes(self) -> tuple[Causes, ...]:
        """What each diagnosis finds missing (`Diagnosis.causes`); a second or two each at first."""
        return tuple(dx.causes for dx in self.diagnoses)

    @cached_property
    def hidden(self) -> BiasReport | None:
        """What the effects would do that this driving tells least of; some seconds at first.

        None where it could tell each of them.
        """
        return hidden(self)

    @cached_property
    def left_out(self) -> Mapping[str, str]:
        """What `in_time` had no time for: attributes of the study, and what they tell."""
        return {}

    @cached_property
    def ceiling(self) -> Ceiling:
        """How much of what the final model lacks any function of the driving could explain."""
        return ceiling(self.fit, self.validation, rules=self.rules)

    @cached_property
    def shares(self) -> Shares:
        """Errors ahead by channel: baseline, with the effects, ceiling, noise; some seconds.

        Both models have the parameters that predict best, as in `explained`: what other parameters
        would have taken away is nothing that effects explain.
        """
        named = [a.name for a in self.added]
        first, last = (at_its_best(f, self.validation) for f in (self.fits[0], self.fit))
        return shares(first, last, self.validation, named=named)

    @cached_property
    def disagreements(self) -> tuple[Disagreement, ...]:
        """What validation data tell differently, if something is left; some seconds."""
        if self.verdict not in LACKING:
            return ()
        return disagreements(self.fit, self.validation, self.rules)

    @cached_property
    def between_logs(self) -> list[str]:
        """What training logs tell differently, in words, if something is left; some seconds."""
        return told_differently(self.fit, self.rules) if self.verdict in LACKING else []

    @cached_property
    def sufficient(self) -> Fit | None:
        """Baseline whose errors 0.5 to 5 s ahead are below usual ones, if it is unknown why."""
        return sufficient_baseline(self)

    @cached_property
    def predicting(self) -> Predicting | None:
        """First and last model fitted to predictions of 2 s; None if the driving is too short."""
        return predicting(self)

    def in_time(self, seconds: float, *, reported: bool = True) -> Study:
        """The same study with what takes long to tell worked out, as far as that is done in time.

        Parameters
        ----------
        seconds : float
            From now on. Some passes over the data come after.
        reported : bool
            Whether also what only reports and files tell.

        Returns
        -------
        Study
            What is not done in time is left out, and `left_out` says so.

        Raises
        ------
        InvalidInput
            No time above zero.
        """
        ends = time.perf_counter() + duration(seconds, "seconds")
        return in_time(self, ends, reported=reported)

    def with_warnings(self, warnings: Sequence[str]) -> Study:
        """The same study with these warnings; what it has worked out so far it keeps."""
        return take_over(replace(self, warnings=tuple(warnings)), told(self))

    @cached_property
    def horizons(self) -> Horizons:
        """Errors of every step 0.5 to 5 s ahead on the validation data, in physical units."""
        return horizons(self.fits, self.steps, self.validation)

    def waterfall(self, horizons_s: Sequence[float] = (0.5, 1.0, 2.0, 5.0)) -> Waterfall:
        """Errors of every step, one sample and further ahead, on training and validation data.

        Parameters
        ----------
        horizons_s : sequence of float
            How far ahead, beside one sample. Long ones take some seconds each.
        """
        return waterfall(
            self.fits,
            self.steps,
            (self.fit.driving, self.train[-1]),
            (self.validation, self.test[-1]),
            horizons_s,
        )

    __repr__ = brief

    def __str__(self) -> str:
        return as_text(self)

    @property
    def sensors(self) -> tuple[str, ...]:
        """What the channels had to be corrected for before any fit, in sentences."""
        logs = (*self.fits[0].driving.logs, *self.validation.logs)
        said = dict.fromkeys(text for log in logs for text in log.corrections)
        return tuple(f"Sensor of {text}" for text in said)

    @property
    def in_the_end(self) -> str:
        """What is left on the driving of the fit, and on the other, in words."""
        return in_the_end(self)

    @property
    def next_steps(self) -> tuple[str, ...]:
        """What to mend, record or look at next, in sentences; none where the model may be used."""
        return next_steps(self)

    def _repr_html_(self) -> str:
        return as_html(self)

    def to_pandas(self) -> Any:
        """A DataFrame of the one-step-ahead errors of every step, in units of the noise floor."""
        train, test = ([c.error for c in found] for found in (self.train, self.test))
        columns = {"step": self.steps, "train_error": train, "validation_error": test}
        return frame(columns, "step")

    def to_dict(self) -> dict[str, Any]:
        """All figures, ready for JSON."""
        return record(self)

    def to_json(self, path: str | Path) -> None:
        """Write all figures to a JSON file, whole or not at all."""
        write_json(path, self.to_dict())

    def report(self, path: str | Path) -> None:
        """Write the study as one self-contained HTML file, or as Markdown (`.md`)."""
        # Drawing is the last stage; it is imported only where somebody asks for it.
        from ..report import write_report

        write_report(self, Path(path))
