"""What to fit in place of a change, and beside it: another name, and the other one of two.

What changed together with something else is imitated by some effect that is neither: from there
lines lead astray. From either of the two they lead to the other one.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from ...rules import Rules
from ..candidates.causes import CredibleSet
from .both_axles import by_other_names, hold_tyres
from .changes_compete import Competition
from .may_change import May, as_one
from .reference import Exact


def leading(told: Competition, put: Sequence[str], can: Mapping[str, May]) -> tuple[str, ...]:
    """Of each credible set the likeliest that can be fitted, or what was, if it is like it."""
    found = []
    for s in told.causes.sets:
        known = next((e for e in s.effects if e in put), "")
        known = known or told.acts_like(s.effects[0])
        found.append(known or next((e for e in s.effects if e in can), ""))
    return tuple(dict.fromkeys(e for e in (*put, *found) if e))


def in_place(effect: str, told: Competition, can: Mapping[str, May]) -> list[str]:
    """What may have changed in place of an effect that was put in."""
    own = told.causes.of(effect)
    several = (
        *can[effect].rivals,
        *(e for e, m in can.items() if effect in m.rivals),
        *(() if own is None else own.effects),
        *_stood_in_for(effect, told),
        *by_other_names(effect, told.put),
    )
    return [e for e in dict.fromkeys(several) if e in can and e not in told.put]


def _stood_in_for(effect: str, told: Competition) -> list[str]:
    """What lines lead to beside an effect that acts like it: the change may be this one alone."""
    leading = (s.effects[0] for s in told.causes.sets)
    return [e for e in leading if e not in told.put and told.acts_like(e) == effect]


def instead(put: tuple[str, ...], effect: str, rival: str) -> tuple[str, ...]:
    """What was put in, with a rival in place of an effect."""
    return tuple(rival if e == effect else e for e in put)


def beside(told: Competition, can: Mapping[str, May], rules: Rules) -> tuple[str, ...]:
    """What may have changed together with what was put in, the likeliest first.

    Whether it is worth its price is not asked: of large changes lines tell far too little.
    """
    log_odds = {e: x for e, x in told.beside_put.items() if e in can}
    return CredibleSet.of(log_odds, rules.credible).effects if log_odds else ()


def idle(effect: str, state: Exact, visited: Mapping[frozenset[str], Exact], least: float) -> bool:
    """Whether a part of what was put in does as well without an effect, but for `least` nats.

    As a payload does that shifts no centre of gravity. A rival in the place of such an effect is a
    rival beside that part, to which lines lead from there.
    """
    put = frozenset(state.put)
    parts = (s for key, s in visited.items() if key and key < put and effect not in key)
    return any(s.log_likelihood > state.log_likelihood - least for s in parts)


def lacking(
    effect: str,
    several: Sequence[str],
    group: Sequence[str],
    visited: Mapping[frozenset[str], Exact],
) -> list[Exact]:
    """What was fitted without an effect of several and without its group (`Search.lacking`)."""
    put, rest = frozenset(several), frozenset(several) - {effect}
    without = put - {e for one in as_one(several) if effect in one for e in one}
    return [
        s
        for key, s in visited.items()
        if (s.climbed or key == without)
        and key.isdisjoint((effect, *group))
        and not hold_tyres(key, effect)
        and not (rest < key and len(key) == len(put))
    ]
