"""By how many standard errors effects that may act are apart, with driving at hand and after more.

Where the driving at hand shows that something acts, each effect is fitted to it. The distance of
two is what the likelihood tells: at hand the difference of the fits, on a drive to come the sum of
squares that the other model leaves when the first acts, its parameters fitted anew to both
(T-optimality: Atkinson & Fedorov, Biometrika 1975). With r and G its residuals and their
sensitivities on the new drive, I its information at hand, that is

    min_d  d' I d + |r - G d|^2

They are whitened by the noise with which the other model is fitted: what it takes for a disturbance
at hand it will take for one again. What acts has the likeliest size at hand under a normal prior
about nothing of the typical size: by the likelihood alone what it hardly knows may have any size.
Where nothing is shown yet, effects of typical size are apart as `information.py` says.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy

from ..._common.arrays import FloatArray, as_float64
from ..._common.memo import remembered
from ...effects import Effect
from ...errors import NumericalError
from ...estimate import Driving
from ...identify import Fit, refine_from, refit
from ...model import Model
from ...rules import USUAL
from ...simulate import Drive
from ..candidates.score import score_board
from ..evidence.evidence import Evidence
from ..evidence.projection import pseudo_inverse
from .information import COPIED, Information, information_of

Size = tuple[float, ...]
Drives = Callable[[Model], "Drive | None"]
Logged = Callable[[Drive], Driving]


@dataclass(frozen=True)
class Apart:
    """Squared standard errors between the first effect and each other one, by which of them acts.

    Attributes
    ----------
    first_acts, other_acts : tuple of float
        One for each other effect; never below zero.
    """

    first_acts: tuple[float, ...]
    other_acts: tuple[float, ...]

    @property
    def sigmas(self) -> float:
        """Standard errors of the least, whichever acts."""
        return float(np.sqrt(min(*self.first_acts, *self.other_acts)))


@dataclass(frozen=True, eq=False)
class Foreseen:
    """Effects of typical or given size, of which the driving at hand need not show anything.

    Attributes
    ----------
    fit : Fit
        Without them, with the noise that is left where the first one acts.
    effects : tuple of Effect
        The first, then its rivals.
    sizes : tuple of tuple of float
    here : Information
        Of the driving at hand.
    """

    fit: Fit
    effects: tuple[Effect, ...]
    sizes: tuple[Size, ...]
    here: Information

    @classmethod
    def of(cls, fit: Fit, effects: Sequence[Effect], size: Size | None) -> Foreseen:
        """At the typical size of each, or a size of the first."""
        sizes = [typical(e) for e in effects]
        if size is not None:
            sizes[0] = size
        # Without it what it does counts as a disturbance, in which hardly anything is told apart.
        best = _likeliest(fit, effects[0])
        if best is not None and best.log_likelihood > fit.log_likelihood:
            fit = replace(fit, noise=best.noise)
        here = information_of(fit, fit.driving, effects)
        return cls(fit, tuple(effects), tuple(sizes), here)

    @property
    def car(self) -> Model:
        """The model with the first effect."""
        return with_size(self.fit.model, self.effects[0], self.sizes[0])

    @property
    def now(self) -> float:
        """Standard errors with the driving at hand."""
        return self._apart(self.here).sigmas

    def after(self, drive: Drive, _: Drives, logged: Logged) -> Callable[[int], Apart]:
        """The same by how many times a drive is added."""
        there = information_of(self.fit, logged(drive), self.effects)
        return lambda times: self._apart(self.here + there.times(times))

    def _apart(self, known: Information) -> Apart:
        first, *others = zip(self.effects, self.sizes, strict=True)

        def squared(one: tuple[Effect, Size], other: tuple[Effect, Size]) -> float:
            return known.separation(one[0].id, one[1], other[0].id) ** 2

        return Apart(
            tuple(squared(first, o) for o in others), tuple(squared(o, first) for o in others)
        )


@dataclass(frozen=True, eq=False)
class Fitted:
    """Effects as they are fitted to the driving at hand, which shows that something acts.

    Attributes
    ----------
    fits : tuple of Fit
        With the first, then with each of its rivals.
    cars : tuple of Model
        The same of usual size, as they are driven.
    at_hand : tuple of array
        Information of the driving at hand about the free parameters of each.
    """

    fits: tuple[Fit, ...]
    cars: tuple[Model, ...]
    at_hand: tuple[FloatArray, ...]

    @classmethod
    def of(cls, fit: Fit, effects: Sequence[Effect]) -> Fitted | None:
        """None where none of them is shown, or one cannot be fitted."""
        fits = [_likeliest(fit, e) for e in effects]
        found = [f for f in fits if f is not None]
        if len(found) < len(fits) or not any(
            _is_shown(fit, f, e) for f, e in zip(found, effects, strict=True)
        ):
            return None
        at_hand = []
        for f in found:
            G = Evidence(f, f.driving).fitted
            at_hand.append(as_float64(G.T @ G))
        cars = tuple(_of_usual_size(f, e) for f, e in zip(found, effects, strict=True))
        return cls(tuple(found), cars, tuple(at_hand))

    @property
    def car(self) -> Model:
        """The model with the first effect."""
        return self.cars[0]

    @property
    def _leads(self) -> list[float]:
        """Twice what the first is likelier than each other one."""
        first, *others = (f.log_likelihood for f in self.fits)
        return [2.0 * (first - other) for other in others]

    @property
    def now(self) -> float:
        """Standard errors with the driving at hand, of the nearest."""
        return float(np.sqrt(min(map(abs, self._leads))))

    def after(self, drive: Drive, drives: Drives, logged: Logged) -> Callable[[int], Apart]:
        """The same by how many times a drive is added, whichever acts there.

        What acts has to make up for what the other one leads by at hand. Where that tells models
        apart (`Rules.apart`) the likelier one acts.
        """
        with_first, others = logged(drive), range(1, len(self.fits))
        first_acts = [self._left(0, i, with_first) for i in others]
        other_acts = []
        for i in others:
            other = drives(self.cars[i])
            # A car that cannot be driven so is no likely one.
            other_acts.append(None if other is None else self._left(i, 0, logged(other)))

        def apart(times: int) -> Apart:
            first, second = [], []
            for lead, one, two in zip(self._leads, first_acts, other_acts, strict=True):
                ahead, behind = lead + one(times), (two or one)(times) - lead
                if abs(lead) >= 2.0 * USUAL.apart:  # the less likely one hardly acts
                    ahead = behind = ahead if lead > 0.0 else behind
                first.append(max(ahead, 0.0))
                second.append(max(behind, 0.0))
            return Apart(tuple(first), tuple(second))

        return apart

    def _left(self, acts: int, other: int, driving: Driving) -> Callable[[int], float]:
        """What the model with the other effect leaves of the drive on which the first one acts."""
        fit = self.fits[other]
        model = Evidence(fit, driving)
        true = Evidence(replace(fit, model=self.cars[acts]), driving)
        r, G = model.residual - true.residual, model.fitted
        square, score, there = float(r @ r), G.T @ r, G.T @ G

        def left(times: int) -> float:
            inverse, _ = pseudo_inverse(self.at_hand[other] + times * there, COPIED)
            taken = times**2 * float(score @ inverse @ score)
            return max(times * square - taken, 0.0)

        return left


def typical(e: Effect) -> Size:
    """Its typical size, as distance from its null values."""
    return tuple(p.typical - p.null_value for p in e.parameters)


def with_size(model: Model, e: Effect, size: Size) -> Model:
    """The model with an effect of a size within its bounds."""
    return model.add(e).with_values(
        {
            name: float(np.clip(p.null_value + s, p.lower, p.upper))
            for (name, p), s in zip(e.named.items(), size, strict=True)
        }
    )


@remembered(16)
def _likeliest(fit: Fit, e: Effect) -> Fit | None:
    """The likeliest fit with an effect; None where it cannot be fitted.

    From the size that its score foretells, with its time where one is sought, from nothing, and
    from its typical size.
    """
    scored = [
        tuple(v - p.null_value for v, p in zip(s.value, e.parameters, strict=True))
        for s in score_board(fit, fit.driving, (e,)).scores
    ]
    begins = [with_size(fit.model, e, size) for size in (*scored, typical(e))]
    begins.insert(len(scored), fit.model.add(e))
    return refine_from(begins, fit.driving, fit.noise)


@remembered(16)
def _of_usual_size(fit: Fit, e: Effect) -> Model:
    """The fit's model with the size that data and a normal prior of the typical size give."""
    priors = {
        name: (p.null_value, abs(p.typical - p.null_value))
        for name, p in e.named.items()
        if not p.scan
    }
    model = fit.model.with_priors(priors)
    try:
        near = model.with_values(_by_covariance(fit, priors))
        likely = refit(near, fit.driving, fit.noise).model
    except (NumericalError, np.linalg.LinAlgError):
        return fit.model
    return fit.model.with_values(likely.values)


def _by_covariance(fit: Fit, priors: dict[str, tuple[float, float]]) -> dict[str, float]:
    """Where the likelihood and priors lead if the fit's covariance says all about it."""
    names = fit.model.free_names
    of = [names.index(n) for n in priors]
    mean, std = np.array(list(priors.values())).reshape(-1, 2).T
    x, covariance = np.array([fit.model.value(n) for n in names]), fit.covariance
    weight = np.linalg.solve(covariance[np.ix_(of, of)] + np.diag(std**2), mean - x[of])
    lower, upper = np.array([fit.model.bounds(n) for n in names]).T
    moved = np.clip(x + covariance[:, of] @ weight, lower, upper)
    return dict(zip(names, map(float, moved), strict=True))


def _is_shown(fit: Fit, richer: Fit, e: Effect) -> bool:
    gain = 2.0 * (richer.log_likelihood - fit.log_likelihood)
    return gain > float(scipy.special.chdtri(len(e.parameters), USUAL.strict))
