"""The verdict on the whole, and the names that what is left makes uncertain."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

from .facts import Added, Decision, Facts, Tested, Withdrawn
from .limits import USUAL, Rules
from .share import Share, low_of_mean, share_of

Grade = Literal["confirmed", "plausible", "alias"]
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

_UNOPPOSED = (
    "the time limit left open whether an unknown force would explain training and validation data "
    "as well"
)


def excess(test: Tested) -> float:
    """Evidence beyond what a complete model shows."""
    return max(test.statistic - test.degrees, 0.0)


def little(
    first: float,
    before: float,
    after: float,
    last: float,
    own: Sequence[Share] = (),
    rules: Rules = USUAL,
) -> bool:
    """Whether an effect takes little of the validation error, and of what all that was added takes.

    A small misfit is explained by whatever effect fits it best, and its evidence grows with the
    data: what takes little may be any of them. Beside a large effect that came first a share of the
    whole fall is small for any other: what takes a tenth of the error that it found is not little.
    Nor is what takes a tenth of the errors ahead: beside large lateral errors a drag takes little
    of those one step ahead.

    Parameters
    ----------
    first, before, after, last : float
        Errors of the baseline, without and with the effect, and of the final model.
    own : sequence of Share
        Its own shares of the errors ahead, on validation and on training data.
    rules : Rules
    """
    if own and all(s.low > rules.taken for s in own):
        return False
    of_the_fall = before**2 - after**2 < rules.taken * (first**2 - last**2)
    return of_the_fall and before - after < rules.taken * before


def grade(alone: str, beside: str, *, much_left: bool = False, takes_little: bool = False) -> Grade:
    """How sure the name of an added effect is.

    Parameters
    ----------
    alone, beside : str
        What is said of it by itself, and beside what is left.
    much_left : bool
        As in `Decision`.
    takes_little : bool
        Of the error (`little`).

    Returns
    -------
    str
        `confirmed`; `plausible`, where rivals cannot be told from it, its size hardly matters, it
        takes little of the error, or too much is left to be sure; `alias` of what only acts like
        something else.
    """
    if alone == "proxy":
        return "alias"
    sure = beside == "missing" and not much_left and not takes_little
    return "confirmed" if sure else "plausible"


def unforeseen(ratio: float, p_value: float, rules: Rules = USUAL) -> bool:
    """Whether validation data err by more than the training data foretell.

    Parameters
    ----------
    ratio : float
        Of mean squared residuals, in units of the noise with its disturbances.
    p_value : float
        Of data that are alike.
    rules : Rules
    """
    return p_value < rules.strict and ratio * (1.0 - rules.explainable) > 1.0


def something_left(facts: Facts, rules: Rules = USUAL) -> bool:
    """Whether the final model is shown to be incomplete.

    Beyond doubt, or by a share of what it leaves that the driving predicts on all data. Of lesser
    evidence the ceiling has the last word: what no function of the driving predicts on any data is
    disturbance. A baseline alone is asked what it leaves of validation data, too: what training
    data do not bring about they cannot show. So is it whether its disturbances are none: what lasts
    is a force, whether it depends on the driving or on the place.
    """
    anywhere, everywhere = facts.structure
    if not facts.added and (facts.unforeseen or facts.slow):
        return True
    if everywhere > rules.explainable or _together(facts, rules):
        return True
    one_more = min(rules.alpha, rules.level) if facts.added else rules.alpha
    evidence = (facts.fitted.p_value, rules.level), (facts.candidate, one_more)
    if not all(p > min(rules.strict, level) for p, level in evidence):
        return True
    return anywhere > rules.explainable and not all(p > level for p, level in evidence)


def incomplete(facts: Facts, rules: Rules = USUAL) -> bool:
    """Whether something is missing in the final model: left by it, or taken up by a stand-in."""
    return any(a.finding == "proxy" for a in facts.added) or something_left(facts, rules)


def verdict(facts: Facts, rules: Rules = USUAL) -> Decision:
    """The verdict on the whole, and the names that cannot be told beside what is missing.

    What was added may explain all, a part, or only stand in for what is missing. Its residuals
    tell: on the training data, and on all data together, where a stand-in leaves what the right
    effect does not. An uneven road or a coloured sensor keeps the error of the true car above its
    noise floor: what does not depend on the driving is no effect's to explain. Where no name stands
    there is the baseline alone, which may be as good as its user needs.
    """
    names = frozenset(a.id for a in facts.added)
    if facts.contradictions:
        # Readings that contradict each other leave no name safe. Nor along the car: a lateral
        # speed that is led astray acts on the speed, as a drag does in corners.
        because = "; ".join(facts.contradictions)
        return Decision("unknown", (Withdrawn(names, because, names),))
    left = something_left(facts, rules)
    if not names:
        # Tyres that never met a slip angle are free, and leave chance evidence of effects.
        if not facts.excited and facts.fitted.p_value > rules.level:
            return Decision("not_testable")
        return Decision("unknown" if left and not facts.small else "adequate")
    stand_ins = frozenset(a.id for a in facts.added if a.finding == "proxy")
    withdrawn = []
    groups: dict[str, frozenset[str]] = {}
    if left or stand_ins:
        late = frozenset(a.id for a in facts.added if a.late)
        likely = _likely(facts, rules)
        alone, groups, led = _standing(facts, rules)
        spoken = {a.id: a.against for a in facts.added if a.named and a.against}
        falling = names - likely - alone - groups.keys() - led.keys() - spoken.keys()
        if left:
            lows = {a.id: _together_low(a, facts) for a in facts.added}
            nothing = frozenset(e for e, low in lows.items() if low is not None and not low > 0.0)
            unknown = frozenset(e for e, low in lows.items() if low is None)
            withdrawn.append(Withdrawn(nothing - likely - falling, _NOT_TOGETHER, names))
            withdrawn.append(Withdrawn(unknown - likely - falling, _LATE_TOGETHER, names))
        withdrawn.append(Withdrawn(falling - late, _NOT_SHOWN, names))
        withdrawn += [Withdrawn(frozenset({e}), because, names) for e, because in spoken.items()]
        for name, leaders in led.items():
            if name in likely:
                continue
            because = f"of the same errors {' and '.join(sorted(leaders))} {_TAKES_MORE}"
            withdrawn.append(Withdrawn(frozenset({name}), because, names))
        if falling & late:
            withdrawn.append(Withdrawn(falling & late, _LATE, names))
    if facts.unopposed:
        withdrawn.append(Withdrawn(names, _UNOPPOSED, names))
    # What only stands in for something else explains nothing, however well it fits, and what cannot
    # be told from that is no better.
    because = f"it acts like {', '.join(sorted(stand_ins))}, which is not confirmed either"
    withdrawn.append(Withdrawn(stand_ins, because))
    proxies = {a.id for a in facts.added if a.finding == "proxy" or _falls(a, withdrawn)}
    negligible = {a.id for a in facts.added if a.finding == "negligible"}
    if proxies == names or (left and proxies | negligible == names):
        return Decision("adequate" if facts.small else "unknown", tuple(withdrawn))
    whole = not left and not proxies
    # What fell took a part of the error, and what it took may belong to what stands beside it.
    much = left and (bool(proxies) or share_of(*facts.missing) < rules.most)
    groups = {e: others for e, others in groups.items() if e not in proxies}
    return Decision("explained" if whole else "partly_explained", tuple(withdrawn), much, groups)


def standing(facts: Facts, decision: Decision) -> frozenset[str]:
    """Added effects that keep their names.

    Parameters
    ----------
    facts : Facts
    decision : Decision
        That follows from these.
    """
    if decision.verdict not in ("explained", "partly_explained"):
        return frozenset()
    named = (a for a in facts.added if a.named)
    return frozenset(a.id for a in named if not _falls(a, decision.withdrawn))


def _standing(
    facts: Facts, rules: Rules
) -> tuple[frozenset[str], dict[str, frozenset[str]], dict[str, frozenset[str]]]:
    """Effects whose own share of the error ahead is shown on training and validation data.

    The second are those that have none, with the others of the model that act like them, where
    the share of all of these together is shown: each does what the others would do in its place.
    The third are those of either kind that lead none of what they move, with what takes more.

    Evidence grows with the data, whatever small misfit an effect serves; a share does not. It is
    that of the effect beside all others, which were fitted anew without it: what one of them, or
    the tyres, would do in its place is not its own. A stand-in serves one manoeuvre, and the next
    one at a price. Where much is left of the motion that it moves, what it stands in for may be
    that: the share must be shown to be one worth a name, of all data. So may it be what a stand-in
    takes that moves the same channel, if that is the larger part. What is not shown to be off
    nothing, while another of the model acts like it, has no name of its own: either may be there
    for the other. Nor has what something else speaks against. What errors are shown to be smaller
    without has no part in what a group takes.
    """

    def worth(a: Added, *shares: Share) -> bool:
        much = share_of(*(facts.missing if a.missing is None else a.missing)) < rules.most
        least = rules.taken if much else 0.0
        each = all(s.value > rules.taken and s.low > 0.0 for s in shares)
        return each and low_of_mean(shares) > least

    named = [a for a in facts.added if a.named and not a.against]
    own = [a for a in named if a.felt or not a.beside]
    alone = {a.id for a in own if worth(a, a.own, a.own_in_training)}
    together = {
        a.id
        for a in named
        if a.beside
        and not any(s.known and s.high < 0.0 for s in (a.own, a.own_in_training))
        and alone.isdisjoint({a.id, *a.beside})
        and worth(a, a.shared, a.shared_in_training)
    }
    shares = {a.id: (a.own, a.own_in_training) for a in facts.added if a.id in alone}
    shares |= {a.id: (a.shared, a.shared_in_training) for a in facts.added if a.id in together}
    # What something else speaks against was asked beside the others, and they beside it.
    others = [a for a in facts.added if a.id not in shares and not a.against]
    led = {}
    for a in named:
        if a.id in shares:
            more = [b.id for b in others if a.moves & b.moves and _more(b, shares[a.id])]
            led[a.id] = frozenset(more)
    leading = {e for e, more in led.items() if not more}
    return (
        frozenset(alone & leading),
        {a.id: a.beside for a in named if a.id in together & leading},
        {e: more for e, more in led.items() if more},
    )


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


def _together(facts: Facts, rules: Rules) -> bool:
    return facts.together is not None and facts.together.p_value < rules.strict


def _falls(effect: Added, withdrawn: Sequence[Withdrawn]) -> bool:
    """Whether the name of an added effect is taken back."""
    return any(
        effect.id in w.effects and effect.named
        if effect.id in w.beside
        else effect.finding == "one of a group" and set(effect.group) <= w.effects
        for w in withdrawn
    )
