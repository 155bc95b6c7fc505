"""What a study measured, as the facts that its verdict follows from (`sysid_vehicle.rules`)."""

from __future__ import annotations

from collections.abc import Collection, Sequence

from ...compare import Comparison
from ...diagnose import Omnibus, Verdicts
from ...identify import Fit
from ...rules import Added, Decision, Facts
from ..ahead.beyond import Beyond


def facts_of(
    fits: Sequence[Fit],
    told: Verdicts,
    on_train: Comparison,
    explained: Beyond | None,
    *,
    fitted: Omnibus,
    together: Omnibus | None,
    candidate: float,
    excited: bool,
    small: bool = False,
    structure: float = 1.0,
    unopposed: bool = False,
    unforeseen: bool = False,
    slow: tuple[str, ...] = (),
    unfelt: Collection[str] = (),
    backed: Collection[str] = (),
) -> Facts:
    """Collect what is known of a final model.

    Parameters
    ----------
    fits : sequence of Fit
        The baseline, then one for each effect added.
    told : Verdicts
        On every effect, each for itself.
    on_train : Comparison
        Of the last fit with what it was fitted to.
    explained : Beyond or None
        What every fit leaves of the errors ahead; None where nothing was added, or nobody knows:
        then all of them may be left.
    fitted, together, candidate, excited, small, structure, unopposed, unforeseen, slow
        As in `Facts`.
    unfelt : collection of str
        Effects of which no parameter is shown to be off nothing.
    backed : collection of str
        Effects that kinematics alone finds, with the same size.
    """
    added = set(fits[-1].model.effects) - set(fits[0].model.effects)
    missing: tuple[float, ...] = (1.0,) if added else (0.0,)
    if explained is not None:
        missing = explained.squares
    return Facts(
        fitted,
        together,
        candidate,
        (missing[0], missing[-1]),
        1.0 if explained is None else explained.low,
        tuple(
            Added(
                v.effect.id,
                v.finding,
                v.group,
                v.effect.moved,
                felt=v.effect.id not in unfelt,
                backed=v.effect.id in backed,
            )
            for v in told.all
            if v.effect.id in added
        ),
        tuple(on_train.unrelated.values()),
        excited,
        structure,
        small,
        unopposed=unopposed,
        unforeseen=unforeseen,
        slow=slow,
    )


def in_the_light_of(decision: Decision, told: Verdicts) -> Verdicts:
    """Verdicts on every effect, without the names that the decision withdraws.

    Names that stand only together are those of a group.
    """
    for w in decision.withdrawn:
        told = told.with_reservation(w.effects, w.because, added=w.beside)
    return told.with_groups(decision.groups)
