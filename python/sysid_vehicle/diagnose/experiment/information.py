"""What a drive can tell of effects a model lacks, before or after it was driven.

With G the sensitivities of the whitened residuals to the fitted parameters and G_j, G_k those to
the parameters of two effects, the drives' Gram matrices add up, and

    lambda_j|k = psi' [G_j' (I - P_[G, G_k]) G_j] psi

is the noncentrality of the test for effect j of size psi where effect k may act instead: its root
is the distance between the two in standard errors (Atkinson & Fedorov, Biometrika 1975, for small
effects).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..._common.arrays import FloatArray, as_float64
from ...effects import Effect
from ...errors import InvalidInput
from ...estimate import Driving
from ...identify import Fit
from ..evidence.evidence import Evidence
from ..evidence.projection import pseudo_inverse
from ..evidence.sensitivity import sensitivities

COPIED = 1e-12  # share of a column's square that others leave, below which it is their copy


@dataclass(frozen=True, eq=False)
class Information:
    """Expected information about fitted parameters and effects together.

    Attributes
    ----------
    fitted : tuple of str
        The fit's free parameters.
    effects : tuple of Effect
    widths : tuple of int
        How many directions each effect has: its parameters, or a grid where one is sought.
    matrix : array, shape (n, n)
        First the fitted parameters, then those of each effect. Drives of one car are added
        with `+`.
    """

    fitted: tuple[str, ...]
    effects: tuple[Effect, ...]
    widths: tuple[int, ...]
    matrix: FloatArray

    def __add__(self, other: Information) -> Information:
        if (self.fitted, self.effects) != (other.fitted, other.effects):
            raise InvalidInput("information about other parameters cannot be added")
        return replace(self, matrix=as_float64(self.matrix + other.matrix))

    def times(self, count: int) -> Information:
        """Of so many drives that are alike."""
        return replace(self, matrix=as_float64(count * self.matrix))

    def about(self, effect: str, *given: str) -> FloatArray:
        """Information about an effect's parameters that the fit and the effects `given` leave.

        Returns
        -------
        array, shape (parameters of the effect, parameters of the effect)
        """
        own = self._of(effect)
        others = [*range(len(self.fitted)), *(i for g in given for i in self._of(g))]
        across = self.matrix[np.ix_(others, own)]
        return as_float64(self.matrix[np.ix_(own, own)] - across.T @ self._solve(others, across))

    def separation(self, effect: str, size: Sequence[float], *rivals: str) -> float:
        """Standard errors by which the effect stands out where the rivals may act instead."""
        psi = self._along(effect, size)
        noncentrality = float(psi @ self.about(effect, *rivals) @ psi)
        return float(np.sqrt(max(noncentrality, 0.0)))

    def _of(self, effect: str) -> list[int]:
        at = len(self.fitted)
        for e, width in zip(self.effects, self.widths, strict=True):
            if e.id == effect:
                return list(range(at, at + width))
            at += width
        raise InvalidInput(f"this driving shows nothing of '{effect}'")

    def _along(self, effect: str, size: Sequence[float]) -> FloatArray:
        """The size along the effect's directions: in the middle of a grid, where one is sought."""
        width = len(self._of(effect))
        if width == len(size):
            return as_float64(np.asarray(size, dtype=float))
        psi = np.zeros(width)
        psi[width // 2] = size[0]
        return psi

    def _solve(self, which: list[int], right: FloatArray) -> FloatArray:
        """Least squares with the block `which`, whose columns may copy each other."""
        block = self.matrix[np.ix_(which, which)]
        return as_float64(pseudo_inverse(block, COPIED)[0] @ right)


def information_of(fit: Fit, driving: Driving, effects: Sequence[Effect]) -> Information:
    """Information of some driving, at the fit, about its parameters and effects it lacks."""
    evidence = Evidence(fit, driving)
    found = sensitivities(evidence, effects)
    G = np.hstack([evidence.fitted, found.columns])
    widths = tuple(p.stop - p.start for p in found.places.values())
    return Information(fit.model.free_names, found.candidates, widths, as_float64(G.T @ G))
