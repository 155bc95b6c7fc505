"""Whether validation data confirm an effect, and what parameters cost."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from .limits import USUAL, Rules
from .share import Share


def bic(log_likelihood: float, parameters: int, samples: int) -> float:
    """Log-likelihood less the BIC penalty of the parameters [nats] (Schwarz, Ann. Stat. 1978)."""
    return log_likelihood - 0.5 * parameters * float(np.log(samples))


@dataclass(frozen=True)
class Gain:
    """A sum over validation data, and what it would be were all blocks like most of them.

    Attributes
    ----------
    value, error : float
        The sum and its standard error.
    typical, typical_error : float
        The same of the trimmed mean: one spin decides nothing.
    """

    value: float
    error: float
    typical: float
    typical_error: float

    def beyond(self, limit: float) -> bool:
        """Whether it is above nothing by so many standard errors, as it is or trimmed."""
        return self.value > limit * self.error or self.typical > limit * self.typical_error


@dataclass(frozen=True)
class ErrorChange:
    """How an error some seconds ahead changes, median over blocks of the validation data.

    Attributes
    ----------
    channel : str
    horizon_s : float
    log_ratio, error : float
        Logarithm of the error after over that before, and its standard error; of few blocks it is
        larger, so that as many of them hold the true value with the same probability.
    """

    channel: str
    horizon_s: float
    log_ratio: float
    error: float


@dataclass(frozen=True)
class Measures:
    """What an effect changes on validation data.

    Attributes
    ----------
    gain : Gain
        In log-likelihood [nats], both models with the noise of the poorer one.
    own_gain : Gain
        The same, each with noise of its own.
    fall : Gain
        Of the sum of squared errors, in squares of the noise floor.
    plausible : bool
        Whether a car can have such a value.
    as_sure : bool
        Whether the richer model, with noise of its own, is no less sure than the poorer one.
    changes : tuple of ErrorChange
        Of the errors some seconds ahead.
    """

    gain: Gain
    own_gain: Gain
    fall: Gain
    plausible: bool
    as_sure: bool
    changes: tuple[ErrorChange, ...] = ()


def accept(measures: Measures, rules: Rules = USUAL) -> bool:
    """Whether validation data confirm an effect.

    No measure is always right: the noise of the poorer model may be so large that it hides what
    another does better, that of the richer one surer than it may be there, and the noise floor
    weighs the channels as no rough road would. So two of them must speak for it.
    Coloured noise of sensors is predicted best by a model that takes it for motion: its one-step
    errors are smaller than those of the true car. Its likelihood is not, unless its noise grew.
    Whatever speaks for an effect, predictions some seconds ahead must not become worse. Where they
    err more in the mean, however surely, the error that falls is the one of a single step alone:
    then it speaks for nothing that has to be shown less clearly.
    """
    three = (measures.gain, measures.own_gain, measures.fall)
    falls = measures.fall.value > 0.0
    shown = rules.lean if falls and not _grows(measures.changes, rules) else rules.interval
    speak = sum(g.beyond(shown) for g in three) >= 2
    own = measures.own_gain
    sure = own.value > rules.sure * own.error and measures.plausible and measures.as_sure
    confirmed = (speak and (falls or measures.plausible)) or sure
    return confirmed and not worse(measures.changes, rules)


def _grows(changes: Sequence[ErrorChange], rules: Rules) -> bool:
    """Whether errors ahead are larger in the mean over channels and horizons, by what matters."""
    mean = float(np.mean([c.log_ratio for c in changes])) if changes else 0.0
    return mean > math.log1p(rules.worse)


def worse(changes: Sequence[ErrorChange], rules: Rules = USUAL) -> tuple[ErrorChange, ...]:
    """The errors some seconds ahead that have grown, by more than it matters.

    One horizon shows it clearly, were its channel one of as many that are asked, or a channel leans
    to it in the mean over its horizons: errors of few blocks are known so badly that what costs a
    channel a tenth is rarely clear. Horizons of a channel are nearly one test, channels are not: of
    five that do not change one grows by two standard errors in every eighth study.
    """
    least, clear = math.log1p(rules.worse), rules.interval_of(len({c.channel for c in changes}))
    lean = {
        channel
        for channel in {c.channel for c in changes}
        if _mean(changes, channel, "log_ratio")
        > max(least, rules.lean * _mean(changes, channel, "error"))
    }
    return tuple(
        c
        for c in changes
        if c.log_ratio > max(least, clear * c.error) or (c.channel in lean and c.log_ratio > least)
    )


def harmful(own: Share, rules: Rules = USUAL) -> bool:
    """Whether errors some seconds ahead are shown to be larger with an effect, by what matters.

    Its own share of them, where it moves something, is below nothing: as `worse` of one figure.
    """
    return own.known and own.value < -rules.worse and own.high < 0.0


def _mean(changes: Sequence[ErrorChange], channel: str, what: str) -> float:
    """Over the horizons of a channel; their errors are nearly those of the same samples."""
    return float(np.mean([getattr(c, what) for c in changes if c.channel == channel]))
