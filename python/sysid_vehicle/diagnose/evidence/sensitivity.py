"""How the residuals answer to effects the model lacks.

The filter runs once, at the fit; its gains stay. Nothing is refitted.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from ... import _core
from ..._common.arrays import FloatArray, as_float64
from ..._common.threads import in_parallel
from ...effects import Effect
from ...identify import longest_s
from .evidence import Evidence, Section

# Gains that are high answer a delay with oscillations that grow: shorter ones are tried then.
_SHARES = (1.0, 0.5, 0.25, 0.125)
_BOUNDED = 1e9
_AT_ONCE = 24  # columns of one pass: each costs little more, and more are held twice meanwhile


@dataclass(frozen=True, eq=False)
class Sensitivities:
    """Minus the derivatives of the whitened residuals by the parameters of effects.

    Attributes
    ----------
    evidence : Evidence
    candidates : tuple of Effect
        Those that this driving can show at all.
    places : dict of str to slice
        Which columns belong to which effect.
    """

    evidence: Evidence
    candidates: tuple[Effect, ...]
    places: dict[str, slice]
    groups = ()

    @property
    def width(self) -> int:
        """Number of columns."""
        return max((own.stop for own in self.places.values()), default=0)

    @property
    def columns(self) -> FloatArray:
        """By their parameters, at the null values, shape (5 n, width)."""
        return np.concatenate([self.of(section) for section in self.evidence.sections()])

    def asks(self, _: object) -> None:
        """Nothing: which of them are scored is told later."""

    def of(self, section: Section) -> FloatArray:
        """The same of a section of the residuals."""
        # In place: most of the work is in passing over so many numbers.
        out = np.empty((len(section.residual), self.width))
        model, known = self.evidence.fit.model, self.evidence.driving.force_known
        p, base = model.vector(self.candidates), model.vector()
        seconds = longest_s(self.evidence.driving)

        def together(few: tuple[Effect, ...]) -> None:
            columns = [i for c in few for i in c.columns]
            core = model.core(force_known=known, also=few)
            found = section.rows(
                lambda q, g, _: q.with_model(core).sensitivities(p, g, columns), few[0].id
            )
            at = 0
            for c in few:
                out[:, self.places[c.id]] = found[:, at : at + len(c.columns)]
                at += len(c.columns)

        unmoved = {(section.where.start, section.where.stop): section.residual}

        def stepped(c: Effect) -> None:
            core = model.core(force_known=known, also=(c,))
            for i, (there, step) in enumerate(_steps(c, p, seconds)):
                column = out[:, self.places[c.id].start + i]
                column[:] = 0.0  # nothing can be said where no step is small enough
                for share in _SHARES if c.scored_at_typical else _SHARES[:1]:
                    near, far = p + share * (there - p), share * step

                    def moved(
                        q: _core.Problem,
                        g: Any,
                        at: slice,
                        near: FloatArray = near,
                        far: float = far,
                    ) -> FloatArray:
                        here = unmoved.get((at.start, at.stop))
                        if here is None:
                            here = q.residuals(base, g).ravel()
                            unmoved[at.start, at.stop] = here
                        after = q.with_model(core).residuals(near, g).ravel()
                        return as_float64((here - after) / far)

                    with np.errstate(invalid="ignore", over="ignore"):
                        found = section.rows(moved, f"{c.id} {i} {share}")
                    if np.abs(found).max() < _BOUNDED:
                        column[:] = found
                        break

        groups = _groups([c for c in self.candidates if _regular(c)])
        in_parallel(together, groups)
        in_parallel(stepped, [c for c in self.candidates if not _regular(c)])
        return out


def sensitivities(evidence: Evidence, candidates: Sequence[Effect]) -> Sensitivities:
    """Those of the residuals of a fit to effects that its model lacks.

    Parameters
    ----------
    evidence : Evidence
    candidates : sequence of Effect
    """
    driving = evidence.driving
    possible = evidence.fit.model.seated(e for e in candidates if driving.shows(e))
    long = longest_s(driving)
    ends = np.cumsum([0, *(_width(e, long) for e in possible)])
    places = {
        e.id: slice(int(a), int(b)) for e, (a, b) in zip(possible, pairwise(ends), strict=True)
    }
    return Sensitivities(evidence, possible, places)


def _regular(effect: Effect) -> bool:
    return not effect.scored_at_typical and effect.scanned is None


def _width(effect: Effect, seconds: float) -> int:
    if effect.scored_at_typical or effect.scanned is None:
        return len(effect.columns)
    return len(effect.scanned.grid(seconds))


def _steps(effect: Effect, p: FloatArray, seconds: float) -> Iterator[tuple[FloatArray, float]]:
    """Where an effect without derivatives at its null value is tried, and how far that is."""
    if effect.scored_at_typical:
        # No derivative at zero: the finite steps to the typical sizes are the directions.
        for parameter in effect.parameters:
            there = p.copy()
            there[parameter.column] = parameter.typical
            yield there, parameter.typical
    elif effect.scanned is not None:
        # At its null value the effect knows nothing of this parameter: one column for each value
        # of a grid. Their joint test needs no supremum.
        first = effect.parameters[0]
        step = 0.1 * first.matters  # small enough to stand for the derivative
        for value in effect.scanned.grid(seconds):
            there = p.copy()
            there[effect.scanned.column] = value
            there[first.column] = first.null_value + step
            yield there, step


def _groups(effects: Sequence[Effect]) -> list[tuple[Effect, ...]]:
    """Effects that the core differentiates in one pass: the others need not act meanwhile."""
    groups: list[list[Effect]] = [[]]
    for effect in effects:
        if sum(len(e.columns) for e in (*groups[-1], effect)) > _AT_ONCE:
            groups.append([])
        groups[-1].append(effect)
    return [tuple(g) for g in groups if g]
