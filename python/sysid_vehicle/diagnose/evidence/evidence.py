"""Whitened residuals of a fit, and what a signal that acts on the car or a sensor does to them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from ... import _core
from ..._common.arguments import generator
from ..._common.arrays import FloatArray, as_float64
from ..._common.threads import Workers, check_time
from ...errors import InvalidInput
from ...estimate import Driving, again, noisier
from ...estimate.leads import Part, Work
from ...estimate.pieces import DrivingProblem, PiecewiseProblem
from ...identify import Fit, driving_of
from ...log import Log
from .projection import orthonormal_basis, pseudo_inverse, variance_ratio

# Targets in the core's order: external F_x, F_y, M_z, then accelerations, then sensor readings.
FORCES = {"F_x": 0, "F_y": 1, "M_z": 2}
READINGS = {"r": 7, "a_x": 8, "a_y": 9}
TARGETS = {**FORCES, **READINGS}
_AT_ONCE = 16  # columns of one pass
HELD = 1 << 16
"""Samples of which all sensitivities are held at once."""


@dataclass(frozen=True, eq=False)
class Solution:
    """Sizes of some directions by generalised least squares, the fitted parameters left free.

    Attributes
    ----------
    statistic : float
        Fall of the sum of squares, over the variance ratio.
    size : array, shape (n,)
    covariance : array, shape (n, n)
        Widened by the variance ratio.
    ratio : float
        Long-run over naive variance of the score along the solution, at least 1.
    """

    statistic: float
    size: FloatArray
    covariance: FloatArray
    ratio: float


def evident(fit: Fit, logs: Log | Sequence[Log] | Driving | None) -> Driving:
    """Driving in which a fit's noise is that of what is left; by default what it was fitted to.

    Raises
    ------
    InvalidInput
        The fit had the wheel force and a log has none: noise of the acceleration that takes its
        place, which the fit did not learn, would look like something that is missing.
    """
    driving = fit.driving if logs is None else driving_of(fit, logs)
    if fit.driving.force_known and not driving.force_known:
        raise InvalidInput(
            f"{driving}: the fit was made with the wheel force fx_n, and here it is not known; "
            "identify with logs without it too, or diagnose logs that have it"
        )
    return driving


@dataclass(frozen=True, eq=False)
class Evidence:
    """The residuals of a fit on some driving, with the filter's gains frozen.

    Attributes
    ----------
    fit : Fit
    driving : Driving
    inputs : array, shape (samples, 2), optional
        In place of the driving's own steering angle and wheel force.
    gains : optional
        Of the filter, in place of those at the fit with these inputs.
    """

    fit: Fit
    driving: Driving
    inputs: FloatArray | None = None
    gains: Any = None

    @cached_property
    def problem(self) -> DrivingProblem:
        """The core's problem."""
        return self.problem_of(self.inputs)

    def problem_of(self, inputs: FloatArray | None) -> DrivingProblem:
        """The problem with other inputs than the driving's own."""
        return self.driving.problem(self.fit.model, other_inputs=inputs, longest=HELD)

    @cached_property
    def frozen(self) -> Any:
        """The filter at the fit."""
        if self.gains is not None:
            return self.gains
        return self.problem.freeze(self.fit.model.vector(), self.fit.noise.vector())

    @cached_property
    def residual(self) -> FloatArray:
        """Whitened residuals, sample by sample, channel by channel, shape (5 n,)."""
        return self.problem.residuals(self.fit.model.vector(), self.frozen).ravel()

    @cached_property
    def noisier(self) -> tuple[tuple[Evidence, FloatArray], ...]:
        """The same with as much noise of the inputs once more, and that noise, shape (n, 2).

        Drawn twice, with the same gains; once for long driving, which holds many samples of it.
        """
        rng = generator(0)
        drawn = (again(self.driving, rng) for _ in range(1 if self.driving.samples > HELD else 2))
        return tuple((self.with_input_noise(n), n) for n in drawn)

    def with_input_noise(self, noise: FloatArray) -> Evidence:
        """The same gains and noisier inputs; noise of the measured ones, shape (n, 2)."""
        inputs = self.driving.inputs() if self.inputs is None else self.inputs
        return replace(self, inputs=noisier(self.driving, inputs, noise), gains=self.frozen)

    @cached_property
    def filtered(self) -> FloatArray:
        """States of the filter, shape (n, states)."""
        p, noise = self.fit.model.vector(), self.fit.noise.vector()
        return as_float64(self.problem.trace(p, noise, False)["state"])

    @cached_property
    def fitted(self) -> FloatArray:
        """Sensitivities to the free parameters, shape (5 n, parameters)."""
        return self.of_parameters(*self.fit.model.free_names)

    @cached_property
    def basis(self) -> FloatArray:
        """Orthonormal directions of all that the free parameters can do, and offsets of logs."""
        return orthonormal_basis(np.hstack([self.fitted, self._own]))

    @cached_property
    def apart(self) -> FloatArray:
        """Sensitivities to the free parameters, without what offsets of single logs can do."""
        own = orthonormal_basis(self._own)
        return as_float64(self.fitted - own @ (own.T @ self.fitted))

    @property
    def _own(self) -> FloatArray:
        """Sensitivities to the nuisances of each log but the last, which differ from their mean."""
        names = self.fit.model.free_names
        places = [names.index(n) for n in self.fit.model.offset_names]
        logs = np.repeat(self.driving.log_number, _core.CHANNELS)
        apart = range(len(self.driving.logs) - 1 if self.driving.offsets else 0)
        own = [np.where((logs == i)[:, None], self.fitted[:, places], 0.0) for i in apart]
        return as_float64(np.hstack([np.empty((len(logs), 0)), *own]))

    @cached_property
    def left(self) -> FloatArray:
        """Residuals without what the free parameters can do."""
        return self.project(self.residual)

    def sections(self) -> Iterator[Section]:
        """All samples: at once, or of long driving some after the others, which are then gone."""
        if not isinstance(self.problem, PiecewiseProblem):
            yield Section(self, slice(0, self.driving.samples))
            return
        for part in self.problem.parts(self.frozen):
            yield Section(self, slice(part.piece.begin, part.piece.end), part)

    def section_of(self, problem: DrivingProblem, at: slice) -> _core.Problem:
        """Samples of a problem of the same driving."""
        if isinstance(problem, PiecewiseProblem):
            return problem.build(problem.model, at.start, at.stop)
        return problem

    def project(self, columns: FloatArray) -> FloatArray:
        """Take out what the free parameters can do."""
        return as_float64(columns - self.basis @ (self.basis.T @ columns))

    def of_parameters(self, *names: str) -> FloatArray:
        """Sensitivities to parameters of the model, free or not."""
        check_time()
        known = self.fit.model.parameters
        columns = [known[n].column for n in names]
        return self.problem.sensitivities(self.fit.model.vector(), self.frozen, columns)

    def of_signals(
        self, signals: FloatArray, targets: list[str], *, projected: bool = False
    ) -> FloatArray:
        """Sensitivities to signals added to forces or readings, one column each.

        Projected columns hold what the free parameters cannot do.
        """
        numbers = [TARGETS[t] for t in targets]
        p = self.fit.model.vector()
        frozen, problem, basis = self.frozen, self.problem, self.basis
        out = np.empty((len(self.residual), len(numbers)))

        def some(at: int) -> None:
            check_time()
            few = slice(at, at + _AT_ONCE)
            G = problem.signal_sensitivities(p, frozen, as_float64(signals[:, few]), numbers[few])
            out[:, few] = G - basis @ (basis.T @ G) if projected else G

        with Workers() as pool:
            list(pool.map(some, range(0, len(numbers), _AT_ONCE)))
        return out

    def targets(self, *among: str) -> list[str]:
        """Those of some targets that this driving can show."""
        blind = set() if self.driving.force_known else {"F_x", "a_x"}
        return [t for t in (among or TARGETS) if t not in blind]


