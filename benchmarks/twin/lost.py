"""Whether driving shows what is hidden in a car at all, and where a study lost it."""

from collections.abc import Collection
from dataclasses import dataclass
from typing import Any

import numpy as np

import sysid_vehicle as sv
from sysid_vehicle.effects import effect
from sysid_vehicle.errors import NumericalError
from sysid_vehicle.estimate import Driving
from sysid_vehicle.identify import Fit, refine
from sysid_vehicle.rules import Measures, accept, worse
from sysid_vehicle.study.ahead.own_share import own_shares
from sysid_vehicle.study.validation import (
    as_sure,
    changes_ahead,
    fall_in_error,
    gain_in_log_likelihood,
)

MISSING = ("missing", "one of a group")
LEAST_NATS = 5.0  # on validation data; what shows less is not there to be found
_BEGIN = (0.5, -0.5)  # typical sizes from which a search for what is in the car starts


@dataclass(frozen=True)
class Shown:
    """What an effect that is in the car does to the final model, given by hand.

    Attributes
    ----------
    value, std : tuple of float
    training, validation : float
        What the likelihood gains [nats], on validation data with the noise of the model without it.
    own : tuple of str
        Its own share of the errors ahead, on validation and on training data.
    instead_of : tuple of str
        What acts like it, by the catalogue, and was taken out of the final model before.
    """

    value: tuple[float, ...]
    std: tuple[float, ...]
    training: float
    validation: float
    own: tuple[str, ...]
    instead_of: tuple[str, ...]


def shown(final: Fit, test: Driving, name: str) -> Shown | None:
    """Give the final model an effect that the car has, in place of all that acts like it.

    Beside a stand-in it would have nothing left to show. None where the model fails.
    """
    wanted = effect(name)
    alike = [
        e.id
        for e in final.model.parts
        if e.id in wanted.confounded_with or name in e.confounded_with
    ]
    bare = final.model
    for other in (*alike, name):
        if other in bare.effects:
            bare = bare.drop(other)
    try:
        without = refine(bare, final.driving, final.noise)
        ways = [
            bare.add(wanted).with_values(
                {
                    f"{name}.{p.name}": float(
                        np.clip(p.null_value + begin * p.typical, p.lower, p.upper)
                    )
                    for p in wanted.parameters
                }
            )
            for begin in _BEGIN
        ]
        found = [refine(model, final.driving, final.noise) for model in ways]
    except (NumericalError, np.linalg.LinAlgError):
        return None
    best = max(found, key=lambda f: f.log_likelihood)
    sizes = [best[f"{name}.{p.name}"] for p in wanted.parameters]
    return Shown(
        tuple(e.value for e in sizes),
        tuple(e.std for e in sizes),
        best.log_likelihood - without.log_likelihood,
        gain_in_log_likelihood(without, best, test, same_noise=True).value,
        tuple(map(str, own_shares(best, (name,), (name,), test)[name])),
        tuple(alike),
    )


def fate(study: sv.Study, name: str) -> str:
    """Say where a study lost an effect that is in the car, or that it names it."""
    told = next((v for v in study.verdicts.all if v.effect.id == name), None)
    if name in study.fit.model.effects and told is not None:
        if told.finding in MISSING:
            return "named"
        return f"added, {told.finding}: {told.because}".removesuffix(": ")
    if any(name in dx.fit.model.effects for dx in study.diagnoses):
        return "added, and dropped or exchanged later"
    taken_back = next((w for w in study.warnings if " removed again: " in w), "")
    if name in taken_back.split(" removed again: ")[0].split(" and "):
        return "added, and taken back: as the likelihood fits the model, errors ahead grow with it"
    seen = [(dx, c) for dx in study.diagnoses for c in dx.significant if c.id == name]
    if not seen:
        return "no evidence for it"
    refitted = [(dx.fit, c.fit) for dx, c in seen if c.fit is not None]
    if not refitted:
        return "evidence for it, not refitted"
    before, after = refitted[-1]
    measures = Measures(
        gain_in_log_likelihood(before, after, study.validation, same_noise=True),
        gain_in_log_likelihood(before, after, study.validation),
        fall_in_error(before, after, study.validation),
        plausible=True,
        as_sure=as_sure(before, after, study.validation),
    )
    if not accept(measures, study.rules):
        return "refused: validation data do not confirm it"
    grown = worse(changes_ahead(before, after, study.validation), study.rules)
    if grown:
        channels = dict.fromkeys(c.channel for c in grown)
        return f"refused: errors ahead grow, of {', '.join(channels)}"
    return "refitted and confirmed, another one was added"


def lost(study: sv.Study, hidden: Collection[str]) -> dict[str, dict[str, Any]]:
    """For each name of what is hidden: where it was lost, and what driving shows of it."""
    found: dict[str, dict[str, Any]] = {}
    for name in sorted(hidden):
        by_hand = shown(study.fit, study.validation, name)
        found[name] = {"fate": fate(study, name)} | ({} if by_hand is None else vars(by_hand))
    return found


def testable(told: dict[str, Any]) -> bool:
    """Whether driving that no fit saw is likelier with any name of what is hidden."""
    return any(one.get("validation", -np.inf) > LEAST_NATS for one in told.values())
