"""A candidate's exact dynamics in place of its score."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np
import scipy

from ..._common.threads import before
from ...effects import Effect
from ...errors import NumericalError
from ...estimate import Driving
from ...identify import (
    Fit,
    far_below,
    lost_to_input_noise,
    refine,
    refine_above,
    refit,
    unmoved,
    with_exact_inputs,
)
from .candidate import Candidate

_BEYOND = 8.0  # predicted parameters are cut at so many typical sizes before a refit


def refitted(fit: Fit, driving: Driving, c: Candidate) -> Candidate:
    """The candidate with its exact dynamics, under the noise of the model without it.

    Its statistic is what that gains over `fit`, twice the log-likelihood; 0 where the model fails.
    It is never worse than the model that it contains: where no search is better, it is that one.
    Then the score is no evidence: it knows the effect to first order, and the likelihood exactly.
    """
    best: Fit | None = None
    for values in (*_starts(c), {}):
        if not values and best is not None:
            # Once more from the model that it contains. Of several lags none is there.
            lags = c.effect.scored_at_typical and len(c.effect.parameters) > 1
            if lags or best.log_likelihood >= fit.log_likelihood:
                break
        model = fit.model.add(c.effect).with_values(values)
        try:
            trial = refit(model, driving, fit.noise, scanned=(c.effect,))
        except (NumericalError, np.linalg.LinAlgError):
            continue
        if best is None or trial.log_likelihood > best.log_likelihood:
            best = trial
    if best is None:
        return replace(c, statistic=0.0)
    if best.log_likelihood < fit.log_likelihood:
        contained = unmoved(fit.model.add(c.effect), driving, fit.noise)
        return replace(_with_fit(fit, c, contained), statistic=0.0, p_value=1.0)
    return _with_fit(fit, c, best)


def in_time(
    work: Callable[[Candidate], Candidate], ends: float
) -> Callable[[Candidate], Candidate]:
    """The same, but what is not done at `ends`, by `time.perf_counter`, is left as it is."""
    return lambda c: before(ends, lambda: work(c), c)


def finished(fit: Fit, c: Candidate, least: float = -np.inf) -> Candidate:
    """The candidate with noise of its own, unless that makes it worse than the model without it.

    A lag at its smallest is not quite none. `least` is a log-likelihood below which nobody asks for
    the maximum: what ends far below that has a fit that has not converged.
    """
    if c.fit is None:
        return c
    found = _with_fit(fit, c, refine(c.fit.model, c.fit.driving, c.fit.noise, least=least))
    if found.statistic < 0.0 <= c.statistic:
        found = c
    return replace(found, finished=True)


def is_hidden_by_noise(effect: Effect) -> bool:
    """Whether a score may miss the effect: a lag, whose one parameter has no derivative at null.

    A disturbance that was learned without it acts for some time, as the effect does. Under that
    noise neither score nor refit shows what the effect takes over.
    """
    return effect.scored_at_typical and len(effect.parameters) == 1


def from_typical(
    fit: Fit, c: Candidate, tests: int, alpha: float = np.inf, rival: Fit | None = None
) -> Candidate:
    """The candidate fitted with noise of its own from its typical size (`from_size`)."""
    ((name, p),) = c.effect.named.items()
    asked = alpha if is_hidden_by_noise(c.effect) else np.inf
    return from_size(fit, c, {name: p.typical}, tests, asked, rival)


def from_size(
    fit: Fit,
    c: Candidate,
    size: Mapping[str, float],
    tests: int,
    alpha: float = np.inf,
    rival: Fit | None = None,
) -> Candidate:
    """The candidate fitted with noise of its own from a size, and tested by likelihood.

    Its p-value is that of the likelihood ratio, on one side where its only parameter has one sign,
    over the variance ratio of its score, corrected for so many tests (Bonferroni). Where that comes
    out above `alpha` the candidate may be left as it is: what ends at nothing is not climbed. One
    that ends far below a rival is not finished, and its fit has not converged.
    """
    parameters = c.effect.parameters
    sides = 0.5 if len(parameters) == 1 and parameters[0].one_sided else 1.0
    degrees, ratio = len(parameters), max(c.variance_ratio, 1.0)
    significant = -np.inf  # the likelihood at which the p-value is `alpha`
    if alpha < sides * tests:
        significant = fit.log_likelihood + 0.5 * ratio * float(
            scipy.special.chdtri(degrees, alpha / sides / tests)
        )
    try:
        model = fit.model.add(c.effect).with_values(size)
        likelier = refine_above(model, fit.driving, fit, significant, rival)
    except (NumericalError, np.linalg.LinAlgError):
        return c
    if likelier is None:
        return c
    of_rival = -np.inf if rival is None else rival.log_likelihood
    if not likelier.converged and far_below(likelier.log_likelihood, of_rival):
        return replace(c, fit=likelier)
    found = _with_fit(fit, c, likelier)
    alone = sides * float(scipy.special.chdtrc(degrees, max(found.statistic, 0.0) / ratio))
    return replace(found, finished=True, p_value=min(tests * alone, 1.0))


def _with_fit(fit: Fit, c: Candidate, found: Fit) -> Candidate:
    names = c.effect.named
    lost = [lost_to_input_noise(f, f.driving) for f in (fit, found)]
    return replace(
        c,
        statistic=2.0 * (with_exact_inputs(found) - with_exact_inputs(fit)),
        of_inputs=2.0 * (lost[1] - lost[0]),
        value=tuple(found[n].value for n in names),
        std=tuple(found[n].std for n in names),
        fit=found,
    )


def predicted_size(c: Candidate) -> dict[str, float]:
    """What the score predicts, no further from nothing than a refit may begin."""
    predicted = {}
    for (name, p), v in zip(c.effect.named.items(), c.value, strict=True):
        reach = np.inf if p.scan else _BEYOND * p.typical
        value = float(np.clip(v, p.null_value - reach, p.null_value + reach))
        predicted[name] = float(np.clip(value, p.lower, p.upper))
    return predicted


def _starts(c: Candidate) -> list[dict[str, float]]:
    predicted = predicted_size(c)
    starts = [predicted]
    lead, first = next(iter(c.effect.named.items()))
    if len(c.effect.parameters) == 1 and first.another_dynamics(predicted[lead]):
        starts.append({lead: first.typical})
    return starts
