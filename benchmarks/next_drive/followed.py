"""A study that leaves a question, the drive that is to answer it, and the study of both."""

from __future__ import annotations

import sys
import time
import warnings
from pathlib import Path
from typing import Any

import numpy as np

sys.path.append(str(Path(__file__).resolve().parents[1] / "exam"))

import truths
from design import Trial

import sysid_vehicle as sv
from sysid_vehicle.diagnose import NextDrive
from sysid_vehicle.diagnose.experiment.suggestion import Suggestion
from sysid_vehicle.identify import refine

Row = dict[str, Any]
_STARTS = 3


def followed(trial: Trial, limits: sv.DriveLimits | None = None) -> Row:
    """Study, ask, drive, and study again; plain figures, ready for JSON.

    Returns
    -------
    dict
        `state` is `done`, `no question`, `lost` (no driver could hold the car on the first
        drives) or `failed` (with `why`).
    """
    began = time.process_time()
    row: Row = {"key": trial.key, "truth": list(trial.truth), "state": "done"}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", sv.SysidWarning)
        try:
            train, test, _ = truths.sample(trial)
        except sv.NumericalError as error:
            return row | {"state": "lost", "why": str(error)}
        study = _studied(trial, train, test)
        row["before"] = _told(study)
        group = open_group(study)
        if group is None:
            return row | {"state": "no question", "seconds": time.process_time() - began}
        row["between"] = group
        asking = time.process_time()
        try:
            asked = _asked(study, group, limits)
        except sv.SysidError as error:
            return row | {"state": "failed", "why": f"{type(error).__name__}: {error}"}
        row["asked_seconds"] = time.process_time() - asking
        row |= _promise(asked, limits)
        row |= _driven(trial, study, asked, train, test)
    row["seconds"] = time.process_time() - began
    return row


def open_group(study: sv.Study) -> list[str] | None:
    """Effects that the study asks to separate, the one it added first; None where there are none.

    Of several groups the first, as its next steps have it.
    """
    for a in study.added:
        if a.confounded_with and a.grade != "alias":
            return [a.id, *a.confounded_with]
    return None


def _studied(trial: Trial, train: list[sv.Log], test: sv.Log) -> sv.Study:
    return sv.improve(
        truths.baseline(trial.vehicle),
        train,
        test,
        sensors=False,  # late sensors are among what is hidden
        starts=_STARTS,
        seed=trial.seed,
        workers=1,
        progress=False,
    )


def _asked(study: sv.Study, group: list[str], limits: sv.DriveLimits | None) -> NextDrive:
    return sv.next_drive(study, limits=limits, progress=False)


def _told(study: sv.Study) -> Row:
    return {
        "verdict": study.verdict,
        "added": [a.id for a in study.added],
        "groups": {a.id: list(a.confounded_with) for a in study.added},
        "grades": {a.id: a.grade for a in study.added},
        "next_steps": list(study.next_steps),
    }


def _promise(asked: NextDrive, limits: sv.DriveLimits | None) -> Row:
    best = asked.best
    return {
        "now": asked.now,
        "promised": best.sigmas,
        "reaches": asked.reaches,
        "sizes": asked.sizes,
        "printed": str(asked),
        "drive": best.to_dict(),
        "suggested": len(asked.suggestions),
        "refused": asked.refused,
        "lateral_limit": (limits or sv.DriveLimits()).lateral_mps2,
    }


def _driven(
    trial: Trial, study: sv.Study, asked: NextDrive, train: list[sv.Log], test: sv.Log
) -> Row:
    """What the true car did on the drive, and what was said of all logs."""
    try:
        there = _recorded(trial, asked.best)
    except sv.NumericalError as error:
        return {"drivable": False, "why": str(error)}
    lateral = np.concatenate([np.abs(log["ay_mps2"]) for log in there])
    return {
        "drivable": True,
        "lateral": float(np.quantile(lateral, 0.999)),
        "top": float(max(np.quantile(log["vx_mps"], 0.999) for log in there)),
        "apart_before": distances(study, trial, train),
        "apart": distances(study, trial, [*train, *there]),
        "less": _less(trial, study, asked, train),
        "after": _told(_studied(trial, [*train, *there], test)),
    }


def _recorded(trial: Trial, suggestion: Suggestion) -> list[sv.Log]:
    """The suggested drives by the true car, with its noise."""
    rng = np.random.default_rng((trial.seed, 1))
    return [truths.drive_one(trial, suggestion.manoeuvre, rng) for _ in range(suggestion.times)]


def _less(trial: Trial, study: sv.Study, asked: NextDrive, train: list[sv.Log]) -> Row | None:
    """The most telling of what is shorter than the first, and what it tells."""
    shorter = [s for s in asked.suggestions if s.whole_s < asked.best.whole_s]
    if not shorter:
        return None
    best = max(shorter, key=lambda s: s.sigmas)
    try:
        there = _recorded(trial, best)
    except sv.NumericalError:
        return None
    apart = distances(study, trial, [*train, *there])
    return {"promised": best.sigmas, "drive": best.to_dict(), "apart": apart}


def distances(study: sv.Study, trial: Trial, logs: list[sv.Log]) -> dict[str, float]:
    """By how many standard errors the true effect of the group stands before each other one.

    The root of twice what the likelihood of the model with it is above that of the model with the
    other one, with its sign; all else that was added is in both.
    """
    group = open_group(study)
    assert group is not None
    right = next((g for g in group if g in trial.truth), group[0])
    others = [a.id for a in study.added if a.id != group[0]]
    true = truths.hidden(trial).values
    driving = sv.Driving.of(logs)
    likelihood = {}
    for name in group:
        model = study.fits[0].model.add(*dict.fromkeys([*others, name]))
        values = {n: v for n, v in true.items() if n in model.parameters}
        starts = [model.with_values(values)] if values else []
        typical = {
            n: p.typical for n, p in sv.effect(name).named.items() if name not in trial.truth
        }
        starts += [model.with_values(typical), model]
        found = []
        for start in starts:
            try:
                found.append(refine(start, driving, study.fit.noise).log_likelihood)
            except (sv.NumericalError, np.linalg.LinAlgError):
                continue
        likelihood[name] = max(found, default=-np.inf)
    return {
        other: float(np.sign(d) * np.sqrt(2.0 * abs(d)))
        for other in group
        if other != right
        for d in [likelihood[right] - likelihood[other]]
    }
