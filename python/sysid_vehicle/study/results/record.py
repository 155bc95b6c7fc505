"""All figures of a study, ready for JSON."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from ...compare import Comparison
from ...diagnose import Candidate, EffectVerdict, Omnibus

if TYPE_CHECKING:
    from ..study import Study


def record(study: Study) -> dict[str, Any]:
    """Collect what a study found.

    Parameters
    ----------
    study : Study
    """
    errors = study.errors_with[0]
    return {
        "verdict": study.verdict,
        "effects": [
            {**a.to_dict(), "gains": study.horizons.gains(study.step_of(a.id))} for a in study.added
        ],
        "horizons": study.horizons.to_dict(),
        "shares": study.shares.to_dict(),
        "explained": None if study.explained is None else study.explained.to_dict(),
        "late_facts": list(study.late_facts),
        "ranking": [
            _candidate(c, study.verdicts[c.id], *errors.get(c.id, (None, None)))
            for c in study.diagnoses[0].ranking
        ],
        "causes": study.causes[0].to_dict(),
        "verdicts": study.verdicts.to_dict(),
        "channels": {
            "before": {"train": _channels(study.train[0]), "test": _channels(study.test[0])},
            "after": {"train": _channels(study.train[-1]), "test": _channels(study.test[-1])},
        },
        "regions": [
            {
                "speed_mps": list(r.speed_mps),
                "lateral_acceleration_mps2": list(r.lateral_mps2),
                "share": r.share,
            }
            for r in study.test[0].regions
        ],
        "where": _where(study),
        "where_baseline": study.where_baseline.to_dict(),
        "unknown": {
            "p_value": study.omnibus.p_value,
            "strongest": study.omnibus.strongest,
            **_together(study.omnibus_together),
            "slow": list(study.slow),
            "foretold": None if study.foretold is None else study.foretold.to_dict(),
            "explainable": study.ceiling.to_dict(),
            "structure": None if study.structure is None else study.structure.to_dict(),
            **({} if study.unknown is None else study.unknown.to_dict()),
        },
        "errors": {
            "train": [c.error for c in study.train],
            "test": [c.error for c in study.test],
        },
        "events": {"train": _event(study.train[-1]), "test": _event(study.test[-1])},
        "parameters": {e.name: e.to_dict() for e in study.estimates},
        "predicting": None if study.predicting is None else study.predicting.to_dict(),
        "disagreements": [d.to_dict() for d in study.disagreements],
        "between_logs": study.between_logs,
        "warnings": list(study.warnings),
        "left_out": list(study.left_out.values()),
        "next_steps": list(study.next_steps),
    }


def _where(study: Study) -> dict[str, Any]:
    told = study.where.to_dict()
    late = {name: d.to_dict() for name, d in study.late.items()}
    return {**told, "delays_without_lags": late} if late else told


def _together(o: Omnibus | None) -> dict[str, Any]:
    if o is None:
        return {}
    return {"together": {"p_value": o.p_value, "strongest": o.strongest}}


def _candidate(
    c: Candidate, verdict: EffectVerdict, train: float | None, test: float | None
) -> dict[str, Any]:
    return {
        "id": c.id,
        "status": verdict.finding,
        "bound": list(verdict.bound),
        "group": list(verdict.group),
        "retained": c.retained,
        "statistic": c.statistic,
        "p_value": c.p_value,
        "train_error": train,
        "test_error": test,
        "indistinguishable_from": list(c.indistinguishable_from),
        "parameters": {
            p.name: {"value": v, "std": s, "unit": p.unit}
            for p, v, s in zip(c.effect.parameters, c.value, c.std, strict=True)
        },
    }


def _event(c: Comparison) -> dict[str, Any] | None:
    return None if c.event is None else c.event.to_dict()


def _channels(c: Comparison) -> dict[str, Any]:
    return {
        name: {"rmse": s.rmse, "noise_floor": s.noise_floor, "nrmse": s.nrmse, "r2": s.r2}
        for name, s in c.channels.items()
    }
