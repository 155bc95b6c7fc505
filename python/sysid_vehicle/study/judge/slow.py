"""Disturbances of a fit that are none: they last as long as a disturbance may.

Noise is learned with correlation times of a second at most, as slower forces are what effects are:
drag, wind, slopes. One that ends there, and that the likelihood asks for, is a slow force that the
model lacks. It need not depend on the driving: a bank of the road depends on the place.
"""

from __future__ import annotations

import numpy as np

from ..._common.text import number
from ...estimate.noise import DISTURBANCE, TIMES, noise_range
from ...identify import Fit
from ...rules import USUAL, Rules

_WORDS = ("force of {} N along the car", "force of {} N sideways", "moment of {} N m")
_AT_LONGEST = 0.99  # of the longest time: where a search ends that would go on


def slow_forces(fit: Fit, rules: Rules = USUAL) -> tuple[str, ...]:
    """Find disturbances of a fit that last as long as any may, in words with their size.

    The likelihood asks for one if without it, all other noise the same, it falls by the price of
    the two parameters that it has.

    Parameters
    ----------
    fit : Fit
    rules : Rules
    """
    least, most = noise_range(fit.model.vehicle, fit.driving)
    noise, p = fit.noise.vector(), fit.model.vector()
    problem = fit.driving.problem(fit.model)
    price = rules.price * float(np.log(fit.driving.samples))  # of two parameters
    found = []
    for k, words in enumerate(_WORDS):
        size, time = DISTURBANCE.start + k, TIMES.start + k
        if noise[time] < _AT_LONGEST * most[time] or noise[size] <= least[size]:
            continue
        without = noise.copy()
        without[size] = least[size]
        gain = problem.freeze(p, noise).log_likelihood - problem.freeze(p, without).log_likelihood
        if gain > price:
            found.append(words.format(number(float(noise[size]), 3)))
    return tuple(found)
