"""The verdict on the whole, and on every effect in the light of it.

What was added may explain all, a part, or only stand in for what is missing. Its residuals tell: on
the driving it was fitted to, and on driving it never saw, where a stand-in leaves what the right
effect does not.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from ..compare import Comparison
from ..diagnose import Omnibus, Verdicts
from ..identify import Fit
from .held_out import BEYOND, share_explained
from .study import Verdict

__all__ = ["SURE", "Left", "verdict_on"]

SURE = 0.01  # evidence of one effect more: at 5 % it would spoil one complete model in twenty
_MOST = 0.9  # share of what is missing: stand-ins take up four fifths and more of it
_REMAINS = 0.6  # of the evidence: right ones beside others leave less than half, stand-ins most
_LEFT = 1e-3  # evidence of something left, beside which an effect alone is not what is missing


@dataclass(frozen=True)
class Left:
    """What the final model leaves.

    Attributes
    ----------
    before, fitted, held_out : Omnibus
        Whether anything was left by the baseline, and is left now, that depends on the driving of
        the fit or on held-out driving; the latter is not asked where nothing was added.
    candidates : bool
        Whether there is evidence of an effect, or beyond doubt (`SURE`) of one effect more.
    excited : bool
        Whether the driving of the fit excites the lateral motion.
    """

    before: Omnibus
    fitted: Omnibus
    held_out: Omnibus | None = None
    candidates: bool = False
    excited: bool = True

    @property
    def nothing(self) -> bool:
        """Whether the model is complete as far as the driving tells."""
        return not (self.fitted.rejects or self.candidates or self._beyond)

    @property
    def evidence(self) -> tuple[Omnibus, ...]:
        """The tests that show beyond doubt that something is left."""
        beyond = (self.held_out,) if self.held_out is not None and self._beyond else ()
        return (*((self.fitted,) if self.fitted.p_value < _LEFT else ()), *beyond)

    @property
    def share(self) -> float:
        """Of the evidence against the baseline, how much there is against the final model."""
        return _excess(self.fitted) / max(_excess(self.before), 1.0)

    @property
    def _beyond(self) -> bool:
        return self.held_out is not None and self.held_out.p_value < BEYOND


def _excess(o: Omnibus) -> float:
    return max(o.statistic - o.degrees, 0.0)


def verdict_on(
    fits: Sequence[Fit], told: Verdicts, on_train: Sequence[Comparison], left: Left
) -> tuple[Verdict, Verdicts]:
    """Give the verdict on the whole, and take back what cannot be said beside what is left.

    Parameters
    ----------
    fits : sequence of Fit
        The baseline, then one for each effect added.
    told : Verdicts
        On every effect, each for itself.
    on_train : sequence of Comparison
        Of every fit with what it was fitted to.
    left : Left
        By the last of the fits.

    Returns
    -------
    verdict : str
    told : Verdicts
    """
    added = set(fits[-1].model.effects) - set(fits[0].model.effects)
    # An uneven road or a coloured sensor keeps the error of the true car above its noise floor:
    # what does not depend on the driving is no effect's to explain.
    wrong = on_train[-1].unrelated
    if wrong:
        # Readings that contradict each other leave no name safe.
        return "unknown", told.doubting(added, "; ".join(wrong.values()), added=added)
    if not added:
        # Tyres that never met a slip angle are free, and leave chance evidence of effects.
        if not left.excited and not left.fitted.rejects:
            return "not_testable", told
        return ("adequate" if left.nothing else "unknown"), told
    stand_ins = _proxies(told, added)
    share = share_explained(on_train[0].error, on_train[-1].error)
    if not left.nothing and share < _MOST:
        # Beside something larger that is not modelled no name is safe.
        because = f"takes up only {max(100 * share, 0.0):.0f} % of what is missing"
        told = told.doubting(added, because, added=added)
    elif not left.nothing and left.share > _REMAINS:
        because = (
            f"with it, {100 * left.share:.0f} % of the evidence that something is missing stays"
        )
        told = told.doubting(added, because, added=added)
    elif not left.nothing:
        unexplained = on_train[-1].error ** 2 - 1.0
        small = _small(_taken_up(fits, on_train), unexplained, stand_ins)
        told = told.doubting(small, "what is left unexplained is larger", added=added)
        alone = _alone(told, added, left.evidence)
        told = told.doubting(alone, "were it what is missing, nothing would be left", added=added)
    # What only stands in for something else explains nothing, however well it fits, and what cannot
    # be told from that is no better.
    because = f"it acts like {', '.join(sorted(stand_ins))}, which is none either"
    told = told.doubting(stand_ins, because)
    proxies = _proxies(told, added)
    if proxies == added or not (left.nothing or _named(told, added)):
        return "unknown", told
    return "explained" if left.nothing and not proxies else "partly_explained", told


def _named(told: Verdicts, added: set[str]) -> set[str]:
    """What was added and is said to be missing, not only to act like it or to be negligible."""
    return {e for e in added if told[e].finding in ("missing", "one of a group")}


def _proxies(told: Verdicts, added: set[str]) -> set[str]:
    return {e for e in added if told[e].finding == "proxy"}


def _alone(told: Verdicts, added: set[str], left: Sequence[Omnibus]) -> set[str]:
    """The effect that is named, where there is one only, if it should have explained what is left.

    A proxy beside it tells that something else is missing too. That may be all that is left, unless
    it moves what the effect moves.
    """
    named = _named(told, added)
    if len(named) != 1:
        return set()
    if not _proxies(told, added):
        return named if left else set()
    moves = {c for e in named for c in told[e].effect.moves.split(", ")}
    return named if any(moves & set(o.moves) for o in left) else set()


def _taken_up(fits: Sequence[Fit], on_train: Sequence[Comparison]) -> dict[str, float]:
    """Of the square of the error, by each effect that was added, in its turn.

    Of two that act alike the later one counts only for what the first could not take up: that much
    may as well be a part of what is left.
    """
    taken: dict[str, float] = {}
    steps = zip(fits[:-1], fits[1:], on_train[:-1], on_train[1:], strict=True)
    for poorer, richer, before, after in steps:
        for e in set(richer.model.effects) - set(poorer.model.effects):
            taken[e] = before.error**2 - after.error**2
    return taken


def _small(taken: dict[str, float], left: float, proxies: set[str]) -> set[str]:
    """Effects that took up less than is left unexplained in the end.

    What a proxy took up is unexplained too.
    """
    doubted = set(proxies)
    while True:
        unexplained = left + sum(max(taken.get(e, 0.0), 0.0) for e in doubted)
        more = {e for e, t in taken.items() if e not in doubted and t < unexplained}
        if not more:
            return doubted - proxies
        doubted |= more
