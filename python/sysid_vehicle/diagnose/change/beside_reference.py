"""Residuals of a reference and of later driving in one linear model: what they share, what differs.

With G the sensitivities of whitened residuals e to all parameters, those of effects that the model
lacks and unknown forces among them,

    reference:  e_B = G_B t + noise,    later:  e_A = G_A (t + d) + noise.

t is what the reference fit is wrong in, d what changed since. t is learned from both, with priors:
what the reference left is no evidence of a change, and what both drivings confound is known as well
as it has to be. With I = G'G, s = G'e and P the information of the priors,

    K = (I_A + I_B + P)^-1,  information of d: I_A - I_A K I_A,  score of d: s_A - I_A K (s_A + s_B)

(the Schur complement of the normal equations of t and d together). Both drivings are taken as
independent; how the terms of a score hang together in time is read from both.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType

import numpy as np
import numpy.typing as npt

from ... import _core
from ..._common.arrays import FloatArray, as_float64
from ...effects import Effect
from ...estimate import Driving
from ...identify import Fit
from ..candidates.clocks import shifts
from ..evidence.coordinates import BLOCK_S, blocks
from ..evidence.directions import Columns, Directions
from ..evidence.evidence import Evidence, Section
from ..evidence.projection import LongRun, score_terms
from ..evidence.sensitivity import sensitivities
from ..unexplained.omnibus import Unknown
from .pieces import Pieces

_RIDGE = 1e-9  # of the diagonal: of copies of each other any one will do


@dataclass(frozen=True, eq=False)
class _OfModel:
    """Sensitivities to parameters that the model has."""

    evidence: Evidence
    names: tuple[str, ...]
    groups = ()

    @property
    def width(self) -> int:
        """Number of columns."""
        return len(self.names)

    def asks(self, _: object) -> None:
        """Nothing: what is asked for is told later."""

    def of(self, section: Section) -> FloatArray:
        """Those of a section's residuals."""
        model = self.evidence.fit.model
        columns = [model.parameters[n].column for n in self.names]
        return section.rows(lambda q, g, _: q.sensitivities(model.vector(), g, columns), "changed")


class Side:
    """One driving with raw sensitivities to everything that may change.

    Parameters
    ----------
    fit : Fit
        Model, noise and driving.
    names : sequence of str
        Full names of parameters, of the model or of `effects`.
    effects : sequence of Effect
        Those that the model may lack.
    like : Side, optional
        Whose units the unknown forces have.
    residuals_of : Side, optional
        Of the same driving, whose residuals count: those of another model.
    factors : mapping of str to float, optional
        By which the model multiplies parameters: columns are of what is multiplied.

    Attributes
    ----------
    names : tuple of str
        Of all columns: parameters, targets of unknown forces, clocks.
    information, score : array, shape (n, n), (n,)
    """

    def __init__(
        self,
        fit: Fit,
        names: Sequence[str],
        effects: Sequence[Effect],
        like: Side | None = None,
        residuals_of: Side | None = None,
        factors: Mapping[str, float] = MappingProxyType({}),
    ) -> None:
        model = fit.model
        self._residuals_of = residuals_of
        # Nothing is projected off: what the fitted parameters can do may be what changed.
        self.fit = replace(fit, model=model.with_fixed(model.free_names))
        self._evidence = Evidence(self.fit, fit.driving)
        own = tuple(n for n in names if n in model.parameters)
        lacked = sensitivities(self._evidence, [e for e in effects if e.id not in model.effects])
        self.unknown: Unknown = Unknown(self._evidence, None if like is None else like.unknown)
        clocks = shifts(self._evidence)
        sources: tuple[Columns, ...] = (
            _OfModel(self._evidence, own),
            lacked,
            self.unknown,
            *clocks,
        )
        self._directions = Directions(self._evidence, *sources)
        found = [*own, *(n for e in lacked.candidates for n in e.named), *self.unknown.names]
        found += [c.name for source in clocks for c in source.clocks]
        rest = len(own) + lacked.width
        self._order = np.r_[[found.index(n) for n in names], rest : len(found)].astype(np.intp)
        self.names = tuple(found[i] for i in self._order)
        self._factors = as_float64([factors.get(n, 1.0) for n in self.names])
        information = self._directions.information[np.ix_(self._order, self._order)]
        self.information = information * np.outer(self._factors, self._factors)
        self.score = self._directions.score[self._order] * self._factors
        if residuals_of is not None:
            self.score = as_float64(sum(G.T @ e for _, G, e in self.rows()))

    @property
    def driving(self) -> Driving:
        """What was driven."""
        return self._evidence.driving

    def rows(self) -> Iterator[tuple[slice, FloatArray, FloatArray]]:
        """Samples of each section, their sensitivities and residuals."""
        other = self if self._residuals_of is None else self._residuals_of
        residuals = other._directions.rows()
        for where, columns, e in self._directions.rows(*self._directions.sources):
            if other is not self:
                _, _, e = next(residuals)
            yield where, np.hstack(columns)[:, self._order] * self._factors, e


@dataclass(frozen=True, eq=False)
class Shared:
    """What is known of what both drivings share, by column.

    Attributes
    ----------
    precision, centre : array, shape (n,)
        Priors, about the values of the reference.
    """

    precision: FloatArray
    centre: FloatArray


