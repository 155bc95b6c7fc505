"""Which names stand beside something that is missing, by the shares of the error that they take."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from .facts import Added, Facts, Withdrawn
from .limits import Rules
from .share import Share, low_of_mean, share_of

_NOT_SHOWN = (
    "beside the other effects its share of the error 1 to 5 s ahead is not significant on training "
    "and validation data"
)
_NOT_TOGETHER = (
    "together, the effects added do not significantly reduce the error 1 to 5 s ahead of this "
    "motion on validation data: the interval of their share includes zero"
)
_LATE_TOGETHER = (
    "the time limit left open which share of the error 1 to 5 s ahead the effects added remove"
)
_LATE = (
    "the time limit left open its own share of the error 1 to 5 s ahead on training and validation "
    "data"
)

_TAKES_MORE = "explains more and is not confirmed itself: both may compensate for the same cause"


def without_share(
    facts: Facts, left: bool, rules: Rules
) -> tuple[list[Withdrawn], dict[str, frozenset[str]]]:
    """Names that do not stand by a share of the error, and the groups that stand together.

    Parameters
    ----------
    facts : Facts
    left : bool
        Whether something is left, so that all that was added must be shown to take a share, too.
    rules : Rules

    Returns
    -------
    list of Withdrawn
    dict
        By effect that has no share of its own, the others of the model that act like it.
    """
    names = frozenset(a.id for a in facts.added)
    late = frozenset(a.id for a in facts.added if a.late)
    # What kinematics tells is no question of the errors ahead.
    likely = _likely(facts, rules) | {a.id for a in facts.added if a.named and a.backed}
    shown = _standing(facts, rules)
    spoken = {a.id: a.against for a in facts.added if a.named and a.against and not a.backed}
    standing = shown.alone | shown.groups.keys() | shown.led.keys()
    falling = names - likely - standing - spoken.keys()
    found: list[tuple[frozenset[str], str]] = []
    if left:
        lows = {a.id: _together_low(a, facts) for a in facts.added}
        nothing = frozenset(e for e, low in lows.items() if low is not None and not low > 0.0)
        unknown = frozenset(e for e, low in lows.items() if low is None)
        found.append((nothing - likely - falling, _NOT_TOGETHER))
        found.append((unknown - likely - falling, _LATE_TOGETHER))
    found.append((falling - late, _NOT_SHOWN))
    found += [(frozenset({e}), because) for e, because in spoken.items()]
    for name, leaders in shown.led.items():
        if name not in likely:
            because = f"of the same errors {' and '.join(sorted(leaders))} {_TAKES_MORE}"
            found.append((frozenset({name}), because))
    found.append((falling & late, _LATE))
    return [
        Withdrawn(effects, because, names) for effects, because in found if effects
    ], shown.groups


@dataclass(frozen=True)
class _Standing:
    """What the shares of the added effects show.

    Attributes
    ----------
    alone : frozenset of str
        Effects whose own share is shown, on training and on validation data.
    groups : dict
        By effect that has none, the others of the model that act like it, where the share of all of
        these together is shown: each does what the others would do in its place.
    led : dict
        By effect of either kind that does not lead in all that it moves, what takes more.
    """

    alone: frozenset[str]
    groups: dict[str, frozenset[str]]
    led: dict[str, frozenset[str]]


def _standing(facts: Facts, rules: Rules) -> _Standing:
    """Effects whose share of the error ahead is shown, by themselves or in a group.

    Evidence grows with the data, whatever small misfit an effect serves; a share does not. It is
    that of the effect beside all others, which were fitted anew without it: what one of them, or
    the tyres, would do in its place is not its own. What is not shown to be off nothing, while
    another of the model acts like it, has no name of its own: either may be there for the other.
    Nor has what something else speaks against. What errors are shown to be smaller without has no
    part in what a group takes.
    """
    named = [a for a in facts.added if a.named and not a.against]
    shares = {
        a.id: (a.own, a.own_in_training)
        for a in named
        if (a.felt or not a.beside) and _worth(a, (a.own, a.own_in_training), facts, rules)
    }
    alone = frozenset(shares)
    for a in named:
        grows = any(s.known and s.high < 0.0 for s in (a.own, a.own_in_training))
        together = a.shared, a.shared_in_training
        in_a_group = a.beside and not grows and alone.isdisjoint({a.id, *a.beside})
        if in_a_group and _worth(a, together, facts, rules):
            shares[a.id] = together
    led = {a.id: _leaders(a, shares, facts) for a in named if a.id in shares}
    leading = {e for e, more in led.items() if not more}
    return _Standing(
        alone & leading,
        {a.id: a.beside for a in named if a.id in leading - alone},
        {e: more for e, more in led.items() if more},
    )


def _worth(effect: Added, shares: Sequence[Share], facts: Facts, rules: Rules) -> bool:
    """Whether shares of the error, of training and of validation data, are worth a name.

    A stand-in serves one manoeuvre, and the next one at a price. Where much is left of the motion
    that an effect moves, what it stands in for may be that: the share must be shown to be one worth
    a name, of all data.
    """
    missing = facts.missing if effect.missing is None else effect.missing
    least = rules.taken if share_of(*missing) < rules.most else 0.0
    each = all(s.value > rules.taken and s.low > 0.0 for s in shares)
    return each and low_of_mean(shares) > least


def _leaders(effect: Added, shares: Mapping[str, Sequence[Share]], facts: Facts) -> frozenset[str]:
    """Effects without such a share that take more of what this one moves: it may be part of theirs.

    What something else speaks against was asked beside the others, and they beside it.
    """
    others = (b for b in facts.added if b.id not in shares and not b.against)
    moving = (b for b in others if effect.moves & b.moves)
    return frozenset(b.id for b in moving if _more(b, shares[effect.id]))


def _together_low(effect: Added, facts: Facts) -> float | None:
    """Lower end of the share that all effects take together of the motion that one moves."""
    return facts.taken_low if effect.taken_low is None else effect.taken_low


def _likely(facts: Facts, rules: Rules) -> frozenset[str]:
    """Effects whose names stand by the likelihood of validation data.

    Errors below the noise of the sensors have no shares that could be shown. Where the final model
    leaves no larger ones, what is missing in it is small, and the likelihood decides: on effects
    that no other could be taken for, beside which no stand-in was added, and unless the training
    data show something else beyond doubt. What is left shows on all data together, then.
    """
    shown = min(facts.fitted.p_value, facts.candidate) <= rules.strict
    if not facts.buried or shown or any(a.finding == "proxy" for a in facts.added):
        return frozenset()
    likely = (a for a in facts.added if a.finding == "missing" and a.sure and not a.against)
    return frozenset(a.id for a in likely)


def _more(one: Added, shares: Sequence[Share]) -> bool:
    """Whether an effect takes more than others do, on validation and on training data.

    What it stands in for acts on both: what takes more on one of them is not the larger part.
    """
    own = one.own, one.own_in_training
    pairs = [(a.value, b.value) for a, b in zip(own, shares, strict=True) if a.known and b.known]
    return bool(pairs) and all(a > b for a, b in pairs)
