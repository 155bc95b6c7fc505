"""From the scores of all effects to the posterior of what is missing beside a fit."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from ..._common.arrays import FloatArray
from ...effects import Effect, Parameter
from ...rules import USUAL, Rules
from ..evidence.directions import Directions
from ..evidence.evidence import Evidence
from ..unexplained.omnibus import Unknown
from .causes import UNKNOWN, Causes, CredibleSet
from .clocks import clock_parameter, clock_scores
from .possible import Size
from .score import ScoreBoard
from .single_effects import Hypothesis, Posterior, ScoreModel

_KEPT = 40  # of the leading subsets
_LEAST = 1e-6  # probability that is remembered


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
    sets, scattered = _credible_sets(model.effects, by_effect, rules)
    rest = 1.0 - np.prod(1.0 - np.reshape(scattered, (-1, len(model.effects))), axis=0)
    sizes = _sizes_of(model, posterior, scale, parameters)
    return Causes(
        {model.effects[i]: float(included[i]) for i in order},
        tuple(sets),
        sizes,
        tuple(subsets[:_KEPT]),
        tuple(known.subsets()[:_KEPT]),
        {e: tuple((p.name, p.unit) for p in parameters[e]) for e in sizes},
        {e: float(p) for e, p in zip(model.effects, rest, strict=True) if p > _LEAST},
    )


def _credible_sets(
    effects: Sequence[str], by_effect: FloatArray, rules: Rules
) -> tuple[list[CredibleSet], list[FloatArray]]:
    """The set of each effect of a sum, and the weights of those that may be nothing."""
    sets: list[CredibleSet] = []
    scattered = []
    for weights in by_effect:
        likeliest = np.argsort(-weights, kind="stable")
        reached = np.cumsum(weights[likeliest])
        if reached[-1] < rules.credible:
            scattered.append(weights)
            continue
        few = likeliest[: int(np.argmax(reached >= rules.credible)) + 1]
        if any(effects[few[0]] == s.effects[0] for s in sets):
            continue
        likely = {effects[i]: float(weights[i]) for i in likeliest if weights[i] > _LEAST}
        own = tuple(effects[i] for i in few)
        sets.append(CredibleSet(own, tuple(float(weights[i]) for i in few), likely))
    return sets, scattered


def _sizes_of(
    model: ScoreModel,
    posterior: Posterior,
    scale: FloatArray,
    parameters: Mapping[str, tuple[Parameter, ...]],
) -> dict[str, Size]:
    """Parameters of each effect and their standard errors, where it is likeliest."""
    sizes: dict[str, Size] = {}
    for h, weights in zip(model.hypotheses, posterior.weights.T, strict=True):
        if h.name not in parameters or len(h.columns) != len(parameters[h.name]):
            continue
        null = np.array([p.null_value for p in parameters[h.name]])
        at = int(np.argmax(weights))
        own = list(h.columns)
        mean, std = (x[at, own] * scale[own] for x in (posterior.means, posterior.stds))
        sizes[h.name] = tuple(map(float, null + mean)), tuple(map(float, std))
    return sizes
