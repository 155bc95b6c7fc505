"""Whether something unknown would do in place of an effect.

An effect that stands in for a cause outside the catalogue takes up much of it, and no test of all
directions together may see the rest. So forces and readings that no effect has compete for its
place one by one and target by target: those of the omnibus test, curves of either axle's side force
over its slip angle, and forces that remember the driving. One that is significant beside the
effect, and takes over what speaks for it until the rest is not worth its price, explains it away:
the choice between the two is by what each adds to the other (Davidson & MacKinnon, Econometrica
1981). Several functions of the driving may contain the effect itself, and then take over whatever
speaks for it: twelve forces along the car have a drag among them. They explain more only where what
they add is a part worth a name of all that they explain without the effects they copy.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
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
from ...vehicle import AXLES, GRAVITY_MPS2, slip_angles
from ..evidence.coordinates import begins, late
from ..evidence.directions import Ask, Directions
from ..evidence.evidence import FORCES, READINGS, Evidence, Section
from ..evidence.input_noise import added_by_input_noise
from ..evidence.projection import pseudo_inverse
from ..unexplained.omnibus import LEAST_LEFT, Omnibus, Unknown

_SLIPS_RAD = 0.01 * 2.0 ** np.arange(5)  # knots of the curves over slip angles
_MEMORIES_S = (0.5, 2.0, 8.0)
_SHAPES_REMEMBERED = 4
_ONE_OF = " no. "


@dataclass(frozen=True)
class Instead:
    """What competes with the effects of a model.

    Attributes
    ----------
    omnibus : Omnibus
        The most significant unknown beside all effects; its p-value is corrected for testing many.
    away : dict of str to str
        By effect that is explained away, the most significant unknown that does so.
    """

    omnibus: Omnibus
    away: dict[str, str]


def instead(fit: Fit, driving: Driving, effects: Sequence[str], rules: Rules = USUAL) -> Instead:
    """Let something unknown compete for the place of effects of a fitted model.

    Parameters
    ----------
    fit : Fit
    driving : Driving
        Training and validation data together tell most.
    effects : sequence of str
        Ids of effects of the model.
    rules : Rules
    """
    names = [n for n in fit.model.free_names if n.split(".")[0] in effects]
    # What the effects do is no nuisance here: their parameters compete.
    bare = replace(fit, model=fit.model.with_fixed(names))
    rivals = Rivals(Evidence(bare, driving), tuple(names))
    projected = Directions(rivals.evidence, rivals)
    found = _Competition(projected, rivals, bare)
    every = list(range(len(names)))
    if found.strongest(every, rivals.hypotheses, rules)[1].rejects:
        added = added_by_input_noise(rivals.evidence, rivals, rivals.noisier)
        projected.take_off(rivals, added)
        found = _Competition(projected, rivals, bare)
    price = rules.price * float(np.log(driving.samples))
    away: dict[str, str] = {}
    copied: set[str] = set()  # by what explains no more than they do
    # What the pull tells of slopes may be the driver's knowledge: it competes, and proves nothing.
    whole = found.strongest([*every, rivals.answered], rivals.besides_slopes, rules)[1]
    known: list[int] = []
    # The most significant first, then what is significant beside it: much leaks into the others.
    for _ in range(len(effects) + 1):
        what, test = found.strongest([*every, *known], rivals.hypotheses, rules)
        if not (whole.rejects and test.rejects):
            break
        columns, beside = rivals.hypotheses[what], [*every, *known]
        of = {e: [i for i in every if names[i].split(".")[0] == e] for e in effects}
        taken = []
        for effect in (e for e in effects if e not in copied):
            others = [i for i in beside if i not in of[effect]]
            alone = found.gain(others, of[effect])[0]
            left = found.gain([*others, *columns], of[effect])[0]
            if left < min(price, rules.taken * alone):
                taken.append(effect)
        if found.is_richer(beside, [i for e in taken for i in of[e]], columns, rules):
            away |= {e: what.split(_ONE_OF)[0] for e in taken if e not in away}
        else:
            copied.update(taken)
        known += [c for c in columns if c not in known]
    return Instead(whole, away)


class Rivals:
    """Sensitivities to the parameters of effects, and to unknown forces and readings.

    Attributes
    ----------
    hypotheses : dict of str to list of int
        Columns of each unknown; one by one and all of one kind together.
    targets : dict of str to str
        By kind, what it acts on most.
    answered : int
        The column by which the pull tells of slopes (`Unknown`).

    Parameters
    ----------
    evidence : Evidence
    names : tuple of str
        Parameters, whose columns come first.
    flexible : Unknown, optional
        Forces and readings of the driving, by default those of the evidence.
    noise : array, shape (samples, 2), optional
        That is added to the measured steering and pull.
    """

    groups = ()

    def __init__(
        self,
        evidence: Evidence,
        names: tuple[str, ...],
        flexible: Unknown | None = None,
        noise: FloatArray | None = None,
    ) -> None:
        self.evidence, self.names = evidence, names
        self._flexible = flexible or Unknown(evidence)
        driving = evidence.driving
        self._steer = driving.channel("steer_rad")
        self._pull = driving.channel("fx_n" if driving.force_known else "ax_mps2")
        self._pull_unit = max(float(np.nanstd(self._pull)), 1e-9)
        if noise is not None:
            self._steer, self._pull = self._steer + noise[:, 0], self._pull + noise[:, 1]
        forces = evidence.targets(*FORCES)
        several = _SHAPES_REMEMBERED * len(_MEMORIES_S)
        self._remembered = [FORCES[f] for f in forces for _ in range(several)]
        self.hypotheses: dict[str, list[int]] = {}
        self.targets: dict[str, str] = {}
        self.width = len(names)
        for group in self._flexible.groups:
            target = self._flexible.names[group.start]
            what = f"error of {target}" if target in READINGS else target
            self._note(what, target, group)
        self.answered = len(names) + self._flexible.answered
        for axle in AXLES:
            self._note(f"side force of the {axle} axle", "F_y", slice(0, len(_SLIPS_RAD)))
        for force in forces:
            self._note(f"{force} that remembers the driving", force, slice(0, several))

    def noisier(self, evidence: Evidence, noise: FloatArray) -> Rivals:
        """The same of noisier evidence."""
        return Rivals(evidence, self.names, self._flexible.noisier(evidence, noise), noise)

    def _note(self, what: str, target: str, columns: slice) -> None:
        self.targets[what] = target
        several = list(range(self.width, self.width + columns.stop - columns.start))
        self.hypotheses[what] = several
        self.hypotheses |= {f"{what}{_ONE_OF}{i}": [c] for i, c in enumerate(several)}
        self.width += len(several)

    @property
    def besides_slopes(self) -> dict[str, list[int]]:
        """Hypotheses without the column by which the pull tells of slopes."""
        own = ((what, [i for i in c if i != self.answered]) for what, c in self.hypotheses.items())
        return {what: few for what, few in own if few}

    @property
    def kinds(self) -> npt.NDArray[np.intp]:
        """Number of the kind of each unknown's column."""
        found = np.zeros(self.width, dtype=np.intp)
        for number, kind in enumerate(self.targets):
            found[self.hypotheses[kind]] = number
        return found

    def asks(self, _: object) -> None:
        """Nothing: what is asked for is told later."""

    def of(self, section: Section) -> FloatArray:
        """All columns of a section's residuals."""
        return section.rows(self._columns, "rivals")

    def _columns(self, problem: _core.Problem, gains: Any, at: slice) -> FloatArray:
        fit, driving = self.evidence.fit, self.evidence.driving
        p, car = fit.model.vector(), fit.model.vehicle
        state = problem.trace(p, fit.noise.vector(), False)["state"]
        starts = begins(driving)
        first = np.union1d([0], starts[(starts > at.start) & (starts < at.stop)] - at.start)
        v, side, r = state[:, 0], state[:, 1], state[:, 2]
        front, rear = slip_angles(car.lf_m, car.lr_m, self._steer[at], v, side, r)
        slip = {car.lf_m: front, -car.lr_m: rear}
        a, u = v * r / GRAVITY_MPS2, self._pull[at] / self._pull_unit
        shapes = np.column_stack([a, a**2, u, np.abs(u)])
        memory = late(_remembered(shapes, first, driving.sample_rate_hz[at]), first)
        memory = np.tile(memory, len(self._remembered) // memory.shape[1])

        def shown(signals: FloatArray, targets: list[int]) -> FloatArray:
            return problem.signal_sensitivities(p, gains, as_float64(signals), targets)

        def axle(arm: float) -> FloatArray:
            curves = late(_hats(slip[arm]), first)
            sideways, turning = (
                shown(curves, [FORCES[f]] * curves.shape[1]) for f in ("F_y", "M_z")
            )
            return as_float64(sideways + arm * turning)

        columns = [fit.model.parameters[n].column for n in self.names]
        return as_float64(
            np.hstack(
                [
                    problem.sensitivities(p, gains, columns),
                    shown(self._flexible.signals(problem, at), self._flexible.targets),
                    *map(axle, slip),
                    shown(memory, self._remembered),
                ]
            )
        )


def _hats(slip: FloatArray) -> FloatArray:
    """Odd functions of a slip angle, each largest at one knot and nothing at the others."""
    knots = np.concatenate([[0.0], _SLIPS_RAD])
    rows = [np.interp(np.abs(slip), knots, h) for h in np.eye(len(knots))[1:]]
    return as_float64(np.sign(slip)[:, None] * np.column_stack(rows))


def _remembered(shapes: FloatArray, first: npt.NDArray[np.intp], rate_hz: FloatArray) -> FloatArray:
    """Signals through low-passes of first order, which begin anew with each stretch."""
    out = []
    for a, b in pairwise([*first, len(shapes)]):
        keep = np.exp(-1.0 / (np.array(_MEMORIES_S) * rate_hz[a]))
        slow = [scipy.signal.lfilter([1.0 - k], [1.0, -k], shapes[a:b], axis=0) for k in keep]
        out.append(np.hstack(slow))
    return as_float64(np.concatenate(out))


class _Competition:
    """Scores of effects and unknowns together, as if the effects were not in the model."""

    def __init__(self, projected: Directions, rivals: Rivals, fit: Fit) -> None:
        self._projected, self._rivals = projected, rivals
        known = fit.model.parameters
        # The time or place of what has no size yet means nothing.
        off = [
            0.0 if known[n].scan else fit.model.value(n) - known[n].null_value for n in rivals.names
        ]
        self._off = np.concatenate([off, np.zeros(rivals.width - len(off))])
        self._score = projected.score + projected.information @ self._off

    def gain(self, given: list[int], columns: list[int]) -> tuple[float, int, FloatArray]:
        """Statistic, degrees of freedom, and direction of some columns beside others.

        The direction is a sum of all columns: least squares of these, orthogonal to the others.
        """
        information, score = self._projected.information, self._score
        left, S, copy = information[columns], score[columns], np.zeros((len(given), len(score)))
        if given:
            copy = pseudo_inverse(information[np.ix_(given, given)])[0] @ information[given]
            left = left - information[np.ix_(columns, given)] @ copy
            S = S - copy[:, columns].T @ score[given]
        free = np.sqrt(np.maximum(left[:, columns].diagonal(), 0.0))
        kept = np.flatnonzero(free > LEAST_LEFT * np.sqrt(self._projected.before[columns]))
        direction = np.zeros(len(score))
        if not len(kept):
            return 0.0, 0, direction
        few = np.array(columns)[kept]
        inverse, rank = pseudo_inverse(left[np.ix_(kept, few)])
        direction[few] = inverse @ S[kept]
        direction[given] = -copy[:, few] @ direction[few]
        return float(S[kept] @ direction[few]), rank, direction

    def is_richer(
        self, beside: list[int], own: list[int], columns: list[int], rules: Rules
    ) -> bool:
        """Whether an unknown that takes over parameters explains more than they, by what matters.

        One of no more columns than these parameters needs only be significant beside them.
        """
        if len(columns) <= len(own):
            return True
        without = [i for i in beside if i not in own]
        more, whole = self.gain(beside, columns)[0], self.gain(without, columns)[0]
        return more > rules.explainable * whole

    def strongest(
        self, given: list[int], hypotheses: Mapping[str, list[int]], rules: Rules
    ) -> tuple[str, Omnibus]:
        """The most significant hypothesis beside some columns, corrected for so many.

        How white the residuals are is asked only where it could decide.
        """
        found = {what: self.gain(given, columns) for what, columns in hypotheses.items()}
        ratio = dict.fromkeys(found, 1.0)

        def test(what: str) -> Omnibus:
            statistic, degrees = found[what][0] / ratio[what], found[what][1]
            p_value = float(scipy.stats.chi2.sf(statistic, degrees)) if degrees else 1.0
            target = self._rivals.targets[what.split(_ONE_OF)[0]]
            return Omnibus(statistic, degrees, min(len(found) * p_value, 1.0), target, rules)

        few = [what for what in found if test(what).rejects]
        if few:
            sizes = -self._off
            if given:
                information = self._projected.information[np.ix_(given, given)]
                sizes[given] += pseudo_inverse(information)[0] @ self._score[given]
            along = as_float64(np.column_stack([found[what][2] for what in few]))
            ask = Ask(along, as_float64(along + sizes[:, None]))
            ratios = np.maximum(self._projected.answer(self._rivals, ask).ratios, 1.0)
            ratio |= dict(zip(few, map(float, ratios), strict=True))
        told = {what: test(what) for what in found}
        return min(told.items(), key=lambda pair: (pair[1].p_value, -pair[1].statistic))
