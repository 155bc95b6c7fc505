"""Whether validation data confirm an effect, and what parameters cost."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .limits import USUAL, Rules

__all__ = ["Measures", "accept", "bic"]


def bic(log_likelihood: float, parameters: int, samples: int) -> float:
    """Log-likelihood less the BIC penalty of the parameters [nats] (Schwarz, Ann. Stat. 1978)."""
    return log_likelihood - 0.5 * parameters * float(np.log(samples))


@dataclass(frozen=True)
class Measures:
    """What an effect changes on validation data: gains with their standard errors.

    Attributes
    ----------
    gain : (float, float)
        In log-likelihood [nats], both models with the noise of the poorer one.
    own_gain : (float, float)
        The same, each with noise of its own.
    fall : (float, float)
        Of the sum of squared errors, in squares of the noise floor.
    plausible : bool
        Whether a car can have such a value.
    as_sure : bool
        Whether the richer model, with noise of its own, is no less sure than the poorer one.
    """

    gain: tuple[float, float]
    own_gain: tuple[float, float]
    fall: tuple[float, float]
    plausible: bool
    as_sure: bool


def accept(measures: Measures, rules: Rules = USUAL) -> bool:
    """Whether validation data confirm an effect.

    No measure is always right: the noise of the poorer model may be so large that it hides what
    another does better, that of the richer one surer than it may be there, and the noise floor
    weighs the channels as no rough road would. So two of them must speak for it, and none against.
    Coloured noise of sensors is predicted best by a model that takes it for motion: its one-step
    errors are smaller than those of the true car. Its likelihood is not, unless its noise grew.
    """
    three = (measures.gain, measures.own_gain, measures.fall)

    def two_beyond(limit: float) -> bool:
        return sum(v > limit * e for v, e in three) >= 2

    falls = measures.fall[0] > 0.0
    speak = two_beyond(rules.lean) if falls else measures.plausible and two_beyond(rules.clear)
    if speak and all(v > -rules.clear * e for v, e in three):
        return True
    own, error = measures.own_gain
    return own > rules.sure * error and measures.plausible and measures.as_sure
