"""The verdict on the whole, and the names that what is left makes uncertain."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

from .facts import Added, Decision, Facts, Tested, Withdrawn
from .limits import USUAL, Rules
from .share import Share, share_of
from .standing import without_share

Grade = Literal["confirmed", "plausible", "alias"]
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

    Beyond doubt, or by lesser evidence where the driving predicts a share of what is left: what no
    function of the driving predicts on any data is disturbance. Such a share alone proves nothing:
    who steers against a disturbance makes the driving tell of it, and only tests of one step, which
    know no more than the driver did, are not led astray. A baseline alone is asked what it leaves
    of validation data, too: what training data do not bring about they cannot show. So is it
    whether its disturbances are none: what lasts is a force, whether it depends on the driving or
    on the place.
    """
    if not facts.added and (facts.unforeseen or facts.slow):
        return True
    if facts.together is not None and facts.together.p_value < rules.strict:
        return True
    one_more = min(rules.alpha, rules.level) if facts.added else rules.alpha
    evidence = (facts.fitted.p_value, rules.level), (facts.candidate, one_more)
    if not all(p > min(rules.strict, level) for p, level in evidence):
        return True
    return facts.structure > rules.explainable and not all(p > level for p, level in evidence)


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
        return _of_the_baseline(facts, left, rules)
    withdrawn, groups = _taken_back(facts, left, rules)
    proxies = {a.id for a in facts.added if a.finding == "proxy" or _falls(a, withdrawn)}
    negligible = {a.id for a in facts.added if a.finding == "negligible"}
    if proxies == names or (left and proxies | negligible == names):
        return Decision("adequate" if facts.small else "unknown", tuple(withdrawn))
    whole = not left and not proxies
    # What fell took a part of the error, and what it took may belong to what stands beside it.
    much = left and (bool(proxies) or share_of(*facts.missing) < rules.most)
    groups = {e: others for e, others in groups.items() if e not in proxies}
    return Decision("explained" if whole else "partly_explained", tuple(withdrawn), much, groups)


def _of_the_baseline(facts: Facts, left: bool, rules: Rules) -> Decision:
    # Tyres that never met a slip angle are free, and leave chance evidence of effects.
    if not facts.excited and facts.fitted.p_value > rules.level:
        return Decision("not_testable")
    return Decision("unknown" if left and not facts.small else "adequate")


def _taken_back(
    facts: Facts, left: bool, rules: Rules
) -> tuple[list[Withdrawn], dict[str, frozenset[str]]]:
    """Names that are taken back, and by effect the others with which it stands as a group."""
    names = frozenset(a.id for a in facts.added)
    stand_ins = frozenset(a.id for a in facts.added if a.finding == "proxy")
    withdrawn: list[Withdrawn] = []
    groups: dict[str, frozenset[str]] = {}
    if left or stand_ins:
        withdrawn, groups = without_share(facts, left, rules)
    if facts.unopposed:
        withdrawn.append(Withdrawn(names, _UNOPPOSED, names))
    # Where one effect does as much as several, each may be a part of it.
    if facts.one_for_all:
        because = f"{facts.one_for_all}, which was not sought, explains as much in place of all"
        withdrawn.append(Withdrawn(names, because, names))
    # What only stands in for something else explains nothing, however well it fits, and what cannot
    # be told from that is no better.
    because = f"it acts like {', '.join(sorted(stand_ins))}, which is not confirmed either"
    withdrawn.append(Withdrawn(stand_ins, because))
    return withdrawn, groups


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


def _falls(effect: Added, withdrawn: Sequence[Withdrawn]) -> bool:
    """Whether the name of an added effect is taken back."""
    return any(
        effect.id in w.effects and effect.named
        if effect.id in w.beside
        else effect.finding == "one of a group" and set(effect.group) <= w.effects
        for w in withdrawn
    )
