"""Priors that the data contradict: what a user says of a parameter, and what driving says of it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ..._common.arrays import FloatArray
from ..._common.text import number, unit_after, with_error
from ...rules import USUAL
from .estimates import Estimate


@dataclass(frozen=True)
class AgainstPrior:
    """A parameter of which the data say something else than its prior.

    Attributes
    ----------
    name, unit : str
    prior : tuple of 2 floats
        Mean and standard deviation.
    value, std : float
        What the data say without this prior, to first order.
    apart : float
        Distance of both, in its standard errors.
    """

    name: str
    unit: str
    prior: tuple[float, float]
    value: float
    std: float
    apart: float

    def __str__(self) -> str:
        prior = with_error(*self.prior, digits=4)
        data = with_error(self.value, self.std, digits=4) + unit_after(self.unit)
        return (
            f"{self.name}: the prior {prior} contradicts the data, which say about {data}, "
            f"{number(self.apart, 2)} standard errors away; correct the prior or widen it: a wrong "
            "one looks like a missing effect"
        )


def against_priors(
    estimates: Sequence[Estimate],
    covariance: FloatArray,
    priors: Mapping[str, tuple[float, float]],
    least: float = USUAL.sure,
) -> tuple[AgainstPrior, ...]:
    """Find the priors that the data contradict, the surest first.

    Of a normal prior with mean m and variance s2, and a posterior with x and v, the data alone have
    the variance v_d = v s2 / (s2 - v) and the value x_d = m + (x - m) s2 / (s2 - v), by Bayes'
    rule. x_d and m are sqrt(v_d + s2) apart where both are right: (x - m) / sqrt(s2 - v) of it.

    Parameters
    ----------
    estimates : sequence of Estimate
        With their priors.
    covariance : array, shape (n, n)
        Of the estimates, by noise and priors.
    priors : mapping of str to (mean, standard deviation)
    least : float
        Standard errors, above which a prior is contradicted.
    """
    found = []
    for e, v in zip(estimates, np.diag(covariance), strict=True):
        if e.name not in priors or not np.isfinite(e.std):
            continue
        mean, std = priors[e.name]
        left = std**2 - float(v)  # what the data add to the prior; rounding where that is nothing
        off = e.value - mean
        if left > 0.0 and abs(off) > least * np.sqrt(left):
            ratio = std**2 / left
            told = mean + off * ratio, float(np.sqrt(v * ratio))
            found.append(
                AgainstPrior(e.name, e.unit, (mean, std), *told, float(abs(off) / np.sqrt(left)))
            )
    return tuple(sorted(found, key=lambda a: -a.apart))
