"""What competes beside what was put in, as lines from there tell it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ...effects import Effect
from ...identify import Fit
from .beside_reference import Differences, Side
from .both_axles import factors, moves
from .changes_compete import Competition
from .may_change import May
from .one_point import Lines
from .pieces import Pieces
from .reference import Exact, Reference


class Telling:
    """Lines from any state; of the one that was asked for last they are known.

    Parameters
    ----------
    reference : Reference
    start : Fit
        The reference on the later driving.
    may : sequence of May
        What may have changed.
    scalings : sequence of Effect
        Those of it that multiply tyres.
    pieces : tuple of Pieces
        Of the reference and of the later driving.
    unlike : float
        How far the later driving is from it.
    """

    def __init__(
        self,
        reference: Reference,
        start: Fit,
        may: Sequence[May],
        scalings: Sequence[Effect],
        pieces: tuple[Pieces, Pieces],
        unlike: float,
    ) -> None:
        self._reference, self._start, self._may = reference, start, may
        self._scalings, self._pieces, self._unlike = scalings, pieces, unlike
        self._last: tuple[Exact, bool, Competition] | None = None

    def of(self, state: Exact, *, at_one_point: bool) -> Competition:
        """What competes beside a state: lines are then drawn at one point of both."""
        at_one_point = at_one_point or bool(state.put)
        if self._last is not None and self._last[0] is state and self._last[1] is at_one_point:
            return self._last[2]
        found = self._worked_out(state, at_one_point=at_one_point)
        self._last = state, at_one_point, found
        return found

    def _worked_out(self, state: Exact, *, at_one_point: bool) -> Competition:
        reference, side = self._reference, self._reference.side
        names, effects = reference.names, reference.effects
        later = Side(state.fit, names, effects, like=side, factors=factors(state.searched))
        another = self._start.model.vehicle != reference.before.model.vehicle
        lines = Lines.of(reference, state, another=another, at_one_point=at_one_point)
        # Of another vehicle file the information is told in the terms of the later one, too.
        own = lines.side if another else side
        differences = Differences(
            lines.side, later, lines.shift, lines.known, self._pieces, self._unlike
        )
        return Competition(
            differences,
            self._may,
            reference.place,
            own.names,
            np.diag(own.information),
            self._start.driving.samples,
            state.put,
            reference.rules,
            {n: moves(e.id, state.searched) for e in self._scalings for n in e.named},
        )
