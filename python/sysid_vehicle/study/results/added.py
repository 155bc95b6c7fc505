"""The effects that a study added."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from types import MappingProxyType
from typing import Any

import numpy as np

from ..._common.text import unit_after
from ...compare import Comparison
from ...diagnose import Verdicts
from ...identify import Estimate, Fit
from ...rules import UNKNOWN, USUAL, Decision, Facts, Grade, Rules, Share, grade, little
from ..search.trail import Trail

_NOTHING: Mapping[str, str] = MappingProxyType({})


@dataclass(frozen=True)
class AddedEffect:
    """An effect that was added.

    Attributes
    ----------
    parameters : tuple of Estimate
        In the final model; of `Study.estimates`.
    error_before, error_after : float
        On the validation data, in units of the noise floor.
    p_value : float
        Of the model without it being complete.
    confounded_with : tuple of str
        Effects of which any may act in its place: this driving cannot tell them from it.
    stands_in : str
        What tells that it only stands in for what is missing; empty where it is named.
    grade : str
        `confirmed`, `plausible` or `alias` (`rules.grade`).
    takes_little : bool
        Of the error on validation data, and of what all that was added takes off it
        (`rules.little`).
    useful : bool
        Whether some error on validation data, one step or 1 to 5 s ahead, is shown to fall with it
        in its turn, that of one step falls by a part worth a name (`Rules.taken`), or it has an own
        share there. True where nobody asked in time.
    backed : str
        What kinematics alone tells of it, where that is the same; empty elsewhere.
    own, own_in_training : Share
        Of the error 1 to 5 s ahead that the final model leaves without it, all else fitted anew,
        what it takes away: on validation and on training data. Unknown where nothing is missing,
        as nobody asked.
    together, together_in_training : Share
        The same of it and the effects of the model that it is named with, as a group; unknown where
        it stands alone or not at all.
    """

    id: str
    parameters: tuple[Estimate, ...]
    error_before: float
    error_after: float
    p_value: float
    confounded_with: tuple[str, ...] = ()
    stands_in: str = ""
    grade: Grade = "plausible"
    takes_little: bool = False
    useful: bool = True
    backed: str = ""
    own: Share = UNKNOWN
    own_in_training: Share = UNKNOWN
    together: Share = UNKNOWN
    together_in_training: Share = UNKNOWN

    @property
    def name(self) -> str:
        """Its id, and those of the effects that this driving cannot tell from it."""
        return " or ".join((self.id, *self.confounded_with))

    @property
    def reserve(self) -> str:
        """What is to be said against it, in words; empty where there is nothing."""
        said = []
        if self.confounded_with:
            said.append(f"confounded with {', '.join(self.confounded_with)} in this driving")
        if self.stands_in:
            # By itself it is wrong, or it is not sure beside what is left.
            sure = self.grade == "alias"
            what = "compensates for something else" if sure else "may compensate for something else"
            said.append(f"it {what}: {self.stands_in}")
        elif self.takes_little and self.useful and not self.backed:
            said.append("the error hardly falls with it: another effect may explain as much")
        if not self.useful:
            said.append(
                "significant, but of no use for prediction: no error on validation data "
                "significantly falls with it"
            )
        return "; ".join(said)

    def __str__(self) -> str:
        size = ", ".join(
            f"{e.name.split('.')[1]} {e.size}{unit_after(e.unit)}" for e in self.parameters
        )
        known = f"kinematics alone tells it: {self.backed}" if self.backed else ""
        told = (f"{self.id}: {size}", self.grade, known, self.shared_out, self.reserve)
        return "; ".join(text for text in told if text)

    @property
    def shared_out(self) -> str:
        """Its own shares, and those of its group, in words; empty where nobody asked."""
        own = _both(self.own, self.own_in_training)
        if not own:
            return ""
        group = _both(self.together, self.together_in_training)
        others = f", that of the group {group}" if group else ""
        of = "its own share of the error 1 to 5 s ahead, where it changes predictions"
        return f"{of}: {own}{others}"

    def to_dict(self) -> dict[str, Any]:
        """All figures, ready for JSON."""
        return {
            "id": self.id,
            "parameters": {e.name.split(".")[1]: e.to_dict() for e in self.parameters},
            "error_before": self.error_before,
            "error_after": self.error_after,
            "p_value": self.p_value,
            "confounded_with": list(self.confounded_with),
            "stands_in": self.stands_in,
            "grade": self.grade,
            "takes_little": self.takes_little,
            "useful": self.useful,
            "backed": self.backed,
            "own_share": self.own.to_dict(),
            "own_share_in_training": self.own_in_training.to_dict(),
            "share_together": self.together.to_dict(),
            "share_together_in_training": self.together_in_training.to_dict(),
        }


def _both(validation: Share, training: Share) -> str:
    pairs = (validation, "validation"), (training, "training")
    return " and ".join(f"{share} on {data} data" for share, data in pairs if share.known)


def added_by(
    trail: Trail,
    fits: Sequence[Fit],
    on_test: Sequence[Comparison],
    told: Verdicts,
    alone: Verdicts,
    decision: Decision,
    facts: Facts,
    shared: Collection[str] = (),
    rules: Rules = USUAL,
    estimates: Sequence[Estimate] | None = None,
    idle: Collection[str] = (),
    backed: Mapping[str, str] = _NOTHING,
) -> tuple[AddedEffect, ...]:
    """The effects of a study in the order in which they were added.

    Parameters
    ----------
    trail : Trail
        Of the search: what else could act in the place of each.
    fits : sequence of Fit
        From the baseline to the final model.
    on_test : sequence of Comparison
        The same on validation data.
    told, alone : Verdicts
        On each effect, in the light of the whole study, and by itself.
    decision : Decision
    facts : Facts
        From which it follows.
    shared : collection of str
        Effects of which nobody knows what each takes of the error, or that have a simpler
        explanation, which a warning tells: none is sure.
    rules : Rules
    estimates : sequence of Estimate, optional
        Of the parameters of the final model; by default those of its fit.
    idle : collection of str
        Effects with which no error on validation data is shown to fall in their step.
    backed : mapping of str
        What kinematics says of effects that it tells, too.
    """
    added = []
    known = {
        a.id: (a.own, a.own_in_training, a.shared, a.shared_in_training)[
            : 4 if a.id in decision.groups else 2
        ]
        for a in facts.added
    }
    final, ends = fits[-1], (on_test[0].error, on_test[-1].error)
    estimates = final.estimates if estimates is None else estimates
    for (before, after), (poorer, richer) in zip(pairwise(on_test), pairwise(fits), strict=True):
        errors = ends[0], before.error, after.error, ends[1]
        for name in (e for e in richer.model.effects if e not in poorer.model.effects):
            finding, because = told[name].finding, told[name].because
            own = known.get(name, (UNKNOWN, UNKNOWN))
            small = little(*errors, own[:2], rules)
            others = list(trail.confounded.get(name, ()))
            others = [*sorted(decision.groups.get(name, ())), *others]
            added.append(
                AddedEffect(
                    name,
                    tuple(e for e in estimates if e.name.startswith(f"{name}.")),
                    before.error,
                    after.error,
                    trail.p_values.get(name, np.nan),
                    tuple(others),
                    because if finding == "proxy" else "",
                    grade(
                        alone[name].finding,
                        finding,
                        much_left=decision.much_left and name not in backed,
                        takes_little=(small or name in shared) and name not in backed,
                    ),
                    small,
                    name not in idle
                    or before.error - after.error > rules.taken * before.error
                    or any(share.known and share.low > 0.0 for share in own[::2]),
                    backed.get(name, ""),
                    *own,
                )
            )
    return tuple(added)


def of_one_step(fits: Sequence[Fit]) -> tuple[str, ...]:
    """Effects that came together with others in one step."""
    steps = [
        [e for e in richer.model.effects if e not in poorer.model.effects]
        for poorer, richer in pairwise(fits)
    ]
    return tuple(e for step in steps if len(step) > 1 for e in step)
