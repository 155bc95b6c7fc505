"""Pieces of driving too long to be held at once, and how long before each its filter has to begin.

A filter forgets where it began, exponentially. Each piece begins some seconds before its own
samples, its lead, whose results are dropped. With three quarters of the lead nothing may change by
more than (1e-10)^(3/4): with all of it results are those of the whole to 1e-9.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from threading import Lock
from typing import Any

import numpy as np

from .. import _core
from .._common.arrays import FloatArray, as_float64

_LEAD_S = 8.0  # at first
_MET = 1e-10  # of the largest value, up to which a lead may change results
_TRIED = 0.75  # of the lead, with which it is compared
_SEEN = 64  # samples on which they are compared
_LONGER = 1.25  # times as long is the next lead, so that few filters serve all that is asked
_KEPT = 0.5  # of a piece: longer leads are those of single effects, and would fill the memory


Build = Callable[[_core.SingleTrack, int, int], _core.Problem]
"""The problem of a model on the samples from the first to before the second number."""
Work = Callable[[_core.Problem, Any, slice], FloatArray]
"""Rows for each sample of a problem with its gains; the slice says which samples those are."""


@dataclass(frozen=True)
class Piece:
    """Samples `begin` to `end`, of which the first belongs to a run that began at `run`."""

    run: int
    begin: int
    end: int
    last: int
    rate_hz: float


def cut(runs: Sequence[tuple[int, int, float]], longest: int) -> tuple[Piece, ...]:
    """Cut runs, (begin, end, rate), into pieces of at most so many samples; short ones stay one."""
    found: list[Piece] = []
    for begin, end, rate in runs:
        if found and found[-1].last == found[-1].end == begin and end - found[-1].begin <= longest:
            found[-1] = Piece(found[-1].run, found[-1].begin, end, end, found[-1].rate_hz)
            continue
        parts = -(-(end - begin) // longest)
        ends = [begin + (end - begin) * i // parts for i in range(parts + 1)]
        found += [Piece(begin, a, b, end, rate) for a, b in pairwise(ends)]
    return tuple(found)


class Part:
    """A piece with the gains of its filter.

    Parameters
    ----------
    build : callable
    piece : Piece
    model, p, noise
        Of the filter.
    lead : int, optional
        Samples; else as many as the residuals need.
    leads : dict, optional
        By name of some work the lead that it needed in earlier pieces.
    """

    def __init__(
        self,
        build: Build,
        piece: Piece,
        model: _core.SingleTrack,
        p: FloatArray,
        noise: FloatArray,
        lead: int | None = None,
        leads: dict[Hashable, int] | None = None,
    ) -> None:
        self._build, self.piece = build, piece
        self._model, self._p, self._noise = model, p, noise
        self._most = piece.begin - piece.run
        self._leads = {} if leads is None else leads
        self._filters: dict[tuple[int, int], tuple[_core.Problem, _core.FrozenFilter]] = {}
        self._filtering = Lock()
        self.lead = min(self._most, round(_LEAD_S * piece.rate_hz)) if lead is None else lead
        if lead is None:
            self.lead = self._enough(lambda q, g, _: q.residuals(p, g), self.lead, None)

    @property
    def where(self) -> slice:
        """Its samples, with the lead."""
        return slice(self.piece.begin - self.lead, self.piece.end)

    @property
    def after(self) -> int:
        """Samples behind it: a smoother forgets backwards as the filter does forwards."""
        lead = self.lead or round(_LEAD_S * self.piece.rate_hz)
        return min(lead, self.piece.last - self.piece.end)

    @property
    def filtered(self) -> tuple[_core.Problem, _core.FrozenFilter]:
        """The problem with the lead, and its gains."""
        return self._frozen(self.lead, self.piece.end)

    @property
    def head(self) -> tuple[_core.Problem, _core.FrozenFilter] | None:
        """The same of the lead alone; None where there is none."""
        return self._frozen(self.lead, self.piece.begin) if self.lead else None

    def rows(self, work: Work, name: Hashable = None) -> FloatArray:
        """What is worked out for each of its samples.

        Effects with slow states of their own need a longer lead than the filter; with a `name`,
        that of earlier pieces is remembered.
        """
        lead = min(max(self.lead, self._leads.get(name, 0)), self._most)
        while True:
            out = self._some(work, lead, self.piece.end)
            longer = self._enough(work, lead, out, _size(out)) if lead < self._most else lead
            if longer == lead:
                break
            lead = longer
        if name is not None and lead > self.lead:
            self._leads[name] = lead
        return out

    def _enough(
        self,
        work: Work,
        lead: int,
        found: FloatArray | None,
        scale: FloatArray | float = 1.0,
    ) -> int:
        """A lead that is long enough for some work, of which what was `found` with this one.

        What is forgotten falls exponentially with the lead.
        """
        while lead < self._most:
            far = self._some(work, lead, self._seen) if found is None else found
            near = self._some(work, self._tried(lead), self._seen)
            off = np.abs(near - far[: len(near)]).reshape(len(near), -1) / scale
            worst = float(off.max(initial=0.0))
            if worst <= _MET**_TRIED:
                break
            needed = np.log(_MET) / np.log(worst) if worst < 0.5 else np.inf
            lead = self._grown(max(1.1 * _TRIED * lead * min(needed, 2.0), 1.1 * lead))
            found = None
        return lead

    def _grown(self, least: float) -> int:
        """The next lead that is at least so long."""
        first = round(_LEAD_S * self.piece.rate_hz)
        steps = np.ceil(np.log(least / first) / np.log(_LONGER))
        return int(min(self._most, np.ceil(first * _LONGER**steps)))

    @property
    def _seen(self) -> int:
        return min(self.piece.begin + _SEEN, self.piece.end)

    @staticmethod
    def _tried(lead: int) -> int:
        return max(round(_TRIED * lead), 2)

    def _frozen(self, lead: int, end: int) -> tuple[_core.Problem, _core.FrozenFilter]:
        """The problem with another lead, up to a sample, and its gains."""
        if lead > _KEPT * (self.piece.end - self.piece.begin) and lead > self.lead:
            return self._filtered(lead, end)
        with self._filtering:
            if (lead, end) not in self._filters:
                self._filters[lead, end] = self._filtered(lead, end)
            return self._filters[lead, end]

    def _filtered(self, lead: int, end: int) -> tuple[_core.Problem, _core.FrozenFilter]:
        problem = self._build(self._model, self.piece.begin - lead, end)
        return problem, problem.freeze(self._p, self._noise)

    def _some(self, work: Work, lead: int, end: int) -> FloatArray:
        """Rows of the samples from the piece's first on, worked out with some lead."""
        begin = self.piece.begin - lead
        rows = work(*self._frozen(lead, end), slice(begin, end))
        return rows[len(rows) // (end - begin) * lead :]


def _size(rows: FloatArray) -> FloatArray:
    """The largest size in each column, never zero."""
    columns = rows.reshape(len(rows), -1)
    return as_float64(np.maximum(np.maximum(columns.max(axis=0), -columns.min(axis=0)), 1e-300))
