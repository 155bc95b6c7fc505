"""Does a parameter of an effect have one value everywhere? What is truly there has.

An effect that stands in for another one takes whatever value each piece of driving asks for. So
its sensitivities are cut into pieces, one for each log or for some seconds of the only one, and the
pieces are tested beside the whole: a score test of values that differ (Chow, Econometrica 1960),
the same as Cochran's Q of the pieces' own estimates (Biometrics 1954) with all else fitted anew.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import scipy

from ... import _core
from ..._common.arrays import FloatArray
from ..._common.text import number, unit_after
from ...effects import Effect
from ...estimate import Driving
from ...identify import Fit
from ...rules import USUAL, Rules
from ..evidence.directions import Directions
from ..evidence.evidence import Evidence, Section
from ..evidence.input_noise import added_by_input_noise
from ..evidence.projection import pseudo_inverse, variance_ratio

_PIECE_S = 10.0
_MOST_PIECES = 6


@dataclass(frozen=True)
class Constancy:
    """Whether an effect keeps its value throughout the driving.

    Attributes
    ----------
    statistic, degrees : float, int
        Chi-squared where the value is one.
    p_value : float
    spread : float
        Standard deviation of the value over the pieces, beyond what their noise explains, in sizes
        that matter; the largest of the effect's parameters.
    values : tuple of float
        Of the first parameter that was felt, piece by piece.
    rules : Rules
        By which it holds.
    """

    effect: Effect
    statistic: float
    degrees: int
    p_value: float
    spread: float
    values: tuple[float, ...]
    rules: Rules = USUAL

    @property
    def holds(self) -> bool:
        """Whether one value will do: no evidence of differences, or of none that matters."""
        return self.p_value > self.rules.level or self.spread < 1.0

    def __str__(self) -> str:
        if self.holds:
            return f"{self.effect.id} keeps its value (p = {self.p_value:.2g})"
        return f"{self.effect.id} does not keep its value: {self.span} (p = {self.p_value:.2g})"

    @property
    def span(self) -> str:
        """Between which values the first parameter changes, in words."""
        low, high = (number(v, 3) for v in (min(self.values), max(self.values)))
        first = self.effect.parameters[0]
        return f"{first.name} from {low} to {high}{unit_after(first.unit)}"


def constancy(fit: Fit, rules: Rules = USUAL) -> dict[str, Constancy]:
    """Test every effect of a fitted model, on what it was fitted to.

    Parameters that are at a bound, or were never felt, have no value that could differ: cut into
    pieces they would take any, against which the others of the effect move.

    Returns
    -------
    dict
        By id of the effect. Effects whose time or place is itself a parameter are left out, and
        driving that is one short piece tells nothing.
    """
    pieces = _pieces(fit.driving)
    parts = [_as_felt(e, fit) for e in fit.model.sought if e.scanned is None]
    parts = [e for e in parts if e.parameters]
    if len(pieces) < 2 or not parts:
        return {}
    evidence = Evidence(fit, fit.driving)
    names = list(fit.model.free_names)
    return {
        part.id: _of_effect(part, evidence, [names.index(n) for n in part.named], pieces, rules)
        for part in parts
    }


@dataclass(frozen=True, eq=False)
class _Cut:
    """Sensitivities to some of the fitted parameters, in each piece of the driving by themselves.

    Attributes
    ----------
    own : list of int
        Which columns.
    pieces : list of array
        Masks over the residuals.
    """

    own: list[int]
    pieces: list[FloatArray]

    @property
    def width(self) -> int:
        return len(self.own) * len(self.pieces)

    @property
    def groups(self) -> tuple[slice, ...]:
        return ()

    def asks(self, projected: Directions) -> None:
        """Nothing: the colour is asked for along the whole solution."""

    def of_all(self, fitted: FloatArray, first: int = 0) -> FloatArray:
        """Columns of sensitivities to all parameters, which begin with some residual."""
        own = fitted[:, self.own]
        rows = slice(first, first + len(own))
        return np.hstack([own * piece[rows, None] for piece in self.pieces])

    def of(self, section: Section) -> FloatArray:
        return self.of_all(section.fitted, _core.CHANNELS * section.where.start)


def _as_felt(effect: Effect, fit: Fit) -> Effect:
    """The effect with those of its parameters that the driving told of."""
    felt = [p for name, p in effect.named.items() if np.isfinite(fit[name].std)]
    return replace(effect, parameters=tuple(felt))


def _pieces(driving: Driving) -> list[FloatArray]:
    """Masks over the residuals: the logs, or equal parts of the only one."""
    number = driving.log_number
    if len(driving.logs) == 1:
        count = min(int(driving.usable_s / _PIECE_S), _MOST_PIECES)
        number = np.floor(np.arange(driving.samples) * count / max(driving.samples, 1))
    return [np.repeat(number == i, _core.CHANNELS) for i in np.unique(number)]


def _of_effect(
    effect: Effect,
    evidence: Evidence,
    own: list[int],
    pieces: list[FloatArray],
    rules: Rules,
) -> Constancy:
    fit, e = evidence.fit, evidence.left
    whole = np.array([fit[n].value - q.null_value for n, q in effect.named.items()])
    # The pieces add up to the whole, which is fitted: the last one says nothing of its own.
    cut = _Cut(own, pieces)
    R = evidence.project(cut.of_all(evidence.fitted))
    information = R.T @ R
    inverse, rank = pseudo_inverse(information)
    S = R.T @ e
    off = inverse @ S
    along = R @ off
    ratio = variance_ratio(along, e - along)
    if scipy.stats.chi2.sf(float(S @ off) / ratio, rank) <= rules.level:
        # The less an input moves in a piece, the more its noise is of what the piece tells.
        S = S - added_by_input_noise(evidence, cut, lambda *_: cut)
        off = inverse @ S
    statistic = float(S @ off) / ratio
    width = len(own)
    by_piece = off.reshape(len(pieces), width)
    # What each piece tells beside all else. Of two pieces either tells their difference as well,
    # though one may hold nearly all that the effect does.
    precision = information.diagonal().reshape(by_piece.shape)
    weights = precision / np.maximum(precision.sum(axis=0), 1e-300)
    centred = by_piece - (weights * by_piece).sum(axis=0)
    # What noise alone would scatter, taken off (DerSimonian & Laird, Controlled Trials 1986).
    excess = max(1.0 - rank / statistic, 0.0) if statistic > 0.0 else 0.0
    scatter = np.sqrt(excess * (weights * centred**2).sum(axis=0))
    matters = np.array([q.matters for q in effect.parameters])
    return Constancy(
        effect,
        statistic,
        rank,
        float(scipy.stats.chi2.sf(statistic, rank)),
        float(np.max(scatter / matters)),
        tuple(float(v) for v in effect.parameters[0].null_value + whole[0] + centred[:, 0]),
        rules,
    )
