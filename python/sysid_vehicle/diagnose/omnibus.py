"""Is anything left that depends on the driving? A test against flexible unknown forces.

Signals of speed, acceleration and steering, as virtual forces, moments, accelerations and sensor
shifts, are scored together after projection on all the model can already do (a portmanteau score
test; Lin, Biometrika 1997). Signals are built from what was known one sample earlier: the noise of
a measurement must not enter its own prediction.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy

from .._arrays import FloatArray
from ..estimate import Driving
from ..identify import Fit
from ..rules import USUAL, Rules
from ..vehicle import GRAVITY_MPS2
from .coordinates import begins, late
from .evidence import Evidence
from .projection import orthonormal_basis, pseudo_inverse, variance_ratio

# Targets in the core's order: external F_x, F_y, M_z, then accelerations, then sensor readings.
_TARGETS = {"F_x": 0, "F_y": 1, "M_z": 2, "dv_x/dt": 3, "dv_y/dt": 4}
_SENSORS = {"r": 7, "a_x": 8, "a_y": 9}

_FORWARD, _SIDEWAYS, _TURNING = ("vx_mps", "ax_mps2"), ("vy_mps", "ay_mps2"), ("yaw_rate_radps",)
_MOVES = {
    **dict.fromkeys(("F_x", "dv_x/dt", "a_x"), _FORWARD),
    **dict.fromkeys(("F_y", "dv_y/dt", "a_y"), _SIDEWAYS),
    **dict.fromkeys(("M_z", "r"), _TURNING),
}


@dataclass(frozen=True)
class Omnibus:
    """Result of the test.

    Attributes
    ----------
    p_value : float
        Of a complete model.
    strongest : str
        Target that carries most of the evidence.
    rules : Rules
        By which it rejects.
    """

    statistic: float
    degrees: int
    p_value: float
    strongest: str
    rules: Rules = USUAL

    @property
    def rejects(self) -> bool:
        """Whether the model is shown to be incomplete, at 1 % usually."""
        return not self.p_value > self.rules.level

    @property
    def moves(self) -> tuple[str, ...]:
        """Measured channels that the strongest target moves first."""
        return _MOVES[self.strongest]

    def __str__(self) -> str:
        if not self.rejects:
            return f"no sign of anything left that depends on the driving (p = {self.p_value:.2g})"
        return (
            f"something is left that depends on the driving, mostly in {self.strongest} "
            f"(p = {self.p_value:.2g})"
        )


def omnibus(fit: Fit, driving: Driving, rules: Rules = USUAL) -> Omnibus:
    """Test a fitted model, with the effects it has, for anything left."""
    return omnibus_of(Evidence(fit, driving), rules)


def omnibus_of(evidence: Evidence, rules: Rules = USUAL) -> Omnibus:
    """The same of residuals that may be known already."""
    names, R = _directions(evidence)
    e = evidence.left
    information, S = R.T @ R, R.T @ e

    def of(columns: list[int]) -> tuple[float, int]:
        inverse, rank = pseudo_inverse(information[np.ix_(columns, columns)])
        value = np.zeros(len(names))
        value[columns] = inverse @ S[columns]
        along = R @ value
        return float(S @ value) / variance_ratio(along, e - along), rank

    statistic, degrees = of(list(range(len(names))))
    by_target = {t: of([i for i, n in enumerate(names) if n == t])[0] for t in dict.fromkeys(names)}
    return Omnibus(
        statistic,
        degrees,
        float(scipy.stats.chi2.sf(statistic, degrees)),
        max(by_target, key=lambda t: by_target[t]),
        rules,
    )


def unknown_directions(evidence: Evidence) -> list[tuple[str, FloatArray]]:
    """Orthonormal directions of each unknown force, moment or reading, by its name."""
    names, R = _directions(evidence)
    of = np.array(names)
    return [(t, orthonormal_basis(R[:, of == t])) for t in dict.fromkeys(names)]


def _directions(evidence: Evidence) -> tuple[list[str], FloatArray]:
    """Targets and sensitivities of the virtual signals that the free parameters cannot copy."""
    names, signals, targets = _virtual(evidence)
    p = evidence.fit.model.vector()
    G = evidence.problem.signal_sensitivities(p, evidence.frozen, signals, targets)
    R = evidence.project(G)
    kept = np.linalg.norm(R, axis=0) > 1e-3 * np.maximum(np.linalg.norm(G, axis=0), 1e-300)
    return [n for n, k in zip(names, kept, strict=True) if k], R[:, kept]


def _virtual(evidence: Evidence) -> tuple[list[str], FloatArray, list[int]]:
    """Signals and what they act on: names of the targets, signals as columns, their numbers."""
    fit, driving = evidence.fit, evidence.driving
    trace = evidence.problem.trace(fit.model.vector(), fit.noise.vector(), False)
    state = trace["state"]
    v, r = state[:, 0], state[:, 2]
    a = v * r / GRAVITY_MPS2
    steer = driving.channel("steer_rad")
    pull = driving.channel("fx_n" if driving.force_known else "ax_mps2")
    pull = pull / max(float(np.nanstd(pull)), 1e-9)
    w = v / 20.0
    one = np.ones_like(v)
    shapes = [one, w**2, a, a**3, a * w**2, a**2, pull, pull * a, pull * np.abs(a), pull**2, r]
    turn = steer - late(driving, steer)
    turn[begins(driving)] = 0.0  # what lay between two stretches is no turn of the wheel
    shapes.append(turn / max(float(np.std(turn)), 1e-9))
    force = np.column_stack(shapes)
    few = np.column_stack([one, w**2, a, pull])
    # Known one sample earlier; the first sample of a stretch knows nothing.
    force, few = late(driving, force), late(driving, few)
    names: list[str] = []
    targets: list[int] = []
    blocks: list[FloatArray] = []
    heavy = set() if driving.force_known else {"F_x"}
    for target, number in {**_TARGETS, **_SENSORS}.items():
        if target in heavy or (target == "a_x" and not driving.force_known):
            continue
        block = force if number <= 2 else few
        blocks.append(block)
        names += [target] * block.shape[1]
        targets += [number] * block.shape[1]
    return names, np.hstack(blocks), targets
