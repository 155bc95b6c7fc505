"""What changed that no effect explains: what it acts on, and what else changed beside it.

Nothing that was fitted holds it. Under the noise of the reference whatever is fitted takes a part
of it up: tyres that did not change gain thousands of nats by the cornering drag of other ones. So
where it is shown, disturbances of the later driving are learned along what it acts on, and take it
up instead (`noise_beside`); what changed beside it is told then. What it acts on is told by lines
from there, under the noise of the reference again: beside one that was learned little is left.
"""

from __future__ import annotations

from collections.abc import Container, Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt
import scipy

from ..._common.arrays import FloatArray
from ...estimate import Learned, NoiseModel, generous, maximise_noise, noise_range
from ...identify import Fit
from ...rules import Rules
from ...vehicle import Vehicle
from ..candidates.causes import UNKNOWN, CredibleSet
from ..candidates.single_effects import ScoreModel
from .reference import Exact

_MOST = 3  # that act at once
_ROUNDS, _TINY = 12, 1e-300  # steps of learning; what stands for the logarithm of nothing
# Where learning begins: time of disturbances, slopes [m/s2], noise of yaw rate, a_x, a_y.
_TIME_S, _ROAD, _COLOUR = 0.5, (0.1, 0.1), (0.01, 0.1, 0.1)
_ALONG, _ACROSS, _ABOUT = "along", "across", "about"
_WAYS = {
    "F_x": _ALONG,
    "dv_x/dt": _ALONG,
    "a_x": _ALONG,
    "F_y": _ACROSS,
    "dv_y/dt": _ACROSS,
    "a_y": _ACROSS,
    "M_z": _ABOUT,
    "r": _ABOUT,
}


def unknown_beside(model: ScoreModel, put: Sequence[str], rules: Rules) -> tuple[CredibleSet, ...]:
    """Forces, moments and readings that changed beside what was put in, by lines.

    Each is likely beside what was put in and those before it. Which of several it is, is told by
    one variance ratio, that of the one that leads: by ratios of their own, one that leaves more,
    but of another colour, may take the place of one that leaves less. What the drivings do not
    tell apart is a group.

    Parameters
    ----------
    model : ScoreModel
        Scores of all that competes.
    put : sequence of str
    rules : Rules
    """
    found: list[CredibleSet] = []
    least = scipy.special.logit(rules.credible)
    beside = [*put]
    while len(found) < _MOST:
        odds = _of_unknown(model, beside)
        lead = max(odds, key=lambda n: odds[n], default="")
        if not lead or odds[lead] <= least:
            break
        column = next(h.columns[0] for h in model.hypotheses if h.name == lead)
        alike = replace(model, ratio=np.full_like(model.ratio, model.ratio[column]))
        told = CredibleSet.of(_of_unknown(alike, beside), rules.credible)
        found.append(told)
        beside.append(told.effects[0])
    return tuple(found)


def _of_unknown(model: ScoreModel, put: Sequence[str]) -> dict[str, float]:
    return {n: x for n, x in model.beside(put).items() if n.startswith(UNKNOWN)}


@dataclass(frozen=True, eq=False)
class Beside:
    """Noise of later driving that takes up what is unknown beside some changes.

    Attributes
    ----------
    put : tuple of str
        These changes.
    noise : NoiseModel
    """

    put: tuple[str, ...]
    noise: NoiseModel


def noise_beside(
    parts: Iterable[Exact], unknown: Iterable[CredibleSet], reference: NoiseModel
) -> Beside:
    """Noise whose disturbances take up what is unknown, along what that acts on.

    All else is the noise of the reference: what changed across the car is not to be taken up with
    what acts along it. A part of what was put in may only stand in for what is unknown: noise is
    learned beside each part, and the likeliest is told.

    Parameters
    ----------
    parts : iterable of Exact
        What was put in, and parts of it.
    unknown : iterable of CredibleSet
    reference : NoiseModel
    """
    free = _free(acts_on(unknown))
    found = [(state.put, _learned(state.fit, free, reference)) for state in parts]
    put, best = max(found, key=lambda one: one[1].log_likelihood)
    return Beside(put, NoiseModel.from_vector(best.noise))


def acts_on(unknown: Iterable[CredibleSet]) -> frozenset[str]:
    """Along the car, across it or about its vertical axis."""
    return frozenset(_WAYS[e.removeprefix(UNKNOWN)] for s in unknown for e in s.effects)


def _learned(fit: Fit, free: npt.NDArray[np.bool_], reference: NoiseModel) -> Learned:
    driving, vehicle = fit.driving, fit.model.vehicle
    known, usual = reference.vector(), _usual(reference, vehicle)
    low, high = noise_range(vehicle, driving)
    begin = np.where(free, np.clip(np.maximum(known, usual), low, high), known)
    low, high = np.where(free, low, begin), np.where(free, high, begin)
    return maximise_noise(
        driving.problem(fit.model),
        fit.model.vector(),
        begin,
        np.maximum(low, _TINY),
        np.maximum(high, _TINY),
        rounds=_ROUNDS,
    )


def _usual(noise: NoiseModel, vehicle: Vehicle) -> FloatArray:
    """Disturbances of usual size, where learning begins."""
    begin = generous(noise.sensor, vehicle)
    return replace(begin, road=_ROAD, colour=_COLOUR, correlation_time_s=(_TIME_S,) * 3).vector()


def _free(ways: Container[str]) -> npt.NDArray[np.bool_]:
    """Which disturbances are learned: forces, slopes and readings along some ways."""
    along, across, about = (float(w in ways) for w in (_ALONG, _ACROSS, _ABOUT))
    force, reading = (along, across, about), (about, along, across)
    slope = max(along, across)
    none = (0.0,) * 5, (0.0,) * 3
    return NoiseModel(*none, force, force, force[:2], slope, reading, reading).vector() > 0.0
