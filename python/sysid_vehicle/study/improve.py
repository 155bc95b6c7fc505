"""The whole loop: fit, see where it fails, find what is missing, add it, see the error fall."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence

import numpy as np

from ..compare import Comparison, compare
from ..diagnose import (
    Diagnosis,
    Omnibus,
    Verdicts,
    considered,
    judge,
    omnibus,
)
from ..errors import InvalidInput, warn
from ..estimate import Driving
from ..identify import Fit, identify
from ..log import Log
from ..model import Model
from .held_out import hold_out, share_explained
from .search import Search
from .steps import way
from .study import AddedEffect, Study, Verdict

__all__ = ["improve"]

_MOST = 0.8  # share of what is missing, by which an effect has to be more than a stand-in
_SURE = 0.01  # evidence of one effect more: at 5 % it would spoil one complete model in twenty
_SHORT_S = 20.0  # of usable driving: every manoeuvre of the library takes longer
_LEFT = 1e-3  # evidence of something left, beside which an effect alone is not what is missing


def improve(
    model: Model,
    train: Log | Sequence[Log],
    test: Log | Sequence[Log] | None = None,
    *,
    most_effects: int = 6,
    alpha: float = 0.05,
    candidates: Sequence[str] | None = None,
    starts: int = 8,
    seed: int = 0,
    progress: bool = False,
    tell: Callable[[str], None] | None = None,
) -> Study:
    """Improve a model step by step until nothing more is missing that the driving can show.

    Each step scores all effects, refits the best few with their exact dynamics, and adds the best
    one that also predicts the held-out driving better. An effect that became idle is dropped again.

    Parameters
    ----------
    model : Model
        The baseline.
    train, test : Log or sequence of Log
        What to fit to, and driving the fit never sees. Without `test` the last 30 % of the training
        driving are held out.
    most_effects : int
        Stop after so many.
    alpha : float
        Rate of false claims accepted, over all effects together, per step.
    candidates : sequence of str, optional
        Effects to consider.
    tell : callable, optional
        Called with a sentence about each step.

    Returns
    -------
    Study
    """
    if most_effects < 0:
        raise InvalidInput("most_effects must not be negative")
    began = time.perf_counter()
    say = tell if tell is not None else _silent
    train_driving, test_driving = hold_out(train, test)
    baseline = identify(model, train_driving, starts=starts, seed=seed, progress=progress)
    say(f"Fitted the baseline to {train_driving}.")
    search = Search(
        test_driving,
        candidates=candidates,
        most_effects=most_effects,
        alpha=alpha,
        seed=seed,
        progress=progress,
        say=say,
    )
    found = search.from_baseline(baseline)
    fit, diagnoses = found.fit, found.diagnoses
    fits = way(found.fits)
    floor = fit.noise
    on_train = [compare(f, train_driving, noise=floor) for f in fits]
    on_test = [compare(f, test_driving, noise=floor) for f in fits]
    last = diagnoses[-1]
    left = last.omnibus if last.fit is fit else omnibus(fit, train_driving)
    told = judge(
        fit,
        scored=(last.scores, last.family) if last.fit is fit else None,
        lacked={e.id for e in considered(model, candidates)},
        groups={e: g for e, g in found.rivals.items() if e in fit.model.effects},
        acted={c.id for dx in diagnoses for c in dx.significant},
        alpha=alpha,
        seed=seed,
        settled=True,
    )
    verdict, told = _verdict(fits, told, last, on_train, left)
    return Study(
        verdict=verdict,
        fits=tuple(fits),
        diagnoses=tuple(diagnoses),
        train=tuple(on_train),
        test=tuple(on_test),
        held_out=test_driving,
        added=_added(fits, on_test, found.p_values),
        omnibus=left,
        verdicts=told,
        warnings=_warnings(fit, train_driving),
        seconds=time.perf_counter() - began,
    )


def _silent(_: str) -> None:
    pass


def _verdict(
    fits: list[Fit],
    told: Verdicts,
    last: Diagnosis,
    on_train: list[Comparison],
    left: Omnibus,
) -> tuple[Verdict, Verdicts]:
    """The verdict on the whole, and on every effect in the light of it."""
    added = set(fits[-1].model.effects) - set(fits[0].model.effects)
    if not added:
        return "adequate" if not left.rejects and not last.significant else "unknown", told
    # An uneven road or a coloured sensor keeps the error of the true car above its noise floor:
    # what does not depend on the driving is no effect's to explain.
    complete = not left.rejects and not any(c.p_value < _SURE for c in last.significant)
    share = share_explained(on_train[0].error, on_train[-1].error)
    if not complete and share < _MOST:
        # Beside something larger that is not modelled no name is safe.
        told = told.doubting(
            added, f"takes up only {max(100 * share, 0.0):.0f} % of what is missing"
        )
    elif left.p_value < _LEFT and (alone := _alone(told, added)):
        told = told.doubting(alone, "were it what is missing, nothing would be left")
    elif not complete:
        proxies = _proxies(told, added)
        small = _small(_taken_up(fits, on_train), on_train[-1].error ** 2 - 1.0, proxies)
        told = told.doubting(small, "what is left unexplained is larger")
    # What only stands in for something else explains nothing, however well it fits.
    proxies = _proxies(told, added)
    told = told.doubting(
        proxies, f"it acts like {', '.join(sorted(proxies))}, which is none either"
    )
    if proxies == added or not (complete or _named(told, added)):
        return "unknown", told
    return "explained" if complete and not proxies else "partly_explained", told


def _named(told: Verdicts, added: set[str]) -> set[str]:
    """What was added and is said to be missing, not only to act like it or to be negligible."""
    return {e for e in added if told[e].finding in ("missing", "one of a group")}


def _proxies(told: Verdicts, added: set[str]) -> set[str]:
    return {e for e in added if told[e].finding == "proxy"}


def _alone(told: Verdicts, added: set[str]) -> set[str]:
    """The effect that is named, where there is one only and nothing else acted.

    A proxy beside it tells that something else is missing too, which may be all that is left.
    """
    named = _named(told, added)
    return named if len(named) == 1 and not _proxies(told, added) else set()


def _taken_up(fits: list[Fit], on_train: list[Comparison]) -> dict[str, float]:
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


def _added(
    fits: list[Fit], on_test: list[Comparison], p_values: dict[str, float]
) -> tuple[AddedEffect, ...]:
    added = []
    final = fits[-1]
    for before, after, fit_before, fit_after in zip(
        on_test[:-1], on_test[1:], fits[:-1], fits[1:], strict=True
    ):
        new = [e for e in fit_after.model.effects if e not in fit_before.model.effects]
        for name in new:
            estimates = tuple(e for e in final.estimates if e.name.startswith(f"{name}."))
            added.append(
                AddedEffect(name, estimates, before.error, after.error, p_values.get(name, np.nan))
            )
    return tuple(added)


def _warnings(fit: Fit, driving: Driving) -> tuple[str, ...]:
    found = []
    if driving.usable_s < _SHORT_S:
        found.append(
            f"{driving}: too short to tell many effects apart; record {_SHORT_S:.0f} s or more, "
            "with steps, sweeps and corners near the limit"
        )
        warn(found[-1])
    for log in driving.logs:
        found += [f"{log.name}: {text}" for text in log.missing().values()]
    found += [f"{e.name}: {e.note} with this driving" for e in fit.estimates if e.note]
    if not fit.converged:
        found.append("the final fit did not converge; its intervals may be too short")
        warn(found[-1])
    return tuple(dict.fromkeys(found))
