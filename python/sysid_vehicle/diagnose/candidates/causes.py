"""What is probably missing: inclusion probabilities, and credible sets of confounded effects."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from ..._common.arrays import FloatArray
from ..._common.printed import Part, Printed, Table
from ..._common.style import axes_or_new
from ..._common.text import brief, with_error
from ...effects import Effect, Parameter
from ...rules import USUAL, Rules
from ..evidence.directions import Directions
from ..evidence.evidence import Evidence
from ..unexplained.omnibus import Unknown
from .clocks import clock_parameter, clock_scores
from .possible import Size
from .score import ScoreBoard
from .single_effects import Hypothesis, ScoreModel, Subset

if TYPE_CHECKING:
    from matplotlib.axes import Axes

UNKNOWN = "unknown "
"""Begins the names of forces, moments and readings that no effect of the catalogue explains."""
_KEPT = 40  # of the leading subsets
_LEAST = 1e-6  # probability that is remembered


@dataclass(frozen=True, eq=False)
class CredibleSet:
    """Effects of which one is missing, with 95 % probability usually.

    Attributes
    ----------
    effects : tuple of str
        The likeliest first; several are confounded by this driving. A name that begins with
        `unknown` is a force, moment or reading that no effect of the catalogue explains;
        `clock of` an input is a shift in time that no effect of the catalogue explains (negative:
        the car acts before the log says so), to be mended in the log.
    probabilities : tuple of float
        Of each being the one that acts.
    weights : dict of str to float
        The same of all effects that are not next to impossible.
    """

    effects: tuple[str, ...]
    probabilities: tuple[float, ...]
    weights: dict[str, float] = field(default_factory=dict, repr=False)

    def __str__(self) -> str:
        pairs = zip(self.effects, self.probabilities, strict=True)
        return " or ".join(f"{e} ({100 * p:.0f} %)" for e, p in pairs)


@dataclass(frozen=True, eq=False)
class Causes(Printed):
    """The posterior of a sum of single effects (`single_effects.py`).

    Attributes
    ----------
    inclusion : dict of str to float
        Posterior probability that an effect is missing, the likeliest first.
    sets : tuple of CredibleSet
        One for each effect of the sum that is not nothing.
    sizes : dict of str to tuple
        Parameters and standard errors of each effect were it the one that acts beside the other
        sets; linearised at the fit.
    subsets : tuple of Subset
        Leading subsets of up to three effects.
    known : tuple of Subset
        The same of effects of the catalogue alone, which a refit can try. Where a model is wrong in
        several ways, unknown forces lead every other subset.
    units : dict of str to tuple of (str, str)
        Names and units of the parameters.
    rest : dict of str to float
        Probability of being missing by what is in no set.
    """

    inclusion: dict[str, float]
    sets: tuple[CredibleSet, ...]
    sizes: dict[str, Size]
    subsets: tuple[Subset, ...] = ()
    known: tuple[Subset, ...] = ()
    units: dict[str, tuple[tuple[str, str], ...]] = field(default_factory=dict)
    rest: dict[str, float] = field(default_factory=dict)

    def only(self, sets: Sequence[CredibleSet], sizes: Mapping[str, Size]) -> Causes:
        """The same with these sets alone, and some sizes known better."""
        names = dict.fromkeys((*self.inclusion, *(e for s in sets for e in s.weights)))
        absent = {
            e: (1.0 - self.rest.get(e, 0.0)) * np.prod([1.0 - s.weights.get(e, 0.0) for s in sets])
            for e in names
        }
        included = {e: float(1.0 - p) for e, p in absent.items()}
        order = sorted(included, key=lambda e: -included[e])
        better = {e: size for e, size in sizes.items() if e in self.units}
        return replace(
            self,
            inclusion={e: included[e] for e in order},
            sets=tuple(sets),
            sizes=self.sizes | better,
        )

    def of(self, effect: str) -> CredibleSet | None:
        """The credible set an effect is in."""
        return next((s for s in self.sets if effect in s.effects), None)

    _HEAD = ("effect", "probability", "credible set", "size")

    def _rows(self, most: int = 12) -> list[list[str]]:
        return [[e, f"{p:.3f}", self._place(e), self._size(e)] for e, p in self._shown(most)]

    def _shown(self, most: int) -> list[tuple[str, float]]:
        """Effects by set, then the likeliest of the others."""
        grouped = list(dict.fromkeys(e for s in self.sets for e in s.effects))
        others = [e for e in self.inclusion if e not in grouped]
        return [(e, self.inclusion[e]) for e in (*grouped, *others)[:most]]

    def _place(self, effect: str) -> str:
        places = [str(i + 1) for i, s in enumerate(self.sets) if effect in s.effects]
        return ", ".join(places) or "-"

    def _size(self, effect: str) -> str:
        if effect not in self.sizes:
            return "-"
        told = zip(self.units[effect], *self.sizes[effect], strict=True)
        return ", ".join(f"{n} {with_error(v, s)} {u}".removesuffix(" 1") for (n, u), v, s in told)

    def _headline(self) -> str:
        if not self.sets:
            return "no effect is shown to be missing: no credible set"
        kind = "effect" if len(self.sets) == 1 else "effects together"
        return f"{len(self.sets)} {kind}: " + "; ".join(map(str, self.sets))

    __repr__ = brief

    def _parts(self) -> list[Part]:
        return [self._headline(), Table(self._HEAD, self._rows())]

    def to_dict(self) -> dict[str, Any]:
        """All figures, ready for JSON."""
        return {
            "inclusion": dict(self.inclusion),
            "sets": [
                {"effects": list(s.effects), "probabilities": list(s.probabilities)}
                for s in self.sets
            ],
            "sizes": {
                e: {
                    n: {"value": v, "std": s, "unit": u}
                    for (n, u), v, s in zip(self.units[e], *size, strict=True)
                }
                for e, size in self.sizes.items()
            },
            "subsets": [
                {"effects": list(s.effects), "log_odds": s.log_odds} for s in self.subsets[:10]
            ],
        }

    def plot(
        self, ax: Axes | None = None, most: int = 12, grades: Mapping[str, str] | None = None
    ) -> Axes:
        """Bars of inclusion probability, grouped by credible set.

        Parameters
        ----------
        ax : matplotlib Axes, optional
        most : int
            Bars.
        grades : mapping, optional
            By effect, a word to print beside its bar.
        """
        shown = self._shown(most)[::-1]
        ax = axes_or_new(ax, 6.0, 0.9 + 0.28 * max(len(shown), 1))
        for i, s in enumerate(self.sets):
            rows = [k for k, (e, _) in enumerate(shown) if self.of(e) is s]
            widths = [shown[k][1] for k in rows]
            ax.barh(rows, widths, color=f"C{i % 10}", label=f"credible set {i + 1}")
        rest = [k for k, (e, _) in enumerate(shown) if self.of(e) is None]
        ax.barh(rest, [shown[k][1] for k in rest], color="0.7", label="in no set")
        for k, (e, p) in enumerate(shown):
            word = (grades or {}).get(e, "")
            ax.text(p + 0.01, k, f"{p:.2f}  {word}".rstrip(), va="center", fontsize="small")
        ax.set_yticks(range(len(shown)), [e for e, _ in shown])
        ax.set(xlim=(0.0, 1.25), xlabel="probability of being missing")
        ax.legend(frameon=False, loc="lower right", fontsize="small")
        return ax


def causes_of(
    board: ScoreBoard, evidence: Evidence, rules: Rules = USUAL, *, most: int = 6
) -> Causes:
    """The posterior of what is missing beside a fit.

    Parameters
    ----------
    board : ScoreBoard
        Scores of all candidates, and beside them the `Unknown` and the `Shifts`.
    evidence : Evidence
        The same residuals.
    rules : Rules
    most : int
        Effects of the sum.
    """
    if not board.scores:
        return Causes({}, (), {})
    scale, hypotheses, ratio = _candidates(board)
    projected = board.projected
    unknown, named, more = _unknown(projected)
    clocks = clock_scores(projected, rules)
    n, m = len(board.gradient), unknown.shape[1] + len(clocks)
    # What turns all columns into the directions that compete.
    turns = np.zeros((len(projected.score), n + m))
    turns[board.columns, np.arange(n)] = 1.0
    turns[:, n : n + unknown.shape[1]] = unknown
    turns[[c.column for c in clocks], np.arange(n + unknown.shape[1], n + m)] = 1.0
    information = turns.T @ projected.information @ turns
    typical = [abs(c.clock.typical_s) for c in clocks]
    vague = np.full(m - len(clocks), np.sqrt(evidence.driving.samples))
    scale = np.concatenate([scale, vague, typical])
    more = np.concatenate([more, [c.ratio for c in clocks]])
    score = turns.T @ projected.score
    start = n
    for name, width in named:
        own = slice(start, start + width)
        information[own, own] = np.eye(width)  # to the last digit
        columns = tuple(range(start, start + width))
        hypotheses.append(Hypothesis(UNKNOWN + name, columns, (0.0,) * width, 1.0))
        start += width
    for c in clocks:
        hypotheses.append(Hypothesis(c.clock.name, (start,), (0.0,), 1.0))
        start += 1
    model = ScoreModel(
        tuple(hypotheses),
        score * scale,
        information * np.outer(scale, scale),
        np.concatenate([ratio, more]),
        rules.nothing,
    )
    known = replace(model, hypotheses=tuple(h for h in hypotheses if h.name in board.places))
    parameters: dict[str, tuple[Parameter, ...]] = {
        c.clock.name: (clock_parameter(c.clock),) for c in clocks
    }
    parameters |= {s.effect.id: s.effect.parameters for s in board.scores}
    return causes_in(model, known, scale, parameters, rules, most=most)


def _candidates(board: ScoreBoard) -> tuple[FloatArray, list[Hypothesis], FloatArray]:
    """Prior standard deviations and variance ratios by column, and the hypotheses."""
    scored = {s.effect.id: s for s in board.scores}
    scale, ratio = np.empty(len(board.gradient)), np.empty(len(board.gradient))
    hypotheses: list[Hypothesis] = []
    for name, own in board.places.items():
        a, b = own.start, own.stop
        effect = scored[name].effect
        ratio[a:b] = max(scored[name].variance_ratio, 1.0)
        first = effect.parameters[0]
        if effect.scanned is not None:
            scale[a:b] = abs(first.typical - first.null_value)
            hypotheses += [
                Hypothesis(name, (c,), (_side(effect, 0),), 1.0 / (b - a)) for c in range(a, b)
            ]
            continue
        scale[a:b] = [abs(p.typical - p.null_value) for p in effect.parameters]
        several = forms(effect)
        hypotheses += [
            Hypothesis(
                name,
                tuple(int(a) + i for i in form),
                tuple(_side(effect, i) for i in form),
                1.0 / len(several),
            )
            for form in several
        ]
    return scale, hypotheses, ratio


def forms(effect: Effect) -> list[tuple[int, ...]]:
    """Parameters that act: of some that have one sign any may be nothing."""
    every = tuple(range(len(effect.parameters)))
    if len(every) == 2 and any(p.one_sided for p in effect.parameters):
        return [(0,), (1,), every]
    return [every]


def _side(effect: Effect, i: int) -> float:
    p = effect.parameters[i]
    return float(np.sign(p.typical - p.null_value)) if p.one_sided else 0.0


def _unknown(projected: Directions) -> tuple[FloatArray, list[tuple[str, int]], FloatArray]:
    """Orthonormal directions of unknown forces and readings, their targets, variance ratios.

    Directions are columns by which all that was projected is added up.
    """
    unknown = next(s for s in projected.sources if isinstance(s, Unknown))
    named, turns, explained = unknown.spanned(projected)
    told = projected.answer(unknown).ratios
    ratios = np.maximum(told[len(told) - explained.shape[1] :], 1.0)
    whole = np.zeros((len(projected.score), turns.shape[1]))
    whole[projected.place(unknown)] = turns
    return whole, named, np.repeat(ratios, [width for _, width in named])


def causes_in(
    model: ScoreModel,
    known: ScoreModel,
    scale: FloatArray,
    parameters: Mapping[str, tuple[Parameter, ...]],
    rules: Rules = USUAL,
    *,
    most: int = 6,
) -> Causes:
    """The posterior of a model of scores, by effects and in physical units.

    Parameters
    ----------
    model : ScoreModel
    known : ScoreModel
        The same with hypotheses of the catalogue alone.
    scale : array, shape (n,)
        Prior standard deviations.
    parameters : mapping
        Of each effect whose sizes are told.
    rules : Rules
    most : int
        Effects of the sum.
    """
    subsets = model.subsets()
    # Copies of each other hold each other up where nothing is likelier than both.
    posterior = model.posterior(most, subsets[0] if subsets[0].log_odds > 0.0 else None)
    names = [h.name for h in model.hypotheses]
    by_effect = np.array(
        [[w[[n == e for n in names]].sum() for e in model.effects] for w in posterior.weights]
    )
    included = 1.0 - np.prod(1.0 - by_effect, axis=0)
    order = np.argsort(-included, kind="stable")
    sets: list[CredibleSet] = []
    scattered = []
    for weights in by_effect:
        likeliest = np.argsort(-weights, kind="stable")
        reached = np.cumsum(weights[likeliest])
        if reached[-1] < rules.credible:
            scattered.append(weights)
            continue  # it may be nothing
        few = likeliest[: int(np.argmax(reached >= rules.credible)) + 1]
        effects = tuple(model.effects[i] for i in few)
        if not any(effects[0] == s.effects[0] for s in sets):
            likely = {model.effects[i]: float(weights[i]) for i in likeliest if weights[i] > _LEAST}
            sets.append(CredibleSet(effects, tuple(float(weights[i]) for i in few), likely))
    rest = 1.0 - np.prod(1.0 - np.reshape(scattered, (-1, len(model.effects))), axis=0)
    sizes: dict[str, Size] = {}
    for h, weights in zip(model.hypotheses, posterior.weights.T, strict=True):
        if h.name not in parameters or len(h.columns) != len(parameters[h.name]):
            continue
        null = np.array([p.null_value for p in parameters[h.name]])
        at = int(np.argmax(weights))
        own = list(h.columns)
        mean, std = (x[at, own] * scale[own] for x in (posterior.means, posterior.stds))
        sizes[h.name] = tuple(map(float, null + mean)), tuple(map(float, std))
    return Causes(
        {model.effects[i]: float(included[i]) for i in order},
        tuple(sets),
        sizes,
        tuple(subsets[:_KEPT]),
        tuple(known.subsets()[:_KEPT]),
        {e: tuple((p.name, p.unit) for p in parameters[e]) for e in sizes},
        {e: float(p) for e, p in zip(model.effects, rest, strict=True) if p > _LEAST},
    )
