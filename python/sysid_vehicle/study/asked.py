"""What a study is asked for, checked before any of its work begins."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from .._common.arguments import duration, whole
from ..diagnose import considered
from ..effects import Effect, effect
from ..errors import InvalidInput
from ..model import Model
from ..rules import Rules
from .judge.matters import sizes_that_matter


@dataclass(frozen=True)
class Asked:
    """The arguments of `improve` that do not depend on the logs, as it uses them.

    Attributes
    ----------
    most_effects : int
    rules : Rules
        With the rate of false claims that was asked for.
    limit_s : float
        Endless where there is no limit.
    sizes : dict or None
        Errors that matter, by channel.
    excluded : frozenset of str
    wanted : tuple of Effect
        What may be added, without what is excluded.
    """

    most_effects: int
    rules: Rules
    limit_s: float
    sizes: dict[str, float] | None
    excluded: frozenset[str]
    wanted: tuple[Effect, ...]


def asked(
    model: Model,
    *,
    most_effects: int,
    alpha: float | None,
    rules: Rules,
    candidates: Sequence[str] | None,
    exclude: Sequence[str],
    time_limit_s: float | None,
    matters: Mapping[str, float | str] | None,
    starts: int,
    seed: int,
) -> Asked:
    """Check the arguments, which are those of `improve`.

    Raises
    ------
    InvalidInput
        One of them cannot be used.
    """
    for name, effects in (("candidates", candidates), ("exclude", exclude)):
        if isinstance(effects, str):
            raise InvalidInput(f"{name} = '{effects}': give a list of effects, ['{effects}']")
    whole(starts, "starts", 1)
    whole(seed, "seed")
    excluded = frozenset(effect(e).id for e in exclude)
    return Asked(
        whole(most_effects, "most_effects"),
        rules.at(alpha),
        duration(time_limit_s, "time_limit_s"),
        None if matters is None else sizes_that_matter(matters),
        excluded,
        tuple(e for e in considered(model, candidates) if e.id not in excluded),
    )