class Differences:
    """Normal equations of what changed, with what both drivings share learned from both.

    Parameters
    ----------
    reference, later : Side
        With the same columns.
    shift : array, shape (n,)
        By which parameters of the model of `later` differ already.
    known : Shared
    pieces : tuple of Pieces
        Of the reference and of the later driving.
    unlike : float
        How far the later driving is from it (`Alike`).

    Attributes
    ----------
    information, score : array, shape (n, n), (n,)
        Of changes, from none.
    """

    def __init__(
        self,
        reference: Side,
        later: Side,
        shift: FloatArray,
        known: Shared,
        pieces: tuple[Pieces, Pieces],
        unlike: float,
    ) -> None:
        self._reference, self._later, self._shift = reference, later, shift
        self._pieces, self._unlike = pieces, unlike
        precision = known.precision
        score = later.score + later.information @ shift
        whole = later.information + reference.information + np.diag(precision)
        scale = np.sqrt(np.maximum(np.diag(whole), 1e-300))
        inverse = np.linalg.inv(whole / np.outer(scale, scale) + _RIDGE * np.eye(len(scale)))
        K = inverse / np.outer(scale, scale)
        self._shared = K
        self._common = K @ (reference.score + score + precision * known.centre)
        self._response = K @ later.information
        information = later.information - later.information @ self._response
        self.information = 0.5 * (information + information.T)
        self.score = score - later.information @ self._common

    @property
    def samples(self) -> int:
        """Of both drivings."""
        return self._reference.driving.samples + self._later.driving.samples

    def of_both(self, later: FloatArray, shared: FloatArray) -> tuple[FloatArray, float]:
        """What depends on changes and on what both drivings share: by changes alone, and the rest.

        Parameters
        ----------
        later, shared : array, shape (n,)
            Derivatives by the changes and by what is shared.

        Returns
        -------
        along : array, shape (n,)
            Derivatives by the changes, what is shared being what they leave it.
        variance : float
            Of what is shared beside them.
        """
        return as_float64(later - self._response.T @ shared), float(shared @ self._shared @ shared)

    def ratios(
        self, along: FloatArray, sizes: FloatArray, of: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Variance of scores over what white noise would give them, at least 1.

        That of their long-run sums or of blocks that are taken as independent, whichever is
        larger: what a model lacks acts for as long as a manoeuvre does. And what it acts otherwise
        in driving of another kind, as pieces of the reference tell; and in the second array, as
        pieces of the later driving tell too: a change is there all the time.

        Parameters
        ----------
        along, sizes : array, shape (n, k)
            Of each score the sum of columns that it is of, and the change that is taken off before.
        of : array, shape (n, m)
            The changes that the first m scores are to tell, and so the next m, and on.
        """
        mean = np.einsum("ij,ij->j", along, self.score[:, None] - self.information @ sizes)
        found = LongRun(self.samples, along.shape[1])
        sums = []
        few = of.shape[1]
        pieces: list[FloatArray] = []
        sides = ((self._reference, 0.0), (self._later, 1.0))
        for (side, shared), cut_up in zip(sides, self._pieces, strict=True):
            first = blocks(side.driving, BLOCK_S)
            own = np.zeros((len(first), along.shape[1]))
            told_by = [np.zeros((2, cut.max(initial=0) + 1, few)) for cut in cut_up.cuts]
            known = self._common - shared * self._shift
            turned = shared * np.eye(len(known)) - self._response
            for where, G, e in side.rows():
                left = e - G @ known
                off = turned @ sizes
                terms = score_terms(G, left, off, turned @ along)
                terms -= mean / self.samples
                found.add(terms)
                np.add.at(own, _block_of(first, where), terms)
                S = G @ of
                several = np.stack([S * (left[:, None] - G @ off[:, :few]), S**2])
                for cut, own_sums in zip(cut_up.cuts, told_by, strict=True):
                    at = np.repeat(cut[where], _core.CHANNELS)
                    for k in np.unique(at):
                        own_sums[:, k] += several[:, at == k].sum(axis=1)
            sums.append(own)
            pieces += [cut_up.variance(k, *own_sums) for k, own_sums in enumerate(told_by)]
        naive = np.maximum(np.einsum("ij,ij->j", along, self.information @ along), 1e-300)
        every = np.vstack(sums)
        chance = 1.0 + 2.0 * np.sqrt(2.0 / max(len(every), 1))
        by_block = (every**2).sum(axis=0) / naive / chance
        long_run = np.maximum(found.ratios(naive), 1.0)
        many = along.shape[1] // few
        told = np.einsum("ij,ij->j", along, np.tile(self.information @ of, many))
        least = np.maximum(long_run, by_block)
        few_cuts, every_cut = (
            as_float64(least + self._unlike * np.tile(np.max(cuts, axis=0), many) * told**2 / naive)
            for cuts in (pieces[:1], pieces)
        )
        return few_cuts, every_cut


def _block_of(first: npt.NDArray[np.intp], where: slice) -> npt.NDArray[np.intp]:
    return np.searchsorted(first, np.arange(where.start, where.stop), "right") - 1
