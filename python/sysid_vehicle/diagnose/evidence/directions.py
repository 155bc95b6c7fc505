"""Directions of the residuals, section by section: projected off the fitted parameters, added up.

With F = Q T the sensitivities of a section's residuals to the fitted parameters and G those to
something else, the projection over all sections is

    R = G - F C = (G - Q Q'G) + Q (Q'G - T C),

with C of least squares over all sections. The two terms are orthogonal: products of R add up over
sections in one pass, without the digits that G'G - G'F (F'F)^-1 F'G would lose. What belongs to
single samples is kept where there is one section, and found again where there are several.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Protocol

import numpy as np
import numpy.typing as npt

from ..._common.arrays import FloatArray, as_float64
from .evidence import Evidence, Section
from .projection import COPIED, LongRun, score_terms

_ROWS = 5 * 512  # of residuals at once, which stay in the cache


class Columns(Protocol):
    """Sensitivities of the residuals to something that no fitted parameter is."""

    @property
    def width(self) -> int:
        """How many."""

    @property
    def groups(self) -> Sequence[slice]:
        """Columns whose span is asked for (`Directions.spans`)."""

    def of(self, section: Section) -> FloatArray:
        """Those of a section's residuals, shape (5 n, width)."""

    def asks(self, projected: Directions) -> Ask | None:
        """Along which of their sums the colour of the residuals will be asked for, if it is."""


@dataclass(frozen=True, eq=False)
class Ask:
    """How white the residuals are in some directions.

    Attributes
    ----------
    along : array, shape (width, k), or None
        Directions as sums of columns; else each column alone.
    sizes : array, shape (width, k)
        What is taken off the residuals before the score along each direction.
    starts : array of int, optional
        First samples of blocks.
    """

    along: FloatArray | None
    sizes: FloatArray
    starts: npt.NDArray[np.intp] | None = None


class Answer:
    """Long-run over naive variance of scores, and their sums over blocks, without the mean.

    Attributes
    ----------
    ratios : array, shape (k,)
    blocks : array, shape (blocks, k)
    """

    def __init__(self, ask: Ask, information: FloatArray, score: FloatArray, samples: int) -> None:
        self._ask = ask
        A = np.eye(len(score)) if ask.along is None else ask.along
        taken = np.einsum("ij,ij->j", A, information @ ask.sizes)
        self._mean = (A.T @ score - taken) / samples
        self._naive = np.einsum("ij,ij->j", A, information @ A)
        self._found = LongRun(samples, A.shape[1])
        self._first = np.empty(0, dtype=np.intp) if ask.starts is None else ask.starts
        self.blocks = np.zeros((len(self._first), A.shape[1]))

    def add(self, where: slice, R: FloatArray, e: FloatArray) -> None:
        """Go on with the next samples."""
        terms = score_terms(R, e, self._ask.sizes, self._ask.along)
        terms -= self._mean
        self._found.add(terms)
        if len(self._first):
            at = int(np.searchsorted(self._first, where.start, "right")) - 1
            inside = (self._first > where.start) & (self._first < where.stop)
            cuts = np.concatenate([[0], self._first[inside] - where.start])
            self.blocks[at : at + len(cuts)] += np.add.reduceat(terms, cuts, axis=0)

    @cached_property
    def ratios(self) -> FloatArray:
        """After the last samples."""
        return self._found.ratios(self._naive)


@dataclass(frozen=True)
class _Local:
    """What of a section lies along the fitted parameters: T, Q'G and Q'e."""

    fitted: FloatArray
    columns: FloatArray
    residual: FloatArray


