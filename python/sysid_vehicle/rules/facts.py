"""What a study measured, and what is decided on it."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, field, replace
from typing import Literal, Protocol

from .share import UNKNOWN, Share

Verdict = Literal["adequate", "explained", "partly_explained", "unknown", "not_testable"]
LACKING: tuple[Verdict, ...] = ("unknown", "partly_explained")
"""Verdicts by which something is missing in the final model."""


class Tested(Protocol):
    """A test for anything left."""

    @property
    def statistic(self) -> float:
        """Chi-squared of a complete model."""

    @property
    def degrees(self) -> int:
        """Degrees of freedom."""

    @property
    def p_value(self) -> float:
        """Of a complete model."""

    @property
    def moves(self) -> tuple[str, ...]:
        """Channels that what is left moves most."""


@dataclass(frozen=True)
class Added:
    """An effect of the final model that the baseline lacked.

    Attributes
    ----------
    finding : str
        What is said of it by itself: `missing`, `one of a group`, `negligible` or `proxy`.
    group : tuple of str
        Its rivals, where it is one of a group.
    felt : bool
        Whether a parameter of it is shown to be off nothing (`Rules.insignificant`).
    moves : frozenset of str
        Channels that it moves.
    own, own_in_training : Share
        Of the error 1 to 5 s ahead that the final model leaves without it, all else fitted anew,
        what it takes away: on validation and on training data. Only asked where something is
        missing.
    missing : (float, float) or None
        As `Facts.missing`, of the motion that it moves; None where nobody asked.
    taken_low : float or None
        As `Facts.taken_low`, of the motion that it moves.
    late : bool
        Whether the time limit left its own share unknown.
    sure : bool
        Whether the likelihood of validation data is shown to be higher with it (`Rules.interval`),
        all else fitted anew. Only asked where what is left is `buried`.
    beside : frozenset of str
        Others of the final model that act like it, where such a group was asked for its share.
    shared, shared_in_training : Share
        As `own`, of it and all of these together.
    backed : bool
        Whether readings alone, before any tyre, tell it with the same size.
    against : str
        What else speaks against its name, in words. Only asked of names that would stand beside
        something that is missing.
    """

    id: str
    finding: str
    group: tuple[str, ...] = ()
    moves: frozenset[str] = frozenset()
    own: Share = UNKNOWN
    own_in_training: Share = UNKNOWN
    missing: tuple[float, float] | None = None
    taken_low: float | None = None
    late: bool = False
    sure: bool = False
    beside: frozenset[str] = frozenset()
    shared: Share = UNKNOWN
    shared_in_training: Share = UNKNOWN
    felt: bool = True
    against: str = ""
    backed: bool = False

    @property
    def named(self) -> bool:
        """Whether it is said to be missing, not only to act like it or to be negligible."""
        return self.finding in ("missing", "one of a group")


@dataclass(frozen=True)
class Facts:
    """What a study measured, from which its verdict follows.

    Attributes
    ----------
    fitted : Tested
        For anything left by the final model, on the training data.
    together : Tested or None
        For anything unknown beside what was added, on training and validation data together; None
        where the time limit came first.
    candidate : float
        Smallest p-value of an effect that the final model lacks.
    missing : (float, float)
        Squares of errors 1 to 5 s ahead on validation data, beyond the noise of sensors, without
        and with what was added; in one unit.
    taken_low : float or None
        Lower end of the interval of the share of these that what was added takes away, or of what
        any function of the driving could explain of them; None where the time limit left it
        unknown.
    contradictions : tuple of str
        Channels that contradict the others, in words.
    excited : bool
        Whether the training data excite the lateral motion.
    structure : float
        Share of anything that the final model leaves which a function of the driving is shown to
        predict, on training or validation data.
    small : bool
        Whether no error of the baseline 0.5 to 5 s ahead on validation data is as large as matters
        to the user; where nobody said, as the noise of its sensor.
    buried : bool
        Whether no such error of the final model is as large as the noise of its sensor.
    unopposed : bool
        Whether the time limit left unknown if something unknown would do in the place of what was
        added.
    unforeseen : bool
        Whether validation data err by more than the final model, with its disturbances, foretells
        (`unforeseen`).
    slow : tuple of str
        Disturbances of the final model that last as long as any may, in words.
    one_for_all : str
        An effect that was not sought and, in place of all that was added, explains the training
        data as well.
    """

    fitted: Tested
    together: Tested | None = None
    candidate: float = 1.0
    missing: tuple[float, float] = (0.0, 0.0)
    taken_low: float | None = 1.0
    added: tuple[Added, ...] = ()
    contradictions: tuple[str, ...] = ()
    excited: bool = True
    structure: float = 1.0
    small: bool = False
    buried: bool = False
    unopposed: bool = False
    unforeseen: bool = False
    slow: tuple[str, ...] = ()
    one_for_all: str = ""

    def with_own(
        self,
        own: Mapping[str, tuple[Share, Share]],
        late: Collection[str] = (),
        sure: Collection[str] = (),
    ) -> Facts:
        """The same with the own shares of effects: on validation data, and on training data.

        `late`: effects of which a share is unknown because there was no time for it. `sure`: those
        that the likelihood of validation data shows.
        """
        told = ((a, *own.get(a.id, (UNKNOWN, UNKNOWN))) for a in self.added)
        added = tuple(
            replace(a, own=v, own_in_training=t, late=a.id in late, sure=a.id in sure)
            for a, v, t in told
        )
        return replace(self, added=added)

    def with_groups(self, told: Mapping[tuple[str, ...], tuple[Share, Share]]) -> Facts:
        """The same with the shares that effects which act alike take together, by group."""
        of = {e: (frozenset(g) - {e}, *shares) for g, shares in told.items() for e in g}
        added = (
            replace(
                a,
                beside=of[a.id][0],
                shared=of[a.id][1],
                shared_in_training=of[a.id][2],
            )
            if a.id in of
            else a
            for a in self.added
        )
        return replace(self, added=tuple(added))

    def with_against(self, told: Mapping[str, str]) -> Facts:
        """The same with what else speaks against the names of some effects."""
        added = (replace(a, against=told.get(a.id, "")) for a in self.added)
        return replace(self, added=tuple(added))

    def with_motions(self, told: Mapping[str, tuple[tuple[float, float], float]]) -> Facts:
        """The same with `missing` and `taken_low` of the motion that each effect moves."""
        added = (
            replace(a, missing=told[a.id][0], taken_low=told[a.id][1]) if a.id in told else a
            for a in self.added
        )
        return replace(self, added=tuple(added))


@dataclass(frozen=True)
class Withdrawn:
    """Names that are taken back, and why.

    Attributes
    ----------
    effects : frozenset of str
    because : str
    beside : frozenset of str
        Effects of the model, which are no mere rivals of these: each stands or falls by itself.
    """

    effects: frozenset[str]
    because: str
    beside: frozenset[str] = frozenset()


@dataclass(frozen=True)
class Decision:
    """A verdict, and the names that are withdrawn, in this order.

    Attributes
    ----------
    much_left : bool
        Whether names stand beside an error of which all that was added takes up less than
        `Rules.most`, or beside added effects that do not stand: none is confirmed.
    groups : mapping
        By effect that stands only together with others of the model, those others.
    """

    verdict: Verdict
    withdrawn: tuple[Withdrawn, ...] = ()
    much_left: bool = False
    groups: Mapping[str, frozenset[str]] = field(default_factory=dict)
