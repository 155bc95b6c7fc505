"""The likelihood of driving too long to be held at once: worked on piece by piece.

Each piece begins with a lead (`leads.py`), whose results are dropped. Sums over a piece are those
with the lead less those of the lead alone. Nothing is kept from piece to piece, gains neither: they
are found again where they are needed.
"""

from __future__ import annotations

from collections.abc import Hashable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any, TypeAlias

import numpy as np

from .. import _core
from .._common.arrays import FloatArray, as_float64
from ..errors import NumericalError
from .leads import Build, Part, Piece, Work

LONGEST = 1 << 20
"""Samples of a problem that is held at once; a search asks for the gains of pieces at each pass."""


@dataclass(frozen=True, eq=False)
class Gains:
    """Where the gains of a filter come from, and what it says of all samples."""

    model: _core.SingleTrack
    p: FloatArray
    noise: FloatArray
    leads: tuple[int, ...]
    log_likelihood: float
    observed: int
    slow: dict[Hashable, int] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class PiecewiseProblem:
    """A `DrivingProblem` of pieces.

    Attributes
    ----------
    build : callable
    model : _core.SingleTrack
    pieces : tuple of Piece
    """

    build: Build
    model: _core.SingleTrack
    pieces: tuple[Piece, ...]

    @property
    def samples(self) -> int:
        """Number of samples."""
        return sum(p.end - p.begin for p in self.pieces)

    def with_model(self, model: _core.SingleTrack) -> PiecewiseProblem:
        """The same driving, another model."""
        return PiecewiseProblem(self.build, model, self.pieces)

    def parts(self, gains: Gains) -> Iterator[Part]:
        """Pieces with their gains, which are gone when the next one comes."""
        for piece, lead in zip(self.pieces, gains.leads, strict=True):
            yield Part(self.build, piece, gains.model, gains.p, gains.noise, lead, gains.slow)

    def _filtered(self, p: FloatArray, noise: FloatArray) -> Iterator[Part]:
        for piece in self.pieces:
            yield Part(self.build, piece, self.model, p, noise)

    def _acting(self, problem: _core.Problem, gains: Gains) -> _core.Problem:
        return problem if gains.model is self.model else problem.with_model(self.model)

    def freeze(self, p: FloatArray, noise: FloatArray) -> Gains:
        """Gains of the filter."""
        leads, value, observed = [], 0.0, 0
        for part in self._filtered(p, noise):
            leads.append(part.lead)
            for sign, found in ((1, part.filtered), (-1, part.head)):
                if found is not None:
                    value += sign * found[1].log_likelihood
                    observed += sign * found[1].observed
        return Gains(self.model, p.copy(), noise.copy(), tuple(leads), value, observed)

    def log_likelihoods(self, sets: FloatArray, noise: FloatArray) -> FloatArray:
        """Log-likelihoods of sets of parameters; minus infinity where one fails."""

        def one(p: FloatArray) -> float:
            try:
                return self.freeze(p, noise).log_likelihood
            except NumericalError:
                return -np.inf

        return as_float64([one(p) for p in sets])

    def residuals(self, p: FloatArray, gains: Gains) -> FloatArray:
        """Whitened residuals."""
        return self._rows(lambda q, g, _: self._acting(q, gains).residuals(p, g), gains)

    def sensitivities(self, p: FloatArray, gains: Gains, columns: list[int]) -> FloatArray:
        """Minus the derivatives of the residuals."""
        return self._rows(
            lambda q, g, _: self._acting(q, gains).sensitivities(p, g, columns), gains
        )

    def signal_sensitivities(
        self, p: FloatArray, gains: Gains, signals: FloatArray, targets: list[int]
    ) -> FloatArray:
        """Sensitivities to signals that act as forces or shift readings."""
        return self._rows(
            lambda q, g, at: self._acting(q, gains).signal_sensitivities(
                p, g, as_float64(signals[at]), targets
            ),
            gains,
        )

    def _rows(self, work: Work, gains: Gains) -> FloatArray:
        return np.concatenate([part.rows(work) for part in self.parts(gains)])

    def half_sum_of_squares(self, p: FloatArray, gains: Gains) -> float:
        """Half the sum of the residuals' squares."""
        return sum(
            sign * self._acting(q, gains).half_sum_of_squares(p, g)
            for sign, q, g in self._with_and_without(gains)
        )

    def normal_equations(
        self, p: FloatArray, gains: Gains, columns: list[int]
    ) -> tuple[float, FloatArray, FloatArray]:
        """Half the sum of squares, direction of descent, Gauss-Newton matrix."""
        return _added(
            (sign, self._acting(q, gains).normal_equations(p, g, columns))
            for sign, q, g in self._with_and_without(gains)
        )

    def noise_score(self, p: FloatArray, noise: FloatArray) -> tuple[float, FloatArray, FloatArray]:
        """Log-likelihood, its derivatives by the noise's logarithms, and their information."""

        def scores() -> Iterator[tuple[int, tuple[float, FloatArray, FloatArray]]]:
            for part in self._filtered(p, noise):
                end = part.piece.end
                yield 1, self.build(self.model, part.where.start, end).noise_score(p, noise)
                if part.lead:
                    begin = part.piece.begin
                    head = self.build(self.model, part.where.start, begin)
                    yield -1, head.noise_score(p, noise)

        return _added(scores())

    def _with_and_without(self, gains: Gains) -> Iterator[tuple[int, _core.Problem, Any]]:
        """Each piece with its lead, which adds, and the lead alone, which is taken off."""
        for part in self.parts(gains):
            yield 1, *part.filtered
            if part.head is not None:
                yield -1, *part.head

    def traces(
        self, p: FloatArray, noise: FloatArray, smoothed: bool
    ) -> Iterator[tuple[slice, dict[str, Any]]]:
        """What the filter says of each sample, piece by piece, and which samples those are."""
        for part in self._filtered(p, noise):
            piece, begin = part.piece, part.where.start
            end = piece.end + (part.after if smoothed else 0)
            problem = self.build(self.model, begin, end)
            told = dict[str, Any](problem.trace(p, noise, smoothed))
            own = slice(part.lead, piece.end - begin)
            value = float(told.pop("log_likelihood"))
            if end > piece.end:
                value = part.filtered[1].log_likelihood
            value -= 0.0 if part.head is None else part.head[1].log_likelihood
            rows = {name: rows[own] for name, rows in told.items()}
            yield slice(piece.begin, piece.end), {**rows, "log_likelihood": value}

    def trace(self, p: FloatArray, noise: FloatArray, smoothed: bool) -> dict[str, Any]:
        """Everything the filter, or the smoother, says of each sample."""
        told = [rows for _, rows in self.traces(p, noise, smoothed)]
        value = float(sum(rows.pop("log_likelihood") for rows in told))
        return {
            "log_likelihood": value,
            **{name: np.concatenate([rows[name] for rows in told]) for name in told[0]},
        }

    def smoothed_means(self, p: FloatArray, noise: FloatArray) -> FloatArray:
        """The states that the smoother tells, as in `trace`, in a third of the time."""
        found = []
        for part in self._filtered(p, noise):
            piece, begin = part.piece, part.where.start
            problem = self.build(self.model, begin, piece.end + part.after)
            found.append(problem.smoothed_means(p, noise)[part.lead : piece.end - begin])
        return np.concatenate(found)

    def look_ahead(
        self,
        p: FloatArray,
        noise: FloatArray,
        horizons: Sequence[tuple[int, int]],
        *,
        road: FloatArray | None = None,
    ) -> FloatArray:
        """Prediction errors so many samples ahead, (horizons, samples, 5)."""
        found = []
        apart = int(np.lcm.reduce([every for _, every in horizons]))
        for part in self._filtered(p, noise):
            # Predictions that end in a piece may have begun before it.
            before = part.where.start - max(ahead for ahead, _ in horizons) - part.piece.run
            begin = part.piece.run + max(before, 0) // apart * apart
            # Slopes of the road are those of the smoother, which knows what comes after.
            end = part.piece.end + part.after
            problem = self.build(self.model, begin, end)
            own = None if road is None else road[begin:end]
            errors = problem.look_ahead(p, noise, horizons, road=own)
            found.append(errors[:, part.piece.begin - begin : part.piece.end - begin])
        return np.concatenate(found, axis=1)


DrivingProblem: TypeAlias = _core.Problem | PiecewiseProblem
"""Gains for its methods are what its own `freeze` returned."""


def traces(
    problem: DrivingProblem, p: FloatArray, noise: FloatArray
) -> Iterator[tuple[slice, dict[str, Any]]]:
    """What the filter says of each sample, by pieces where the problem has some."""
    if isinstance(problem, PiecewiseProblem):
        yield from problem.traces(p, noise, False)
    else:
        yield slice(0, problem.samples), dict[str, Any](problem.trace(p, noise, False))


def _added(
    terms: Iterator[tuple[int, tuple[float, FloatArray, FloatArray]]],
) -> tuple[float, FloatArray, FloatArray]:
    added = [sign * np.concatenate([[v], g, h.ravel()]) for sign, (v, g, h) in terms]
    total = np.sum(added, axis=0)
    n = round(np.sqrt(len(total) - 0.75) - 0.5)
    return float(total[0]), total[1 : n + 1], total[n + 1 :].reshape(n, n)
