"""The verdict on the whole, and the names that what is left makes uncertain."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
import numpy.typing as npt

from .accept import falls
from .facts import Added, Decision, Facts, Tested, Withdrawn
from .limits import USUAL, Rules

Grade = Literal["confirmed", "plausible", "alias"]
NONE_GONE = (
    "with the parameters that predict validation data best, the baseline errs no more 1 to 5 s "
    "ahead"
)
"""Why what was added explains nothing, though the fits of one step err less with it."""


def excess(test: Tested) -> float:
    """Evidence beyond what a complete model shows."""
    return max(test.statistic - test.degrees, 0.0)


def share_explained(before: float, after: float) -> float:
    """Of the square of an error beyond the noise floor, what a richer model took away.

    All of it, where nothing was beyond the noise floor.
    """
    most, left = (max(error**2 - 1.0, 0.0) for error in (before, after))
    return share_of(most, left) if most > 0.0 else 1.0


def share_of(before: float, after: float) -> float:
    """Of what is missing, what a richer model took away; where nothing was missing, all or none."""
    if before > 0.0:
        return 1.0 - after / before
    return 0.0 if after > 0.0 else 1.0


@dataclass(frozen=True)
class Share:
    """Of what could be explained, what is; NaN where nothing could.

    Attributes
    ----------
    value, low, high : float
        With a 95 % interval.
    """

    value: float
    low: float
    high: float

    @property
    def known(self) -> bool:
        """Whether there is anything that could be explained."""
        return not np.isnan(self.value)

    def __str__(self) -> str:
        if not self.known:
            return ""
        return f"{100 * self.value:.0f} % ({100 * self.low:.0f} to {100 * self.high:.0f})"

    def to_dict(self) -> dict[str, float | None]:
        """Share and interval, ready for JSON."""
        names = ("value", "low", "high")
        return {n: getattr(self, n) if self.known else None for n in names}


def share_between(
    squares: npt.NDArray[np.float64], least: float = 0.0, rules: Rules = USUAL
) -> Share:
    """Share of the way from the baseline to the ceiling.

    Parameters
    ----------
    squares : array, shape (1 + draws, 3)
        Mean squared errors of baseline, final model and ceiling: as found, then with blocks drawn
        anew (Efron 1979).
    least : float
        Share of the baseline's square that must be explainable.

    Returns
    -------
    Share
        Unknown where the ceiling is not below the baseline by so much in 95 % of the draws.
    """
    before, after, least_left = squares.T
    explainable = before - np.minimum(least_left, after)
    seen = explainable - least * before
    if not seen[0] > 0.0 or not np.quantile(seen[1:], rules.alpha) > 0.0:
        return Share(np.nan, np.nan, np.nan)
    found = explainable[1:] > 0.0
    drawn = (before[1:] - after[1:])[found] / explainable[1:][found]
    low, high = np.quantile(drawn, (0.025, 0.975))
    return Share(float((before[0] - after[0]) / explainable[0]), float(low), float(high))


def grade(alone: str, beside: str, *, much_left: bool = False) -> Grade:
    """How sure the name of an added effect is.

    Parameters
    ----------
    alone, beside : str
        What is said of it by itself, and beside what is left.
    much_left : bool
        As in `Decision`.

    Returns
    -------
    str
        `confirmed`; `plausible`, where rivals cannot be told from it, its size hardly matters, or
        too much is left to be sure; `alias` of what only acts like something else.
    """
    if alone == "proxy":
        return "alias"
    return "confirmed" if beside == "missing" and not much_left else "plausible"


def something_left(facts: Facts, rules: Rules = USUAL) -> bool:
    """Whether the final model is shown to be incomplete.

    Beyond doubt, or by a share of what it leaves that the driving predicts on all data. Of lesser
    evidence the ceiling has the last word: what no function of the driving predicts on any data is
    disturbance.
    """
    anywhere, everywhere = facts.structure
    if everywhere > rules.explainable or _together(facts, rules):
        return True
    one_more = rules.alpha if facts.together is None else min(rules.alpha, rules.level)
    evidence = (facts.fitted.p_value, rules.level), (facts.candidate, one_more)
    if not all(p > min(rules.strict, level) for p, level in evidence):
        return True
    return anywhere > rules.explainable and not all(p > level for p, level in evidence)


def verdict(facts: Facts, rules: Rules = USUAL) -> Decision:
    """The verdict on the whole, and the names that cannot be told beside what is left.

    What was added may explain all, a part, or only stand in for what is missing. Its residuals
    tell: on the training data, and on all data together, where a stand-in leaves what the right
    effect does not. An uneven road or a coloured sensor keeps the error of the true car above its
    noise floor: what does not depend on the driving is no effect's to explain.
    """
    names = frozenset(a.id for a in facts.added)
    if facts.contradictions:
        # Readings that contradict each other leave no name safe.
        because = "; ".join(facts.contradictions)
        return Decision("unknown", (Withdrawn(names, because, names),))
    left = something_left(facts, rules)
    if not names:
        # Tyres that never met a slip angle are free, and leave chance evidence of effects.
        if not facts.excited and facts.fitted.p_value > rules.level:
            return Decision("not_testable")
        return Decision("unknown" if left and not facts.small else "adequate")
    stand_ins = frozenset(a.id for a in facts.added if a.finding == "proxy")
    withdrawn = _withdrawn(facts, rules, names, stand_ins) if left else []
    # What only stands in for something else explains nothing, however well it fits, and what cannot
    # be told from that is no better.
    because = f"it acts like {', '.join(sorted(stand_ins))}, which is none either"
    withdrawn.append(Withdrawn(stand_ins, because))
    proxies = {a.id for a in facts.added if a.finding == "proxy" or _falls(a, withdrawn)}
    negligible = {a.id for a in facts.added if a.finding == "negligible"}
    if proxies == names or (left and proxies | negligible == names):
        return Decision("unknown", tuple(withdrawn))
    whole = not left and not proxies
    much = left and share_of(*facts.missing) < rules.most
    return Decision("explained" if whole else "partly_explained", tuple(withdrawn), much)


def _withdrawn(
    facts: Facts, rules: Rules, names: frozenset[str], stand_ins: frozenset[str]
) -> list[Withdrawn]:
    """Names that are not safe beside something that is left."""
    before, after = facts.missing
    share = share_of(before, after)
    stands = _standing(facts, rules)
    if share < rules.most and stands:
        # A real road, and what nobody knows of a car, leave much beside the right effect too. What
        # only stands in for it serves some channels and moments at the price of others.
        because = (
            "with it errors 1 to 5 s ahead are not shown to fall in every channel that it moves"
        )
        return [Withdrawn(names - stands, because, names)]
    if share < rules.most:
        little = f"takes up only {100 * share:.0f} % of the error 1 to 5 s ahead"
        because = little if share > 0.0 else NONE_GONE
        return [Withdrawn(names, because, names)]
    taken = {a.id: a.taken for a in facts.added}
    small = smaller_than(after, taken, stand_ins)
    first = Withdrawn(small, "what is left unexplained is larger", names)
    # A real car lacks more than one effect: what stands need not have explained what is left.
    alone = _alone(facts, rules, small) - stands
    because = "were it what is missing, nothing would be left"
    return [first, Withdrawn(alone, because, names)]


def _standing(facts: Facts, rules: Rules) -> frozenset[str]:
    """Effects with which the errors ahead fall wherever they move them, whatever is left.

    What does not stand tells that something is missing which moves the same: where an effect moves
    a channel that such a one moves, it may be a part of that itself, unless next to nothing of the
    error is at stake.
    """
    least = rules.taken * facts.missing[0]
    standing = {
        a.id
        for a in facts.added
        if a.named and a.taken >= least and falls(a.changes, a.changes_in_training, rules)
    }
    unsure = {
        c for a in facts.added if a.id not in standing and abs(a.taken) >= least for c in a.moves
    }
    return frozenset(a.id for a in facts.added if a.id in standing and not a.moves & unsure)


def _alone(facts: Facts, rules: Rules, small: frozenset[str]) -> frozenset[str]:
    """The effect that is named, where it is one only, if it should have explained what is left.

    A proxy beside it tells that something else is missing too. That may be all that is left, unless
    it moves what the effect moves.
    """
    tests = [facts.fitted] if facts.fitted.p_value < rules.strict else []
    if facts.together is not None and _together(facts, rules):
        tests.append(facts.together)
    named = [a for a in facts.added if a.named and a.id not in small]
    if len(named) != 1:
        return frozenset()
    own = frozenset({named[0].id})
    if not any(a.finding == "proxy" or (a.named and a.id in small) for a in facts.added):
        return own if tests else frozenset()
    return own if any(named[0].moves & set(t.moves) for t in tests) else frozenset()


def smaller_than(
    left: float, taken: Mapping[str, float], proxies: frozenset[str]
) -> frozenset[str]:
    """Effects that took up less than is left unexplained in the end.

    What a proxy took up is unexplained too.
    """
    uncertain = set(proxies)
    while True:
        unexplained = left + sum(max(taken.get(e, 0.0), 0.0) for e in uncertain)
        more = {e for e, t in taken.items() if e not in uncertain and t < unexplained}
        if not more:
            return frozenset(uncertain - proxies)
        uncertain |= more


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
