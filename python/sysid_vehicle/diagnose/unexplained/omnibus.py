"""Is anything left that depends on the driving? A test against flexible unknown forces.

Signals of speed, acceleration and steering, as virtual forces, moments, accelerations and sensor
shifts, are scored together after projection on all the model can already do (a portmanteau score
test; Lin, Biometrika 1997). Signals are built from the motion that was foreseen a moment earlier:
noise of a measurement must not enter its own prediction, and noise of sensors that lasts for some
samples enters those of the next ones through the filter.

No slope of a road depends on the pull. But whoever holds a speed answers slopes with the pull, and
may know the speed better than its sensor does: what the pull then tells of slopes is no evidence,
and is taken off all other directions.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
import numpy.typing as npt
import scipy

from ... import _core
from ..._common.arrays import FloatArray, as_float64
from ...estimate import Driving
from ...identify import Fit
from ...rules import USUAL, Rules
from ...vehicle import GRAVITY_MPS2
from ..evidence.coordinates import begins, late
from ..evidence.directions import Ask, Directions
from ..evidence.evidence import FORCES, READINGS, Evidence, Section
from ..evidence.input_noise import added_by_input_noise
from ..evidence.projection import pseudo_inverse

_FORCE_SHAPES, _FEW_SHAPES = 12, 4  # signals that act on each force, and on each of the others
LEAST_LEFT = 1e-3
"""Share of its size: of a direction of which less is left others can copy it."""
_TARGETS = {**FORCES, "dv_x/dt": 3, "dv_y/dt": 4, **READINGS}

_FORWARD, _SIDEWAYS, _TURNING = ("vx_mps", "ax_mps2"), ("vy_mps", "ay_mps2"), ("yaw_rate_radps",)
_FORESEEN_S = 0.2  # what of the noise of a sensor lasts longer is in no noise model a sensor's
_SLOPE, _PULL = "dv_x/dt", 3  # the acceleration that no accelerometer feels, and its signal

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
            none = "no remaining error that depends on the driving is shown"
            return f"{none} (p = {self.p_value:.2g})"
        return (
            f"an error that depends on the driving remains, mostly in {self.strongest} "
            f"(p = {self.p_value:.2g})"
        )


def omnibus(fit: Fit, driving: Driving, rules: Rules = USUAL) -> Omnibus:
    """Test a fitted model, with the effects it has, for anything left."""
    return omnibus_of(Evidence(fit, driving), rules)


def omnibus_of(
    evidence: Evidence, rules: Rules = USUAL, projected: Directions | None = None
) -> Omnibus:
    """The same of residuals that may be known already, and of `Unknown` directions of them."""
    if projected is None:
        projected = Directions(evidence, Unknown(evidence))
    unknown = next(s for s in projected.sources if isinstance(s, Unknown))
    found = _tested(unknown, projected, rules)
    if not found.rejects:
        return found
    projected.take_off(unknown, added_by_input_noise(evidence, unknown, unknown.noisier))
    return _tested(unknown, projected, rules)


def _tested(unknown: Unknown, projected: Directions, rules: Rules) -> Omnibus:
    targets, values, ranks = unknown.tested(projected)
    ratios = np.maximum(projected.answer(unknown).ratios[: len(ranks)], 1.0)
    statistics = projected.score[projected.place(unknown)] @ values / ratios
    return Omnibus(
        float(statistics[0]),
        ranks[0],
        float(scipy.stats.chi2.sf(statistics[0], ranks[0])),
        targets[int(np.argmax(statistics[1:]))],
        rules,
    )


def not_copied(projected: Directions) -> npt.NDArray[np.bool_]:
    """Of which directions the fitted parameters leave something."""
    after, before = np.diag(projected.information), np.maximum(projected.before, 1e-300)
    return np.asarray(np.sqrt(after) > LEAST_LEFT * np.sqrt(before))


class Unknown:
    """Virtual signals of the driving that act as forces, moments, accelerations, sensor shifts.

    Parameters
    ----------
    evidence : Evidence
    like : Unknown, optional
        Of other driving, in whose units signals are.
    noise : array, shape (samples, 2), optional
        That is added to the measured steering and pull.

    Attributes
    ----------
    names : list of str
        What each column acts on.
    units : tuple of 2 floats
        Of turns of the steering and of the pull.
    """

    def __init__(
        self,
        evidence: Evidence,
        like: Unknown | None = None,
        noise: FloatArray | None = None,
    ) -> None:
        self.evidence = evidence
        driving = evidence.driving
        self._steer = driving.channel("steer_rad")
        self._pull = driving.channel("fx_n" if driving.force_known else "ax_mps2")
        if noise is not None:
            self._steer, self._pull = self._steer + noise[:, 0], self._pull + noise[:, 1]
        turn = self._turned(self._steer, begins(driving))
        own = max(float(np.std(turn)), 1e-9), max(float(np.nanstd(self._pull)), 1e-9)
        self.units: tuple[float, float] = own if like is None else like.units
        self._turn_std, self._pull_std = self.units
        self.targets: list[int] = []
        self.names: list[str] = []
        heavy = set() if driving.force_known else {"F_x", "a_x"}
        for target, number in _TARGETS.items():
            if target not in heavy:
                count = _FORCE_SHAPES if number <= 2 else _FEW_SHAPES
                self.names += [target] * count
                self.targets += [number] * count

    def noisier(self, evidence: Evidence, noise: FloatArray) -> Unknown:
        """The same of noisier evidence."""
        return Unknown(evidence, self, noise)

    @property
    def width(self) -> int:
        """Number of columns."""
        return len(self.names)

    @property
    def groups(self) -> list[slice]:
        """The columns of each target."""
        firsts = [i for i, n in enumerate(self.names) if n not in self.names[:i]]
        return [slice(a, b) for a, b in pairwise([*firsts, self.width])]

    @property
    def answered(self) -> int:
        """The column by which the pull tells of slopes."""
        return self.names.index(_SLOPE) + _PULL

    def _kept(self, projected: Directions) -> npt.NDArray[np.bool_]:
        """Of which of all directions something is left, but for what the pull tells of slopes."""
        kept = not_copied(projected)
        kept[projected.place(self).start + self.answered] = False
        return kept

    def tested(self, projected: Directions) -> tuple[list[str], FloatArray, list[int]]:
        """Targets of which something is left; least squares along all and along each, their ranks.

        The second has a column for all of them and one for each.
        """
        place = projected.place(self)
        information, S = projected.information[place, place], projected.score[place]
        copy = information[self.answered] / max(information[self.answered, self.answered], 1e-300)
        S = S - copy * S[self.answered]
        information = information - np.outer(copy, information[self.answered])
        kept = np.flatnonzero(self._kept(projected)[place])
        names = [self.names[i] for i in kept]
        targets = list(dict.fromkeys(names))
        tested = [kept, *(kept[[n == t for n in names]] for t in targets)]
        values, ranks = np.zeros((len(S), len(tested))), []
        for value, columns in zip(values.T, tested, strict=True):
            inverse, rank = pseudo_inverse(information[np.ix_(columns, columns)])
            value[columns] = inverse @ S[columns]
            value[self.answered] = -copy[columns] @ value[columns]
            ranks.append(rank)
        return targets, values, ranks

    def spanned(
        self, projected: Directions
    ) -> tuple[list[tuple[str, int]], FloatArray, FloatArray]:
        """Targets and how many directions each has; these, orthonormal; what they explain.

        The second and the third are sums of the columns: of a direction, and of a target.
        """
        place = projected.place(self)
        spans = [
            (slice(g.start - place.start, g.stop - place.start), turns)
            for g, turns in projected.spans(self._kept(projected))
            if turns.shape[1]
        ]
        ends = np.cumsum([0, *(turns.shape[1] for _, turns in spans)])
        whole = np.zeros((self.width, int(ends[-1])))
        for (group, turns), a, b in zip(spans, ends, ends[1:], strict=False):
            whole[group, a:b] = turns
        along = whole * (whole.T @ projected.score[place])
        explained = np.add.reduceat(along, ends[:-1], axis=1)
        return [(self.names[g.start], t.shape[1]) for g, t in spans], whole, explained

    def asks(self, projected: Directions) -> Ask:
        """The colour along all that is tested, then along all that is spanned."""
        along = np.hstack([self.tested(projected)[1], self.spanned(projected)[2]])
        return Ask(along, along)

    def of(self, section: Section) -> FloatArray:
        """Sensitivities of a section's residuals."""
        p = self.evidence.fit.model.vector()

        def work(problem: _core.Problem, gains: Any, at: slice) -> FloatArray:
            return problem.signal_sensitivities(p, gains, self.signals(problem, at), self.targets)

        return section.rows(work, "unknown")

    def foreseen(self, problem: _core.Problem) -> tuple[FloatArray, FloatArray]:
        """Speed and yaw rate as the filter foresaw them; where it had just begun, from there.

        Each prediction is read as long as the next one has not got so far.
        """
        fit, driving = self.evidence.fit, self.evidence.driving
        least = max(round(_FORESEEN_S * driving.mean_rate_hz), 1)
        asked = [(least + i, least) for i in range(least)]
        asked += [(i, driving.samples) for i in range(1, least)]
        ahead = problem.look_ahead(fit.model.vector(), fit.noise.vector(), asked, True)
        known = np.isfinite(ahead)
        motion = np.where(known, ahead, 0.0).sum(0)
        begins = np.flatnonzero(~known[:, :, 0].any(0))  # of stretches, which nothing foresees
        motion[begins] = motion[np.minimum(begins + 1, len(motion) - 1)]
        return as_float64(motion[:, 0]), as_float64(motion[:, 2])

    def signals(self, problem: _core.Problem, at: slice) -> FloatArray:
        """Signals of some samples as columns."""
        every = begins(self.evidence.driving)
        # The first sample of a stretch knows nothing.
        first = np.union1d([0], every[(every > at.start) & (every < at.stop)] - at.start)
        v, r = self.foreseen(problem)
        a = v * r / GRAVITY_MPS2
        pull = self._pull[at] / self._pull_std
        w = v / 20.0
        one = np.ones_like(v)
        shapes = [one, w**2, a, a**3, a * w**2, a**2, pull, pull * a, pull * np.abs(a), pull**2, r]
        shapes.append(self._turned(self._steer[at], first) / self._turn_std)
        # Known one sample earlier.
        force, few = (late(np.column_stack(c), first) for c in (shapes, [one, w**2, a, pull]))
        found = [force if self.targets[g.start] <= 2 else few for g in self.groups]
        return as_float64(np.hstack(found))

    @staticmethod
    def _turned(steer: FloatArray, first: npt.NDArray[np.intp]) -> FloatArray:
        turn = steer - late(steer, first)
        turn[first] = 0.0  # what lay between two stretches is no turn of the wheel
        return as_float64(turn)
