"""How much of what a model leaves depends on the driving, whatever the reason.

Missing forces, and errors one and five seconds ahead, are regressed on the histories of steering,
speed and longitudinal acceleration (`sysid_vehicle.diagnose.unexplained.ceiling`), on each data set
by itself: what is predicted of pieces that the regression did not see depends on the driving. What
is left of that is disturbance and noise, as far as any function of the driving tells.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from ..._common.arrays import FloatArray, as_float64
from ..._common.threads import in_parallel
from ...diagnose.unexplained.ceiling import Explainable, Inputs, Whole, left_out, pieces, thinned
from ...diagnose.unexplained.force_map import missing_forces
from ...errors import NumericalError
from ...estimate import MEASURED, Driving
from ...estimate.driving import WORDS
from ...identify import Fit, driving_of
from ..ahead.horizons import ALONG
from ..ahead.waterfall import all_ahead

_AHEAD_S = (1.0, 5.0)
_APART = 0.1  # of the horizon, between predictions
_FEW = 40  # predictions that a regression needs


@dataclass(frozen=True)
class Structure:
    """What the driving predicts of what a model leaves.

    Attributes
    ----------
    train, test : dict
        By what is predicted, its share of the square with a 95 % interval, on either data set.
    """

    train: dict[str, Explainable]
    test: dict[str, Explainable]

    @property
    def anywhere(self) -> float:
        """Largest share that is shown on one of the data sets, the lower end of its interval."""
        return max((e.low for e in (*self.train.values(), *self.test.values())), default=0.0)

    @property
    def everywhere(self) -> float:
        """Largest share that is shown of one and the same on both data sets."""
        both = self.train.keys() & self.test.keys()
        return max(map(self._shown, both), default=0.0)

    def _shown(self, name: str) -> float:
        return min(self.train[name].low, self.test[name].low)

    @property
    def strongest(self) -> str:
        """What the driving is shown to predict most of on both data sets, in words."""
        name = max(sorted(self.train.keys() & self.test.keys()), key=self._shown)
        e = self.test[name]
        return (
            f"{100.0 * e.share:.0f} % ({100.0 * e.low:.0f} to {100.0 * e.high:.0f}) of the {name} "
            "on validation data"
        )

    def to_dict(self) -> dict[str, dict[str, list[float]]]:
        """Shares with their intervals, ready for JSON."""
        return {
            told: {name: [e.share, e.low, e.high] for name, e in found.items()}
            for told, found in (("train", self.train), ("test", self.test))
        }


def structure(fit: Fit, test: Driving) -> Structure:
    """Find what the driving predicts of what a fit leaves.

    Parameters
    ----------
    fit : Fit
    test : Driving
        Validation data.
    """
    train, other = in_parallel(lambda d: dict(_of(fit, d)), (fit.driving, driving_of(fit, test)))
    return Structure(train, other)


def _of(fit: Fit, driving: Driving) -> Iterator[tuple[str, Explainable]]:
    inputs = Inputs.of(fit, driving, driving).train
    try:
        missing = missing_forces(fit, driving)
        ahead = all_ahead(fit, fit.noise.floor(), driving, _AHEAD_S, apart=_APART)
    except NumericalError:  # the model loses the car: of its errors nothing can be told
        return
    rows = thinned(driving)
    # Whoever holds a speed answers what is missing along the car with the pull.
    kept = [i for i, target in enumerate(missing.targets) if target != "F_x"]
    names = [f"missing {missing.targets[i]}" for i in kept]
    force = missing.force[rows][:, kept]
    yield from _named(names, driving, inputs, rows, as_float64(force - force.mean(axis=0)))
    for seconds, errors in zip(_AHEAD_S, ahead, strict=True):
        # Channels read at the same samples are regressed together, those along the car apart.
        alike: dict[tuple[bool, bytes], list[int]] = {}
        there = np.isfinite(errors) & np.isfinite(driving.measured)
        for j, channel in enumerate(MEASURED):
            alike.setdefault((channel in ALONG, there[:, j].tobytes()), []).append(j)
        before = Inputs.of(fit, driving, driving, along_until_s=seconds).train
        for (along, _), few in alike.items():
            rows = np.flatnonzero(there[:, few[0]])
            names = [f"error of {WORDS[MEASURED[j]]} {seconds:g} s ahead" for j in few]
            known = before if along else inputs
            yield from _named(names, driving, known, rows, as_float64(errors[rows][:, few]))


def _named(
    names: Sequence[str], driving: Driving, inputs: FloatArray, rows: Whole, Y: FloatArray
) -> Iterator[tuple[str, Explainable]]:
    there = np.flatnonzero(Y.any(axis=0))
    if len(rows) >= _FEW and len(there):
        few = [names[int(k)] for k in there]
        found = left_out(few, inputs[rows], as_float64(Y[:, there]), *pieces(driving, rows))
        yield from ((e.target, e) for e in found)
