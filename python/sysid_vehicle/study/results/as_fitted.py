"""What errors ahead do with the parameters of the fits one step ahead, beside the share."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..._common.arrays import FloatArray
from ..ahead.horizons import LATERAL

if TYPE_CHECKING:
    from ..study import Study


def as_fitted(study: Study) -> list[str]:
    """What the errors do with the parameters of the fits, where the share tells another story."""
    if study.explained is None:
        return []
    errors, shares = study.horizons, study.shares
    first, last = (errors.error[k] for k in (0, -1))
    fall = _fall(first, last, study)
    # Errors hold the noise of the sensors, the share does not: a smaller fall says nothing yet.
    if 0.0 <= fall <= study.explained.high:
        return []
    does = "fall" if fall >= 0.0 else "grow"
    text = (
        "This share compares both models with the parameters that predict best. As fitted one "
        f"step ahead, the squared lateral errors {does} by {100 * abs(fall):.0f} %"
    )
    alone = np.full_like(first, np.nan)
    for i, h in enumerate(errors.horizons_s):
        for j, c in enumerate(errors.channels):
            if h in shares.horizons_s and c in shares.channels:
                at = 1, shares.horizons_s.index(h), shares.channels.index(c)  # the median
                alone[i, j] = shares.baseline[at]
    other = _fall(first, alone, study)
    if fall > study.explained.high and other > 0.0:
        text += f"; other parameters alone lower those of the baseline by {100 * other:.0f} %"
    return [f"{text}."]


def _fall(first: FloatArray, last: FloatArray, study: Study) -> float:
    """Fall of the squares of the median lateral errors 1 to 5 s ahead, in the mean."""
    ahead = [h >= 1.0 for h in study.horizons.horizons_s]
    lateral = [c in LATERAL for c in study.horizons.channels]
    first, last = (errors[ahead][:, lateral] for errors in (first, last))
    known = np.isfinite(first) & np.isfinite(last) & (first > 0.0)
    return float(1.0 - np.mean((last[known] / first[known]) ** 2)) if known.any() else 0.0