@dataclass(frozen=True, eq=False)
class Section:
    """Some of the samples, with what their residuals need.

    Attributes
    ----------
    evidence : Evidence
    where : slice
        Which samples.
    part : Part, optional
        None where they are all.
    """

    evidence: Evidence
    where: slice
    part: Part | None = None

    @property
    def whole(self) -> bool:
        """Whether these are all samples."""
        return self.part is None

    def rows(self, work: Work, name: str) -> FloatArray:
        """Rows for each sample, of a problem, its gains and the samples it has.

        What has one name needs one lead in all sections.
        """
        check_time()
        if self.part is not None:
            return self.part.rows(work, name)
        evidence = self.evidence
        assert isinstance(evidence.problem, _core.Problem)
        return work(evidence.problem, evidence.frozen, self.where)

    @cached_property
    def residual(self) -> FloatArray:
        """Whitened residuals, shape (5 n,)."""
        if self.whole:
            return self.evidence.residual
        p = self.evidence.fit.model.vector()
        return self.rows(lambda q, gains, _: q.residuals(p, gains), "residuals").ravel()

    @cached_property
    def fitted(self) -> FloatArray:
        """Sensitivities to the free parameters."""
        if self.whole:
            return self.evidence.fitted
        model = self.evidence.fit.model
        columns = [model.parameters[n].column for n in model.free_names]
        return self.rows(
            lambda q, gains, _: q.sensitivities(model.vector(), gains, columns), "fitted"
        )

    @property
    def apart(self) -> FloatArray:
        """The same without what offsets of logs can do, where these are all samples."""
        return self.evidence.apart if self.whole else self.fitted

    @cached_property
    def basis(self) -> FloatArray:
        """Orthonormal directions that hold the sensitivities to the free parameters."""
        return self.evidence.basis if self.whole else as_float64(np.linalg.qr(self.fitted)[0])

    @property
    def left(self) -> FloatArray:
        """Residuals: without what the parameters can do, where these are all samples."""
        return self.evidence.left if self.whole else self.residual


def solve(R: FloatArray, e: FloatArray) -> Solution:
    """Sizes of directions that are projected off the fitted parameters."""
    inverse, _ = pseudo_inverse(R.T @ R)
    score = R.T @ e
    size = inverse @ score
    ratio = variance_ratio(R @ size, e - R @ size)
    return Solution(float(score @ size) / ratio, size, inverse * ratio, ratio)
