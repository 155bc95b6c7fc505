"""Kinds of noise that a fit may lack: a road whose slope varies, sensors of coloured noise."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..errors import NumericalError
from ..estimate import NoiseModel
from ..estimate.noise import COLOURED
from .fit import Fit
from .maximum import THINNED, log_likelihood_of, polish
from .search.box import objective_of
from .search.objective import Objective

_SLOPES_MPS2 = (0.05, 0.2)  # of a road whose slope varies, to begin with
_COLOUR_TIME_S = 0.05  # to begin with; searches from 0.03 and 0.1 s end at the same noise
_HINT, _SHOWN = 2.0, 20.0  # nats that another kind of noise gains at first sight, and learned
_NEXT_TO_NONE = 1.01  # times the least colour
_FEW, _ALL = 4, 12  # steps of learning, at first sight and then


def on_its_road(fit: Fit) -> Fit:
    """The same fit where the road is level, another where its slope varies."""
    objective = _objective(fit)
    p, others = fit.model.vector(), [replace(fit.noise, road=(s, s)) for s in _SLOPES_MPS2]
    values = [log_likelihood_of(objective, p, noise.vector()) for noise in others]
    if max(values) < fit.log_likelihood + _HINT:
        return fit
    return _likelier(fit, objective, others[int(np.argmax(values))])


def with_coloured_sensors(fit: Fit) -> Fit:
    """The same fit where noise of sensors is white, another where it is correlated in time.

    What white sensors leave of such noise is a force to the filter, which the motion has to follow:
    then effects are seen that the car does not have. Few samples tell whether there is any.
    """
    present = set(fit.driving.present) - (set() if fit.driving.force_known else {"ax_mps2"})
    white = fit.noise.sensor[-len(COLOURED) :]
    colour = tuple(s if c in present else 0.0 for c, s in zip(COLOURED, white, strict=True))
    begin = replace(fit.noise, colour=colour, colour_time_s=(_COLOUR_TIME_S,) * len(COLOURED))
    if not begin.coloured:
        return fit
    few, p = _objective(fit, THINNED), fit.model.vector()
    try:
        as_it_is = few.learn_noise(p, fit.noise.vector(), rounds=_FEW)
        learned = few.learn_noise(p, begin.vector(), rounds=_FEW)
    except (NumericalError, np.linalg.LinAlgError):
        return fit
    if learned.log_likelihood < as_it_is.log_likelihood + _HINT:
        return fit
    return _likelier(fit, _objective(fit), NoiseModel.from_vector(learned.noise))


def _objective(fit: Fit, most_samples: int | None = None) -> Objective:
    problem = fit.driving.problem(fit.model, most_samples=most_samples)
    return objective_of(fit.model, problem, fit.driving)


def _likelier(fit: Fit, objective: Objective, noise: NoiseModel) -> Fit:
    """The fit with another kind of noise where that is shown; the same fit where not."""
    p = fit.model.vector()
    learned = objective.learn_noise(p, noise.vector(), rounds=_ALL)
    if learned.log_likelihood < fit.log_likelihood + _SHOWN:
        return fit
    told = NoiseModel.from_vector(learned.noise)
    least = NoiseModel.from_vector(_NEXT_TO_NONE * objective.lowest).colour
    there = tuple(c if c > low else 0.0 for c, low in zip(told.colour, least, strict=True))
    found = polish(fit.model, fit.driving, p, replace(told, colour=there), fit.starts)
    return found if found.log_likelihood > fit.log_likelihood else fit
