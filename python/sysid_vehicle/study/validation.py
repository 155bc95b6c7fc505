"""validation data: how it is set aside, and what it says of two models."""

from __future__ import annotations

import math
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace
from typing import cast

import numpy as np

from .._common.arrays import FloatArray, as_float64
from .._common.memo import remembered
from .._common.text import few
from .._common.threads import in_parallel
from ..diagnose import blocks
from ..errors import NumericalError, warn
from ..estimate import MEASURED, Driving, alike_in_force, without_unlearned
from ..identify import (
    Fit,
    Prediction,
    driving_of,
    lost_to_input_noise,
    predict,
    predicting_ahead,
)
from ..log import LEAST_USABLE_S, Log, copies, several_logs
from ..rules import USUAL, ErrorChange, Gain, Rules
from .ahead.beyond import Beyond, beyond_noise
from .ahead.fitted_range import Bools, fitted, within_fitted_range
from .ahead.horizons import ALONG, typical_error
from .ahead.unmoved import along_alone, changes_of

_SHARE = 0.3
_PIECE_S, _FEWEST_PIECES = 5.0, 6
_TRIMMED = 0.1  # of the pieces, at either end
AHEAD = (1.0, 2.0, 5.0)
AHEAD_S = 2.0
"""What parameters are fitted to predict, beside one step [s]."""
BEST, FITTED_AHEAD = "best", "fitted ahead"
"""With a fit questions that `Driving.told` may answer: `at_its_best` by validation data, and
`fitted_ahead` by the driving of the fit."""
_NONE = Gain(-np.inf, 0.0, -np.inf, 0.0)


def set_aside(
    train: Log | Sequence[Log], test: Log | Sequence[Log] | None
) -> tuple[Driving, Driving]:
    """Training and validation data; without `test`: the last log, or 30 % of the only one.

    Of logs of single manoeuvres, the last of which is too short to tell anything, the last 30 %.
    """
    logs = several_logs(train)
    if test is not None:
        return _driven_alike(logs, several_logs(test))
    if len(logs) > 1:
        short = logs[-1].duration_s < LEAST_USABLE_S
        first = -math.ceil(_SHARE * len(logs)) if short else -1
        taken = few([f"'{log.name}'" for log in logs[first:]]) + (" is" if first == -1 else " are")
        warn(f"no validation data were given: {taken} taken for them")
        return _driven_alike(logs[:first], logs[first:])
    log = logs[0]
    cut = float(log["time_s"][int((1.0 - _SHARE) * log.n)])
    warn(
        f"no validation data were given: '{log.name}' is fitted up to {cut:.1f} s and the rest "
        "taken for them; another manoeuvre would tell more"
    )
    return Driving.of(log.between(-np.inf, cut)), Driving.of(log.between(cut, np.inf))


def _driven_alike(train: Sequence[Log], test: Sequence[Log]) -> tuple[Driving, Driving]:
    """Both by the wheel force, or neither: noise that was learned with it is another one.

    A log that is on both sides is told. Channels that training data lack are left out.
    """
    for text in twice(train, test):
        warn(text)
    logs = alike_in_force((*train, *test))
    own, others = logs[: len(train)], logs[len(train) :]
    return Driving.of(own), Driving.of(without_unlearned(others, own))


def twice(train: Sequence[Log], test: Sequence[Log]) -> list[str]:
    """What is to be said of logs that are both training and validation data."""
    both = copies(test, train)
    told = "training and validation data; the validation error then proves nothing"
    return [f"{few(both)} {'is' if len(both) == 1 else 'are'} {told}"] if both else []


def together(train: Driving, test: Driving) -> Driving:
    """Training and validation data as one; a log that is both counts once."""
    own = (log for log in test.each_log() if not copies(log.logs, train.logs))
    return Driving.joined((train, *own))


def gain_in_log_likelihood(
    poorer: Fit, richer: Fit, test: Driving, *, same_noise: bool = False
) -> Gain:
    """What the richer model gains on validation data [nats].

    Either model's parameters are as unsure as the fit left them (`predict`), so that what it leaves
    open of the tyres does not drown what an effect explains. Each model predicts with
    its own noise, or both with that of the poorer one: a richer model that has only learnt larger
    noise gains by the first and loses by the second, and none is taken to be surer than
    `NoiseModel.elsewhere`. The error comes from pieces (`_with_error`). A model that fails on the
    validation data gains minus infinity.
    """
    try:
        asked = ((poorer, poorer), (richer, poorer if same_noise else richer))
        before, after = in_parallel(lambda of: _prediction(of[0], test, of[1]), asked)
    except (NumericalError, np.linalg.LinAlgError):
        return _NONE
    return _with_error(after.log_density - before.log_density, test)


