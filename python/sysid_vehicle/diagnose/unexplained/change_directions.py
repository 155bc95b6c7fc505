"""In which ways a car may change, and what a change that begins at a moment does to residuals."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy

from ..._common.arrays import FloatArray, as_float64
from ...effects import effect
from ...estimate.pieces import DrivingProblem
from ..evidence.coordinates import running_time
from ..evidence.evidence import FORCES, Evidence
from .shape import known

_BLEND_S = 0.2  # a change takes about a second, as that of `friction_change`
_SMALL = 0.01
_GRIP = ("D_front", "D_rear")


@dataclass(frozen=True, eq=False)
class Kind:
    """A way in which a car may change.

    Attributes
    ----------
    what : str
        `grip`, `side force` or `forward force`.
    names : tuple of str
        Sizes that say how much.
    columns : array, shape (5 n, names)
        Sensitivities to them, had they always been there.
    """

    what: str
    names: tuple[str, ...]
    columns: FloatArray


def kinds_of_change(evidence: Evidence) -> list[Kind]:
    """Grip, a side force at an unknown place, and where it can be told a forward force."""
    model = evidence.fit.model
    of_grip = evidence.of_parameters(*_GRIP) @ [[model.value(n)] for n in _GRIP]
    kinds = [Kind("grip", ("grip",), of_grip)]
    for what, names in (("side force", ("F_y", "M_z")), ("forward force", ("F_x",))):
        if evidence.targets(*names):
            ones = np.ones((evidence.driving.samples, len(names)))
            kinds.append(Kind(what, names, evidence.of_signals(ones, list(names))))
    return kinds


def of_driving(evidence: Evidence) -> FloatArray:
    """Forces that depend on speed and acceleration: that the driving changed, is no change."""
    where = known(evidence)
    v, side, ahead = (where[n] for n in ("vx_mps", "ay_mps2", "ax_mps2"))
    turning = [v**2, side, side * np.abs(side), ahead, ahead * side]
    signals, targets = [], []
    for target in evidence.targets(*FORCES):
        some = [v**2, side**2, ahead] if target == "F_x" else turning
        signals += some
        targets += [target] * len(some)
    return evidence.of_signals(np.column_stack(signals), targets)


def beginning(evidence: Evidence, kind: Kind, samples: list[int]) -> list[FloatArray]:
    """Directions of changes of a kind that begin at some samples, (5 n, names) each."""
    driving, n = evidence.driving, evidence.driving.samples
    now, model = running_time(driving), evidence.fit.model
    change = effect("friction_change")
    if kind.what == "grip" and change in model.parts:
        return [_cut(kind.columns, n, k) for k in samples]
    if kind.what == "grip":
        wide = model.core(force_known=driving.force_known, also=(change,))
        changing = evidence.problem.with_model(wide)
        return [_of_grip(evidence, kind, changing, change.columns, k) for k in samples]
    width = len(kind.names)
    signals = [scipy.special.expit((now - now[k]) / _BLEND_S) for k in samples]
    columns = evidence.of_signals(
        np.repeat(np.column_stack(signals), width, axis=1), list(kind.names) * len(samples)
    )
    return [as_float64(c) for c in np.split(columns, len(samples), axis=1)]


def _of_grip(
    evidence: Evidence, kind: Kind, changing: DrivingProblem, at: list[int], sample: int
) -> FloatArray:
    """Direction of more grip from a sample on, exact in the stretch in which it lies."""
    driving = evidence.driving
    s, (begin, end, rate) = next(
        pair for pair in zip(driving.stretches, driving.spans, strict=True) if sample < pair[1].end
    )
    p = evidence.fit.model.vector().copy()
    moment = (s.where.start + sample - begin) / rate
    p[at] = [-_SMALL, moment]
    channels = len(evidence.residual) // driving.samples
    own = slice(channels * begin, channels * end)
    direction = _cut(kind.columns, driving.samples, end)
    changed = changing.residuals(p, evidence.frozen).ravel()
    direction[own, 0] = (evidence.residual - changed)[own] / _SMALL
    return direction


def _cut(columns: FloatArray, samples: int, first: int) -> FloatArray:
    late = columns.copy()
    late[: first * (len(columns) // samples)] = 0.0
    return late
