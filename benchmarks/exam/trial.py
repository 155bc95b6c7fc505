"""One trial: drive, study, and keep what the tables need."""

from __future__ import annotations

import time
import warnings
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import truths
from design import Trial, catalogue
from rivals import separate

import sysid_vehicle as sv
from sysid_vehicle.diagnose import constancy
from sysid_vehicle.identify import refine

Outcome = dict[str, Any]

STARTS = 3
_SHOWN = 4.5  # nats, beyond the Bayesian price of the parameters


def examine(trial: Trial, among: Sequence[str] | None = None) -> Outcome:
    """Do one trial; plain figures, ready for JSON.

    Parameters
    ----------
    among : sequence of str, optional
        Candidates, where not all effects are.

    Returns
    -------
    dict
        `state` is `done`, `lost` (no driver could hold the car) or `failed` (with `why`).
    """
    began, cpu = time.perf_counter(), time.process_time()
    outcome: Outcome = {"key": trial.key, "trial": trial.to_dict(), "state": "done"}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", sv.SysidWarning)
        try:
            train, test, ease = truths.sample(trial)
        except sv.NumericalError as error:
            return outcome | {"state": "lost", "why": str(error)}
        try:
            if trial.kind == "rivals":
                return outcome | separate(trial, train) | {"seconds": time.perf_counter() - began}
            known = [e.id for e in catalogue()] if among is None else among
            candidates = [e for e in known if e not in trial.removed]
            study = sv.improve(
                truths.baseline(trial.vehicle),
                train,
                test,
                candidates=candidates,
                # Late sensors are among what is hidden; the likelihood is to name them.
                sensors=False,
                starts=STARTS,
                seed=trial.seed,
            )
        except sv.SysidError as error:
            outcome |= {"state": "failed", "why": f"{type(error).__name__}: {error}"}
        else:
            outcome |= {"ease": ease, **_told(study), **_against(study, trial)}
    outcome["seconds"] = time.perf_counter() - began
    outcome["cpu_seconds"] = time.process_time() - cpu
    return outcome


def _told(study: sv.Study) -> Outcome:
    """What the study said."""
    first, last = study.diagnoses[0], study.diagnoses[-1]
    together = None if study.omnibus_together is None else study.omnibus_together.p_value
    leader, group = None, ()
    if first.significant:
        leader, group = first.ranking[0].id, first.ranking[0].indistinguishable_from
    if study.added:
        # After the refits, and with a word from the validation data.
        leader = study.added[0].id
        group = study.verdicts[leader].group
    return {
        "verdict": study.verdict,
        "added": [a.id for a in study.added],
        "own": {a.id: [a.own.to_dict(), a.own_in_training.to_dict()] for a in study.added},
        "groups": {a.id: list(study.verdicts[a.id].group) for a in study.added},
        "evidence": [c.id for c in first.significant],
        "leader": leader,
        "leader_group": list(group),
        "sets": [list(s.effects) for s in first.causes.sets],
        "findings": {v.effect.id: v.finding for v in study.verdicts.all if v.finding != "absent"},
        "constancy": {e: [c.p_value, c.spread, c.degrees] for e, c in constancy(study.fit).items()},
        "left": [c.id for c in last.significant],
        "omnibus_first": first.omnibus.p_value,
        "omnibus_last": study.omnibus.p_value,
        "omnibus_together": together,
        "foretold": None if study.foretold is None else study.foretold.to_dict(),
        "explained": None if study.explained is None else study.explained.to_dict(),
        "train_errors": [c.error for c in study.train],
        "test_errors": [c.error for c in study.test],
        "study_seconds": study.seconds,
    }


def _against(study: sv.Study, trial: Trial) -> Outcome:
    """How that compares with what was hidden."""
    told: Outcome = {"intervals": {}}
    if trial.kind == "outside":
        return told
    # Where the road pushes at random the true car itself errs by more than the noise floor.
    truth = replace(study.fit, model=truths.hidden(trial))
    told["true_error"] = sv.compare(truth, study.validation, noise=study.fit.noise).error
    if trial.kind == "pair":
        told["shown"] = _shown(study, trial)
    estimates = {e.name: e for e in study.estimates}
    for name, true in truths.true_values(trial).items():
        if name in estimates:
            told["intervals"][name] = [estimates[name].value, estimates[name].std, true]
    return told


def _shown(study: sv.Study, trial: Trial) -> bool:
    """Whether the driving tells of every hidden effect beside the others: three standard errors."""
    baseline = study.fits[0]
    model = baseline.model.add(*trial.truth).with_values(truths.true_values(trial))
    try:
        true = refine(model, baseline.driving, study.fit.noise)
        poorer = [refine(true.model.drop(e), baseline.driving, true.noise) for e in trial.truth]
    except (sv.NumericalError, np.linalg.LinAlgError):
        return False
    price = 0.5 * np.log(baseline.driving.samples)
    return all(
        true.log_likelihood - p.log_likelihood
        > _SHOWN + price * (len(true.estimates) - len(p.estimates))
        for p in poorer
    )