def gain_with_exact_inputs(
    poorer: Fit, richer: Fit, test: Driving, *, same_noise: bool = False
) -> float:
    """What the richer model would gain on validation data whose inputs had no noise [nats]."""
    gain = gain_in_log_likelihood(poorer, richer, test, same_noise=same_noise).value
    return gain + lost_to_input_noise(richer, test) - lost_to_input_noise(poorer, test)


def foreseen(poorer: Fit, richer: Fit, test: Driving) -> None:
    """Work out at once the predictions that gains and sureness ask for one after the other."""
    asked = ((poorer, poorer), (richer, poorer), (richer, richer))
    with suppress(NumericalError, np.linalg.LinAlgError):
        in_parallel(lambda of: _prediction(of[0], test, of[1]), asked)


def as_sure(poorer: Fit, richer: Fit, test: Driving) -> bool:
    """Whether the richer model, with noise of its own, is no less sure of validation data.

    What such a model gains does not come from having learnt larger noise.
    """
    try:
        before, after = in_parallel(lambda fit: _prediction(fit, test, fit), (poorer, richer))
    except (NumericalError, np.linalg.LinAlgError):
        return False
    return after.sureness >= before.sureness


# The poorer model of all candidates of a step is the same one.
@remembered(24)
def _prediction(fit: Fit, test: Driving, like: Fit) -> Prediction:
    """Of validation data by a fit, with another's noise."""
    return predict(fit, test, like.noise.elsewhere(fit.model.vehicle))


# The baseline is asked beside every step that is taken back.
@remembered(4)
def serving(fit: Fit, test: Driving) -> Fit:
    """The fit with parameters that serve validation data too, as far as it left them unsure.

    The fit itself, where the model fails there.
    """
    try:
        return replace(fit, model=predict(fit, test, fit.noise).model)
    except (NumericalError, np.linalg.LinAlgError):
        return fit


def fall_in_error(poorer: Fit, richer: Fit, test: Driving) -> Gain:
    """By how much the sum of squared errors falls on validation data.

    Both models are measured by the noise floor of the richer one: noise of its own can make a model
    likelier whose forces explain less than before. Where nothing but effects along the car tells
    the models apart its speed and acceleration along it count: lateral errors fall and grow with
    tyres that were fitted anew. The error comes from pieces (`_with_error`). Where a model fails
    there is no fall.
    """
    floor = richer.noise.floor().vector()
    counted = ALONG if along_alone(poorer, richer) else MEASURED
    columns = [MEASURED.index(c) for c in counted]

    def squares(fit: Fit) -> FloatArray:
        own = driving_of(fit, test)
        trace = own.problem(fit.model).trace(fit.model.vector(), floor, False)
        return as_float64(np.sum(trace["whitened"][:, columns] ** 2, axis=1))

    try:
        before, after = in_parallel(squares, (poorer, richer))
    except NumericalError:
        return _NONE
    return _with_error(as_float64(before - after), test)


def _with_error(difference: FloatArray, test: Driving) -> Gain:
    """The sum over all samples, and its standard error from what pieces of the driving scatter.

    They are of one length, or a steady gain would seem unsteady: 5 s, by when what disturbs a car
    is another thing, and less where the driving is short, as few pieces tell nothing of scatter.
    The trimmed mean has the standard error of its winsorised sample (Tukey & McLaughlin, Sankhya
    1963).
    """
    pieces = max(round(test.usable_s / _PIECE_S), _FEWEST_PIECES)
    sums = np.add.reduceat(difference, blocks(test, test.usable_s / pieces))
    n = len(sums)
    error = float(np.std(sums, ddof=1) * np.sqrt(n))
    cut = max(round(_TRIMMED * n), 1)
    if n <= 2 * cut:
        return Gain(float(np.sum(difference)), error, float(np.sum(difference)), error)
    kept = np.sort(sums)[cut : n - cut]
    winsorised = np.clip(sums, kept[0], kept[-1])
    return Gain(
        float(np.sum(difference)),
        error,
        float(n * np.mean(kept)),
        float(np.std(winsorised, ddof=1) * np.sqrt(n) / (1.0 - 2.0 * cut / n)),
    )


