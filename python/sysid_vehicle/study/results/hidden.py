"""What effects that the driving could hide would do to the identified parameters."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ...diagnose import BiasReport, EffectVerdict, bias_report

if TYPE_CHECKING:
    from ..study import Study

# Each effect takes two refits: nobody is to wait for all of them.
_MOST = 6
_SAMPLES = 1500


def open_effects(study: Study) -> list[EffectVerdict]:
    """Effects that the driving cannot test, of which it tells least first."""
    known = {e.id for e in study.fit.model.candidates}
    found = [v for v in study.verdicts.of("not testable") if v.effect.id in known]

    def looseness(v: EffectVerdict) -> float:
        sizes = zip(v.bound, v.effect.parameters, strict=False)
        return max((b / abs(p.typical) for b, p in sizes if p.typical != 0.0), default=np.inf)

    return sorted(found, key=looseness, reverse=True)


def hidden(study: Study) -> BiasReport | None:
    """What those of which it tells least would do; None where all are tested."""
    least = [v.effect for v in open_effects(study)[:_MOST]]
    return bias_report(study.fit, least, most_samples=_SAMPLES) if least else None
