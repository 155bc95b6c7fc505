"""Doing one study, in whichever process or on whichever machine it was sent to."""

from __future__ import annotations

import threading
import time
import warnings
from collections.abc import Iterable
from dataclasses import dataclass, replace
from pathlib import Path

from .._common.memo import forget
from .._common.threads import at_most
from ..effects import load_effects
from ..effects.catalogue import know
from ..errors import SysidError
from ..log import Log
from ..read import read_log
from ..saved import packed
from ..study import AddedEffect, Study, horizons, improve
from .jobs import Job
from .results import AHEAD_S, Effect, Row

_defined: set[Path] = set()
_defining = threading.Lock()


@dataclass(frozen=True)
class Outcome:
    """What comes back: the row, and the study as it stands in a file; None where it failed.

    `heard` are the warnings of a worker, for the process that asked.
    """

    row: Row
    study: bytes | None
    heard: tuple[str, ...] = ()


def do(job: Job) -> Outcome:
    """Do a study. One that cannot be done is an outcome, too."""
    if threading.current_thread() is not threading.main_thread():
        return _done(job)  # other threads would hear of it if warnings were caught
    with warnings.catch_warnings(record=True) as heard:
        warnings.simplefilter("always")
        outcome = _done(job)
    return replace(outcome, heard=tuple(dict.fromkeys(str(w.message) for w in heard)))


def _done(job: Job) -> Outcome:
    began = time.perf_counter()
    try:
        define(job.define)
        know(job.effects)
        # Other studies have the other cores.
        with at_most(1):
            train, validation = (_logs(job, drives) for drives in (job.train, job.validation))
            study = improve(job.model, train, validation or None, progress=False, **job.options)
            row = _row(job, study, time.perf_counter() - began)
        return Outcome(row, packed(study))
    except SysidError as error:
        return failed(job, str(error), time.perf_counter() - began)
    except Exception as error:  # one study that fails, however it does, leaves the others alone
        return failed(job, f"{type(error).__name__}: {error}", time.perf_counter() - began)
    finally:
        forget()  # the next study is of another log


def failed(job: Job, because: str, seconds: float = 0.0) -> Outcome:
    """The outcome of a study that cannot be done."""
    return Outcome(Row(job.name, job.car, failure=because or "unknown", seconds=seconds), None)


def define(files: Iterable[Path], *, again: bool = False) -> frozenset[str]:
    """Run files that define effects, those that this process has run only if asked.

    Returns
    -------
    frozenset of str
        Effects of the files that were run.
    """
    found: list[str] = []
    with _defining:
        for path in files:
            if again or path not in _defined:
                found += [e.id for e in load_effects(path)]
                _defined.add(path)
    return frozenset(found)


def _logs(job: Job, drives: tuple[Log | Path, ...]) -> list[Log]:
    def read(path: Path) -> Log:
        return read_log(path, job.channels, dbc=job.dbc, vehicle=job.model.vehicle)

    return [x if isinstance(x, Log) else read(x) for x in drives]


def _row(job: Job, study: Study, seconds: float) -> Row:
    ahead = horizons(study.fits, study.steps, study.validation, horizons_s=(AHEAD_S,))
    told = study.explained
    return Row(
        job.name,
        job.car,
        verdict=study.verdict,
        effects=tuple(
            _effect(a, {c: g[0] for c, g in ahead.gains(study.step_of(a.id)).items()})
            for a in study.added
        ),
        error_before=study.test[0].error,
        error_after=study.test[-1].error,
        explained=None if told is None else (told.share, told.low, told.high),
        usable_s=study.fit.driving.usable_s,
        validation_s=study.validation.usable_s,
        warnings=study.warnings,
        seconds=seconds,
    )


def _effect(added: AddedEffect, gains: dict[str, float | None]) -> Effect:
    return Effect(
        added.id,
        added.grade,
        added.confounded_with,
        added.stands_in,
        {e.name.split(".")[1]: (e.value, e.std, e.unit) for e in added.parameters},
        added.error_before,
        added.error_after,
        gains,
    )