def changes_ahead(poorer: Fit, richer: Fit, test: Driving) -> tuple[ErrorChange, ...]:
    """How errors 1 to 5 s ahead change, both models with the parameters of `at_its_best`."""
    one, other = in_parallel(lambda fit: at_its_best(fit, test), (poorer, richer))
    return changes_of(one, other, test, AHEAD)


def beyond_noise_ahead(fits: Sequence[Fit], test: Driving, rules: Rules = USUAL) -> Beyond:
    """Errors 1 to 5 s ahead beyond the noise, of models with the parameters of `best_within`."""
    final = fits[-1]
    best = in_parallel(lambda fit: at_its_best(fit, test), fits)
    within, counted = 1.0, counted_in_shares(final, test, rules)
    if not counted.all():
        within = float(np.mean(fitted(best[-1], test, rules)))
        best = in_parallel(lambda fit: best_within(fit, test, final, rules), fits)
    return replace(beyond_noise(best, test, AHEAD, counted=counted), within=within)


def as_elsewhere(fit: Fit, test: Driving) -> Fit:
    """The fit with parameters that serve validation data too, and its noise on other driving."""
    noise = fit.noise.elsewhere(fit.model.vehicle)
    return replace(fit, model=_prediction(fit, test, fit).model, noise=noise)


# One object for each fit: errors ahead are remembered by it.
@remembered(16)
def at_its_best(fit: Fit, test: Driving) -> Fit:
    """The fit, or the same model with the parameters that predict validation data best.

    Of three: the fit's own; those that serve validation data too (`serving`), as tyres which were
    not fitted at their peak err there whatever effect is in the model; and those fitted to
    predictions of seconds, as parameters of the likelihood serve the errors of one step, which
    disturbances share, at the price of those some seconds ahead. What an effect takes away is then
    nothing that other parameters would have taken away.
    """
    if (BEST, fit) in test.told:
        return cast(Fit, test.told[BEST, fit])
    noise = fit.noise.floor()
    ways = tuple(_ways(fit, test))
    return min(ways, key=lambda f: typical_error(f, noise, test, AHEAD, between=ways))


@remembered(4)
def counted_in_shares(final: Fit, test: Driving, rules: Rules = USUAL) -> Bools:
    """Predictions of `AHEAD` that count in shares of the errors on validation data.

    Those in which the tyres work as far as they were fitted, where the final model fails beyond
    (`within_fitted_range`).
    """
    return within_fitted_range(at_its_best(final, test), test, AHEAD, rules)


@remembered(32)
def best_within(fit: Fit, test: Driving, final: Fit, rules: Rules = USUAL) -> Fit:
    """As `at_its_best`, by the predictions that count in shares beside a final model."""
    counted, noise = counted_in_shares(final, test, rules), fit.noise.floor()
    if counted.all():
        return at_its_best(fit, test)
    ways = tuple(_ways(fit, test))
    return min(ways, key=lambda f: typical_error(f, noise, test, AHEAD, counted, ways))


def _ways(fit: Fit, test: Driving) -> list[Fit]:
    found = [fit]
    with suppress(NumericalError, np.linalg.LinAlgError):
        found.append(replace(fit, model=_prediction(fit, test, fit).model))
    ahead = fitted_ahead(fit)
    if ahead is not None:
        found.append(ahead)
    return found


@remembered(16)
def fitted_ahead(fit: Fit) -> Fit | None:
    """The same model fitted to predictions of `AHEAD_S`; None where its driving is too short."""
    if (FITTED_AHEAD, fit) in fit.driving.told:
        return cast(Fit | None, fit.driving.told[FITTED_AHEAD, fit])
    if longest_s(fit.driving) < 2.0 * AHEAD_S:
        return None
    try:
        return predicting_ahead(fit, AHEAD_S)
    except (NumericalError, np.linalg.LinAlgError):
        return None


def longest_s(driving: Driving) -> float:
    """Duration of the longest stretch [s]."""
    return max((end - first) / rate for first, end, rate in driving.spans)


def error_falls(poorer: Fit, richer: Fit, test: Driving) -> bool:
    """Whether the richer model errs less on validation data (`fall_in_error`)."""
    return fall_in_error(poorer, richer, test).value > 0.0
