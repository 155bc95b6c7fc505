"""What each effect that was added does that nothing else of the model would do in its place."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence

import numpy as np

from ..._common.memo import remembered
from ..._common.threads import before, in_parallel
from ...effects import Effect
from ...errors import NumericalError
from ...estimate import Driving
from ...identify import Fit, refit
from ...rules import UNKNOWN, USUAL, Rules, Share
from ..validation import (
    AHEAD,
    at_its_best,
    best_within,
    counted_in_shares,
    gain_in_log_likelihood,
)
from .beyond import Beyond, own_share, taken_of
from .horizons import LATERAL, moved_by
from .shares import shares


def own_shares(
    final: Fit,
    effects: Sequence[str],
    named: Collection[str],
    test: Driving,
    ends: float = np.inf,
    rules: Rules = USUAL,
) -> dict[str, tuple[Share, Share]]:
    """Find the share of the error 1 to 5 s ahead that is an effect's own.

    The model without it is fitted anew under the same noise: tyres and the other effects take up
    what they can. On validation data both models have the parameters of `best_within`. Errors of
    the motion that it moves count, along the car or lateral: others it cannot take away, and what
    parameters fitted anew change there is none of its doing. They count where the two models
    predict something else (`apart`).

    Parameters
    ----------
    final : Fit
    effects : sequence of str
        Those that were added.
    named : collection of str
        Those of them that are asked for: where none has a share of the training data, validation
        data are not asked.
    test : Driving
        Validation data.
    ends : float
        When the work ends, wherever it is, by `time.perf_counter`.
    rules : Rules
        By which driving counts as fitted (`fitted_range`).

    Returns
    -------
    dict
        By effect, on validation and on training data; unknown where a model fails. Effects for
        which there was no time are not in it.
    """
    each = [(e,) for e in effects]
    found = _shares(final, each, [(e,) for e in named], test, ends, rules)
    return {one: both for (one,), both in found.items()}


def shares_of_groups(
    final: Fit,
    groups: Sequence[tuple[str, ...]],
    test: Driving,
    ends: float = np.inf,
    rules: Rules = USUAL,
) -> dict[tuple[str, ...], tuple[Share, Share]]:
    """Find what all effects of a group take off the error 1 to 5 s ahead together.

    As `own_shares`, of the final model without any of them: beside each other neither a drag nor
    a rolling resistance has a share that is its own.

    Parameters
    ----------
    final : Fit
    groups : sequence of tuple of str
        As `alike` finds them.
    test : Driving
        Validation data.
    ends, rules
        As for `own_shares`.
    """
    return _shares(final, groups, groups, test, ends, rules)


def alike(final: Fit, effects: Collection[str]) -> tuple[tuple[str, ...], ...]:
    """Find groups of effects of a model that act alike, by the catalogue, and move the same motion.

    What refines another is in one group with it: it moves more.

    Parameters
    ----------
    final : Fit
    effects : collection of str
        Those that may be in a group.
    """
    left = [part for part in final.model.parts if part.id in effects]
    groups = []
    while left:
        group, left = left[:1], left[1:]
        while near := [e for e in left if any(_act_alike(e, one) for one in group)]:
            group += near
            left = [e for e in left if e not in near]
        if len(group) > 1:
            groups.append(tuple(e.id for e in group))
    return tuple(groups)


def without_idle(
    groups: Sequence[tuple[str, ...]],
    own: Mapping[str, tuple[Share, Share]],
    rules: Rules = USUAL,
) -> tuple[tuple[str, ...], ...]:
    """Groups without what takes nothing beside the others, where several of them take a part each.

    What takes a part each, and cannot be told from the others, needs these: what has none beside
    them is no part of that.

    Parameters
    ----------
    groups : sequence of tuple of str
        As `alike` finds them.
    own : mapping
        By effect, its own shares on validation and on training data.
    rules : Rules
    """
    busy = {e for e, both in own.items() if all(s.value > rules.taken for s in both)}
    few = (tuple(e for e in group if e in busy) for group in groups)
    return tuple(some if len(some) > 1 else group for group, some in zip(groups, few, strict=True))


def _act_alike(one: Effect, other: Effect) -> bool:
    refines = other.id in one.refines or one.id in other.refines
    return refines or (one.is_like(other) and moved_by(one) == moved_by(other))


def _shares(
    final: Fit,
    asked: Sequence[tuple[str, ...]],
    named: Collection[tuple[str, ...]],
    test: Driving,
    ends: float,
    rules: Rules,
) -> dict[tuple[str, ...], tuple[Share, Share]]:
    """Of effects that are taken out together, on validation and on training data."""
    late: set[tuple[str, ...]] = set()

    def in_time(
        share: Callable[[tuple[str, ...]], Share | None], asked: Collection[tuple[str, ...]]
    ) -> dict[tuple[str, ...], Share]:
        told = in_parallel(lambda e: before(ends, lambda: (share(e),), None), asked)
        late.update(e for e, found in zip(asked, told, strict=True) if found is None)
        found = {e: one[0] for e, one in zip(asked, told, strict=True) if one is not None}
        return {e: one for e, one in found.items() if one is not None}

    parts = {part.id: moved_by(part) for part in final.model.parts}
    moved = {few: frozenset(c for e in few for c in parts[e]) for few in asked}

    def on_train(few: tuple[str, ...]) -> Share | None:
        fit = without(final, few)
        if fit is None:
            return None
        return own_share(fit, final, final.driving, AHEAD, channels=moved[few])

    def on_test(few: tuple[str, ...]) -> Share:
        fit = without(final, few)
        assert fit is not None  # its share of the training data is known
        poorer, best = (best_within(f, test, final, rules) for f in (fit, final))
        counted = counted_in_shares(final, test, rules)
        return own_share(poorer, best, test, AHEAD, channels=moved[few], counted=counted)

    fitted = in_time(on_train, asked)
    judged: dict[tuple[str, ...], Share] = {}
    if any(fitted[e].low > 0.0 for e in fitted if e in named):
        before(ends, lambda: best_within(final, test, final, rules), None)  # once for all of them
        judged = in_time(on_test, fitted)
    return {e: (judged.get(e, UNKNOWN), fitted.get(e, UNKNOWN)) for e in asked if e not in late}


# Twice the effects of any study so far.
@remembered(16)
def without(final: Fit, effects: tuple[str, ...]) -> Fit | None:
    """Fit a model anew without some of its effects, under its noise; None where that fails.

    Parameters
    ----------
    final : Fit
    effects : tuple of str
    """
    model = final.model
    for effect in effects:
        model = model.drop(effect)
    try:
        return refit(model, final.driving, final.noise)
    except (NumericalError, np.linalg.LinAlgError):
        return None


def sure_of(
    final: Fit, effects: Sequence[str], test: Driving, rules: Rules, ends: float = np.inf
) -> frozenset[str]:
    """Find the effects without which validation data are less likely (`Rules.interval`).

    Parameters
    ----------
    final : Fit
    effects : sequence of str
        Those that are asked for.
    test : Driving
        Validation data.
    rules : Rules
    ends : float
        As for `own_shares`; what there was no time for is not sure.
    """

    def sure(effect: str) -> bool:
        poorer = without(final, (effect,))
        if poorer is None:
            return False
        return gain_in_log_likelihood(poorer, final, test).beyond(rules.interval)

    told = in_parallel(lambda e: before(ends, lambda: sure(e), False), effects)
    return frozenset(e for e, shown in zip(effects, told, strict=True) if shown)


def shown_together(explained: Beyond, fits: Sequence[Fit], test: Driving) -> float:
    """Find the lower end of the share of the error 1 to 5 s ahead that all effects take together.

    Where that of the error itself reaches nothing, as disturbances may do most of it: of what any
    function of the driving could explain of it, if any is seen to. Of an error that does not fall
    nothing is taken, whatever other blocks of the driving say of what could be.

    Parameters
    ----------
    explained : Beyond
        What is known of the error itself.
    fits : sequence of Fit
        From the baseline to the final model.
    test : Driving
        Validation data.
    """
    if explained.low > 0.0 or not explained.share > 0.0:
        return explained.low
    whole = shares(at_its_best(fits[0], test), at_its_best(fits[-1], test), test).whole
    return whole.low if whole.known else explained.low


def together_by_motion(
    fits: Sequence[Fit], added: Sequence[str], test: Driving, rules: Rules = USUAL
) -> dict[str, tuple[tuple[float, float], float]]:
    """Find what all effects together take off the error 1 to 5 s ahead, motion by motion.

    What the lateral model lacks says nothing of a mass, nor the other way round. The share is that
    of `own_share`, block against block. Where its interval reaches nothing for lateral errors, that
    of what could be explained counts. Of a median error that does not fall nothing is taken, though
    more blocks may gain than lose.

    Parameters
    ----------
    fits : sequence of Fit
        From the baseline to the final model.
    added : sequence of str
        Effects.
    test : Driving
        Validation data.
    rules : Rules
        As for `own_shares`.

    Returns
    -------
    dict
        By effect, of the motion that it moves: squares of the errors of the baseline and of the
        final model, and the lower end of the share.
    """
    first, last = (best_within(fit, test, fits[-1], rules) for fit in (fits[0], fits[-1]))
    counted = counted_in_shares(fits[-1], test, rules)
    parts = {part.id: moved_by(part) for part in fits[-1].model.parts}
    found: dict[frozenset[str], tuple[tuple[float, float], float]] = {}
    for channels in {parts[e] for e in added}:
        taken = taken_of(first, last, test, AHEAD, channels, counted=counted)
        low = own_share(first, last, test, AHEAD, channels=channels, counted=counted).low
        if not taken.share > 0.0:
            low = min(low, taken.share)
        elif not low > 0.0 and not channels.isdisjoint(LATERAL):
            low = shown_together(taken, (first, last), test)
        found[channels] = (taken.squares[0], taken.squares[-1]), low
    return {e: found[parts[e]] for e in added}