class Directions:
    """Columns projected off what the fitted parameters can do.

    Parameters
    ----------
    evidence : Evidence
    *sources : Columns
        All are gone through together.

    Attributes
    ----------
    information, score : array, shape (n, n), (n,)
        R'R of all columns, source after source, and R'e.
    before : array, shape (n,)
        Sums of squares of the columns as they were.
    """

    def __init__(self, evidence: Evidence, *sources: Columns) -> None:
        self.evidence, self.sources = evidence, sources
        ends = np.cumsum([0, *(s.width for s in sources)])
        self._places = [slice(int(a), int(b)) for a, b in pairwise(ends)]
        groups = [
            slice(place.start + g.start, place.start + g.stop)
            for place, s in zip(self._places, sources, strict=True)
            for g in s.groups
        ]
        self._held: list[FloatArray] | None = None
        self._answers: dict[Columns, Answer] = {}
        n = int(ends[-1])
        self.information, self.score, self.before = np.zeros((n, n)), np.zeros(n), np.zeros(n)
        factors: list[list[FloatArray]] = [[] for _ in groups]
        local: list[_Local] = []
        for section in evidence.sections():
            parts = [s.of(section) for s in sources]
            Q, e = section.basis, section.left
            copied = [Q.T @ G for G in parts]
            for G, c in zip(parts, copied, strict=True):
                _take_off(G, Q, c)
            for first in range(0, len(e), _ROWS):
                rows = slice(first, first + _ROWS)
                piece = parts[0][rows] if len(parts) == 1 else np.hstack([G[rows] for G in parts])
                self.information += piece.T @ piece
                self.score += piece.T @ e[rows]
            along = np.hstack(copied) if copied else np.empty((Q.shape[1], 0))
            self.before += np.einsum("ij,ij->j", along, along)
            for found, group in zip(factors, groups, strict=True):
                i = next(i for i, p in enumerate(self._places) if p.start <= group.start < p.stop)
                begin = self._places[i].start
                own = parts[i][:, group.start - begin : group.stop - begin]
                found[:] = [_factor(np.vstack([*found, _factor(own)]))]
            if section.whole:
                self._held = parts
            else:
                local.append(_Local(Q.T @ section.fitted, along, Q.T @ e))
        self.before += np.diag(self.information)
        if local:
            self._join(local, groups, factors)
        self._factors = [(g, np.vstack(f)) for g, f in zip(groups, factors, strict=True)]

    def _join(
        self, local: list[_Local], groups: Sequence[slice], factors: list[list[FloatArray]]
    ) -> None:
        """The second term of the projections, which needs all sections."""
        T = np.vstack([one.fitted for one in local])
        size = np.maximum(np.linalg.norm(T, axis=0), 1e-300)
        u, s, v = np.linalg.svd(T / size, full_matrices=False)
        kept = s > COPIED * s.max(initial=0.0)
        inverse = ((v[kept].T / s[kept]) @ u[:, kept].T) / size[:, None]
        self._copied = inverse @ np.vstack([one.columns for one in local])
        self._explained = inverse @ np.concatenate([one.residual for one in local])
        for one in local:
            D = one.columns - one.fitted @ self._copied
            self.information += D.T @ D
            self.score += D.T @ one.residual
            for found, group in zip(factors, groups, strict=True):
                found.append(D[:, group])

    def place(self, source: Columns) -> slice:
        """Where the columns of a source stand."""
        return self._places[self.sources.index(source)]

    def take_off(self, source: Columns, added: FloatArray) -> None:
        """Take off the scores of a source what is known to be no evidence; it is asked anew."""
        self.score[self.place(source)] -= added
        self._answers.pop(source, None)

    def spans(self, kept: npt.NDArray[np.bool_]) -> list[tuple[slice, FloatArray]]:
        """For each group the columns it has, and a matrix that makes an orthonormal basis of them.

        Only columns that are `kept` have a part in it.
        """
        found = []
        for group, factor in self._factors:
            few = np.flatnonzero(kept[group])
            size = np.maximum(np.linalg.norm(factor[:, few], axis=0), 1e-300)
            _, s, v = np.linalg.svd(factor[:, few] / size, full_matrices=False)
            told = s > COPIED * s[0] if len(s) else np.zeros(0, dtype=bool)
            turns = np.zeros((group.stop - group.start, int(told.sum())))
            turns[few] = (v[told].T / s[told]) / size[:, None]
            found.append((group, turns))
        return found

    def rows(self, *sources: Columns) -> Iterator[tuple[slice, tuple[FloatArray, ...], FloatArray]]:
        """Samples of each section, projected columns of each source, residuals left."""
        if self._held is not None:
            every = slice(0, self.evidence.driving.samples)
            held = tuple(self._held[self.sources.index(s)] for s in sources)
            yield every, held, self.evidence.left
            return
        for section in self.evidence.sections():
            F = section.fitted
            found = tuple(s.of(section) for s in sources)
            for s, G in zip(sources, found, strict=True):
                _take_off(G, F, self._copied[:, self.place(s)])
            yield section.where, found, section.left - F @ self._explained

    def answer(self, source: Columns, ask: Ask | None = None) -> Answer:
        """How white the residuals are along what a source asks for, or along something else.

        What the other sources ask for is answered on the way.
        """
        if ask is None and source in self._answers:
            return self._answers[source]
        asked = {s: told for s in self.sources if (told := s.asks(self)) is not None}
        asked = {s: told for s, told in asked.items() if s not in self._answers}
        if ask is not None:
            asked[source] = ask
        samples = self.evidence.driving.samples
        for s, one in asked.items():
            own = self.place(s)
            self._answers[s] = Answer(one, self.information[own, own], self.score[own], samples)
        for where, columns, e in self.rows(*asked):
            for s, R in zip(asked, columns, strict=True):
                self._answers[s].add(where, R, e)
        return self._answers[source]


def _factor(columns: FloatArray) -> FloatArray:
    """The triangular factor of columns."""
    return as_float64(np.linalg.qr(columns, "r"))


def _take_off(columns: FloatArray, known: FloatArray, sizes: FloatArray) -> None:
    """`columns -= known @ sizes` without room for the product of all rows."""
    for first in range(0, len(columns), _ROWS):
        rows = slice(first, first + _ROWS)
        columns[rows] -= known[rows] @ sizes
